//! The whole search: a swarm, its costs, its stop criteria.

use super::cost::{Costs, Evaluator};
use super::problem::{Problem, Theta};
use super::swarm::{Swarm, SwarmSettings};
use crate::error::{Error, Result};
use crate::integrate::Stop;
use std::ops::ControlFlow;

/// Why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The best cost had stalled for as long as the settings allow.
    Stalled,
    /// All iterations were done.
    Iterations,
    /// The caller's monitor or stop flag ended it.
    Interrupted,
}

/// Where a search stands after an iteration.
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

/// What a search found.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Parameters of the best guess, SI.
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
    /// Steps of the integrator in each sampling interval.
    pub substeps: usize,
}

/// Searches the box of a problem with one swarm.
///
/// The same seed gives the same bits, whatever the threads and the instruction set.
///
/// # Errors
/// [`Error::Parameter`] for settings that cannot be used, [`Error::Numerical`] where no guess
/// could be simulated.
pub fn search(
    evaluator: &Evaluator<'_>,
    problem: &Problem,
    settings: &SwarmSettings,
    seed: u64,
    monitor: &mut dyn Monitor,
    stop: Stop<'_>,
) -> Result<Outcome> {
    let mut swarm = Swarm::new(settings.clone(), problem.free().count(), seed, 0)?;
    let mut offset = 0.0;
    let mut evaluations = 0;
    let mut failures = 0;
    let mut history = Vec::with_capacity(settings.iterations + 1);
    let reason = loop {
        let places: Vec<Option<Theta>> = swarm
            .ask()
            .map(|place| place.map(|place| problem.theta(place)))
            .collect();
        let inside: Vec<Theta> = places.iter().flatten().copied().collect();
        let costs = evaluator.costs(&inside, stop);
        if stop() {
            break StopReason::Interrupted;
        }
        evaluations += inside.len();
        failures += costs.iter().filter(|costs| costs.rms.is_infinite()).count();
        let before = swarm.best().1;
        if let Some(best) = costs.iter().min_by(|a, b| a.rms.total_cmp(&b.rms))
            && best.rms < before
        {
            offset = best.offset;
        }
        let mut computed = costs.iter();
        let told: Vec<f64> = places
            .iter()
            .map(|place| {
                place
                    .and_then(|_| computed.next())
                    .map_or(f64::INFINITY, |c| c.rms)
            })
            .collect();
        swarm.tell(&told);
        let (place, cost) = swarm.best();
        history.push(cost);
        let progress = Progress {
            iteration: swarm.iteration(),
            iterations: settings.iterations,
            evaluations,
            cost,
            theta: problem.theta(place),
        };
        if monitor.report(&progress).is_break() {
            break StopReason::Interrupted;
        }
        if swarm.stalled() {
            break StopReason::Stalled;
        }
        if swarm.exhausted() {
            break StopReason::Iterations;
        }
    };
    let (place, rms) = swarm.best();
    if rms.is_infinite() && reason != StopReason::Interrupted {
        return Err(Error::Numerical(format!(
            "not one of {evaluations} simulations stayed finite: check bounds and units"
        )));
    }
    Ok(Outcome {
        theta: problem.theta(place),
        place: place.to_vec(),
        costs: Costs { rms, offset },
        iterations: swarm.iteration(),
        evaluations,
        polish_evaluations: 0,
        failures,
        history,
        reason,
        substeps: evaluator.substeps,
    })
}
