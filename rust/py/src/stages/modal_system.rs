//! Modes in parallel with several drives and sensors, and loops around them.

use numpy::PyArray1;
use piezotrack_control::Pid;
use piezotrack_core::Error;
use piezotrack_core::simulate::{AxesLoop, ModalState, ModalSystem};
use pyo3::prelude::*;

use crate::conversions::arrays::{array, samples};
use crate::enter::enter;
use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyModalSystem>()
}

/// Real and imaginary parts, each as an array.
pub(super) type Parts<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

/// Outputs, and real and imaginary parts of the state after them.
type Simulated<'py> =
    (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Outputs and drives of a loop.
type Tracked<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Reference, feedforward and noise of a loop.
type Signals<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// Gain, integral, derivative and tracking time.
type Gains = (f64, f64, f64, Option<f64>);

/// A sampled system of modes in parallel.
#[pyclass(name = "ModalSystem", frozen, module = "piezotrack._core")]
pub(super) struct PyModalSystem(pub(super) ModalSystem);

pub(super) fn complex(name: &str, (real, imaginary): &Parts<'_>) -> PyResult<Vec<[f64; 2]>> {
    let (real, imaginary) = (samples(name, real)?, samples(name, imaginary)?);
    if real.len() != imaginary.len() {
        return Err(raise(&Error::Shape {
            name: name.into(),
            found: format!("{} real and {} imaginary parts", real.len(), imaginary.len()),
            expected: "as many of both".into(),
        }));
    }
    Ok(real.into_iter().zip(imaginary).map(|(re, im)| [re, im]).collect())
}

pub(super) fn modal_state((real, imaginary): &Parts<'_>) -> PyResult<ModalState> {
    Ok(ModalState { real: samples("state", real)?, imaginary: samples("state", imaginary)? })
}

#[pymethods]
impl PyModalSystem {
    /// Poles, and the vectors b and c of each mode after each other, as real and imaginary parts.
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn new(
        drives: usize,
        sensors: usize,
        poles: Parts<'_>,
        inputs: Parts<'_>,
        outputs: Parts<'_>,
        direct: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let poles = complex("poles", &poles)?;
        let (inputs, outputs) = (complex("inputs", &inputs)?, complex("outputs", &outputs)?);
        let direct = samples("direct", direct)?;
        ModalSystem::new([drives, sensors], &poles, &inputs, &outputs, &direct)
            .map(Self)
            .map_err(|error| raise(&error))
    }

    /// Outputs of a drive from a state, and the state after it.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        state: Parts<'py>,
        drive: &Bound<'py, PyAny>,
    ) -> PyResult<Simulated<'py>> {
        let mut state = modal_state(&state)?;
        let drive = samples("drive", drive)?;
        let outputs = enter(py, |_| self.0.simulate(&mut state, &drive))?;
        Ok((
            array(py, outputs.into_iter())?,
            array(py, state.real.into_iter())?,
            array(py, state.imaginary.into_iter())?,
        ))
    }

    /// Outputs and drives of a loop of PID controllers from rest.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn track<'py>(
        &self,
        py: Python<'py>,
        gains: Vec<Gains>,
        dt: f64,
        matrices: Parts<'py>,
        limits: Vec<[f64; 2]>,
        signals: Signals<'py>,
    ) -> PyResult<Tracked<'py>> {
        let (to_drives, to_axes) =
            (samples("to_drives", &matrices.0)?, samples("to_axes", &matrices.1)?);
        let reference = samples("reference", &signals.0)?;
        let (feedforward, noise) =
            (samples("feedforward", &signals.1)?, samples("noise", &signals.2)?);
        let run = enter(py, |_| {
            let laws = gains
                .iter()
                .map(|&(kp, ti, td, tt)| Ok(Pid::new(kp, ti, td, tt)?.at(dt)?))
                .collect::<Result<_, Error>>()?;
            let around = AxesLoop { laws, to_drives, to_axes, limits };
            self.0.track(&around, &reference, &feedforward, &noise)
        })?;
        Ok((array(py, run.outputs.into_iter())?, array(py, run.drives.into_iter())?))
    }
}
