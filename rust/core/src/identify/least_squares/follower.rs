//! Creep and dynamics behind one signal of a record.

use crate::models::{Relaxation, RelaxationFlow, RelaxationState};
use crate::signal::Hold;

/// Creep and dynamics behind one signal of a record.
pub(super) struct Follower {
    pub state: RelaxationState,
    before: Option<f64>,
}

impl Follower {
    pub fn new() -> Self {
        Self { state: RelaxationState::default(), before: None }
    }

    /// What comes out at the sample where `input` comes in, as the stage's simulation does.
    pub fn next(
        &mut self,
        part: &Relaxation,
        flow: &RelaxationFlow,
        hold: Hold,
        input: f64,
    ) -> f64 {
        match (hold, self.before) {
            (Hold::First, None) => part.jump(&mut self.state, input),
            (Hold::First, Some(_)) => part.step(flow, &mut self.state, input),
            (Hold::Zero, None) => {}
            (Hold::Zero, Some(held)) => {
                part.jump(&mut self.state, held);
                part.step(flow, &mut self.state, held);
            }
        }
        self.before = Some(input);
        self.state.x
    }
}

/// The dynamics behind what one relaxation has reached, which moves from sample to sample.
pub(super) fn crept(
    column: &mut Follower,
    part: &Relaxation,
    flow: &RelaxationFlow,
    reached: f64,
) -> f64 {
    part.step(flow, &mut column.state, reached);
    column.state.x
}
