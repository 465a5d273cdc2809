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
//! a closed form too, and another exponential beyond it. For any other exponent power series of the
//! solution are summed.

use super::power_series::{LENGTH, PowerSeries};
use super::series::{TERMS, growth, logarithm, power};
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
/// Longest piece with another exponent, times the rate: the error is below 1e-9 of the change.
const SHORT_PIECE: f64 = 0.15;
/// Share of the slope A that the decay takes from it where z counts as near 0.
const NEAR: f64 = 0.1;
/// Terms of the series of the path near 0: the next is below `NEAR`^16 / 17 = 6e-18.
const PATH_TERMS: usize = 16;
/// Most pieces with n = 1: e^-40 of the distance to the limit is left after them.
const MOST_PIECES: usize = 80;
/// Most pieces with another exponent.
const MOST_SHORT_PIECES: usize = 250;

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
        if self.is_exact() { self.lead_exact(z, length) } else { self.lead_bent(z, length) }
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

    /// Another n: power series in the path, through z = 0 those of [`Self::through_zero`].
    #[inline(always)]
    fn lead_bent(&self, mut z: N, length: N) -> N {
        let (zero, one) = (z.like(0.0), z.like(1.0));
        let mut left = length;
        for _ in 0..MOST_SHORT_PIECES {
            let bent = z * self.bent(z);
            let kappa = self.side(z, left).mul_add(self.gamma, self.beta);
            let far = magnitude(kappa * bent) - z.like(NEAR) * magnitude(self.rise);
            // NaN is far.
            let far = far.where_negative(-one, one);
            let [mut end, mut more] = [z, left];
            if (-far).any_negative() {
                [end, more] = self.away_from_zero([z, bent], kappa, left);
            }
            if far.any_negative() {
                let near = self.through_zero(z, kappa * bent, left);
                end = far.where_negative(near[0], end);
                more = far.where_negative(near[1], more);
            }
            // Other lanes may be at their ends.
            z = (-left).where_negative(end, z);
            left = left - more;
            if !(-left).any_negative() {
                return z;
            }
        }
        // A bounded output has reached its limit by now; any other grows without bound.
        let moving = magnitude(self.slope(z, zero) * left);
        let still = magnitude(z).mul_add(z.like(1e-4), -moving);
        let end = still.where_negative(z.each(N::Lane::INFINITY), z);
        (-left).where_negative(end, z)
    }

    /// |z|^(n-1)
    #[inline(always)]
    fn bent(&self, z: N) -> N {
        power(magnitude(z), self.exponent - N::Lane::of(1.0))
    }

    /// Output and length of one piece, from z that is not 0 and from z |z|^(n-1): the power series of
    /// z in the path.
    ///
    /// That of the power follows from z v' = n v z'.
    #[inline(always)]
    fn away_from_zero(&self, [z, bent]: [N; 2], kappa: N, left: N) -> [N; 2] {
        let n = self.exponent;
        let least = z.each(N::Lane::MIN_POSITIVE);
        let inverse = z.like(1.0) / (magnitude(z) - least).where_negative(least, z);
        let slope = kappa.mul_add(-bent, self.rise);
        // Of the decay, and of z itself, which must not come near 0 or change its power much.
        let decay = z.each(n) * magnitude(kappa * bent * inverse);
        let change = z.each((n * N::Lane::of(0.5)).larger(N::Lane::of(1.0)));
        let longest = z.like(SHORT_PIECE) / decay.larger(change * magnitude(slope * inverse));
        let more = (left - longest).where_negative(left, longest);
        let mut series = PowerSeries::new(z, bent);
        series.integrate(slope * more);
        for _ in 1..LENGTH - 1 {
            let rate = kappa * series.raise(n, inverse);
            series.integrate(-rate * more);
        }
        [series.sum(), more]
    }

    /// Output and length of one piece from near z = 0, given the decrease kappa z |z|^(n-1) of the
    /// slope.
    ///
    /// With p counted from where z = 0, z is A p times a power series in s = kappa p |A p|^(n-1), and
    /// p is z/A times one in r = kappa z |z|^(n-1)/A.
    #[inline(always)]
    fn through_zero(&self, z: N, decrease: N, left: N) -> [N; 2] {
        let (one, n) = (N::Lane::of(1.0), self.exponent);
        let mut parts = [one; PATH_TERMS];
        let mut multiple = one;
        for part in &mut parts {
            *part = one / multiple;
            multiple = multiple + n;
        }
        let r = decrease / self.rise;
        let mut sum = z.each(parts[PATH_TERMS - 1]);
        for part in parts[..PATH_TERMS - 1].iter().rev() {
            sum = sum.mul_add(r, z.each(*part));
        }
        let from = z / self.rise * sum;
        let mut to = from + left;
        let mut more = left;
        let kappa = (self.rise * to).where_negative(self.beta - self.gamma, self.beta + self.gamma);
        let mut s = kappa * to * self.bent(self.rise * to);
        let widest = z.like(2.0 * NEAR);
        let room = widest - magnitude(s);
        if room.any_negative() {
            let share = widest / magnitude(s);
            to = room.where_negative(to * power(share, one / n), to);
            s = room.where_negative(s * share, s);
            more = room.where_negative(to - from, more);
        }
        let mut series = PowerSeries::new(z.like(1.0), z.like(1.0));
        series.push(-s * z.each(parts[1]));
        for part in &parts[2..LENGTH] {
            let power = series.raise(n, z.like(1.0));
            series.push(-s * power * z.each(*part));
        }
        [self.rise * to * series.sum(), more]
    }

    /// dz/dp at the beginning of a path of length `length`.
    #[inline(always)]
    fn slope(&self, z: N, length: N) -> N {
        let kappa = self.side(z, length).mul_add(self.gamma, self.beta);
        if self.is_exact() {
            return kappa.mul_add(-z, self.rise);
        }
        (kappa * z).mul_add(-self.bent(z), self.rise)
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

#[inline(always)]
fn magnitude<N: Number>(value: N) -> N {
    value.where_negative(-value, value)
}
