//! The swarm with an ask/tell interface, for cost functions that the caller evaluates.

use piezotrack_core::identify::Swarm;
use pyo3::prelude::*;

use crate::errors::raise;
use crate::identify::PySettings;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PySwarm>()
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
