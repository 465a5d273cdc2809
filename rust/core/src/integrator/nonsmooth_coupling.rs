//! An operator whose slope jumps at a reversal, in feedback on the displacement.
//!
//! The scheme of [`super::FeedbackCoupling`] approximates the force over a step by a cubic in time.
//! The slope of first-order Dahl and Bouc-Wen hysteresis jumps at a reversal, so a step begins with
//! the slope for its direction, and both predictor and corrector evaluate the operator through a
//! reversal inside it: the cubic is exact at both ends, and only the kink between them is smoothed. Fourth order between reversals, third across them.

use piezotrack_control::Number;
use piezotrack_control::hysteresis::NonsmoothOperator;

use super::feedback_coupling::{advance_operator, conclude, heading, predict, sign};
use super::propagator::Propagator;
use super::traits::{Coupling, FeedbackState};

/// An operator with kinks at reversals in feedback.
#[derive(Clone, Copy, Debug)]
pub struct NonsmoothCoupling<N, O> {
    /// The linear part over one step.
    pub linear: Propagator<N>,
    /// The hysteresis.
    pub operator: O,
}

impl<N: Number, O: NonsmoothOperator<N>> Coupling<N> for NonsmoothCoupling<N, O> {
    type Memory = O::State;

    #[inline(always)]
    fn step(
        &self,
        state: &FeedbackState<N, O::State>,
        drive: N,
        rise: N,
    ) -> FeedbackState<N, O::State> {
        let Self { linear, operator } = self;
        // At rest the slope does not matter, as the force does not change.
        let memory = operator.leaving(&state.memory, state.w, sign(state.w));
        let from = FeedbackState { memory, ..*state };
        let ahead = predict(linear, operator, &from, drive, rise);
        let branch = operator.branch(&from.memory, sign(heading(&from, &ahead)));
        let (mut x, mut w) = (ahead.x, ahead.w);
        // In a loop, as the legs of a step are: the operator's code is long.
        let mut corrected = false;
        loop {
            let memory = advance_operator(operator, &from, &branch, x, w);
            if corrected {
                return FeedbackState { x, w, memory };
            }
            (x, w) = conclude(linear, &ahead, operator.output(&memory));
            corrected = true;
        }
    }
}
