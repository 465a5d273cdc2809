//! Identification of a stage's weights by least squares.

use piezotrack_core::identify::{
    CreepKind, DynamicsKind, History, LeastSquaresFit, NodesKind, RecordFit, Structure,
    WeightsSettings, identify_weights, resonances,
};
use piezotrack_core::math::{FREE, NOT_NEGATIVE, Rows};
use piezotrack_core::models::{Dynamics, Mode};
use piezotrack_core::signal::{Drive, Stop};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::conversions::arrays::samples;
use crate::enter::{enter, enter_quiet_pool_until};
use crate::errors::raise;
use crate::identify::problem::{OneRecord, PyProblem};
use crate::stages::models::{Named, named};
use crate::stages::stage::hold;

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

    /// Values of each record, in their order.
    #[getter]
    fn records(&self) -> Vec<Own> {
        self.0.records.iter().map(Own::of).collect()
    }

    /// Lags that explain the record as well, s.
    #[getter]
    fn lag_range(&self) -> Option<(f64, f64)> {
        self.0.lag_range
    }
}

/// Values of one of the records, as a dict in Python.
#[derive(IntoPyObject)]
struct Own {
    /// RMS deviation, m.
    rms: f64,
    /// Reading at rest, m.
    offset: f64,
    /// Drift where the window begins, m, and its time constant, s.
    drift: Option<(f64, f64)>,
    /// Delay of the reading, s.
    delay: f64,
    history: &'static str,
    /// State of the stage before the first sample, by its names.
    start: Named,
}

impl Own {
    fn of(found: &RecordFit) -> Self {
        let RecordFit { offset, drift, delay, rms, history, ref start } = *found;
        Self { rms, offset, drift, delay, history: history.name(), start: named(start) }
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

/// A `Structure`.
#[derive(FromPyObject)]
struct PyStructure {
    histories: Vec<String>,
    drifts: Vec<Option<f64>>,
    creep_times: Vec<f64>,
    dynamics: Vec<f64>,
    kept: bool,
}

impl PyStructure {
    fn structure(self) -> Result<Structure> {
        let histories: Result<Vec<_>> =
            self.histories.iter().map(|name| History::named(name)).collect();
        let dynamics = match self.dynamics[..] {
            [time] => Dynamics::First { time },
            [frequency, damping_ratio] => Dynamics::Second { frequency, damping_ratio },
            [frequency, damping_ratio, weight, second, damping] => {
                let further = Mode { weight, frequency: second, damping_ratio: damping };
                Dynamics::modes(frequency, damping_ratio, &[further])?
            }
            _ => Dynamics::None,
        };
        let records = histories?.into_iter().zip(self.drifts).collect();
        Ok(Structure { records, creep_times: self.creep_times, dynamics, kept: self.kept })
    }
}

/// Identifies a stage by least squares; what is None is chosen.
#[pyfunction]
#[pyo3(name = "identify_weights", signature = (problem, *, count, thresholds, zones, creep_times,
    dynamics, start, threads, stopped = None))]
#[expect(clippy::too_many_arguments, reason = "keyword-only, called from one place")]
fn fit_weights(
    py: Python<'_>,
    problem: PyProblem<'_>,
    count: Option<usize>,
    thresholds: Option<Vec<f64>>,
    zones: usize,
    creep_times: Option<Vec<f64>>,
    dynamics: &str,
    start: Option<PyStructure>,
    threads: usize,
    stopped: Option<Py<PyAny>>,
) -> PyResult<PyLeastSquaresFit> {
    let question = problem.question()?;
    let checked = || -> Result<_> {
        let records: Result<Vec<_>> =
            question.records.iter().map(OneRecord::weights_record).collect();
        let nodes = match (thresholds, count) {
            (Some(thresholds), _) => NodesKind::Given(thresholds),
            (None, Some(count)) => NodesKind::Spread(count),
            (None, None) => NodesKind::Auto,
        };
        let creep = creep_times.map_or(CreepKind::Auto, CreepKind::Times);
        let dynamics = dynamics_named(dynamics)?;
        let start = start.map(PyStructure::structure).transpose()?;
        Ok((records?, WeightsSettings { nodes, zones, creep, dynamics, start }))
    };
    let (records, settings) = checked().map_err(|error| raise(&error))?;
    let job = |stop: Stop<'_>| identify_weights(question.model, &records, &settings, stop);
    let fit = enter_quiet_pool_until(py, threads, stopped, job)?;
    // None means stopped, for which `enter_quiet_pool_until` has raised.
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
