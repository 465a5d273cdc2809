//! Identification of a stage's weights by least squares.

use piezotrack_core::identify::{
    CreepKind, DynamicsKind, History, LeastSquaresFit, PlacesKind, Record, RecordFit,
    WeightsRecord, WeightsSettings, identify_weights, resonances,
};
use piezotrack_core::math::{FREE, NOT_NEGATIVE, Rows};
use piezotrack_core::models::Model;
use piezotrack_core::signal::{Drive, Stop};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::arrays::samples;
use crate::enter::{enter, enter_quiet_pool};
use crate::errors::raise;
use crate::models::{Named, named};
use crate::question::{delay_between, drift_with};
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

    /// What each record has of its own, in their order.
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

/// What one of the records has of its own, as a dict in Python.
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

/// A record and what is asked of it alone, from a dict of Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Asked<'py> {
    u: Bound<'py, PyAny>,
    y: Bound<'py, PyAny>,
    dt: f64,
    hold_name: String,
    start: usize,
    history: Option<String>,
    offset: bool,
    /// Time constant of the drift, s; 0 for none, None for what the record shows.
    drift: Option<f64>,
    delay: Option<(f64, f64)>,
    label: String,
    weight: f64,
}

/// The same with its numbers out of Python.
struct Samples {
    u: Vec<f64>,
    y: Vec<f64>,
}

impl Asked<'_> {
    fn samples(&self) -> PyResult<Samples> {
        Ok(Samples { u: samples("u", &self.u)?, y: samples("y", &self.y)? })
    }

    /// The record as the core takes it.
    fn record<'a>(&self, of: &'a Samples) -> Result<WeightsRecord<'a>> {
        let record = Record::new(&of.u, &of.y, self.dt, hold(&self.hold_name)?, self.start);
        let Record { drive, y, weight, .. } =
            record.map_err(|error| error.of(&self.label))?.among(&self.label, self.weight)?;
        let history = self.history.as_deref().map(History::named).transpose()?;
        let Self { start, offset, .. } = *self;
        let drift = drift_with(self.drift);
        let one =
            WeightsRecord { history, offset, drift, weight, ..WeightsRecord::of(drive, y, start) };
        one.delayed(delay_between(self.delay)).map_err(|error| error.of(&self.label))
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

/// Identifies a stage of a model from records; what is None is chosen.
#[pyfunction]
#[pyo3(name = "identify_weights", signature = (records, *, model, count, thresholds, zones,
    creep_times, dynamics, threads))]
#[expect(clippy::too_many_arguments, reason = "keyword-only, called from one place")]
#[expect(clippy::needless_pass_by_value, reason = "from Python")]
fn fit_weights(
    py: Python<'_>,
    records: Vec<Asked<'_>>,
    model: &str,
    count: Option<usize>,
    thresholds: Option<Vec<f64>>,
    zones: usize,
    creep_times: Option<Vec<f64>>,
    dynamics: &str,
    threads: usize,
) -> PyResult<PyLeastSquaresFit> {
    let numbers: Vec<Samples> = records.iter().map(Asked::samples).collect::<PyResult<_>>()?;
    let checked = || -> Result<_> {
        let both = records.iter().zip(&numbers);
        let records: Result<Vec<_>> = both.map(|(one, numbers)| one.record(numbers)).collect();
        let places = match (thresholds, count) {
            (Some(thresholds), _) => PlacesKind::Given(thresholds),
            (None, Some(count)) => PlacesKind::Spread(count),
            (None, None) => PlacesKind::Auto,
        };
        let creep = creep_times.map_or(CreepKind::Auto, CreepKind::Times);
        let dynamics = dynamics_named(dynamics)?;
        Ok((Model::named(model)?, records?, WeightsSettings { places, zones, creep, dynamics }))
    };
    let (model, asked, settings) = checked().map_err(|error| raise(&error))?;
    let job = |stop: Stop<'_>| identify_weights(model, &asked, &settings, stop);
    let fit = enter_quiet_pool(py, threads, job)?;
    // None means stopped, for which `enter_quiet_pool` has raised.
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
