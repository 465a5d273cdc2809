//! The Bouc-Wen operator: drive in, hysteretic part out.
//!
//! ```text
//! h' = A u' - beta |u'| h |h|^(n-1) - gamma u' |h|^n
//! ```
//!
//! Xu and Li 2010, equation (20), doi 10.1115/1.4001712, with A = alpha d; after Bouc 1967 and
//! Wen 1976. Along a monotone section of the path time drops out. With p the length of the path
//! and z the output counted positive in the direction of motion,
//!
//! ```text
//! dz/dp = A - kappa z |z|^(n-1),   kappa = beta + sgn(z) gamma
//! ```
//!
//! For n = 1 the solution is an exponential in p up to the point where z changes sign, which has
//! a closed form too, and another exponential beyond it. For any other exponent the equation is
//! integrated in short Runge-Kutta steps of fourth order.

use core::cmp::Ordering;

use super::series::{TERMS, growth, logarithm};
use super::{NonsmoothOperator, Operator};
use crate::cast::{Cast, rounded};
use crate::error::Result;
use crate::unfused::Unfused;
use crate::{Number, Real};

/// Bouc-Wen operator.
///
/// It is passive only for |gamma| <= beta. It is bounded only for beta + gamma > 0, by
/// (A/(beta + gamma))^(1/n).
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `rise` | A | output per input | any |
/// | `beta` | beta | 1 over input and output^(n-1) | any, >= 0 to be passive |
/// | `gamma` | gamma | as beta | any, within +-beta to be passive |
/// | `exponent` | n | 1 | >= 1 |
///
/// ```
/// use piezotrack_control::hysteresis::{BoucWen, Operator};
///
/// let hysteresis = BoucWen { rise: 1.0, beta: 0.5, gamma: 0.5, exponent: 1.0 };
/// let up = hysteresis.branch(&hysteresis.rest(), 1.0);
/// let there = hysteresis.along(&up, 2.0);
/// assert!((there.value - (1.0 - (-2.0_f64).exp())).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoucWen<N: Number> {
    /// Slope where the output is 0, A.
    pub rise: N,
    /// Coefficient of the dissipative term, beta.
    pub beta: N,
    /// Coefficient of the non-dissipative term, gamma.
    pub gamma: N,
    /// Exponent n, the sharpness of the transition to saturation; the same for all lanes.
    pub exponent: N::Lane,
}

/// State of the operator: its output and the slope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoucWenState<N> {
    /// Output, h.
    pub value: N,
    /// Slope of the output along the last section of the path.
    pub slope: N,
}

crate::snapshot!([N: crate::Snapshot] BoucWenState<N> { value, slope });

/// A state about to be left in one direction.
#[derive(Clone, Copy, Debug)]
pub struct BoucWenBranch<N> {
    /// Output counted along the direction.
    pub(super) along: N,
    pub(super) direction: N,
}

/// Longest piece with n = 1, times the rate: the series below are summed for it.
const PIECE: f64 = 0.5;
/// Longest piece with another exponent, times the rate: an error of 1e-8 of the change.
const SHORT_PIECE: f64 = 0.02;
/// Most pieces with n = 1: e^-40 of the distance to the limit is left after them.
const MOST_PIECES: usize = 80;
/// Most pieces with another exponent.
const MOST_SHORT_PIECES: usize = 2000;

impl Cast for BoucWen<Unfused> {
    type In<T: Real> = BoucWen<Unfused<T>>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        Ok(BoucWen {
            rise: Unfused(rounded("alpha", self.rise.0, "")?),
            beta: Unfused(rounded("beta", self.beta.0, "")?),
            gamma: Unfused(rounded("gamma", self.gamma.0, "")?),
            exponent: rounded("exponent", self.exponent, "")?,
        })
    }
}

impl<N: Number> BoucWen<N> {
    /// The output, counted along the direction of motion, after a path of length `length`.
    #[inline(always)]
    fn advance(&self, z: N, length: N) -> N {
        if self.is_exact() {
            return self.lead_exact(z, length);
        }
        let n = self.exponent;
        let arguments = [z, length, self.rise, self.beta, self.gamma];
        N::lanewise(arguments, move |[z, length, rise, beta, gamma]| {
            Bend { rise, beta, gamma, n }.advance(z, length)
        })
    }

    #[inline(always)]
    fn is_exact(&self) -> bool {
        (self.exponent - N::Lane::of(1.0)).abs() <= N::Lane::ZERO
    }

    /// n = 1, in pieces short enough for the series to converge: mostly one piece.
    #[inline(always)]
    fn lead_exact(&self, mut z: N, length: N) -> N {
        let rate = magnitude(self.beta) + magnitude(self.gamma);
        let longest = rate.like(PIECE) / rate;
        let mut left = length;
        for _ in 0..MOST_PIECES {
            let more = (left - longest).where_negative(left, longest);
            z = self.piece(z, more);
            left = left - more;
            if !(-left).any_negative() {
                return z;
            }
        }
        // A bounded output has reached its limit by now, or the rest is one exponential towards it;
        // any other grows without bound.
        let kappa = self.side(z, longest).mul_add(self.gamma, self.beta);
        let slope = kappa.mul_add(-z, self.rise);
        let moving = magnitude(slope * longest);
        let still = magnitude(z).mul_add(z.like(-1e-9), moving - z.each(N::Lane::MIN_POSITIVE));
        let rest = N::lanewise([z, slope, kappa, left], |[z, slope, kappa, left]| {
            let bounded = z - slope / kappa * (-kappa * left).exp_m1();
            if kappa > N::Lane::ZERO { bounded } else { N::Lane::INFINITY }
        });
        (-left).where_negative(still.where_negative(z, rest), z)
    }

    /// n = 1 over one piece: an exponential up to the sign change of z, another one beyond it.
    #[inline(always)]
    fn piece(&self, z: N, length: N) -> N {
        let side = self.side(z, length);
        let kappa = side.mul_add(self.gamma, self.beta);
        let slope = kappa.mul_add(-z, self.rise);
        let end = (slope * length).mul_add(growth::<_, TERMS>(-(kappa * length)), z);
        let crossed = side * end;
        if !crossed.any_negative() {
            return end;
        }
        // Where z = 0: 1 - exp(-kappa p) = -kappa z / slope
        let reach = -(z / slope);
        let zero_at = reach * logarithm(-(kappa * reach));
        let rest = length - zero_at;
        let kappa = self.beta - side * self.gamma;
        let beyond = (self.rise * rest) * growth::<_, TERMS>(-(kappa * rest));
        crossed.where_negative(beyond, end)
    }

    /// dz/dp at the beginning of a path of length `length`.
    #[inline(always)]
    fn slope(&self, z: N, length: N) -> N {
        let kappa = self.side(z, length).mul_add(self.gamma, self.beta);
        if self.is_exact() {
            return kappa.mul_add(-z, self.rise);
        }
        let n = self.exponent;
        N::lanewise([z, kappa, self.rise], move |[z, kappa, rise]| {
            Bend { rise, beta: kappa, gamma: N::Lane::ZERO, n }.slope(z, kappa)
        })
    }

    /// Sign of z at the beginning of a move; where z = 0, its sign right after the beginning.
    #[inline(always)]
    fn side(&self, z: N, length: N) -> N {
        let ahead = (self.rise * length).mul_add(z.like(1e-12), z);
        ahead.where_negative(z.like(-1.0), z.like(1.0))
    }
}

impl<N: Number> Operator<N> for BoucWen<N> {
    type State = BoucWenState<N>;
    type Branch = BoucWenBranch<N>;

    #[inline(always)]
    fn rest(&self) -> BoucWenState<N> {
        BoucWenState { value: self.rise.like(0.0), slope: self.rise }
    }

    #[inline(always)]
    fn output(&self, state: &BoucWenState<N>) -> (N, N) {
        (state.value, state.slope)
    }

    #[inline(always)]
    fn branch(&self, state: &BoucWenState<N>, direction: N) -> BoucWenBranch<N> {
        BoucWenBranch { along: direction * state.value, direction }
    }

    #[inline(always)]
    fn along(&self, branch: &BoucWenBranch<N>, distance: N) -> BoucWenState<N> {
        let BoucWenBranch { along, direction } = *branch;
        let length = direction * distance;
        let z = self.advance(along, length);
        BoucWenState { value: direction * z, slope: self.slope(z, length) }
    }
}

impl<N: Number> NonsmoothOperator<N> for BoucWen<N> {
    #[inline(always)]
    fn leaving(&self, state: &BoucWenState<N>, distance: N, direction: N) -> BoucWenState<N> {
        BoucWenState { slope: self.slope(direction * state.value, direction * distance), ..*state }
    }
}

/// The operator with an exponent other than 1, for scalars.
#[derive(Clone, Copy)]
struct Bend<T> {
    rise: T,
    beta: T,
    gamma: T,
    n: T,
}

impl<T: Real> Bend<T> {
    /// Runge-Kutta steps of fourth order along the path, their length limited by the decay rate.
    /// The distance to a sign change of z is found by quadrature over z.
    #[inline(never)]
    fn advance(self, mut z: T, length: T) -> T {
        let (zero, one) = (T::ZERO, T::of(1.0));
        let mut left = length;
        // The rate at the limit that z tends to, on one side of 0.
        let mut limit = (zero, zero);
        for _ in 0..MOST_SHORT_PIECES {
            let side = if z + T::of(1e-12) * self.rise * left < zero { -one } else { one };
            let kappa = self.beta + side * self.gamma;
            let power = z.abs().pow(self.n - one);
            // The rate where |z| is largest: here, or at the limit.
            let here = kappa.abs() * power;
            if limit.0 * side <= zero {
                let share = one / self.n;
                let rate = self.rise.abs().pow(one - share);
                limit = (side, rate * kappa.abs().pow(share));
            }
            let fastest = if here.is_nan() { limit.1 } else { here.larger(limit.1) };
            let longest = T::of(SHORT_PIECE) / (self.n * fastest);
            let more = if left < longest { left } else { longest };
            z = self.piece((z, power), more, side, kappa);
            left = left - more;
            // Written so that NaN ends the loop too.
            if left.partial_cmp(&zero) != Some(Ordering::Greater) {
                return z;
            }
        }
        // A bounded output has reached its limit by now; any other grows without bound.
        let kappa = self.beta + if z < zero { -self.gamma } else { self.gamma };
        let still = (self.slope(z, kappa) * left).abs() <= T::of(1e-4) * z.abs();
        if still { z } else { T::INFINITY }
    }

    /// One step from `z`, whose power of n - 1 is known.
    fn piece(self, (z, power): (T, T), length: T, side: T, kappa: T) -> T {
        let end = self.runge_kutta((z, power), length, kappa);
        if side * end >= T::ZERO {
            return end;
        }
        // dp/dz is smooth between z and 0: Boole's rule.
        let slowness = |part: f64| T::of(1.0) / self.slope(z * T::of(part), kappa);
        let sum = T::of(7.0) * (slowness(1.0) + slowness(0.0))
            + T::of(32.0) * (slowness(0.75) + slowness(0.25))
            + T::of(12.0) * slowness(0.5);
        let rest = length + z * sum / T::of(90.0);
        // n is above 1: the power of 0 is 0.
        self.runge_kutta((T::ZERO, T::ZERO), rest, self.beta - side * self.gamma)
    }

    fn runge_kutta(self, (z, power): (T, T), length: T, kappa: T) -> T {
        let (half, two) = (T::of(0.5), T::of(2.0));
        let k1 = self.rise - kappa * z * power;
        let k2 = self.slope(z + half * length * k1, kappa);
        let k3 = self.slope(z + half * length * k2, kappa);
        let k4 = self.slope(z + length * k3, kappa);
        z + length / T::of(6.0) * (k1 + two * (k2 + k3) + k4)
    }

    /// dz/dp.
    fn slope(self, z: T, kappa: T) -> T {
        self.rise - kappa * z * z.abs().pow(self.n - T::of(1.0))
    }
}

#[inline(always)]
fn magnitude<N: Number>(value: N) -> N {
    value.where_negative(-value, value)
}
