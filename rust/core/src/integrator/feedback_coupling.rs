//! An operator in feedback on the displacement: `M x'' + D x' + K x = T u - F(x)`.
//!
//! The exponential scheme. Over a step the force is a polynomial in time; the linear part is
//! exact for it, and the operator is exact in the displacement. The force is extrapolated along
//! its slope, which by itself gives second order. A corrector then evaluates the operator at the
//! predicted displacement and takes the cubic through values and slopes at both ends; a reversal
//! inside the step is located, and the operator evaluated to the turning point and back: fourth
//! order.

use piezotrack_control::Number;
use piezotrack_control::cubic_motion::{CubicVelocity, between, turning_time};
use piezotrack_control::hysteresis::Operator;

use super::propagator::Propagator;
use super::traits::{Coupling, FeedbackState};

/// An operator without dry friction in feedback, coupled to second or fourth order.
#[derive(Clone, Copy, Debug)]
pub struct FeedbackCoupling<N, O, const FOURTH: bool> {
    /// The linear part over one step.
    pub linear: Propagator<N>,
    /// The hysteresis.
    pub operator: O,
}

impl<N: Number, O: Operator<N>, const FOURTH: bool> Coupling<N> for FeedbackCoupling<N, O, FOURTH> {
    const SHORT: bool = true;

    type Memory = O::State;

    #[inline(always)]
    fn step(
        &self,
        state: &FeedbackState<N, O::State>,
        drive: N,
        rise: N,
    ) -> FeedbackState<N, O::State> {
        if FOURTH {
            fourth_order(&self.linear, &self.operator, state, drive, rise)
        } else {
            second_order(&self.linear, &self.operator, state, drive, rise)
        }
    }
}

/// State at the end of the step with the force extrapolated along its slope.
pub(super) struct Prediction<N> {
    pub x: N,
    pub w: N,
    /// Force at the start, and its change over the step at the slope that it starts with.
    force: N,
    change: N,
}

/// The step with the force extrapolated along its initial slope.
#[inline(always)]
pub(super) fn predict<N: Number, O: Operator<N>>(
    linear: &Propagator<N>,
    operator: &O,
    state: &FeedbackState<N, O::State>,
    drive: N,
    rise: N,
) -> Prediction<N> {
    let (force, slope) = operator.output(&state.memory);
    extrapolate(linear, state, (force, slope * state.w), drive, rise)
}

/// The step with a force that changes at a constant rate, by `change` over the step.
#[inline(always)]
pub(super) fn extrapolate<N: Number, M>(
    linear: &Propagator<N>,
    state: &FeedbackState<N, M>,
    (force, change): (N, N),
    drive: N,
    rise: N,
) -> Prediction<N> {
    let f0 = drive - force;
    let f1 = rise - change;
    // The force's change comes last: it is what the chain of operations waits for.
    let x = linear.position.x.mul_add(state.x, linear.velocity.x * state.w);
    let w = linear.position.w.mul_add(state.x, linear.velocity.w * state.w);
    let x = linear.ramp.x.mul_add(f1, linear.constant.x.mul_add(f0, x));
    let w = linear.ramp.w.mul_add(f1, linear.constant.w.mul_add(f0, w));
    Prediction { x, w, force, change }
}

/// Displacement and scaled velocity with the cubic through the forces at both ends, the force
/// at the end being that of the branch at the predicted displacement.
#[inline(always)]
pub(super) fn correct<N: Number, O: Operator<N>>(
    linear: &Propagator<N>,
    operator: &O,
    branch: &O::Branch,
    ahead: &Prediction<N>,
    from: N,
) -> (N, N) {
    conclude(linear, ahead, operator.output(&operator.along(branch, ahead.x - from)))
}

/// Displacement and scaled velocity with the cubic through the forces at both ends, the one at
/// the end given with its slope along the path.
#[inline(always)]
pub(super) fn conclude<N: Number>(
    linear: &Propagator<N>,
    ahead: &Prediction<N>,
    (force, slope): (N, N),
) -> (N, N) {
    conclude_with(linear, ahead, (force, slope * ahead.w))
}

/// The same with the force at the end and its change over a step at the rate that it has there.
#[inline(always)]
pub(super) fn conclude_with<N: Number>(
    linear: &Propagator<N>,
    ahead: &Prediction<N>,
    (force, change): (N, N),
) -> (N, N) {
    let excess = ahead.force + ahead.change - force;
    let bend = ahead.change - change;
    let x = linear.excess.x.mul_add(excess, linear.bend.x.mul_add(bend, ahead.x));
    let w = linear.excess.w.mul_add(excess, linear.bend.w.mul_add(bend, ahead.w));
    (x, w)
}

/// One step of second order under a drive force that goes from `drive` to `drive + rise`.
#[inline(always)]
fn second_order<N: Number, O: Operator<N>>(
    linear: &Propagator<N>,
    operator: &O,
    state: &FeedbackState<N, O::State>,
    drive: N,
    rise: N,
) -> FeedbackState<N, O::State> {
    let branch = operator.branch(&state.memory, sign(state.w));
    let Prediction { x, w, .. } = predict(linear, operator, state, drive, rise);
    FeedbackState { x, w, memory: operator.along(&branch, x - state.x) }
}

/// One step of fourth order under a drive force that goes from `drive` to `drive + rise`.
#[inline(always)]
fn fourth_order<N: Number, O: Operator<N>>(
    linear: &Propagator<N>,
    operator: &O,
    state: &FeedbackState<N, O::State>,
    drive: N,
    rise: N,
) -> FeedbackState<N, O::State> {
    let ahead = predict(linear, operator, state, drive, rise);
    let direction = sign(heading(state, &ahead));
    let branch = operator.branch(&state.memory, direction);
    let (x, w) = correct(linear, operator, &branch, &ahead, state.x);
    let memory = advance_operator(operator, state, &branch, x, w);
    FeedbackState { x, w, memory }
}

/// A number with the sign of the motion over the step: at rest the predicted velocity decides;
/// otherwise it is too small to matter.
#[inline(always)]
pub(super) fn heading<N: Number, M>(from: &FeedbackState<N, M>, ahead: &Prediction<N>) -> N {
    ahead.w.mul_add(ahead.w.like(1e-12), from.w)
}

/// The operator's memory where a step ends: along the branch, to the turning point and back, or
/// through both turning points of a step that goes back in its middle.
#[inline(always)]
pub(super) fn advance_operator<N: Number, O: Operator<N>>(
    operator: &O,
    from: &FeedbackState<N, O::State>,
    branch: &O::Branch,
    x: N,
    w: N,
) -> O::State {
    let turned = from.w * w;
    let velocity = CubicVelocity::along(sign(from.w), [from.x, from.w], [x, w]);
    // A lane that turns does not go back besides; each lane takes its own way, whatever the others.
    let dips = turned.where_negative(x.like(1.0), velocity.dips());
    // The legs of a step that reverses are gone through in a loop: the operator's code, which is
    // long, would otherwise be compiled for each of them.
    let (ends, directions, legs) = if dips.any_negative() {
        // Lanes without a leg go to its end before; it then has length 0.
        // No closure, as of `map`: it would not be compiled for the vector instructions of its caller.
        let [first, second] = velocity.dip();
        let first = between(from.x, from.w, x, w, first);
        let second = between(from.x, from.w, x, w, second);
        let first = dips.where_negative(first, x);
        let first = turned.where_negative(turning_point(from, x, w), first);
        let second = dips.where_negative(second, x);
        let back = dips.where_negative(-velocity.direction, sign(w));
        let on = dips.where_negative(velocity.direction, sign(w));
        ([first, second, x], [back, on], 3)
    } else if turned.any_negative() {
        // Lanes that did not turn go to the end on the first leg; their second has length 0.
        let turning = turned.where_negative(turning_point(from, x, w), x);
        ([turning, x, x], [sign(w); 2], 2)
    } else {
        return operator.along(branch, x - from.x);
    };
    let (mut at, mut leg, mut branch) = (from.x, 0, *branch);
    loop {
        let memory = operator.along(&branch, ends[leg] - at);
        if leg + 1 == legs {
            return memory;
        }
        branch = operator.branch(&memory, directions[leg]);
        at = ends[leg];
        leg += 1;
    }
}

/// +1 or -1; +1 for 0.
#[inline(always)]
pub(super) fn sign<N: Number>(value: N) -> N {
    value.where_negative(value.like(-1.0), value.like(1.0))
}

/// Displacement where the velocity passes zero, on the cubic through both ends.
#[inline(always)]
fn turning_point<N: Number, M>(from: &FeedbackState<N, M>, x: N, w: N) -> N {
    between(from.x, from.w, x, w, turning_time(from.w, w))
}
