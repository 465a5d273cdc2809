//! Motion between two instants: the cubic through displacement and velocity at both, in lanes.
//!
//! Velocities are displacements per interval, and s goes from 0 to 1 over it.

use crate::Number;

/// The cubic through values and scaled slopes at 0 and 1, at `s`.
#[inline(always)]
#[must_use]
pub fn between<N: Number>(x0: N, w0: N, x1: N, w1: N, s: N) -> N {
    let rise = x1 - x0;
    let c3 = rise.mul_add(rise.like(-2.0), w0 + w1);
    let c2 = rise - w0 - c3;
    s.mul_add(s.mul_add(s.mul_add(c3, c2), w0), x0)
}

/// Part of the interval after which the velocity passes zero, on a straight line through those at
/// both ends: the displacement is flat there, so its error is of fourth order.
#[inline(always)]
#[must_use]
pub fn turning_time<N: Number>(from: N, to: N) -> N {
    from / (from - to)
}

/// Velocity along the direction of motion over a step, `c + b s + a s^2` for s from 0 to 1: that
/// of the cubic through displacement and velocity at both ends.
#[derive(Clone, Copy, Debug)]
pub struct CubicVelocity<N> {
    /// Direction of motion at the beginning, +1 or -1.
    pub direction: N,
    /// Share of s^2.
    pub a: N,
    /// Share of s.
    pub b: N,
    /// Velocity at the beginning.
    pub c: N,
}

impl<N: Number> CubicVelocity<N> {
    /// Of a step that starts in a given direction, between two pairs of displacement and velocity.
    #[inline(always)]
    #[must_use]
    pub fn along(direction: N, [x0, w0]: [N; 2], [x1, w1]: [N; 2]) -> Self {
        let rise = x1 - x0;
        let c3 = rise.mul_add(rise.like(-2.0), w0 + w1);
        let c2 = rise - w0 - c3;
        Self {
            direction,
            a: direction * (c3 + c3 + c3),
            b: direction * (c2 + c2),
            c: direction * w0,
        }
    }

    /// Below 0 where the velocity starts along the direction, passes zero and comes back to it:
    /// both ends of such a step look as if it had not turned.
    #[inline(always)]
    #[must_use]
    pub fn dips(&self) -> N {
        let Self { a, b, c, .. } = *self;
        let one = a.like(1.0);
        let roots = (a * c).mul_add(a.like(4.0), -(b * b));
        let falls = b.where_negative(roots, one);
        let rises = (-(a + a + b)).where_negative(falls, one);
        (-c).where_negative(rises, one)
    }

    /// Both parts of the step after which the velocity of a step that dips passes zero.
    #[inline(always)]
    #[must_use]
    pub fn dip(&self) -> [N; 2] {
        let Self { a, b, c, .. } = *self;
        let square = b.mul_add(b, -((a * c) * a.like(4.0)));
        let root = square.where_negative(a.like(0.0), square).sqrt();
        [(c + c) / (root - b), (root - b) / (a + a)]
    }
}
