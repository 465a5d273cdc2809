//! An operator in feedback on the displacement: `M x'' + D x' + K x = T u - F(x)`.
//!
//! The exponential scheme. Over a step the force is taken as the cubic through its values and
//! slopes at both ends; the linear part is exact for that cubic, the operator is exact in the
//! displacement. The force at the end is first extrapolated along its slope (predictor), then
//! read off the operator where that leads (corrector). A reversal inside the step is located,
//! and the operator led to the turning point and back. Fourth order in the step.

use piezotrack_control::Number;
use piezotrack_control::operator::Operator;

use crate::mechanics::Propagator;

/// Displacement, scaled velocity `h x'` and the operator's memory.
#[derive(Clone, Copy, Debug)]
pub struct FeedbackState<N, M> {
    /// Displacement, m.
    pub x: N,
    /// Velocity times the step, m.
    pub w: N,
    /// Memory of the operator.
    pub memory: M,
}

/// One step under a drive force that goes from `drive` to `drive + rise`, linearly.
#[inline(always)]
pub fn step<N: Number, O: Operator<N>>(
    linear: &Propagator<N>,
    operator: &O,
    state: &FeedbackState<N, O::State>,
    drive: N,
    rise: N,
) -> FeedbackState<N, O::State> {
    let (force, slope) = operator.output(&state.memory);
    let change = slope * state.w;
    let f0 = drive - force;
    let f1 = rise - change;
    let px = linear.constant.x.mul_add(f0, linear.ramp.x * f1);
    let pw = linear.constant.w.mul_add(f0, linear.ramp.w * f1);
    let px = linear
        .position
        .x
        .mul_add(state.x, linear.velocity.x.mul_add(state.w, px));
    let pw = linear
        .position
        .w
        .mul_add(state.x, linear.velocity.w.mul_add(state.w, pw));

    // At rest the predicted velocity tells the direction; else it is too small to matter.
    let heading = pw.mul_add(pw.like(1e-12), state.w);
    let branch = operator.branch(&state.memory, sign(heading));
    let ahead = operator.along(&branch, px - state.x);
    let (force_ahead, slope_ahead) = operator.output(&ahead);
    let excess = force + change - force_ahead;
    let bend = change - slope_ahead * pw;
    let x = linear
        .excess
        .x
        .mul_add(excess, linear.bend.x.mul_add(bend, px));
    let w = linear
        .excess
        .w
        .mul_add(excess, linear.bend.w.mul_add(bend, pw));

    let turned = state.w * w;
    let memory = if turned.any_negative() {
        // Lanes that did not turn go to the end on the first leg; their second has length 0.
        let turning = turned.where_negative(turning_point(state, x, w), x);
        let there = operator.along(&branch, turning - state.x);
        operator.along(&operator.branch(&there, sign(w)), x - turning)
    } else {
        operator.along(&branch, x - state.x)
    };
    FeedbackState { x, w, memory }
}

/// +1 or -1; +1 for 0.
#[inline(always)]
fn sign<N: Number>(value: N) -> N {
    value.where_negative(value.like(-1.0), value.like(1.0))
}

/// Displacement where the velocity passes zero, on the cubic through both ends.
///
/// The time comes from a straight line through the velocities: the displacement is flat there,
/// so its error is of fourth order.
#[inline(always)]
fn turning_point<N: Number, M>(from: &FeedbackState<N, M>, x: N, w: N) -> N {
    let s = from.w / (from.w - w);
    let rise = x - from.x;
    // Hermite form about the start: w0 s + (3 r - 2 w0 - w1) s^2 + (w0 + w1 - 2 r) s^3
    let c3 = rise.mul_add(rise.like(-2.0), from.w + w);
    let c2 = rise - from.w - c3;
    s.mul_add(s.mul_add(s.mul_add(c3, c2), from.w), from.x)
}
