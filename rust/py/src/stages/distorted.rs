//! Modes that regressors move beside the drives.

use numpy::PyArray1;
use piezotrack_core::simulate::{DistortedModes, DistortedState, RegressorState};
use pyo3::prelude::*;

use super::modal_system::{Parts, PyModalSystem, complex, modal_state};
use super::regressors::PyRegressors;
use crate::conversions::arrays::{array, samples};
use crate::enter::enter;
use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyDistortedModes>()
}

/// Real and imaginary parts of the modes and of the forced modes, variables and values.
type State<'py> = (Parts<'py>, Parts<'py>, Parts<'py>);

/// A pair of arrays.
type Pair<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Outputs, and the state after them.
type Simulated<'py> = (Bound<'py, PyArray1<f64>>, (Pair<'py>, Pair<'py>, Pair<'py>));

/// Modes that drives and regressors move.
#[pyclass(name = "DistortedModes", frozen, module = "piezotrack._core")]
struct PyDistortedModes(DistortedModes);

#[pymethods]
impl PyDistortedModes {
    /// Modes, regressors, and e of drives and regressors mode by mode.
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn new(system: &PyModalSystem, regressors: &PyRegressors, forces: Parts<'_>) -> PyResult<Self> {
        let forces = complex("forces", &forces)?;
        DistortedModes::new(system.0.clone(), regressors.0.clone(), &forces)
            .map(Self)
            .map_err(|error| raise(&error))
    }

    /// Outputs of a drive from a state, and the state after it.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        state: State<'py>,
        drive: &Bound<'py, PyAny>,
    ) -> PyResult<Simulated<'py>> {
        let (last, values) = &state.2;
        let memory =
            RegressorState { last: samples("state", last)?, values: samples("state", values)? };
        let mut state = DistortedState {
            modes: modal_state(&state.0)?,
            forced: modal_state(&state.1)?,
            memory,
        };
        let drive = samples("drive", drive)?;
        let outputs = enter(py, |_| self.0.simulate(&mut state, &drive))?;
        let pair = |first: Vec<f64>, second: Vec<f64>| -> PyResult<Pair<'py>> {
            Ok((array(py, first.into_iter())?, array(py, second.into_iter())?))
        };
        let DistortedState { modes, forced, memory } = state;
        let after = (
            pair(modes.real, modes.imaginary)?,
            pair(forced.real, forced.imaginary)?,
            pair(memory.last, memory.values)?,
        );
        Ok((array(py, outputs.into_iter())?, after))
    }
}
