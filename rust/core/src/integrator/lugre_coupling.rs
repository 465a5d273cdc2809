//! LuGre friction in feedback on the displacement: a force that depends on the speed too.
//!
//! ```text
//! M x'' + D x' + K x = T u - F,   F = sigma0 z + sigma1 z' + sigma2 x'
//! ```
//!
//! With z' put in, F is `(sigma1 + sigma2) x'`, which the linear part has, and the rest
//! `sigma0 z (1 - sigma1 |x'|/g)`. As in [`super::NonsmoothCoupling`] the rest is a cubic in time
//! over a step, through its values and rates at both ends. Its rate needs the acceleration: at first
//! none, then that of the cubic through the motion found, with which the step is corrected twice.
//! Between reversals this is of fourth order without sigma1, and of third with it.

use piezotrack_control::Number;
use piezotrack_control::cubic_motion::CubicVelocity;
use piezotrack_control::hysteresis::LuGre;

use super::feedback_coupling::{Prediction, conclude_with, extrapolate, heading, sign};
use super::propagator::Propagator;
use super::traits::{Coupling, FeedbackState};

/// Corrections of a step: the first brings the acceleration, the second uses it.
const CORRECTIONS: usize = 2;

/// LuGre friction over one step.
#[derive(Clone, Copy, Debug)]
pub struct LuGreCoupling<N> {
    /// The linear part over one step, with the damping D + sigma1 + sigma2.
    pub linear: Propagator<N>,
    /// The friction.
    pub friction: LuGre<N>,
    /// Steps in a second, 1/s.
    pub rate: N,
}

/// State of the friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LuGreMemory<N> {
    /// Deflection z, m.
    pub deflection: N,
    /// Velocity, m/s.
    pub velocity: N,
}

type State<N> = FeedbackState<N, LuGreMemory<N>>;

impl<N: Number> LuGreCoupling<N> {
    /// The deflection where a step ends, through the reversals within it.
    #[inline(always)]
    fn deflection(&self, from: &State<N>, direction: N, x: N, w: N) -> N {
        let velocity = CubicVelocity::along(direction, [from.x, from.w], [x, w]);
        let ends = [[from.x, from.w], [x, w]];
        self.friction.through(from.memory.deflection, &velocity, ends, self.rate)
    }

    /// Force and its change over a step at its rate at one end.
    #[inline(always)]
    fn force(&self, deflection: N, w: N, acceleration: N) -> (N, N) {
        let velocity = w * self.rate;
        let acceleration = acceleration * (self.rate * self.rate);
        let [force, rate] = self.friction.force_and_rate(deflection, velocity, acceleration);
        (force, rate / self.rate)
    }
}

impl<N: Number> Coupling<N> for LuGreCoupling<N> {
    type Memory = LuGreMemory<N>;

    #[inline(always)]
    fn step(&self, state: &State<N>, drive: N, rise: N) -> State<N> {
        let zero = drive.like(0.0);
        let z = state.memory.deflection;
        let begin = |acceleration: N| -> Prediction<N> {
            let force = self.force(z, state.w, acceleration);
            extrapolate(&self.linear, state, force, drive, rise)
        };
        let ahead = begin(zero);
        let (mut x, mut w) = (ahead.x, ahead.w);
        let direction = sign(heading(state, &ahead));
        // The deflection is computed in one place of a loop: its code is long.
        let mut correction = 0;
        loop {
            let deflection = self.deflection(state, direction, x, w);
            if correction == CORRECTIONS {
                let memory = LuGreMemory { deflection, velocity: w * self.rate };
                return FeedbackState { x, w, memory };
            }
            correction += 1;
            let velocity = CubicVelocity::along(drive.like(1.0), [state.x, state.w], [x, w]);
            let ahead = begin(velocity.b);
            let end = self.force(deflection, w, velocity.a + velocity.a + velocity.b);
            (x, w) = conclude_with(&self.linear, &ahead, end);
        }
    }
}
