//! From a record to an identified stage: the steps in their order.

use super::cost::Evaluator;
use super::local::{Local, Sensitivity};
use super::problem::{Problem, Record, Spec};
use super::search::{Monitor, Outcome, StopReason, search};
use super::swarm::SwarmSettings;
use crate::error::Result;
use crate::integrate::Stop;

/// An identified stage and how it was found.
#[derive(Clone, Debug)]
pub struct Identification {
    /// What was held, what was free, and between which bounds.
    pub problem: Problem,
    /// What was found; `None` where the search was stopped before its first cost.
    pub outcome: Option<Outcome>,
    /// What the record tells of each free parameter; empty where the search was stopped.
    pub sensitivities: Vec<Sensitivity>,
}

/// Identifies a Dahl stage from a record: a swarm, where asked a polish, and the spread.
///
/// # Errors
/// [`crate::Error::Parameter`] for a specification or setting that cannot be used,
/// [`crate::Error::Numerical`] where no guess could be simulated.
pub fn identify(
    record: &Record<'_>,
    spec: &Spec,
    settings: &SwarmSettings,
    seed: u64,
    monitor: &mut dyn Monitor,
    stop: Stop<'_>,
) -> Result<Identification> {
    settings.validate()?;
    let problem = Problem::new(record, spec)?;
    let evaluator = Evaluator::new(record, &problem, stop);
    let mut outcome = search(&evaluator, &problem, settings, seed, monitor, stop)?;
    if outcome.costs.rms.is_infinite() {
        return Ok(Identification {
            problem,
            outcome: None,
            sensitivities: Vec::new(),
        });
    }
    let mut sensitivities = Vec::new();
    if outcome.reason != StopReason::Interrupted {
        let local = Local {
            record,
            problem: &problem,
            evaluator: &evaluator,
            stop,
        };
        if settings.polish {
            let polished = local.polish(&outcome.place, outcome.costs);
            outcome.polish_evaluations = polished.evaluations;
            outcome.costs = polished.costs;
            outcome.theta = problem.theta(&polished.place);
            outcome.place = polished.place;
        }
        sensitivities = local.sensitivities(&outcome.place, outcome.costs.rms);
        if stop() {
            outcome.reason = StopReason::Interrupted;
        }
    }
    Ok(Identification {
        problem,
        outcome: Some(outcome),
        sensitivities,
    })
}
