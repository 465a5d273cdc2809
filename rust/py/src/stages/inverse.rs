//! The inverse of a stage, for feedforward.

use numpy::PyArray1;
use piezotrack_control::inverse::{Inverse, NetworkNumbers, NeuralNetworkInverse, after_drive};
use piezotrack_control::{Limits, OnlineFeedforward, OnlineFeedforwardState, ReferenceSample};
use piezotrack_core::math::room;
use piezotrack_core::models::{AnyInverse, AnyInverseState, StageInverse, StageInverseState};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::conversions::arrays::{array, samples};
use crate::conversions::displacements::in_metres;
use crate::conversions::snapshots::{load, saved};
use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyInverse>()
}

/// The inverse of a stage, sample by sample or along a whole reference.
#[pyclass(name = "Inverse", module = "piezotrack._core")]
pub struct PyInverse {
    online: OnlineFeedforward<AnyInverse>,
    start: AnyInverseState,
    state: OnlineFeedforwardState<AnyInverseState>,
    /// Drives that reach the stage, where that is known.
    limits: Option<Limits>,
}

impl PyInverse {
    /// An inverse that starts from what it remembers.
    pub fn of_stage(
        inverse: StageInverse,
        start: &StageInverseState,
        dt: f64,
        offset: f64,
        delay: f64,
    ) -> Result<Self> {
        let any = AnyInverse::Stage(Box::new(inverse));
        Ok(Self::new(
            OnlineFeedforward::new(any, dt, offset, delay)?,
            &AnyInverseState::Stage(*start),
        ))
    }

    fn new(online: OnlineFeedforward<AnyInverse>, start: &AnyInverseState) -> Self {
        Self { state: online.start(*start), online, start: *start, limits: None }
    }
}

/// Centre, scales, thresholds, hidden rows, biases, outputs, direct weights and offset.
type Network = (f64, [f64; 3], Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>, f64);

#[pymethods]
impl PyInverse {
    /// A network for samples every `dt` seconds.
    #[staticmethod]
    fn network(numbers: Network, dt: f64, offset: f64, delay: f64) -> PyResult<Self> {
        let (centre, scales, thresholds, hidden, biases, outputs, direct, constant) = numbers;
        let build = || -> Result<Self> {
            let network = NeuralNetworkInverse::new(&NetworkNumbers {
                centre,
                scales,
                thresholds: &thresholds,
                hidden: &hidden,
                biases: &biases,
                outputs: &outputs,
                direct: &direct,
                offset: constant,
            })?;
            let start = AnyInverseState::Network(network.rest());
            let any = AnyInverse::Network(Box::new(network));
            Ok(Self::new(OnlineFeedforward::new(any, dt, offset, delay)?, &start))
        };
        build().map_err(|error| raise(&error))
    }

    /// The drive for the next sample of a reference; NaN where there is none.
    fn step(
        &mut self,
        reference: f64,
        velocity: Option<f64>,
        acceleration: Option<f64>,
        preview: Option<f64>,
    ) -> PyResult<f64> {
        let position = in_metres(reference)?;
        let sample = ReferenceSample { position, velocity, acceleration, preview };
        Ok(match &self.limits {
            Some(limits) => self.online.step_within(&mut self.state, &sample, limits),
            None => self.online.step(&mut self.state, &sample),
        })
    }

    /// The numbers of the inverse of a Dahl stage without creep; `None` of any other.
    fn coefficients(&self) -> Option<Vec<f64>> {
        match self.online.inverse() {
            AnyInverse::Stage(inverse) => match inverse.as_ref() {
                StageInverse::Dahl(inverse) => {
                    inverse.without_creep().map(|inverse| inverse.coefficients().to_vec())
                }
                _ => None,
            },
            AnyInverse::Network(_) => None,
        }
    }

    /// Sets the drives that reach the stage, V.
    fn limit(&mut self, low: f64, high: f64) -> PyResult<()> {
        self.limits = Some(Limits::new(low, high).map_err(|error| raise(&error.into()))?);
        Ok(())
    }

    /// Takes the drive (V) that reached the stage in place of the last one.
    fn applied(&mut self, volts: f64) {
        self.online.applied(&mut self.state, volts);
    }

    /// The drive along a whole path, whose derivatives are known, from the start.
    fn along<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (x, v, a) = (samples("x", x)?, samples("v", v)?, samples("a", a)?);
        let drive = along(&self.online, self.start, self.limits.as_ref(), [&x, &v, &a]);
        array(py, drive.map_err(|error| raise(&error))?.iter().copied())
    }

    /// The state as bytes, for `load` of the same inverse.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        saved(py, &self.state)
    }

    fn load(&mut self, bytes: &[u8]) -> PyResult<()> {
        load(&mut self.state, bytes)
    }

    fn reset(&mut self) {
        self.state = self.online.start(self.start);
    }
}

/// Voltages along a reference. A voltage beyond the limits does not reach the stage, and the inverse
/// does not remember it.
fn along(
    online: &OnlineFeedforward<AnyInverse>,
    mut state: AnyInverseState,
    limits: Option<&Limits>,
    [x, v, a]: [&[f64]; 3],
) -> Result<Vec<f64>> {
    let mut drive = room("the drive along the reference", x.len())?;
    let (inverse, dt, mut off) = (online.inverse(), online.dt(), [0.0; 2]);
    for (k, ((&x, &v), &a)) in x.iter().zip(v).zip(a).enumerate() {
        let before = state;
        let value = inverse.step(&mut state, x, v, a);
        if !value.is_finite() {
            return Err(Error::Numerical(format!(
                "the inverse has no voltage for sample {k} of the reference ({x:e} m, \
                 {v:e} m/s, {a:e} m/s^2): check its units and its sampling"
            )));
        }
        let reached = limits.map_or(value, |limits| limits.clip(value));
        let off_before = core::mem::replace(&mut off, [0.0; 2]);
        if (value - reached).abs() > 0.0 {
            (state, off) = after_drive(inverse, &before, [x, v, a], off_before, dt, reached)
                .unwrap_or((state, off));
        }
        drive.push(value);
    }
    Ok(drive)
}
