//! Identification of a stage whose parameters a swarm searches.

use std::sync::Arc;

use numpy::PyArray1;
use piezotrack_core::identify::{
    BEFORE, Coordinate, DELAY, DRIFT_TIME, History, Identification, Journal, Method, Outcome,
    OwnResult, Plan, Record, Relations, Spec, StopReason, identify_together,
};
use piezotrack_core::integrator::Order;
use piezotrack_core::signal::Drive;
use pyo3::prelude::*;

use crate::conversions::arrays::{array, samples};
use crate::enter::{Watchers, enter_pool};
use crate::errors::raise;
use crate::identify::checkpoint::PyCheckpoint;
use crate::identify::descents::PyDescents;
use crate::identify::problem::PyProblem;
use crate::identify::swarm::PySettings;
use crate::stages::stage::hold;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PySearch>()?;
    module.add_class::<PyCheckpoint>()?;
    module.add_function(wrap_pyfunction!(voltages_before, module)?)?;
    module.add_function(wrap_pyfunction!(identify, module)?)
}

fn reason_name(reason: StopReason) -> &'static str {
    match reason {
        StopReason::Stalled => "stalled",
        StopReason::Iterations => "iterations",
        StopReason::Agreed => "agreed",
        StopReason::Converged => "converged",
        StopReason::Interrupted => "interrupted",
    }
}

/// Estimate of one parameter, as a dict in Python.
#[derive(IntoPyObject)]
struct Estimate {
    name: &'static str,
    value: f64,
    /// Bounds of the search; None for a parameter that was held.
    bounds: Option<(f64, f64)>,
    /// Whether it is held as the records do not show it.
    not_shown: bool,
    at_bound: bool,
    /// How the search went through the bounds; None for a parameter that was not searched.
    scale: Option<&'static str>,
    /// Expression of a parameter that follows from others.
    tie: Option<String>,
    /// Value and standard deviation that were known besides the record.
    prior: Option<(f64, f64)>,
}

/// Values of one of the records, as a dict in Python.
#[derive(IntoPyObject)]
struct Own {
    /// RMS deviation, m, without priors.
    rms: f64,
    offset: f64,
    delay: Estimate,
    voltage_before: Estimate,
    drift_time: Estimate,
    /// Part of the reading that fades along the window, m.
    drift: f64,
}

/// Result of a search, in plain numbers.
#[pyclass(name = "Search", frozen, module = "piezotrack._core")]
struct PySearch {
    found: Identification,
    outcome: Outcome,
}

#[pymethods]
impl PySearch {
    /// The parameters of the stage, by their names.
    #[getter]
    fn estimates(&self) -> Vec<Estimate> {
        let names = self.found.problem.model.scalars().iter().map(|info| info.name);
        names.enumerate().filter_map(|(place, name)| self.estimate(0, place, name)).collect()
    }

    /// Values of each record, in their order.
    #[getter]
    fn records(&self) -> Vec<Own> {
        let own = |(r, one): (usize, &OwnResult)| {
            let (rms, offset) = (one.costs.rms, one.costs.offset);
            let delay = self.estimate(r, DELAY, "delay")?;
            let voltage_before = self.estimate(r, BEFORE, "voltage_before")?;
            let drift_time = self.estimate(r, DRIFT_TIME, "drift_time")?;
            let drift = one.costs.drift;
            Some(Own { rms, offset, delay, voltage_before, drift_time, drift })
        };
        self.found.records.iter().enumerate().filter_map(own).collect()
    }

    /// Without the factor of the priors.
    #[getter]
    fn rms(&self) -> f64 {
        let relations = &self.found.problem.relations;
        self.outcome.costs.rms / relations.factor(&self.outcome.theta)
    }

    /// Minimised cost, with the factor of the priors; None without priors.
    #[getter]
    fn rms_with_priors(&self) -> Option<f64> {
        let known = !self.found.problem.relations.priors.is_empty();
        known.then_some(self.outcome.costs.rms)
    }

    /// Text, smaller and larger parameter of each inequality, and whether the two are equal.
    #[getter]
    fn constraints(&self) -> Vec<(String, &'static str, &'static str, bool)> {
        let problem = &self.found.problem;
        let name = |place: usize| problem.model.scalars()[place].name;
        let active = problem.active(&self.outcome.place);
        let all = problem.relations.constraints.iter().zip(active);
        all.map(|(one, active)| (one.text.clone(), name(one.lower), name(one.upper), active))
            .collect()
    }

    #[getter]
    fn offset(&self) -> f64 {
        self.outcome.costs.offset
    }

    /// Weights and time constants (s) of the creep.
    #[getter]
    fn creep(&self) -> (Vec<f64>, Vec<f64>) {
        let times = self.found.problem.creep_times.clone();
        (self.outcome.costs.creep_weights[..times.len()].to_vec(), times)
    }

    #[getter]
    fn iterations(&self) -> usize {
        self.outcome.iterations
    }

    #[getter]
    fn evaluations(&self) -> usize {
        self.outcome.evaluations
    }

    #[getter]
    fn polish_evaluations(&self) -> usize {
        self.outcome.polish_evaluations
    }

    #[getter]
    fn failures(&self) -> usize {
        self.found.runs.iter().map(|run| run.failures).sum()
    }

    #[getter]
    fn substeps(&self) -> usize {
        self.found.stepping.substeps.usual
    }

    #[getter]
    fn history<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        array(py, self.outcome.history.iter().copied())
    }

    #[getter]
    fn order(&self) -> u32 {
        match self.found.stepping.order {
            Order::Second => 2,
            Order::Fourth => 4,
        }
    }

    #[getter]
    fn stop_reason(&self) -> &'static str {
        reason_name(self.outcome.reason)
    }

    /// (cost, iterations, simulations, why it ended) of each run.
    #[getter]
    fn runs(&self) -> Vec<(f64, usize, usize, &'static str)> {
        let runs = self.found.runs.iter();
        runs.map(|run| (run.costs.rms, run.iterations, run.evaluations, reason_name(run.reason)))
            .collect()
    }

    /// Runs that ended as low as the best one.
    #[getter]
    fn agreeing(&self) -> usize {
        self.found.agreeing
    }

    /// Least and largest lag that fit as well, s, and whether none fits too; None where the drive
    /// shows the dynamics.
    #[getter]
    fn lags(&self) -> Option<(f64, f64, bool)> {
        let found = self.found.lags.as_ref()?;
        Some((found.lags.0, found.lags.1, found.from_zero))
    }

    #[getter]
    fn scale_assumed(&self) -> bool {
        self.found.problem.scale_assumed
    }
}

impl PySearch {
    /// Value at a place of a record's parameters.
    fn estimate(&self, r: usize, place: usize, name: &'static str) -> Option<Estimate> {
        let OwnResult { problem, theta, .. } = self.found.records.get(r)?;
        // A mass that the record does not show is held where it has no effect.
        let held = problem.mass_if_shown.is_some();
        let (bounds, scale) = match problem.coordinates[place] {
            Coordinate::Fixed(_) | Coordinate::Tied => (None, None),
            Coordinate::Free { low, high, scale } => (Some((low, high)), Some(scale.name())),
        };
        let Relations { ties, priors, .. } = &problem.relations;
        let tie = ties.iter().find(|tie| tie.parameter == place);
        let prior = priors.iter().find(|prior| prior.parameter == place);
        Some(Estimate {
            name,
            value: theta.0[place],
            bounds,
            not_shown: held && name == "mass",
            at_bound: self.found.at_bound.contains(&(r, place)),
            scale,
            tie: tie.map(|tie| tie.text.clone()),
            prior: prior.map(|prior| (prior.mean, prior.width)),
        })
    }
}

/// The voltages that a stage visits slowly before the drive of a record.
#[pyfunction]
fn voltages_before<'py>(
    py: Python<'py>,
    u: &Bound<'py, PyAny>,
    dt: f64,
    hold_name: &str,
    history: &str,
    before: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let u = samples("u", u)?;
    let voltages = || {
        let drive = Drive::new(&u, dt, hold(hold_name)?)?;
        Ok(piezotrack_core::identify::voltages_before(&drive, History::named(history)?, before))
    };
    array(py, voltages().map_err(|error| raise(&error))?.into_iter())
}

/// Settings of a search, in Python.
#[derive(FromPyObject)]
enum Searcher<'py> {
    Swarm(PyRef<'py, PySettings>),
    Descents(PyRef<'py, PyDescents>),
}

impl Searcher<'_> {
    fn into_method(self) -> Method {
        match self {
            Self::Swarm(settings) => Method::Swarm(settings.0.clone()),
            Self::Descents(settings) => Method::Descents(settings.0.clone()),
        }
    }
}

/// Searches the parameters of a stage; None where the search was stopped before its first cost.
#[pyfunction]
#[pyo3(signature = (problem, *, method, seed, runs, start, threads, callback, progress, checkpoint))]
#[expect(clippy::too_many_arguments, reason = "keyword-only, called from one place")]
fn identify(
    py: Python<'_>,
    problem: PyProblem<'_>,
    method: Searcher<'_>,
    seed: u64,
    runs: usize,
    start: Option<Vec<f64>>,
    threads: usize,
    callback: Option<Py<PyAny>>,
    progress: Option<Py<PyAny>>,
    checkpoint: Option<PyRef<'_, PyCheckpoint>>,
) -> PyResult<Option<PySearch>> {
    let question = problem.question()?;
    let plan = Plan { method: method.into_method(), seed, runs, start };
    let journal = checkpoint.map(|one| one.0.clone() as Arc<dyn Journal>);
    let watchers = Watchers { callback, progress, journal, stopped: None };
    let found = enter_pool(py, threads, &watchers, |monitor, stop| {
        let searched = question.searched()?;
        let together: Vec<(&Record<'_>, &Spec)> =
            searched.iter().map(|(record, spec)| (record, spec)).collect();
        identify_together(&together, &plan, monitor, stop)
    })?;
    Ok(found.best.map(|best| PySearch { outcome: found.runs[best].clone(), found }))
}
