//! Identification of a stage's weights by least squares.

use piezotrack_core::identify::{
    CreepKind, DynamicsKind, History, LeastSquaresFit, PlaysKind, WeightsRecord, WeightsSettings,
    identify_weights, resonances,
};
use piezotrack_core::math::{FREE, NOT_NEGATIVE, Rows};
use piezotrack_core::models::Model;
use piezotrack_core::signal::Drive;
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::arrays::samples;
use crate::enter::enter;
use crate::errors::raise;
use crate::identify::history_named;
use crate::models::{Named, named};
use crate::stage::hold;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyLeastSquaresFit>()?;
    module.add_function(wrap_pyfunction!(fit_weights, module)?)?;
    module.add_function(wrap_pyfunction!(shown_modes, module)?)?;
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

    /// Names of the parameters that lie on a bound.
    #[getter]
    fn at_bound(&self) -> Vec<String> {
        self.0.at_bound.clone()
    }

    #[getter]
    fn history(&self) -> &'static str {
        match self.0.history {
            History::Virgin => "virgin",
            History::Settled => "settled",
            History::Fitted => "fit",
        }
    }

    /// State of the stage before the first sample, by its names.
    #[getter]
    fn start(&self) -> Named {
        named(&self.0.start)
    }

    /// Lags that explain the record as well, s.
    #[getter]
    fn lag_range(&self) -> Option<(f64, f64)> {
        self.0.lag_range
    }
}

fn dynamics_named(name: &str) -> Result<DynamicsKind> {
    match name {
        "none" => Ok(DynamicsKind::None),
        "first" => Ok(DynamicsKind::First),
        "second" => Ok(DynamicsKind::Second),
        "auto" => Ok(DynamicsKind::Auto),
        other => {
            let expected = "'auto', None, 'first' or 'second'";
            Err(Error::parameter("dynamics", format!("'{other}'"), expected))
        }
    }
}

/// Identifies a stage of a model from a record; what is None is chosen.
#[pyfunction]
#[pyo3(name = "identify_weights", signature = (*, model, u, y, dt, hold_name, start, count,
    thresholds, zones, creep_times, dynamics, history, offset))]
#[expect(clippy::too_many_arguments, reason = "keyword-only, called from one place")]
fn fit_weights(
    py: Python<'_>,
    model: &str,
    u: &Bound<'_, PyAny>,
    y: &Bound<'_, PyAny>,
    dt: f64,
    hold_name: &str,
    start: usize,
    count: Option<usize>,
    thresholds: Option<Vec<f64>>,
    zones: usize,
    creep_times: Option<Vec<f64>>,
    dynamics: &str,
    history: Option<&str>,
    offset: bool,
) -> PyResult<PyLeastSquaresFit> {
    let (u, y) = (samples("u", u)?, samples("y", y)?);
    let fit = enter(py, |stop| {
        let drive = Drive::new(&u, dt, hold(hold_name)?)?;
        let dynamics = dynamics_named(dynamics)?;
        let plays = match (thresholds, count) {
            (Some(thresholds), _) => PlaysKind::Thresholds(thresholds),
            (None, Some(count)) => PlaysKind::Spread(count),
            (None, None) => PlaysKind::Auto,
        };
        let creep = creep_times.map_or(CreepKind::Auto, CreepKind::Times);
        let history = history.map(history_named).transpose()?;
        let settings = WeightsSettings { plays, zones, creep, dynamics, history, offset };
        let record = WeightsRecord { drive, y: &y, start };
        identify_weights(Model::named(model)?, &record, &settings, stop)
    })?;
    // None means stopped, for which `enter` has raised.
    fit.map(PyLeastSquaresFit)
        .ok_or_else(|| raise(&Error::Numerical("the search was stopped".into())))
}

/// Modes that a record shows: frequency, damping ratio, share of the deviation that each explains.
#[pyfunction]
#[pyo3(name = "resonances", signature = (*, u, y, dt, hold_name, start, most))]
fn shown_modes(
    py: Python<'_>,
    u: &Bound<'_, PyAny>,
    y: &Bound<'_, PyAny>,
    dt: f64,
    hold_name: &str,
    start: usize,
    most: usize,
) -> PyResult<Vec<(f64, f64, f64)>> {
    let (u, y) = (samples("u", u)?, samples("y", y)?);
    let found = enter(py, |stop| {
        let drive = Drive::new(&u, dt, hold(hold_name)?)?;
        Ok(resonances(&drive, &y, start, most, stop))
    })?;
    let all = found.unwrap_or_default();
    Ok(all.iter().map(|one| (one.frequency, one.damping_ratio, one.gain)).collect())
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
    let bounds: Vec<(f64, f64)> =
        free.iter().map(|free| if *free { FREE } else { NOT_NEGATIVE }).collect();
    Ok(rows.solve(&bounds))
}
