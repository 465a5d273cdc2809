//! Identification of a stage's weights by least squares.

use piezotrack_core::identify::{
    DynamicsKind, LeastSquaresFit, WeightsRecord, WeightsSettings, identify_weights,
};
use piezotrack_core::math::Rows;
use piezotrack_core::models::Model;
use piezotrack_core::signal::Drive;
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::arrays::samples;
use crate::enter::enter;
use crate::errors::raise;
use crate::models::{Named, named};
use crate::stage::hold;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyLeastSquaresFit>()?;
    module.add_function(wrap_pyfunction!(fit_weights, module)?)?;
    module.add_function(wrap_pyfunction!(nnls, module)?)
}

/// A stage as identified.
#[pyclass(name = "LeastSquaresFit", frozen, module = "piezotrack._core")]
struct PyLeastSquaresFit(LeastSquaresFit);

#[pymethods]
impl PyLeastSquaresFit {
    /// Parameters of the stage, by their names.
    #[getter]
    fn parameters(&self) -> Named {
        named(&self.0.values)
    }

    #[getter]
    fn offset(&self) -> f64 {
        self.0.offset
    }

    #[getter]
    fn rms(&self) -> f64 {
        self.0.rms
    }

    #[getter]
    fn evaluations(&self) -> usize {
        self.0.evaluations
    }

    #[getter]
    fn at_bound(&self) -> bool {
        self.0.at_bound
    }
}

fn dynamics_named(name: &str) -> Result<DynamicsKind> {
    match name {
        "none" => Ok(DynamicsKind::None),
        "first" => Ok(DynamicsKind::First),
        "second" => Ok(DynamicsKind::Second),
        other => {
            let expected = "None, 'first' or 'second'";
            Err(Error::parameter("dynamics", format!("'{other}'"), expected))
        }
    }
}

/// Identifies a stage of a model from a record.
#[pyfunction]
#[pyo3(name = "identify_weights", signature = (*, model, u, y, dt, hold_name, start, thresholds,
    zones, creep_times, dynamics, offset))]
#[expect(clippy::too_many_arguments, reason = "keyword-only, called from one place")]
fn fit_weights(
    py: Python<'_>,
    model: &str,
    u: &Bound<'_, PyAny>,
    y: &Bound<'_, PyAny>,
    dt: f64,
    hold_name: &str,
    start: usize,
    thresholds: Vec<f64>,
    zones: usize,
    creep_times: Vec<f64>,
    dynamics: &str,
    offset: bool,
) -> PyResult<PyLeastSquaresFit> {
    let (u, y) = (samples("u", u)?, samples("y", y)?);
    let fit = enter(py, |stop| {
        let drive = Drive::new(&u, dt, hold(hold_name)?)?;
        let dynamics = dynamics_named(dynamics)?;
        let settings = WeightsSettings { thresholds, zones, times: creep_times, dynamics, offset };
        let record = WeightsRecord { drive, y: &y, start };
        identify_weights(Model::named(model)?, &record, &settings, stop)
    })?;
    // None means stopped, for which `enter` has raised.
    fit.map(PyLeastSquaresFit)
        .ok_or_else(|| raise(&Error::Numerical("the search was stopped".into())))
}

/// Non-negative least squares, for tests: rows of A, b, which unknowns are free of sign.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "from Python")]
fn nnls(a: Vec<Vec<f64>>, b: Vec<f64>, free: Vec<bool>) -> PyResult<Vec<f64>> {
    let unknowns = free.len();
    if a.len() != b.len() || a.iter().any(|row| row.len() != unknowns) {
        return Err(crate::errors::shape("a", "another shape", "len(b) rows of len(free)"));
    }
    let mut rows = Rows::new(unknowns);
    for (row, right) in a.iter().zip(&b) {
        rows.push(row, *right);
    }
    Ok(rows.solve(&free))
}
