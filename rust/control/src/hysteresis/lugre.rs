//! The LuGre friction model: displacement and speed in, friction force out.
//!
//! ```text
//! z' = v - sigma0 |v| z/g(v),   g(v) = Fc + (Fs - Fc) exp(-(v/vs)^2)
//! F = sigma0 z + sigma1 z' + sigma2 v
//! ```
//!
//! Canudas de Wit, Olsson, Astrom and Lischinsky 1995, IEEE Trans. Autom. Control 40(3), 419-425,
//! equations (1) to (4), doi 10.1109/9.376053. z is the mean deflection of the bristles between two
//! surfaces. Along a monotone section of the path, with p its length and z counted in the direction
//! of motion,
//!
//! ```text
//! dz/dp = 1 - sigma0 z/g
//! ```
//!
//! where time enters through g only. The square of the speed is a smooth function of p, also where
//! the motion begins or ends at rest, and so is g. It is taken as the parabola through its values at
//! both ends and in the middle, for which the equation has a closed form: exact for a constant g,
//! where the operator is [`super::FirstOrderDahl`] with exponent 1.

use super::decay::decay;
use super::series::RECIPROCAL_FACTORIAL;
use crate::Number;
use crate::cubic_motion::{CubicVelocity, between, turning_time};

/// LuGre friction, without its viscous part sigma2 v.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `rest_stiffness` | sigma0 | N/m | > 0 |
/// | `micro_damping` | sigma1 | N s/m | >= 0 |
/// | `coulomb_force` | Fc | N | > 0 |
/// | `static_force` | Fs | N | > 0 |
/// | `stribeck_velocity` | vs | m/s | > 0 |
///
/// ```
/// use piezotrack_control::hysteresis::LuGre;
///
/// let friction = LuGre {
///     rest_stiffness: 2.0,
///     micro_damping: 0.0,
///     coulomb_force: 4.0,
///     static_force: 6.0,
///     stribeck_velocity: 1.0,
/// };
/// // Sliding at a constant speed for long.
/// let z = friction.along(0.0, 1000.0, [0.25; 3]);
/// assert!((2.0 * z - (4.0 + 2.0 * (-0.25_f64).exp())).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LuGre<N> {
    /// Stiffness of the bristles, sigma0: slope of the force where it is 0.
    pub rest_stiffness: N,
    /// Damping of the bristles, sigma1.
    pub micro_damping: N,
    /// Force of sliding at high speed, Fc.
    pub coulomb_force: N,
    /// Force of sliding at low speed, Fs.
    pub static_force: N,
    /// Speed at which the force has fallen by 63 % of the difference, vs.
    pub stribeck_velocity: N,
}

/// A leg in one direction: its ends, and there the square of the velocity and the acceleration, in
/// units of the interval.
struct Leg<N> {
    direction: N,
    ways: [N; 2],
    squares: [N; 2],
    accelerations: [N; 2],
}

impl<N> Leg<N> {
    #[inline(always)]
    fn new(direction: N, ways: [N; 2], squares: [N; 2], accelerations: [N; 2]) -> Self {
        Self { direction, ways, squares, accelerations }
    }
}

/// Terms of the series below: the next is below 0.5^12 / 15! = 2e-16.
const TERMS: usize = 12;

/// Longest path, times the rate, for which it is summed.
const SHORT: f64 = 0.5;

impl<N: Number> LuGre<N> {
    /// Whether the limit depends on the speed, in any lane.
    #[inline(always)]
    fn falls(&self) -> bool {
        (self.coulomb_force - self.static_force).any_negative()
            || (self.static_force - self.coulomb_force).any_negative()
    }

    /// g at the square of a speed.
    #[inline(always)]
    pub fn limit(&self, square: N) -> N {
        if !self.falls() {
            // As the formula gives it, to the last bit.
            return self.static_force;
        }
        let fall = decay(square / (self.stribeck_velocity * self.stribeck_velocity));
        (self.static_force - self.coulomb_force).mul_add(fall, self.static_force)
    }

    /// Deflection z, counted along the direction of motion, after a path of length `length` from
    /// `z` on, of the squares of the speed at its beginning, its middle and its end.
    #[inline(always)]
    pub fn along(&self, z: N, length: N, squares: [N; 3]) -> N {
        let number = |value: f64| z.like(value);
        if !self.falls() {
            return self.along_constant(z, length);
        }
        let [start, middle, end] = squares;
        let limits = [self.limit(start), self.limit(middle), self.limit(end)];
        let [first, second, third] = [
            limits[0] / self.rest_stiffness,
            limits[1] / self.rest_stiffness,
            limits[2] / self.rest_stiffness,
        ];
        let one = number(1.0);
        let [begin, halfway, finish] = [one / first, one / second, one / third];
        // Simpson's rule for the whole way, and the part of it up to the middle.
        let sum = halfway.mul_add(number(4.0), begin + finish);
        let path = length * sum * number(1.0 / 6.0);
        let part =
            halfway.mul_add(number(8.0), begin.mul_add(number(5.0), -finish)) / (sum * number(4.0));
        let part = within(part, 0.1, 0.9);
        // Along the path as the exponential counts it, the limit is first + rise s + bend s (1 - s).
        let rise = third - first;
        let bend = ((-rise).mul_add(part, second) - first) / (part * (one - part));
        let change = decay(path);
        let [linear, square] = means(path, change);
        let driven = rise.mul_add(linear, bend * (linear - square));
        (z - first).mul_add(change, z) + driven
    }

    /// The same where the limit does not depend on the speed, operation by operation: what the
    /// other lanes hold must not show in the bits of one.
    #[inline(always)]
    fn along_constant(&self, z: N, length: N) -> N {
        let number = |value: f64| z.like(value);
        let limit = self.static_force / self.rest_stiffness;
        let part = number(1.0) / limit;
        let sum = part.mul_add(number(4.0), part + part);
        let path = length * sum * number(1.0 / 6.0);
        (z - limit).mul_add(decay(path), z) + number(0.0)
    }

    /// Deflection where a motion ends, through the reversals within it, from the deflection `z` on:
    /// between the `ends`, displacement and velocity per interval, with the velocity of the cubic
    /// through them; `rate` is the number of intervals in a second.
    #[inline(always)]
    pub fn through(
        &self,
        z: N,
        velocity: &CubicVelocity<N>,
        [[x0, w0], [x1, w1]]: [[N; 2]; 2],
        rate: N,
    ) -> N {
        let (zero, one) = (z.like(0.0), z.like(1.0));
        let direction = velocity.direction;
        let (start, end) = (w0 * w0, w1 * w1);
        let turned = direction * w1;
        let dips = turned.where_negative(one, velocity.dips());
        if !turned.any_negative() && !dips.any_negative() {
            let accelerations = [acceleration(velocity, zero), acceleration(velocity, one)];
            let leg = Leg::new(direction, [x0, x1], [start, end], accelerations);
            return self.leg(z, &leg, rate);
        }
        // Lanes without a reversal go to the end at once; their further legs have length 0.
        let [first, second] = velocity.dip();
        let first = turned.where_negative(turning_time(w0, w1), dips.where_negative(first, one));
        let second = dips.where_negative(second, one);
        let turning = between(x0, w0, x1, w1, first);
        let turning = turned.where_negative(turning, dips.where_negative(turning, x1));
        let coming = dips.where_negative(between(x0, w0, x1, w1, second), x1);
        let late = dips.where_negative(zero, end);
        let still = turned.where_negative(zero, late);
        // No closure, as of `map`: it would not be compiled for the vector instructions of its caller.
        let [a0, a1] = [acceleration(velocity, zero), acceleration(velocity, first)];
        let [a2, a3] = [acceleration(velocity, second), acceleration(velocity, one)];
        let legs = [
            Leg::new(direction, [x0, turning], [start, still], [a0, a1]),
            Leg::new(-direction, [turning, coming], [still, late], [a1, a2]),
            Leg::new(direction, [coming, x1], [late, end], [a2, a3]),
        ];
        // In a loop, so that what a leg is, which is long, is compiled once for all three.
        let mut z = z;
        for leg in &legs {
            z = self.leg(z, leg, rate);
        }
        z
    }

    /// The deflection after a leg.
    #[inline(always)]
    fn leg(&self, z: N, leg: &Leg<N>, rate: N) -> N {
        let zero = z.like(0.0);
        let positive = |value: N| value.where_negative(zero, value);
        let Leg { direction, ways: [from, to], squares: [start, end], accelerations } = *leg;
        let length = positive(direction * (to - from));
        // The square of the velocity changes by twice the acceleration along the path: the cubic
        // through both ends, in the middle.
        let bend = direction * (accelerations[0] - accelerations[1]);
        let middle = length.mul_add(bend * z.like(0.25), (start + end) * z.like(0.5));
        let speed = rate * rate;
        let squares = [start * speed, positive(middle) * speed, end * speed];
        direction * self.along(direction * z, length, squares)
    }

    /// Force without its viscous part, less `sigma1 v`, at a deflection and a velocity:
    /// `sigma0 z (1 - sigma1 |v|/g)`.
    #[inline(always)]
    pub fn force(&self, z: N, velocity: N) -> N {
        self.force_and_rate(z, velocity, z.like(0.0))[0]
    }

    /// That force, and its derivative with respect to time at an acceleration.
    #[inline(always)]
    pub fn force_and_rate(&self, z: N, velocity: N, acceleration: N) -> [N; 2] {
        let one = z.like(1.0);
        let square = velocity * velocity;
        let limit = self.limit(square);
        let slip = magnitude(velocity) / limit;
        let held = (-slip).mul_add(self.micro_damping, one);
        let deflected = (-(self.rest_stiffness * slip)).mul_add(z, velocity);
        let steeper = (limit - self.coulomb_force) * square
            / (limit * (self.stribeck_velocity * self.stribeck_velocity));
        let slips = sign(velocity) * acceleration * steeper.mul_add(z.like(2.0), one) / limit;
        let rate = deflected.mul_add(held, -(self.micro_damping * z * slips));
        [self.rest_stiffness * z * held, self.rest_stiffness * rate]
    }
}

/// Integrals of s and s^2, times q exp(-q (1 - s)), for s from 0 to 1; `change` is e^-q - 1.
#[inline(always)]
fn means<N: Number>(q: N, change: N) -> [N; 2] {
    let number = |value: f64| q.like(value);
    let short = q - number(SHORT);
    let part = short.where_negative(q, number(SHORT));
    // (1/2 - 1/q + (1 - e^-q)/q^2)/q by its series.
    let mut sum = number(RECIPROCAL_FACTORIAL[TERMS + 2]);
    for k in (0..TERMS - 1).rev() {
        sum = sum.mul_add(-part, number(RECIPROCAL_FACTORIAL[k + 3]));
    }
    let linear = part * (-part).mul_add(sum, number(0.5));
    let square = part * sum * number(2.0);
    let far_linear = number(1.0) + change / q;
    let far_square = number(1.0) - far_linear * number(2.0) / q;
    [short.where_negative(linear, far_linear), short.where_negative(square, far_square)]
}

/// Acceleration along the direction of motion, a part `s` of a step after its beginning.
#[inline(always)]
fn acceleration<N: Number>(velocity: &CubicVelocity<N>, s: N) -> N {
    velocity.direction * (velocity.a + velocity.a).mul_add(s, velocity.b)
}

#[inline(always)]
fn within<N: Number>(value: N, low: f64, high: f64) -> N {
    let (low, high) = (value.like(low), value.like(high));
    let value = (value - low).where_negative(low, value);
    (high - value).where_negative(high, value)
}

#[inline(always)]
fn magnitude<N: Number>(value: N) -> N {
    value.where_negative(-value, value)
}

#[inline(always)]
fn sign<N: Number>(value: N) -> N {
    value.where_negative(value.like(-1.0), value.like(1.0))
}
