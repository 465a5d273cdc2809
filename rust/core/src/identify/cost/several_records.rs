//! The records of a search: one cost for all of them, and what each has of its own.
//!
//! ```text
//! f^2 = sum_r w_r n_r f_r^2 / sum_r w_r n_r
//! ```
//!
//! with the weight, the samples and the RMS deviation of each record: with equal weights the RMS
//! deviation of all samples. Each record is simulated from a beginning of its own. A place of the
//! unit box has the coordinates of the stage's parameters and then, record by record, those of the
//! delay, the voltage before and the drift.

use std::sync::Arc;

use super::creep_sums::{CreepCost, CreepSums};
use super::evaluator::Evaluator;
use super::journal::{Journal, remembered};
use super::residual_sums::{Costs, Simulated};
use crate::identify::parameters::candidate::{Candidate, DELAY, Point, Theta};
use crate::identify::problem::Problem;
use crate::identify::records::creep_weights::CreepWeights;
use crate::integrator::Stepping;
use crate::signal::{NEVER, Stop, index};

/// Records with one problem, and what computes their costs.
pub struct Records<'a> {
    members: Vec<Member<'a>>,
    /// Record and parameter of each coordinate; of what the records share the first record.
    coordinates: Vec<(usize, usize)>,
    samples: usize,
    journal: Option<Arc<dyn Journal>>,
}

/// One of the records.
pub(in crate::identify) struct Member<'a> {
    /// Its costs.
    pub evaluator: Evaluator<'a>,
    /// Share of its mean square in that of all.
    pub share: f64,
    /// Which coordinates of a place are its own.
    own: Vec<usize>,
}

impl<'a> Records<'a> {
    /// One record.
    #[must_use]
    pub fn one(evaluator: Evaluator<'a>) -> Self {
        Self::new(vec![evaluator])
    }

    /// Several, with the weights that they have; their problems share the coordinates of the stage.
    #[must_use]
    pub fn new(evaluators: Vec<Evaluator<'a>>) -> Self {
        let counts = |one: &Evaluator<'_>| one.record().weight * index(one.record().samples());
        let total: f64 = evaluators.iter().map(counts).sum();
        let samples = evaluators.iter().map(|one| one.record().samples()).sum();
        let mut coordinates = Vec::new();
        let mut own = vec![Vec::new(); evaluators.len()];
        let shared = evaluators.first().into_iter().flat_map(|one| one.problem().free());
        for parameter in shared.filter(|&parameter| parameter < DELAY) {
            for own in &mut own {
                own.push(coordinates.len());
            }
            coordinates.push((0, parameter));
        }
        for (r, one) in evaluators.iter().enumerate() {
            for parameter in one.problem().free().filter(|&parameter| parameter >= DELAY) {
                own[r].push(coordinates.len());
                coordinates.push((r, parameter));
            }
        }
        let member = |(evaluator, own): (Evaluator<'a>, Vec<usize>)| {
            let share = counts(&evaluator) / total;
            Member { evaluator, share, own }
        };
        let members = evaluators.into_iter().zip(own).map(member).collect();
        Self { members, coordinates, samples, journal: None }
    }

    /// The same records and steppings for problems with other parameters held.
    pub(in crate::identify) fn of<'b>(&self, problems: &'b [Problem]) -> Records<'b>
    where
        'a: 'b,
    {
        let evaluators = self.members.iter().zip(problems);
        let records = evaluators.map(|(one, problem)| one.evaluator.of(problem)).collect();
        Records::new(records).kept(self.journal.clone())
    }

    /// The same with steps half as long, and nothing kept.
    pub(in crate::identify) fn finer(&self) -> Records<'a> {
        let finer = |one: &Member<'a>| {
            let Stepping { order, substeps } = one.evaluator.stepping;
            let stepping = Stepping { order, substeps: substeps.doubled() };
            Evaluator::stepped(one.evaluator.record(), one.evaluator.problem(), stepping)
        };
        Records::new(self.members.iter().map(finer).collect())
    }

    /// The same with what is computed kept.
    pub(in crate::identify) fn kept(mut self, journal: Option<Arc<dyn Journal>>) -> Self {
        self.journal = journal;
        self
    }

    /// Where what is computed is kept.
    pub(in crate::identify) fn journal(&self) -> Option<&Arc<dyn Journal>> {
        self.journal.as_ref()
    }

    /// The problem of the first record: what it says of the stage it says of all.
    pub(in crate::identify) fn problem(&self) -> &'a Problem {
        self.first().evaluator.problem()
    }

    /// The problems, record by record.
    pub(in crate::identify) fn problems(&self) -> impl Iterator<Item = &'a Problem> {
        self.members.iter().map(|one| one.evaluator.problem())
    }

    /// The records with what computes their costs.
    pub(in crate::identify) fn members(&self) -> &[Member<'a>] {
        &self.members
    }

    fn first(&self) -> &Member<'a> {
        &self.members[0]
    }

    /// Record and parameter of each coordinate.
    #[must_use]
    pub fn coordinates(&self) -> &[(usize, usize)] {
        &self.coordinates
    }

    /// Values at a place, in the order of the coordinates.
    #[must_use]
    pub fn values(&self, place: &[f64]) -> Vec<f64> {
        let of =
            |&(record, parameter): &(usize, usize)| self.members[record].theta(place).0[parameter];
        self.coordinates.iter().map(of).collect()
    }

    /// The place nearest to values, in the order of the coordinates.
    #[must_use]
    pub fn place(&self, values: &[f64]) -> Vec<f64> {
        let known = |parameter: usize| {
            let mut all = self.coordinates.iter().zip(values);
            let free = all.find(|((record, other), _)| (*record, *other) == (0, parameter));
            let held = self.problem().coordinates[parameter].value(0.5);
            free.map_or(held, |(_, value)| *value)
        };
        let of = |(&(record, parameter), &value): (&(usize, usize), &f64)| {
            let problem = self.members[record].evaluator.problem();
            let above = problem.relations.constraints.iter().filter(|one| one.lower == parameter);
            let limited = above.fold(problem.coordinates[parameter], |coordinate, one| {
                coordinate.limited(known(one.upper))
            });
            limited.place(value)
        };
        self.coordinates.iter().zip(values).map(of).collect()
    }

    /// Samples in the windows of all records.
    pub(in crate::identify) fn samples(&self) -> usize {
        self.samples
    }

    /// Range of the displacement, m; of several records the root mean square.
    pub(in crate::identify) fn stroke(&self) -> f64 {
        let squares = self.members.iter().map(|one| {
            let stroke = one.evaluator.record().stroke();
            one.share * stroke * stroke
        });
        match &self.members[..] {
            [one] => one.evaluator.record().stroke(),
            _ => libm::sqrt(squares.sum()),
        }
    }

    /// The parameters at a place, with delay and voltage before of the first record.
    #[must_use]
    pub fn theta(&self, place: &[f64]) -> Theta {
        self.first().theta(place)
    }

    /// Costs at places, in their order; where there are priors, with their factors. Offset, drift and
    /// weights are those of the first record.
    ///
    /// Those that were not finished when `stop` said so are infinite.
    #[must_use]
    pub fn costs(&self, points: &[Point], stop: Stop<'_>) -> Vec<Costs> {
        let questions = (points.len(), self.coordinates.len());
        remembered(self.journal(), questions, stop, || self.simulated(points, stop))
    }

    fn simulated(&self, points: &[Point], stop: Stop<'_>) -> Vec<Costs> {
        if let [one] = &self.members[..] {
            let candidates: Vec<Candidate> =
                points.iter().map(|point| one.candidate(&point.place, point.limit)).collect();
            return one.evaluator.costs(&candidates, stop);
        }
        let relations = &self.problem().relations;
        let factors: Vec<f64> =
            points.iter().map(|point| relations.factor(&self.theta(&point.place))).collect();
        let limits = points.iter().zip(&factors).map(|(point, factor)| {
            let limit = point.limit / factor;
            // A hair above, so that rounding cannot abandon one that ends at its limit.
            limit * limit * (1.0 + 1e-9)
        });
        let limits: Vec<f64> = limits.collect();
        let creeping = self.problem().creep_times.len();
        let mut found = vec![Together::none(); points.len()];
        let mut left: Vec<usize> = (0..points.len()).collect();
        for (r, one) in self.members.iter().enumerate() {
            let candidate = |&i: &usize| {
                let rest = (limits[i] - found[i].square) / one.share;
                one.candidate(&points[i].place, libm::sqrt(rest))
            };
            let candidates: Vec<Candidate> = left.iter().map(candidate).collect();
            for (&i, simulated) in left.iter().zip(one.evaluator.simulated(&candidates, 0, stop)) {
                found[i].add(r, one, &simulated, creeping);
            }
            // What is beyond its limit is not simulated on the records after.
            left.retain(|&i| found[i].square <= limits[i] && found[i].square.is_finite());
        }
        let costs = found.iter().zip(&factors).map(|(one, factor)| {
            let rms = libm::sqrt(one.square) * factor;
            let first = &self.first().evaluator;
            let costs = if creeping > 0 {
                first.costs_with(&one.sums, one.creep_weights)
            } else {
                one.first
            };
            Costs { rms, ..costs }
        });
        costs.collect()
    }

    /// Parameters of each record at a place, with its cost and offset without priors; `whole`
    /// is the cost of all.
    pub(in crate::identify) fn each(&self, place: &[f64], whole: Costs) -> Vec<(Theta, Costs)> {
        if let [one] = &self.members[..] {
            let theta = one.theta(place);
            let factor = self.problem().relations.factor(&theta);
            return vec![(theta, Costs { rms: whole.rms / factor, ..whole })];
        }
        let found = self.members.iter().map(|one| {
            let creep_weights =
                (!self.problem().creep_times.is_empty()).then_some(whole.creep_weights);
            let candidate = Candidate { creep_weights, ..one.candidate(place, f64::INFINITY) };
            // Also where the search was stopped: what it found so far is told.
            let costs = one.evaluator.deviations(&[candidate], NEVER);
            (candidate.theta, costs.first().copied().unwrap_or(Costs::FAILED))
        });
        found.collect()
    }
}

/// Sums at a point over the records simulated so far.
#[derive(Clone, Copy)]
struct Together {
    /// Their part of the mean square of all, with the weights of the creep that
    /// suit them best, m^2.
    square: f64,
    creep_weights: CreepWeights,
    cost: CreepCost,
    /// Of the first record.
    first: Costs,
    sums: CreepSums,
}

impl Together {
    /// Of no record.
    fn none() -> Self {
        let (cost, sums) = (CreepCost::default(), CreepSums::default());
        Self {
            square: 0.0,
            creep_weights: Costs::FAILED.creep_weights,
            cost,
            first: Costs::FAILED,
            sums,
        }
    }

    /// Adds a record with so many relaxations.
    fn add(&mut self, r: usize, of: &Member<'_>, simulated: &Simulated, relaxations: usize) {
        let finite = simulated.costs.rms.is_finite();
        let sums = simulated.sums.filter(|_| relaxations > 0 && finite);
        if r == 0 {
            (self.first, self.sums) = (simulated.costs, sums.unwrap_or_default());
        }
        let Some(sums) = sums else {
            // Without creep; or given up or diverged, and beyond the limit with any weights.
            self.square += of.share * simulated.costs.rms * simulated.costs.rms;
            return;
        };
        self.cost.add(&of.evaluator.creep_cost(&sums), of.share);
        self.creep_weights = self.cost.best(relaxations);
        self.square = self.cost.at(&self.creep_weights).max(0.0);
    }
}

impl Member<'_> {
    /// Its own coordinates of a place.
    pub fn own(&self, place: &[f64]) -> Vec<f64> {
        self.own.iter().map(|&i| place[i]).collect()
    }

    /// Where its coordinates are among those of all.
    pub fn slots(&self) -> &[usize] {
        &self.own
    }

    /// The parameters at a place of all.
    pub fn theta(&self, place: &[f64]) -> Theta {
        self.evaluator.problem().theta(&self.own(place))
    }

    /// The candidate at a place of all.
    pub fn candidate(&self, place: &[f64], limit: f64) -> Candidate {
        Candidate { limit, ..Candidate::of(self.theta(place)) }
    }
}
