//! Creep and dynamics behind one signal of a record.

use piezotrack_control::Number;

use crate::models::{Relaxation, RelaxationFlow, RelaxationState};
use crate::signal::Hold;

/// Creep and dynamics behind one signal of a record, from an equilibrium on.
#[derive(Clone, Copy, Debug)]
pub(in crate::identify::least_squares) struct Follower {
    pub state: RelaxationState,
    /// Input of the latest sample.
    pub before: f64,
}

impl Follower {
    /// At rest where `input` comes in; the creep stands at `creep`.
    pub fn at_rest(part: &Relaxation, input: f64, creep: &[f64]) -> Self {
        let mut state = RelaxationState { input, ..RelaxationState::default() };
        for (slot, reached) in state.creep.iter_mut().zip(creep) {
            *slot = *reached;
        }
        state.x = part.target(&state);
        state.mode_x.fill(state.x);
        Self { state, before: input }
    }

    /// Output at the sample where `input` comes in, as the stage's simulation does.
    #[inline(always)]
    pub fn next(
        &mut self,
        part: &Relaxation,
        flow: &RelaxationFlow,
        hold: Hold,
        input: f64,
    ) -> f64 {
        follow(part, flow, hold, &mut self.state, [self.before, input]);
        self.before = input;
        self.state.x
    }
}

/// Moves a state from the sample where the first input comes in to the one of the second.
#[inline(always)]
pub(super) fn follow<N: Number>(
    part: &Relaxation,
    flow: &RelaxationFlow,
    hold: Hold,
    state: &mut RelaxationState<N>,
    [before, input]: [N; 2],
) {
    match hold {
        Hold::First => part.step(flow, state, input),
        Hold::Zero => {
            part.jump(state, before);
            part.step(flow, state, before);
        }
        Hold::Jump => {
            part.step(flow, state, before);
            part.jump(state, input);
        }
    }
}
