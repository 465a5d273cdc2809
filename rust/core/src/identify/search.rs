//! The search: swarms, costs, stop criteria.

use super::candidate::Candidate;
use super::candidate::Theta;
use super::cost::Evaluator;
use super::descents::DescentSettings;
use super::problem::Problem;
use super::residual_sums::Costs;
use super::swarm::{Swarm, SwarmSettings};
use crate::error::{Error, Result};
use crate::math::available;
use crate::signal::Stop;
use std::ops::ControlFlow;

/// Why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The best cost had stalled for as long as the settings allow.
    Stalled,
    /// All iterations were done.
    Iterations,
    /// As many independent descents as asked for ended at the lowest cost.
    Agreed,
    /// A descent had nothing left to gain.
    Converged,
    /// The caller's monitor or stop flag ended it.
    Interrupted,
}

/// Progress of a search after an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Iterations done; 0 after the first evaluation.
    pub iteration: usize,
    /// Most iterations.
    pub iterations: usize,
    /// Simulations done.
    pub evaluations: usize,
    /// The best cost so far, m.
    pub cost: f64,
    /// The parameters that gave it, SI.
    pub theta: Theta,
}

/// Watches a search, and may end it.
pub trait Monitor {
    /// Called after each iteration, in order.
    fn report(&mut self, progress: &Progress) -> ControlFlow<()>;
}

impl<F: FnMut(&Progress) -> ControlFlow<()>> Monitor for F {
    fn report(&mut self, progress: &Progress) -> ControlFlow<()> {
        self(progress)
    }
}

/// Result of one restart of a search.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Parameters of the best candidate, SI.
    pub theta: Theta,
    /// Its place in the unit box.
    pub place: Vec<f64>,
    /// Its cost and offset.
    pub costs: Costs,
    /// Iterations done.
    pub iterations: usize,
    /// Simulations of the swarm.
    pub evaluations: usize,
    /// Simulations of the polish; 0 where there was none.
    pub polish_evaluations: usize,
    /// Simulations that did not stay finite.
    pub failures: usize,
    /// Best cost after each iteration, m, the first entry after the first evaluation.
    pub history: Vec<f64>,
    /// Why it ended.
    pub reason: StopReason,
}

/// How a problem is searched.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What searches.
    pub method: Method,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Searches apart from each other.
    pub runs: usize,
}

/// What searches.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// A particle swarm.
    Swarm(SwarmSettings),
    /// Descents from random points.
    Descents(DescentSettings),
}

impl Plan {
    /// Checks the settings and the number of runs.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming what cannot be used.
    pub fn validate(&self) -> Result<()> {
        let each = match &self.method {
            Method::Swarm(settings) => {
                settings.validate()?;
                settings.particles
            }
            Method::Descents(settings) => {
                settings.validate()?;
                settings.samples
            }
        };
        if self.runs == 0 || self.runs > MOST_RUNS {
            let expected = format!("1 or more, {MOST_RUNS} at most");
            return Err(Error::parameter("runs", self.runs, expected));
        }
        let particles = self.runs * each;
        if particles > MOST_PARTICLES {
            let expected = format!(
                "{} at most with {each} particles in each: {MOST_PARTICLES} together",
                (MOST_PARTICLES / each).max(1)
            );
            return Err(Error::parameter("runs", self.runs, expected));
        }
        available("the particles of the search", particles, PARTICLE)
    }
}

/// Most swarms of a search.
const MOST_RUNS: usize = 10_000;

/// Most particles of all swarms together.
const MOST_PARTICLES: usize = 1_000_000;

/// Bytes that a particle takes at most, with what is asked about it.
const PARTICLE: usize = 2000;

/// One swarm of a search.
struct Run {
    swarm: Swarm,
    /// Of its best candidate.
    costs: Costs,
    evaluations: usize,
    failures: usize,
    history: Vec<f64>,
    reason: Option<StopReason>,
}

impl Run {
    fn new(settings: &SwarmSettings, coordinates: usize, seed: u64, run: u64) -> Result<Self> {
        Ok(Self {
            swarm: Swarm::new(settings.clone(), coordinates, seed, run)?,
            costs: Costs::FAILED,
            evaluations: 0,
            failures: 0,
            history: Vec::new(),
            reason: None,
        })
    }

    /// What the swarm wants to know now; nothing once it has ended.
    fn candidates(&self, problem: &Problem) -> Vec<Candidate> {
        if self.reason.is_some() {
            return Vec::new();
        }
        let asked = self.swarm.ask().zip(self.swarm.limits());
        asked
            .filter_map(|(place, limit)| Some(Candidate { theta: problem.theta(place?), limit }))
            .collect()
    }

    /// Takes the costs of its candidates, in their order.
    fn tell(&mut self, costs: &[Costs]) {
        self.evaluations += costs.len();
        self.failures += costs.iter().filter(|costs| costs.rms.is_infinite()).count();
        let best = costs.iter().min_by(|a, b| a.rms.total_cmp(&b.rms));
        if let Some(best) = best.filter(|best| best.rms < self.swarm.best().1) {
            self.costs = *best;
        }
        let mut computed = costs.iter();
        let costs: Vec<f64> = self
            .swarm
            .ask()
            .map(|place| place.and_then(|_| computed.next()).map_or(f64::INFINITY, |c| c.rms))
            .collect();
        self.swarm.tell(&costs);
        self.history.push(self.swarm.best().1);
        if self.swarm.stalled() {
            self.reason = Some(StopReason::Stalled);
        } else if self.swarm.exhausted() {
            self.reason = Some(StopReason::Iterations);
        }
    }

    fn outcome(self, problem: &Problem) -> Outcome {
        let (place, rms) = self.swarm.best();
        Outcome {
            theta: problem.theta(place),
            place: place.to_vec(),
            costs: Costs { rms, ..self.costs },
            iterations: self.swarm.iteration(),
            evaluations: self.evaluations,
            polish_evaluations: 0,
            failures: self.failures,
            history: self.history,
            reason: self.reason.unwrap_or(StopReason::Interrupted),
        }
    }
}

/// Searches the box of a problem with one or more swarms, whose particles share the lanes.
///
/// A run gives the same bits whatever the other runs, the threads and the instruction set.
///
/// # Errors
/// [`Error::Parameter`] for settings that cannot be used, [`Error::Numerical`] where no candidate
/// could be simulated.
pub fn search(
    evaluator: &Evaluator<'_>,
    problem: &Problem,
    settings: &SwarmSettings,
    seed: u64,
    runs: usize,
    monitor: &mut dyn Monitor,
    stop: Stop<'_>,
) -> Result<Vec<Outcome>> {
    let coordinates = problem.free().count();
    let runs: Result<Vec<Run>> =
        (0..runs as u64).map(|run| Run::new(settings, coordinates, seed, run)).collect();
    let mut runs = runs?;
    while runs.iter().any(|run| run.reason.is_none()) {
        let asked: Vec<Vec<Candidate>> = runs.iter().map(|run| run.candidates(problem)).collect();
        let costs = evaluator.costs(&asked.concat(), stop);
        if stop() {
            break;
        }
        let mut rest = costs.as_slice();
        for (run, asked) in runs.iter_mut().zip(&asked) {
            let (own, others) = rest.split_at(asked.len());
            rest = others;
            if run.reason.is_none() {
                run.tell(own);
            }
        }
        if monitor.report(&progress(&runs, problem, settings.iterations)).is_break() {
            for run in &mut runs {
                run.reason = Some(StopReason::Interrupted);
            }
        }
    }
    let simulations: usize = runs.iter().map(|run| run.evaluations).sum();
    let found = runs.iter().any(|run| run.swarm.best().1.is_finite());
    let interrupted =
        runs.iter().any(|run| matches!(run.reason, None | Some(StopReason::Interrupted)));
    if !found && !interrupted {
        return Err(Error::Numerical(format!(
            "not one of {simulations} simulations stayed finite: check bounds and units"
        )));
    }
    Ok(runs.into_iter().map(|run| run.outcome(problem)).collect())
}

/// Where the runs stand together.
fn progress(runs: &[Run], problem: &Problem, iterations: usize) -> Progress {
    let best = runs.iter().map(|run| run.swarm.best()).min_by(|a, b| a.1.total_cmp(&b.1));
    let (place, cost) = best.unwrap_or((&[], f64::INFINITY));
    Progress {
        iteration: runs.iter().map(|run| run.swarm.iteration()).max().unwrap_or(0),
        iterations,
        evaluations: runs.iter().map(|run| run.evaluations).sum(),
        cost,
        theta: problem.theta(place),
    }
}
