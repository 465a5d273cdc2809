//! Adaptive steps along half a circle about 0, for counting roots by the argument principle.

use core::f64::consts::PI;

use super::sampled_loop::{Parts, SampledLoop, small};
use crate::math::{C, Jet};

/// Angle by which a function may turn, and logarithm by which it may grow, in one step.
const TURN: f64 = 0.5;
/// The shortest step, rad.
const SHORTEST: f64 = 1e-15;

/// The characteristic function at one angle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub theta: f64,
    pub delta: C,
    pub parts: Parts,
}

impl Place {
    /// z.
    pub fn z(&self) -> C {
        self.delta + C::new(1.0, 0.0)
    }

    /// The characteristic function.
    pub fn closed(&self) -> Jet {
        self.parts.a + self.parts.b
    }

    /// The open loop; infinite at its poles.
    pub fn open(&self) -> C {
        self.parts.b.value / self.parts.a.value
    }

    /// `d ln f/d ln z` of the characteristic function.
    pub fn turn_closed(&self) -> C {
        let f = self.closed();
        self.z() * f.slope / f.value
    }

    /// The same of the open loop.
    pub fn turn_open(&self) -> C {
        let Parts { a, b } = self.parts;
        if b.value.norm() == 0.0 && b.slope.norm() == 0.0 {
            return C::new(0.0, 0.0);
        }
        self.z() * (b.slope / b.value - a.slope / a.value)
    }
}

impl SampledLoop {
    /// The place at an angle (rad) of the circle.
    pub(crate) fn place(&self, radius: f64, theta: f64) -> Place {
        // z - 1 without cancelling near z = 1; exactly real at both ends
        let delta = if theta >= PI {
            C::new(-radius - 1.0, 0.0)
        } else {
            let half = libm::sin(0.5 * theta);
            let turned = C::new(-2.0 * half * half, libm::sin(theta));
            turned * radius + C::new(radius - 1.0, 0.0)
        };
        Place { theta, delta, parts: self.parts(delta) }
    }

    /// Visits neighbouring places from the angle `from` to pi such that between two of them
    /// `turn`, a logarithmic derivative, allows no more than half a radian.
    ///
    /// A zero or pole on the circle is approached to 1e-15 rad and stepped over. Where numbers
    /// are not finite the number of places is bounded too; whether it was enough.
    pub(crate) fn sweep(
        &self,
        radius: f64,
        from: f64,
        turn: impl Fn(&Place) -> f64,
        mut visit: impl FnMut(&Place, &Place),
    ) -> bool {
        let cells = 32 + self.longest_delay();
        let mut left = self.place(radius, from);
        let mut rate = turn(&left);
        let mut ahead = Vec::new();
        let mut left_over = 100 * cells + 20_000;
        for cell in 1..=cells {
            let theta =
                if cell == cells { PI } else { from + (PI - from) * small(cell) / small(cells) };
            let right = self.place(radius, theta);
            ahead.push((right, turn(&right)));
            while let Some((right, right_rate)) = ahead.last().copied() {
                let step = right.theta - left.theta;
                // Not a number where the function is 0: as steep as can be
                let short = step * rate <= TURN && step * right_rate <= TURN;
                let middle = left.theta + 0.5 * step;
                if short || step < SHORTEST || left_over == 0 {
                    visit(&left, &right);
                    (left, rate) = (right, right_rate);
                    ahead.pop();
                } else {
                    left_over -= 1;
                    let middle = self.place(radius, middle);
                    ahead.push((middle, turn(&middle)));
                }
            }
        }
        left_over > 0
    }
}

/// The highest of a function's values on a sweep, and the piece in which it may be higher still.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Peak {
    pub height: f64,
    pub theta: f64,
    from: f64,
    to: f64,
}

impl Peak {
    /// Takes in the value at the right end of a piece of the sweep.
    pub fn take(&mut self, left: f64, right: f64, height: f64) {
        if height > self.height {
            *self = Self { height, theta: right, from: left, to: right };
        } else if left <= self.theta {
            // The piece that follows the highest place
            self.to = self.to.max(right);
        }
    }

    /// Searches the two pieces beside the highest place.
    pub fn refine(mut self, value: impl Fn(f64) -> f64) -> Self {
        let (mut from, mut to) = (self.from, self.to);
        for _ in 0..80 {
            let third = (to - from) / 3.0;
            let (lower, upper) = (value(from + third), value(to - third));
            for (height, theta) in [(lower, from + third), (upper, to - third)] {
                if height > self.height {
                    (self.height, self.theta) = (height, theta);
                }
            }
            if lower < upper {
                from += third;
            } else {
                to -= third;
            }
        }
        self
    }
}
