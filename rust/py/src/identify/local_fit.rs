//! A search around its result: profiles of the cost, and refits of resampled noise.

use piezotrack_core::identify::{
    Coordinate, Evaluator, ITS_OWN, LocalRefinement, Point, Problem, Profile, ProfilePoint, Record,
    Records, Spec,
};
use piezotrack_core::integrator::Stepping;
use piezotrack_core::signal::Stop;
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::conversions::arrays::samples;
use crate::enter::enter_quiet_pool;
use crate::errors::raise;
use crate::identify::problem::{OneRecord, PyProblem, Question};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyLocalFit>()
}

/// Records, what is searched, and how finely its candidates are stepped.
#[pyclass(name = "LocalFit", frozen, module = "piezotrack._core")]
pub struct PyLocalFit {
    question: Question,
    problems: Vec<Problem>,
    steppings: Vec<Stepping>,
    coordinates: Vec<(usize, usize)>,
}

/// Values and cost, with the priors.
type Minimum = (Vec<f64>, f64);

/// Values of the coordinate with the cost, and the ends of the interval.
type Curve = (Vec<(f64, f64)>, (Option<f64>, Option<f64>));

#[pymethods]
#[expect(clippy::needless_pass_by_value, reason = "extracted from lists")]
impl PyLocalFit {
    #[new]
    fn new(py: Python<'_>, problem: PyProblem<'_>) -> PyResult<Self> {
        let question = problem.question()?;
        let (problems, steppings, coordinates) = enter_quiet_pool(py, 0, |stop| {
            let searched = question.searched()?;
            let each: Vec<(&Record<'_>, &Spec)> =
                searched.iter().map(|(record, spec)| (record, spec)).collect();
            let problems = Problem::of_records(&each, stop)?;
            let evaluators: Vec<Evaluator<'_>> = each
                .iter()
                .zip(&problems)
                .map(|((record, _), problem)| Evaluator::new(record, problem, stop))
                .collect();
            let steppings = evaluators.iter().map(|one| one.stepping).collect();
            let coordinates = Records::new(evaluators).coordinates().to_vec();
            Ok((problems, steppings, coordinates))
        })?;
        Ok(Self { question, problems, steppings, coordinates })
    }

    /// Record, name and bounds of each coordinate.
    #[getter]
    fn coordinates(&self) -> Vec<(usize, &'static str, f64, f64)> {
        let infos = self.problems[0].model.scalars();
        let each = self.coordinates.iter().filter_map(|&(record, place)| {
            let own = ITS_OWN.iter().find(|own| own.0 == place).map_or("", |own| own.1);
            let name = infos.get(place).map_or(own, |one| one.name);
            match self.problems[record].coordinates[place] {
                Coordinate::Free { low, high, .. } => Some((record, name, low, high)),
                _ => None,
            }
        });
        each.collect()
    }

    /// Cost at values of the coordinates, with the priors.
    fn cost(&self, py: Python<'_>, values: Vec<f64>) -> PyResult<f64> {
        self.around(py, &values, |local, place, stop| {
            let point = Point { place: place.to_vec(), limit: f64::INFINITY };
            Ok(local.records.costs(&[point], stop)[0].rms)
        })
    }

    /// Lowest minimum met, and the profile along each of some coordinates, with the relative rise of
    /// the squared cost at the ends.
    fn profiles(
        &self,
        py: Python<'_>,
        values: Vec<f64>,
        wanted: Vec<(usize, f64)>,
    ) -> PyResult<(Minimum, Vec<Curve>)> {
        self.around(py, &values, |local, place, _| {
            let found = local.profiles(place, &wanted).ok_or_else(|| {
                Error::Numerical(
                    "the fitted model cannot be simulated, or leaves no residual".into(),
                )
            })?;
            let minimum = found.minimum;
            let curves = found.profiles.iter().zip(&wanted);
            let curves = curves.map(|(profile, (i, _))| self.curve(local, profile, *i)).collect();
            Ok(((local.records.values(&minimum.place), minimum.costs.rms), curves))
        })
    }

    /// Values, those of the tied parameters behind them, and cost of each refit of resampled noise.
    fn refits(
        &self,
        py: Python<'_>,
        values: Vec<f64>,
        noises: Vec<Bound<'_, PyAny>>,
        draws: u32,
        seed: u64,
    ) -> PyResult<Vec<Minimum>> {
        let noises: Vec<Vec<f64>> =
            noises.iter().map(|one| samples("noise", one)).collect::<PyResult<_>>()?;
        self.around(py, &values, |local, place, stop| {
            let point = Point { place: place.to_vec(), limit: f64::INFINITY };
            let costs = local.records.costs(&[point], stop)[0];
            let found = local.refits(place, costs, &noises, (draws, seed))?;
            let ties = &self.problems[0].relations.ties;
            let all = found.into_iter().map(|one| {
                let theta = local.records.theta(&one.place);
                let tied = ties.iter().map(|tie| theta.0[tie.parameter]);
                (local.records.values(&one.place).into_iter().chain(tied).collect(), one.costs.rms)
            });
            Ok(all.collect())
        })
    }

    /// Names of the tied parameters, in the order of their values.
    #[getter]
    fn tied(&self) -> Vec<&'static str> {
        let infos = self.problems[0].model.scalars();
        let ties = &self.problems[0].relations.ties;
        ties.iter().filter_map(|tie| infos.get(tie.parameter)).map(|one| one.name).collect()
    }
}

impl PyLocalFit {
    /// Values of a profile along coordinate `i`.
    fn curve(&self, local: &LocalRefinement<'_>, profile: &Profile, i: usize) -> Curve {
        let (record, parameter) = self.coordinates[i];
        let coordinate = self.problems[record].coordinates[parameter];
        let point = |one: &ProfilePoint| (local.records.values(&one.place)[i], one.costs.rms);
        let [below, above] =
            [profile.ends.0, profile.ends.1].map(|end| end.map(|z| coordinate.value(z)));
        (profile.points.iter().map(point).collect(), (below, above))
    }

    /// Runs a job around the place of some values, on threads of its own.
    fn around<T: Send>(
        &self,
        py: Python<'_>,
        values: &[f64],
        job: impl FnOnce(&LocalRefinement<'_>, &[f64], Stop<'_>) -> Result<T> + Send,
    ) -> PyResult<T> {
        if values.len() != self.coordinates.len() {
            let expected = format!("{}, one for each coordinate", self.coordinates.len());
            let error = Error::parameter("number of values", values.len(), expected);
            return Err(raise(&error));
        }
        enter_quiet_pool(py, 0, |stop| {
            let read = self.question.records.iter().map(OneRecord::record);
            let all: Vec<Record<'_>> = read.collect::<Result<_>>()?;
            let each = all.iter().zip(&self.problems).zip(&self.steppings);
            let evaluators =
                each.map(|((record, problem), step)| Evaluator::stepped(record, problem, *step));
            let records = Records::new(evaluators.collect());
            let place = records.place(values);
            job(&LocalRefinement { records: &records, stop }, &place, stop)
        })
    }
}
