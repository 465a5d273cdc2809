//! Identification by swarm search, and the settings of the swarm.

use numpy::{PyArray1, ToPyArray};
use piezotrack_core::identify::{
    Boundary, Coordinate, DELAY, Delay, Identification, Outcome, Plan, Record, Spec, StopReason,
    SwarmSettings, Topology, Update, identify as identified,
};
use piezotrack_core::integrator::Order;
use piezotrack_core::models::Model;
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::arrays::samples;
use crate::enter::{Watchers, enter_pool};
use crate::errors::raise;
use crate::stage::hold;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PySettings>()?;
    module.add_class::<PySearch>()?;
    module.add_function(wrap_pyfunction!(identify, module)?)
}

/// Checked settings of a swarm.
#[pyclass(name = "SwarmSettings", frozen, module = "piezotrack._core")]
pub struct PySettings(pub SwarmSettings);

#[pymethods]
impl PySettings {
    #[new]
    #[pyo3(signature = (*, particles, iterations, update, inertia_start, inertia_end,
        inertia_iterations, cognitive, social, topology, velocity_limit, boundary, min_improvement,
        stall_iterations, polish))]
    #[expect(clippy::too_many_arguments, reason = "keyword-only, one for each setting")]
    fn new(
        particles: usize,
        iterations: usize,
        update: &str,
        inertia_start: f64,
        inertia_end: f64,
        inertia_iterations: usize,
        cognitive: f64,
        social: f64,
        topology: &str,
        velocity_limit: f64,
        boundary: &str,
        min_improvement: f64,
        stall_iterations: usize,
        polish: bool,
    ) -> PyResult<Self> {
        let update = update_named(update).map_err(|error| raise(&error))?;
        let boundary = boundary_named(boundary).map_err(|error| raise(&error))?;
        let topology = topology_named(topology).map_err(|error| raise(&error))?;
        let settings = SwarmSettings {
            particles,
            iterations,
            update,
            inertia: (inertia_start, inertia_end),
            inertia_iterations,
            cognitive,
            social,
            topology,
            velocity_limit,
            boundary,
            min_improvement,
            stall_iterations,
            polish,
        };
        settings.validate().map_err(|error| raise(&error))?;
        Ok(Self(settings))
    }

    /// Settings of Xu and Li 2010, section 3.3, by their names.
    #[staticmethod]
    fn xu_li_2010() -> Settings {
        Settings::of(&SwarmSettings::xu_li_2010())
    }

    /// Settings of Standard Particle Swarm Optimisation 2011, by their names.
    #[staticmethod]
    fn spso_2011() -> Settings {
        Settings::of(&SwarmSettings::spso_2011())
    }
}

/// Settings of a swarm, as a dict in Python.
#[derive(IntoPyObject)]
struct Settings {
    particles: usize,
    iterations: usize,
    update: &'static str,
    inertia_start: f64,
    inertia_end: f64,
    inertia_iterations: usize,
    cognitive: f64,
    social: f64,
    topology: &'static str,
    velocity_limit: f64,
    boundary: &'static str,
    min_improvement: f64,
    stall_iterations: usize,
    polish: bool,
}

impl Settings {
    fn of(settings: &SwarmSettings) -> Self {
        Self {
            particles: settings.particles,
            iterations: settings.iterations,
            update: match settings.update {
                Update::Classic => "classic",
                Update::Hypersphere => "hypersphere",
                Update::HypersphereRadial => "hypersphere-radial",
            },
            inertia_start: settings.inertia.0,
            inertia_end: settings.inertia.1,
            inertia_iterations: settings.inertia_iterations,
            cognitive: settings.cognitive,
            social: settings.social,
            topology: match settings.topology {
                Topology::Global => "global",
                Topology::Ring => "ring",
                Topology::Random => "random",
            },
            velocity_limit: settings.velocity_limit,
            boundary: match settings.boundary {
                Boundary::Absorb => "absorb",
                Boundary::Rebound => "rebound",
                Boundary::Reflect => "reflect",
                Boundary::Invisible => "invisible",
            },
            min_improvement: settings.min_improvement,
            stall_iterations: settings.stall_iterations,
            polish: settings.polish,
        }
    }
}

fn update_named(name: &str) -> Result<Update> {
    match name {
        "classic" => Ok(Update::Classic),
        "hypersphere" => Ok(Update::Hypersphere),
        "hypersphere-radial" => Ok(Update::HypersphereRadial),
        other => Err(Error::parameter(
            "update",
            format!("'{other}'"),
            "'classic', 'hypersphere' or 'hypersphere-radial'",
        )),
    }
}

fn boundary_named(name: &str) -> Result<Boundary> {
    match name {
        "absorb" => Ok(Boundary::Absorb),
        "rebound" => Ok(Boundary::Rebound),
        "reflect" => Ok(Boundary::Reflect),
        "invisible" => Ok(Boundary::Invisible),
        other => Err(Error::parameter(
            "boundary",
            format!("'{other}'"),
            "'absorb', 'rebound', 'reflect' or 'invisible'",
        )),
    }
}

fn topology_named(name: &str) -> Result<Topology> {
    match name {
        "global" => Ok(Topology::Global),
        "ring" => Ok(Topology::Ring),
        "random" => Ok(Topology::Random),
        other => {
            Err(Error::parameter("topology", format!("'{other}'"), "'global', 'ring' or 'random'"))
        }
    }
}

fn reason_name(reason: StopReason) -> &'static str {
    match reason {
        StopReason::Stalled => "stalled",
        StopReason::Iterations => "iterations",
        StopReason::Interrupted => "interrupted",
    }
}

/// What a search found, in plain numbers.
#[pyclass(name = "Search", frozen, module = "piezotrack._core")]
struct PySearch {
    found: Identification,
    outcome: Outcome,
}

#[pymethods]
impl PySearch {
    /// The parameters of the stage, then the delay.
    #[getter]
    fn theta(&self) -> Vec<f64> {
        self.places().map(|i| self.outcome.theta.0[i]).collect()
    }

    #[getter]
    fn rms(&self) -> f64 {
        self.outcome.costs.rms
    }

    #[getter]
    fn offset(&self) -> f64 {
        self.outcome.costs.offset
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
        self.found.stepping.substeps
    }

    #[getter]
    fn history<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.outcome.history.to_pyarray(py)
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

    #[getter]
    fn scale_assumed(&self) -> bool {
        self.found.problem.scale_assumed
    }

    /// Bounds of each parameter; None for one that was held.
    #[getter]
    fn bounds(&self) -> Vec<Option<(f64, f64)>> {
        let bound = |i: usize| match self.found.problem.coordinates[i] {
            Coordinate::Fixed(_) => None,
            Coordinate::Free { low, high, .. } => Some((low, high)),
        };
        self.places().map(bound).collect()
    }

    /// (index of the parameter, standard deviation, whether it lies on a bound).
    #[getter]
    fn sensitivities(&self) -> Vec<(usize, f64, bool)> {
        let found = self.found.sensitivities.iter();
        let place = |i: usize| i.min(self.found.problem.model.info().parameters.len());
        found.map(|s| (place(s.parameter), s.deviation, s.at_bound)).collect()
    }
}

impl PySearch {
    /// Indices of the model's parameters, and of the delay.
    fn places(&self) -> impl Iterator<Item = usize> {
        (0..self.found.problem.model.info().parameters.len()).chain([DELAY])
    }
}

/// Identifies a stage, its `delay` between two bounds, known where they are equal, or
/// between bounds of its own choice where there are none; None where the search was stopped before
/// its first cost.
#[pyfunction]
#[pyo3(signature = (*, model, u, y, dt, hold_name, start, free, fixed, bounds, stiffness, offset,
    delay, settings, seed, runs, threads, callback, progress))]
#[expect(clippy::too_many_arguments, reason = "keyword-only, called from one place")]
fn identify(
    py: Python<'_>,
    model: &str,
    u: &Bound<'_, PyAny>,
    y: &Bound<'_, PyAny>,
    dt: f64,
    hold_name: &str,
    start: usize,
    free: Option<Vec<String>>,
    fixed: Vec<(String, f64)>,
    bounds: Vec<(String, (f64, f64))>,
    stiffness: Option<f64>,
    offset: bool,
    delay: Option<(f64, f64)>,
    settings: &PySettings,
    seed: u64,
    runs: usize,
    threads: usize,
    callback: Option<Py<PyAny>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Option<PySearch>> {
    let (u, y) = (samples("u", u)?, samples("y", y)?);
    let delay = match delay {
        None => Delay::Fitted,
        #[expect(clippy::float_cmp, reason = "the caller writes one number twice")]
        Some((low, high)) if low == high => Delay::Fixed(low),
        Some((low, high)) => Delay::Between(low, high),
    };
    let model = Model::named(model).map_err(|error| raise(&error))?;
    let spec = Spec { model, free, fixed, bounds, stiffness, offset, delay };
    let plan = Plan { settings: settings.0.clone(), seed, runs };
    let watchers = Watchers { callback, progress };
    let found = enter_pool(py, threads, &watchers, |monitor, stop| {
        let record = Record::new(&u, &y, dt, hold(hold_name)?, start)?;
        identified(&record, &spec, &plan, monitor, stop)
    })?;
    Ok(found.best.map(|best| PySearch { outcome: found.runs[best].clone(), found }))
}
