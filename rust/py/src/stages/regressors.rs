//! Nonlinear functions of drives and displacements of several axes.

use numpy::PyArray1;
use piezotrack_core::simulate::{Regressor, RegressorState, Regressors};
use pyo3::prelude::*;

use crate::conversions::arrays::{array, samples};
use crate::enter::enter;
use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyRegressors>()
}

/// Variables at the last sample, and values.
type State<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

/// Regressors sample by sample, and the state after them.
type Followed<'py> =
    (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Functions of variables that are linear in the drives and the displacements of a sample.
#[pyclass(name = "Regressors", frozen, module = "piezotrack._core")]
pub(super) struct PyRegressors(pub(super) Regressors);

#[pymethods]
impl PyRegressors {
    /// Products of variables, stop operators and saturated changes, each with a threshold or scale.
    #[new]
    fn new(
        drives: usize,
        sensors: usize,
        matrix: &Bound<'_, PyAny>,
        products: Vec<Vec<usize>>,
        stops: Vec<(usize, f64)>,
        changes: Vec<(usize, f64)>,
    ) -> PyResult<Self> {
        let matrix = samples("matrix", matrix)?;
        let mut list: Vec<Regressor> = products.into_iter().map(Regressor::Product).collect();
        let stops = stops.into_iter();
        list.extend(stops.map(|(variable, threshold)| Regressor::Stop { variable, threshold }));
        let changes = changes.into_iter();
        list.extend(changes.map(|(variable, scale)| Regressor::Change { variable, scale }));
        Regressors::new([drives, sensors], &matrix, list).map(Self).map_err(|error| raise(&error))
    }

    /// The regressors along drives and displacements from a state, at rest by default, and the
    /// state after them.
    #[pyo3(signature = (drives, displacements, state = None))]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn follow<'py>(
        &self,
        py: Python<'py>,
        drives: &Bound<'py, PyAny>,
        displacements: &Bound<'py, PyAny>,
        state: Option<State<'py>>,
    ) -> PyResult<Followed<'py>> {
        let (drives, displacements) =
            (samples("drives", drives)?, samples("displacements", displacements)?);
        let mut state = match &state {
            Some((last, values)) => {
                RegressorState { last: samples("state", last)?, values: samples("state", values)? }
            }
            None => self.0.rest().map_err(|error| raise(&error))?,
        };
        let found = enter(py, |_| self.0.follow(&mut state, &drives, &displacements))?;
        Ok((
            array(py, found.into_iter())?,
            array(py, state.last.into_iter())?,
            array(py, state.values.into_iter())?,
        ))
    }
}
