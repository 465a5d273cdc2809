//! What an experiment moves: a voltage goes in, a displacement comes out.

use piezotrack_control::operator::Dahl;

use crate::march::TERMS;
use crate::mechanics::{Propagator, halvings};
use crate::stage::feedback::{FeedbackState, fourth_order};
use crate::stage::{DahlStage, StageState};

/// A stage from its terminals to its displacement: configuration in `&self`, memory in `State`.
pub trait Plant {
    /// What the stage remembers.
    type State: Clone;
    /// All that the length of a step decides.
    type Flow;

    /// The state before any voltage.
    fn rest(&self) -> Self::State;

    /// Works out steps of `step` seconds.
    fn flow(&self, step: f64) -> Self::Flow;

    /// One step under a voltage that goes straight from `from` to `to`, V.
    fn advance(&self, flow: &Self::Flow, state: &mut Self::State, from: f64, to: f64);

    /// Displacement, m.
    fn displacement(&self, state: &Self::State) -> f64;
}

/// Steps of a [`DahlStage`].
#[derive(Clone, Copy, Debug)]
pub struct DahlFlow {
    linear: Propagator<f64>,
    operator: Dahl<f64, TERMS>,
    step: f64,
}

impl Plant for DahlStage {
    type State = StageState;
    type Flow = DahlFlow;

    fn rest(&self) -> StageState {
        StageState::default()
    }

    fn flow(&self, step: f64) -> DahlFlow {
        let m = &self.mechanics;
        let (inverse, d, k) = (1.0 / m.mass, m.damping / m.mass, m.stiffness / m.mass);
        let linear = Propagator::new(inverse, d, k, step, halvings(m.rate(), step));
        DahlFlow { linear, operator: self.operator(), step }
    }

    #[inline(always)]
    fn advance(&self, flow: &DahlFlow, state: &mut StageState, from: f64, to: f64) {
        let DahlFlow { linear, operator, step } = flow;
        let start = FeedbackState { x: state.x, w: state.v * step, memory: (*state).into() };
        let gain = self.piezo_coefficient;
        let end = fourth_order(linear, operator, &start, gain * from, gain * (to - from));
        *state = StageState {
            x: end.x,
            v: end.w / step,
            hysteresis: end.memory.force,
            hysteresis_slope: end.memory.slope,
        };
    }

    fn displacement(&self, state: &StageState) -> f64 {
        state.x
    }
}
