//! Progress of a search, and the outcome of each of its runs.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::identify::cost::journal::Journal;
use crate::identify::cost::residual_sums::Costs;
use crate::identify::parameters::candidate::Theta;

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

    /// Where what is computed is kept, if anywhere.
    fn journal(&self) -> Option<Arc<dyn Journal>> {
        None
    }
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
