//! An operator at the input: `M x'' + D x' + K x = K (d u - h(u))`.
//!
//! The input of the operator is the drive, which is linear between samples, so its output is a
//! smooth function of time between two reversals and does not depend on the motion. Over a step
//! the force is approximated by the cubic through its values and slopes at both ends, for which
//! the linear part is exact: fourth order, and no limit on the step, however stiff the stage is.

use piezotrack_control::Number;
use piezotrack_control::hysteresis::NonsmoothOperator;

use super::feedback_coupling::sign;
use super::propagator::Propagator;
use super::traits::{Coupling, FeedbackState};

/// An operator between the drive and linear mechanics.
#[derive(Clone, Copy, Debug)]
pub struct InputCoupling<N, O> {
    /// The linear part over one step.
    pub linear: Propagator<N>,
    /// The hysteresis, from volts to metres.
    pub operator: O,
    /// K, N/m.
    pub stiffness: N,
    /// Free displacement for 1 V, d, m/V.
    pub gain: N,
}

/// State of an operator at the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputMemory<N, S> {
    /// Memory of the operator.
    pub operator: S,
    /// Latest drive, V.
    pub input: N,
    /// Change of the drive over the last step, V: 0 where the slope there is not known.
    pub rise: N,
}

/// Share of the drive below which a difference is taken for rounding.
const ROUNDING: f64 = 1e-13;

impl<N: Number, O: NonsmoothOperator<N>> Coupling<N> for InputCoupling<N, O> {
    type Memory = InputMemory<N, O::State>;

    /// Here the drive is in volts.
    #[inline(always)]
    fn step(
        &self,
        state: &FeedbackState<N, Self::Memory>,
        drive: N,
        rise: N,
    ) -> FeedbackState<N, Self::Memory> {
        let InputMemory { mut operator, input, rise: before } = state.memory;
        let direction = sign(rise);
        // All lanes have the same drive, and so take the same turns here.
        let gap = drive - input;
        let size = drive.mul_add(drive, input * input);
        let jumped = size.mul_add(size.like(ROUNDING * ROUNDING), -(gap * gap));
        let mut onward = -(before * rise);
        if jumped.any_negative() {
            let branch = self.operator.branch(&operator, sign(gap));
            operator = self.operator.along(&branch, gap);
            onward = gap.like(0.0);
        }
        // Under a drive that is held nothing below depends on slopes.
        let moves = (-(rise * rise)).any_negative();
        let branch = self.operator.branch(&operator, direction);
        if moves && !onward.any_negative() {
            operator = self.operator.leaving(&operator, rise, direction);
        }
        let (h0, slope0) = self.operator.output(&operator);
        if moves {
            operator = self.operator.along(&branch, rise);
        }
        let (h1, slope1) = self.operator.output(&operator);

        let (k, p) = (self.stiffness, &self.linear);
        let force = k * self.gain.mul_add(drive, -h0);
        let ramp = k * ((self.gain - slope0) * rise);
        let excess = k * slope0.mul_add(rise, h0 - h1);
        let bend = k * ((slope0 - slope1) * rise);
        let end = |position: N, velocity: N, gains: [N; 4]| {
            let free = position.mul_add(state.x, velocity * state.w);
            let driven = gains[1].mul_add(ramp, gains[0].mul_add(force, free));
            gains[3].mul_add(bend, gains[2].mul_add(excess, driven))
        };
        let x = [p.constant.x, p.ramp.x, p.excess.x, p.bend.x];
        let w = [p.constant.w, p.ramp.w, p.excess.w, p.bend.w];
        FeedbackState {
            x: end(p.position.x, p.velocity.x, x),
            w: end(p.position.w, p.velocity.w, w),
            memory: InputMemory { operator, input: drive + rise, rise },
        }
    }
}
