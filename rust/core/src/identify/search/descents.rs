//! Many descents: random points of the box, and from the best distinct ones the way down, side by
//! side in the lanes, until independent descents agree at the lowest cost.
//!
//! Each descent takes the steps of [`crate::identify::descent::damped_step`].
//! Multistart with a reduced sample: Boender, Rinnooy Kan, Timmer and Stougie 1982, doi
//! 10.1007/BF01581046.

use super::descent_settings::DescentSettings;
use super::plan::Plan;
use super::progress::{Monitor, Outcome, Progress, StopReason};
use crate::error::{Error, Result};
use crate::identify::cost::residual_sums::Costs;
use crate::identify::cost::several_records::Records;
use crate::identify::descent::damped_step::DampedStep;
use crate::identify::descent::levenberg_marquardt::{LocalRefinement, Polished};
use crate::identify::descent::normal::{Normal, STEPS, Spot};
use crate::identify::parameters::candidate::Point;
use crate::math::Draws;

/// Searches whose costs differ by less than the first share of the lowest agree, and those whose
/// costs are below the second share of the stroke.
const ALIKE: f64 = 1e-3;
const EXACT: f64 = 1e-5;

/// The cost up to which a search agrees with the one at the lowest.
pub(in crate::identify) fn as_low_as(lowest: f64, stroke: f64) -> f64 {
    (lowest * (1.0 + ALIKE)).max(EXACT * stroke)
}

/// Most iterations of one descent.
const ITERATIONS: usize = 60;

/// Shares of the cost that an iteration gains: below the first it is over, below the second twice
/// in a row too.
const NOTHING: f64 = 1e-9;
const LITTLE: f64 = 3e-4;

/// Dampings that are tried side by side, as factors of the last one that gained.
const DAMPINGS: [f64; STEPS] = [0.1, 1.0, 10.0];

/// The damping beyond which nothing is tried.
const MOST_DAMPING: f64 = 1e8;

/// Distance of a coordinate of the unit box within which two points count as one.
const BESIDE: f64 = 0.05;

/// One descent on its way.
struct Descent {
    place: Vec<f64>,
    costs: Costs,
    damping: f64,
    /// Coordinate that stays as it is.
    held: Option<usize>,
    /// Share of the cost that is little for an iteration to gain, and most iterations.
    little: f64,
    most: usize,
    /// Iterations in a row that gained little.
    stalled: usize,
    evaluations: usize,
    history: Vec<f64>,
    reason: Option<StopReason>,
}

impl Descent {
    fn new(place: Vec<f64>, costs: Costs, evaluations: usize) -> Self {
        let history = vec![costs.rms];
        Self {
            place,
            costs,
            damping: 1e-2,
            held: None,
            little: LITTLE,
            most: ITERATIONS,
            stalled: 0,
            evaluations,
            history,
            reason: None,
        }
    }

    /// Where it asks for normal equations, with the curvature along its steps.
    fn spot(&self) -> Spot {
        let dampings = DAMPINGS.map(|factor| factor * self.damping);
        let (place, creep_weights) = (self.place.clone(), self.costs.creep_weights);
        Spot { place, creep_weights, dampings, held: self.held }
    }

    /// Takes what an iteration gained.
    fn iterated(&mut self, before: f64) {
        let gained = before - self.costs.rms;
        self.history.push(self.costs.rms);
        self.stalled = if gained <= self.little * before { self.stalled + 1 } else { 0 };
        if gained <= NOTHING * before || self.stalled >= 2 {
            self.reason = Some(StopReason::Converged);
        } else if self.history.len() > self.most {
            self.reason = Some(StopReason::Iterations);
        }
    }

    fn outcome(self, records: &Records<'_>) -> Outcome {
        Outcome {
            theta: records.theta(&self.place),
            iterations: self.history.len() - 1,
            place: self.place,
            costs: self.costs,
            evaluations: self.evaluations,
            polish_evaluations: 0,
            failures: 0,
            history: self.history,
            reason: self.reason.unwrap_or(StopReason::Interrupted),
        }
    }
}

/// A place that is simulated to its end however bad.
fn anywhere(place: &[f64]) -> Point {
    Point { place: place.to_vec(), limit: f64::INFINITY }
}

/// A descent with the normal equations at its place.
type Moving<'d> = (&'d mut Descent, Normal);

/// A search by descents.
struct Search<'a> {
    local: &'a LocalRefinement<'a>,
    settings: &'a DescentSettings,
    coordinates: usize,
    ended: Vec<Descent>,
    evaluations: usize,
    iterations: usize,
    failures: usize,
}

/// Searches the box of a problem by descents, as often as planned, each time with its own random
/// numbers.
///
/// The result has the same bits whatever the threads and the instruction set.
///
/// # Errors
/// [`Error::Numerical`] where no candidate could be simulated, [`Error::Parameter`] for a start in a
/// box of another size.
pub(in crate::identify) fn descend(
    local: &LocalRefinement<'_>,
    settings: &DescentSettings,
    plan: &Plan,
    monitor: &mut dyn Monitor,
) -> Result<Vec<Outcome>> {
    let expected = local.records.coordinates().len();
    if let Some(start) = plan.start.as_ref().filter(|start| start.len() != expected) {
        return Err(Error::parameter(
            "coordinates of the start",
            start.len(),
            expected.to_string(),
        ));
    }
    let mut outcomes = Vec::new();
    for run in 0..plan.runs as u64 {
        let mut search = Search::new(local, settings);
        let reason = search.run(plan, run, monitor);
        let simulations = search.evaluations;
        let failures = search.failures;
        let mut found: Vec<Outcome> =
            search.ended.into_iter().map(|one| one.outcome(local.records)).collect();
        let best = found.iter_mut().min_by(|a, b| a.costs.rms.total_cmp(&b.costs.rms));
        match best {
            Some(best) => (best.reason, best.failures) = (reason, failures),
            None if reason == StopReason::Interrupted || !outcomes.is_empty() => {}
            None => {
                return Err(Error::Numerical(format!(
                    "not one of {simulations} simulations stayed finite: check bounds and units"
                )));
            }
        }
        outcomes.append(&mut found);
        if reason == StopReason::Interrupted {
            break;
        }
    }
    Ok(outcomes)
}

/// Start of a descent.
#[derive(Clone, Debug)]
pub(in crate::identify) struct Start {
    pub place: Vec<f64>,
    /// Coordinate that stays as it is.
    pub held: Option<usize>,
    /// Share of the cost: two iterations in a row that gain less are the last.
    pub little: f64,
    /// Most iterations.
    pub most: usize,
}

impl Start {
    /// A descent of all coordinates.
    pub fn free(place: &[f64], little: f64) -> Self {
        Self { place: place.to_vec(), held: None, little, most: ITERATIONS }
    }
}

impl LocalRefinement<'_> {
    /// Descends from places of the unit box, side by side; the cost of one that could not be
    /// simulated is infinite.
    #[must_use]
    pub fn descended(&self, places: &[Vec<f64>]) -> Vec<Polished> {
        let start = |place: &Vec<f64>| Start::free(place, LITTLE);
        self.descended_from(&places.iter().map(start).collect::<Vec<_>>())
    }

    /// The same with coordinates that stay as they are.
    pub(in crate::identify) fn descended_from(&self, starts: &[Start]) -> Vec<Polished> {
        let settings = DescentSettings::default();
        let mut search = Search::new(self, &settings);
        let points: Vec<Point> = starts.iter().map(|one| anywhere(&one.place)).collect();
        let costs = self.records.costs(&points, self.stop);
        let start = |(start, costs): (&Start, Costs)| {
            let mut one = Descent::new(start.place.clone(), costs, 1);
            (one.held, one.little, one.most) = (start.held, start.little, start.most);
            one.reason = costs.rms.is_infinite().then_some(StopReason::Converged);
            one
        };
        let mut descents: Vec<Descent> = starts.iter().zip(costs).map(start).collect();
        while descents.iter().any(|one| one.reason.is_none()) && !(self.stop)() {
            search.iterate(&mut descents);
        }
        let ended = |one: Descent| {
            let Descent { place, costs, evaluations, .. } = one;
            Polished { place, costs, evaluations }
        };
        descents.into_iter().map(ended).collect()
    }
}

impl<'a> Search<'a> {
    fn new(local: &'a LocalRefinement<'a>, settings: &'a DescentSettings) -> Self {
        let coordinates = local.records.coordinates().len();
        let ended = Vec::new();
        Self { local, settings, coordinates, ended, evaluations: 0, iterations: 0, failures: 0 }
    }

    /// Round after round, until descents agree.
    fn run(&mut self, plan: &Plan, run: u64, monitor: &mut dyn Monitor) -> StopReason {
        for round in 0..self.settings.rounds {
            let mut descents = self.starts(plan, run, round as u64);
            loop {
                if (self.local.stop)() || self.report(&descents, monitor) {
                    self.ended.append(&mut descents);
                    return StopReason::Interrupted;
                }
                if descents.iter().all(|one| one.reason.is_some()) {
                    break;
                }
                self.iterate(&mut descents);
                self.iterations += 1;
            }
            self.ended.append(&mut descents);
            if self.agreeing() >= self.settings.agreeing {
                return StopReason::Agreed;
            }
        }
        StopReason::Iterations
    }

    /// Descents that ended at the lowest cost.
    fn agreeing(&self) -> usize {
        let lowest = self.ended.iter().fold(f64::INFINITY, |low, one| low.min(one.costs.rms));
        let near = as_low_as(lowest, self.local.records.stroke());
        self.ended.iter().filter(|one| one.costs.rms <= near).count()
    }

    /// Draws the points of a round, with the planned start in the first, and starts from the best
    /// that are not beside a better one.
    fn starts(&mut self, plan: &Plan, run: u64, round: u64) -> Vec<Descent> {
        let Self { local, settings, coordinates, .. } = *self;
        let count = settings.samples as u64;
        let point = |i| {
            let mut draws = Draws::at(plan.seed, run, round, i, count);
            (0..coordinates).map(|_| draws.uniform()).collect::<Vec<f64>>()
        };
        let given = plan.start.iter().filter(|_| round == 0).cloned();
        let points: Vec<Vec<f64>> = given.chain((0..count).map(point)).collect();
        let drawn = points.len();
        let asked: Vec<Point> = points.iter().map(|place| anywhere(place)).collect();
        let costs = local.records.costs(&asked, local.stop);
        self.evaluations += points.len();
        self.failures += costs.iter().filter(|costs| costs.rms.is_infinite()).count();
        let mut order: Vec<(Vec<f64>, Costs)> =
            points.into_iter().zip(costs).filter(|(_, costs)| costs.rms.is_finite()).collect();
        order.sort_by(|a, b| a.1.rms.total_cmp(&b.1.rms));
        let mut chosen: Vec<(Vec<f64>, Costs)> = Vec::new();
        for one in order {
            let beside = |other: &(Vec<f64>, Costs)| {
                one.0.iter().zip(&other.0).all(|(a, b)| (a - b).abs() < BESIDE)
            };
            if chosen.len() < settings.starts && !chosen.iter().any(beside) {
                chosen.push(one);
            }
        }
        // The simulations of the points are counted with the descents, in even shares.
        let share = chosen.len().max(1);
        let (each, rest) = (drawn / share, drawn % share);
        let start = |(i, (place, costs)): (usize, (Vec<f64>, Costs))| {
            Descent::new(place, costs, each + usize::from(i < rest))
        };
        chosen.into_iter().enumerate().map(start).collect()
    }

    /// One iteration of each descent that has not ended.
    fn iterate(&mut self, descents: &mut [Descent]) {
        let active: Vec<&mut Descent> =
            descents.iter_mut().filter(|one| one.reason.is_none()).collect();
        let spots: Vec<Spot> = active.iter().map(|one| one.spot()).collect();
        let normals = self.local.records.normals(&spots, self.local.stop);
        let each = self.coordinates + 1 + STEPS;
        self.evaluations += each * active.len();
        let mut moving = Vec::new();
        for (one, normal) in active.into_iter().zip(normals) {
            one.evaluations += each;
            match normal {
                Some(normal) => moving.push((one, normal)),
                None => one.reason = Some(StopReason::Converged),
            }
        }
        while !moving.is_empty() && !(self.local.stop)() {
            moving = self.step(moving);
        }
    }

    /// Steps of each descent with several dampings; those that none took down, to try again with
    /// larger ones.
    fn step<'d>(&mut self, moving: Vec<Moving<'d>>) -> Vec<Moving<'d>> {
        let trials: Vec<Vec<(f64, Vec<f64>)>> = moving
            .iter()
            .map(|(one, normal)| {
                let dampings = DAMPINGS.map(|factor| factor * one.damping);
                let next = |(damping, bend): (f64, &Option<_>)| {
                    let step = DampedStep::new(normal, &one.place, damping)?;
                    let end = match bend {
                        Some(bend) => step.bent_end(normal, &one.place, bend),
                        None => step.end(&one.place),
                    };
                    Some((damping, end?))
                };
                dampings.into_iter().zip(&normal.bends).filter_map(next).collect()
            })
            .collect();
        let points: Vec<Point> = moving
            .iter()
            .zip(&trials)
            .flat_map(|((one, _), trials)| {
                let limit = one.costs.rms;
                trials.iter().map(move |(_, place)| Point { place: place.clone(), limit })
            })
            .collect();
        let costs = self.local.records.costs(&points, self.local.stop);
        self.evaluations += points.len();
        let mut rest = costs.as_slice();
        let tried = moving.into_iter().zip(trials).filter_map(|((one, normal), trials)| {
            let (own, others) = rest.split_at(trials.len());
            rest = others;
            one.evaluations += trials.len();
            let best = own
                .iter()
                .zip(trials)
                .filter(|(costs, _)| costs.rms < one.costs.rms)
                .min_by(|a, b| a.0.rms.total_cmp(&b.0.rms));
            let before = one.costs.rms;
            if let Some((&costs, (damping, place))) = best {
                (one.costs, one.place, one.damping) = (costs, place, damping.max(1e-12));
                one.iterated(before);
                return None;
            }
            one.damping *= 1e3;
            if own.is_empty() || one.damping > MOST_DAMPING {
                one.iterated(before);
                return None;
            }
            // The bends are those of longer steps.
            Some((one, Normal { bends: [const { None }; STEPS], ..normal }))
        });
        tried.collect()
    }

    /// Tells the monitor where the search stands; whether it ends it.
    fn report(&self, descents: &[Descent], monitor: &mut dyn Monitor) -> bool {
        let all = self.ended.iter().chain(descents);
        let Some(best) = all.min_by(|a, b| a.costs.rms.total_cmp(&b.costs.rms)) else {
            return false;
        };
        let progress = Progress {
            iteration: self.iterations,
            iterations: self.settings.rounds * ITERATIONS,
            evaluations: self.evaluations,
            cost: best.costs.rms,
            theta: self.local.records.theta(&best.place),
        };
        monitor.report(&progress).is_break()
    }
}
