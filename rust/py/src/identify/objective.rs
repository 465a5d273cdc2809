//! The cost that an identification minimises, for optimisers of the caller's.

use piezotrack_core::identify::{
    Coordinate, Evaluator, ITS_OWN, LocalRefinement, Point, Problem, Records, Scale,
};
use piezotrack_core::integrator::Stepping;
use piezotrack_core::signal::Stop;
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::enter::enter_quiet_pool;
use crate::errors::raise;
use crate::identify::problem::{PyProblem, Question};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyObjective>()
}

/// A record, what is asked of it, and how finely its candidates are stepped.
#[pyclass(name = "Objective", frozen, module = "piezotrack._core")]
pub struct PyObjective {
    question: Question,
    problem: Problem,
    stepping: Stepping,
    threads: usize,
}

/// Place in the unit box, cost and simulations of a descent.
type Descended = (Vec<f64>, f64, usize);

#[pymethods]
#[expect(clippy::needless_pass_by_value, reason = "extracted from lists")]
impl PyObjective {
    #[new]
    fn new(py: Python<'_>, problem: PyProblem<'_>, threads: usize) -> PyResult<Self> {
        let question = problem.question()?;
        let (problem, stepping) = enter_quiet_pool(py, threads, |stop| {
            let [(record, spec)] = &question.searched()?[..] else {
                return Err(Error::parameter("data", "several records", "one record"));
            };
            let problem = Problem::new(record, spec, stop)?;
            let stepping = Evaluator::new(record, &problem, stop).stepping;
            Ok((problem, stepping))
        })?;
        Ok(Self { question, problem, stepping, threads })
    }

    /// Name, bounds and scale of each coordinate.
    #[getter]
    fn coordinates(&self) -> Vec<(&'static str, f64, f64, &'static str)> {
        let infos = self.problem.model.scalars();
        let name = |place: usize| {
            let own = ITS_OWN.iter().find(|own| own.0 == place).map_or("", |own| own.1);
            infos.get(place).map_or(own, |one| one.name)
        };
        let searched =
            self.problem.free().filter_map(|place| match self.problem.coordinates[place] {
                Coordinate::Free { low, high, scale } => {
                    let scale = if scale == Scale::Log { "log" } else { "linear" };
                    Some((name(place), low, high, scale))
                }
                _ => None,
            });
        searched.collect()
    }

    /// Costs at places of the unit box.
    fn costs(&self, py: Python<'_>, places: Vec<Vec<f64>>) -> PyResult<Vec<f64>> {
        self.check(&places).map_err(|error| raise(&error))?;
        self.evaluated(py, |local, stop| {
            let point = |place| Point { place, limit: f64::INFINITY };
            let points: Vec<Point> = places.into_iter().map(point).collect();
            let costs = local.records.costs(&points, stop);
            Ok(costs.into_iter().map(|one| one.rms).collect())
        })
    }

    /// Descends from places of the unit box, side by side.
    fn descend(&self, py: Python<'_>, places: Vec<Vec<f64>>) -> PyResult<Vec<Descended>> {
        self.check(&places).map_err(|error| raise(&error))?;
        self.evaluated(py, |local, _| {
            let found = local.descended(&places);
            Ok(found.into_iter().map(|one| (one.place, one.costs.rms, one.evaluations)).collect())
        })
    }

    /// The parameters at a place of the unit box, SI, in the order of the model; then what the
    /// record has of its own.
    fn parameters(&self, place: Vec<f64>) -> PyResult<Vec<f64>> {
        self.check(std::slice::from_ref(&place)).map_err(|error| raise(&error))?;
        Ok(self.problem.theta(&place).0.to_vec())
    }
}

impl PyObjective {
    /// Refuses places that are not in the unit box of the problem.
    fn check(&self, places: &[Vec<f64>]) -> Result<()> {
        let count = self.problem.free().count();
        for place in places {
            if place.len() != count {
                let expected = format!("{count}, one for each searched parameter");
                return Err(Error::parameter("coordinates of a place", place.len(), expected));
            }
            if let Some(z) = place.iter().find(|z| !(0.0..=1.0).contains(*z)) {
                return Err(Error::parameter("coordinate of a place", z, "0 to 1"));
            }
        }
        Ok(())
    }

    /// Runs a job with the evaluator, on threads of its own.
    fn evaluated<T: Send>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&LocalRefinement<'_>, Stop<'_>) -> Result<T> + Send,
    ) -> PyResult<T> {
        enter_quiet_pool(py, self.threads, |stop| {
            let [one] = &self.question.records[..] else { unreachable!("checked by new") };
            let record = one.record()?;
            let evaluator = Evaluator::stepped(&record, &self.problem, self.stepping);
            let records = Records::one(evaluator);
            job(&LocalRefinement { records: &records, stop }, stop)
        })
    }
}
