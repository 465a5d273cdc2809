//! An operator whose slope jumps at a reversal, in feedback on the displacement.
//!
//! The scheme of [`super::Smooth`] takes the force over a step for a cubic in time. First-order
//! Dahl and Bouc-Wen hysteresis leave a reversal with another slope than they came with, so a
//! step begins with the slope of the direction in which it goes, and a reversal inside it is led
//! through in both predictor and corrector: the cubic is right at both ends, and only the kink
//! between them is smoothed. Fourth order between reversals, third across them.

use piezotrack_control::Number;
use piezotrack_control::hysteresis::Facing;

use super::feedback_coupling::{conclude, heading, lead, predict, sign};
use super::propagator::Propagator;
use super::traits::{Coupling, FeedbackState};

/// An operator with kinks at reversals in feedback.
#[derive(Clone, Copy, Debug)]
pub struct Kinked<N, O> {
    /// The linear part over one step.
    pub linear: Propagator<N>,
    /// The hysteresis.
    pub operator: O,
}

impl<N: Number, O: Facing<N>> Coupling<N> for Kinked<N, O> {
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
        let memory = operator.facing(&state.memory, state.w, sign(state.w));
        let from = FeedbackState { memory, ..*state };
        let ahead = predict(linear, operator, &from, drive, rise);
        let branch = operator.branch(&from.memory, sign(heading(&from, &ahead)));
        let arrived = lead(operator, &from, &branch, ahead.x, ahead.w);
        let (x, w) = conclude(linear, &ahead, operator.output(&arrived));
        FeedbackState { x, w, memory: lead(operator, &from, &branch, x, w) }
    }
}
