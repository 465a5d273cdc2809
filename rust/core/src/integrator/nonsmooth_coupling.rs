//! An operator whose slope jumps at a reversal, in feedback on the displacement.
//!
//! The scheme of [`super::feedback`] takes the force over a step for a cubic in time. First-order
//! Dahl and Bouc-Wen hysteresis leave a reversal with another slope than they came with, so a
//! step begins with the slope of the direction in which it goes, and a reversal inside it is led
//! through in both predictor and corrector: the cubic is right at both ends, and only the kink
//! between them is smoothed. Fourth order between reversals, third across them.

use piezotrack_control::Number;
use piezotrack_control::hysteresis::{BoucWenState, Facing};

use super::feedback_coupling::{conclude, heading, lead, predict, sign};
use super::propagator::Propagator;
use super::simulate::{Alone, Motion};
use super::traits::{Coupling, FeedbackState, Kernel, Parameters};
use crate::error::Result;
use crate::signal::{Drive, Stop};

/// Motion of a stage with such an operator.
pub type KinkedMotion = Motion<BoucWenState<f64>>;

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

/// Simulates from displacement, velocity and the operator's output; `None` where `stop` said so.
///
/// # Errors
/// Those of [`Alone::simulate`].
pub(crate) fn simulate<K, O>(
    kernel: &K,
    parameters: &Parameters<f64>,
    drive: &Drive<'_>,
    [x, v, value]: [f64; 3],
    accuracy: f64,
    stop: Stop<'_>,
) -> Result<Option<KinkedMotion>>
where
    K: Kernel<f64, Coupling = Kinked<f64, O>> + Copy,
    O: Facing<f64, State = BoucWenState<f64>>,
{
    let alone = Alone { kernel, parameters };
    let mut start = alone.rest();
    (start.x, start.v, start.memory.value) = (x, v, value);
    alone.simulate(drive, start, accuracy, stop)
}
