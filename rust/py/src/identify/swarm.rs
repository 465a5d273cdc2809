//! Settings of the swarm, and the swarm as ask/tell for costs that the caller evaluates.

use piezotrack_core::identify::{Boundary, Swarm, SwarmSettings, Topology, Update};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PySettings>()?;
    module.add_class::<PySwarm>()
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

/// A swarm in the unit box, between two evaluations.
#[pyclass(name = "Swarm", module = "piezotrack._core")]
pub struct PySwarm(Swarm);

#[pymethods]
impl PySwarm {
    #[new]
    fn new(settings: &PySettings, coordinates: usize, seed: u64) -> PyResult<Self> {
        let swarm = Swarm::new(settings.0.clone(), coordinates, seed, 0);
        swarm.map(Self).map_err(|error| raise(&error))
    }

    /// The places to evaluate; None for one that is outside and invisible.
    fn ask(&self) -> Vec<Option<Vec<f64>>> {
        self.0.ask().map(|place| place.map(<[f64]>::to_vec)).collect()
    }

    /// Takes the costs of the places asked for, and moves on.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from a list")]
    fn tell(&mut self, costs: Vec<f64>) {
        self.0.tell(&costs);
    }

    /// The best place so far, and its cost.
    #[getter]
    fn best(&self) -> (Vec<f64>, f64) {
        let (place, cost) = self.0.best();
        (place.to_vec(), cost)
    }

    /// Whether the iterations are all done, or the best cost has stalled.
    #[getter]
    fn done(&self) -> bool {
        self.0.exhausted() || self.0.stalled()
    }
}
