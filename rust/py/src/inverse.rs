//! The inverse of a stage, for feedforward.

use numpy::PyArray1;
use piezotrack_control::inverse::Inverse;
use piezotrack_control::{OnlineFeedforward, OnlineFeedforwardState, ReferenceSample};
use piezotrack_core::math::room;
use piezotrack_core::models::{StageInverse, StageInverseState};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::arrays::{array, samples};
use crate::control::{in_metres, load, saved};
use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyInverse>()
}

/// The inverse of a stage, sample by sample or along a whole reference.
#[pyclass(name = "Inverse", module = "piezotrack._core")]
pub struct PyInverse {
    online: OnlineFeedforward<StageInverse>,
    start: StageInverseState,
    state: OnlineFeedforwardState<StageInverseState>,
}

impl PyInverse {
    /// An inverse that starts from what it remembers.
    pub fn new(online: OnlineFeedforward<StageInverse>, start: &StageInverseState) -> Self {
        Self { state: online.start(*start), online, start: *start }
    }
}

#[pymethods]
impl PyInverse {
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
        Ok(self.online.step(&mut self.state, &sample))
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
        let drive = along(self.online.inverse(), self.start, &x, &v, &a);
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

fn along(
    inverse: &StageInverse,
    mut state: StageInverseState,
    x: &[f64],
    v: &[f64],
    a: &[f64],
) -> Result<Vec<f64>> {
    let mut drive = room("the drive along the reference", x.len())?;
    for (k, ((&x, &v), &a)) in x.iter().zip(v).zip(a).enumerate() {
        let value = inverse.step(&mut state, x, v, a);
        if !value.is_finite() {
            return Err(Error::Numerical(format!(
                "the inverse has no voltage for sample {k} of the reference ({x:e} m, \
                 {v:e} m/s, {a:e} m/s^2): check its units and its sampling"
            )));
        }
        drive.push(value);
    }
    Ok(drive)
}
