//! The first-order Dahl operator: displacement in, friction force out.
//!
//! ```text
//! dF/dx = sigma |1 - F sgn(x')/Fc|^i sgn(1 - F sgn(x')/Fc)
//! ```
//!
//! Dahl 1968, "A solid friction model", Aerospace Corporation TOR-0158(3107-18)-1, and Dahl 1976,
//! equation (1), doi 10.2514/3.61511. With w = 1 - F sgn(x')/Fc, the normalised distance to the
//! Coulomb force in the direction of motion, and p the length of the path,
//!
//! ```text
//! dw/dp = -(sigma/Fc) |w|^i sgn(w)
//! ```
//!
//! This has a closed form for every i: an exponential for i = 1, a power for any other i. The
//! force stays within +-Fc, the influence of the initial state decays along the path, and loops
//! close.

use super::decay::decay;
use super::{BoucWenBranch, BoucWenState, NonsmoothOperator, Operator};
use crate::cast::{Cast, rounded};
use crate::error::Result;
use crate::unfused::Unfused;
use crate::{Number, Real};

/// First-order Dahl operator.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `rest_stiffness` | sigma | N/m | >= 0 |
/// | `coulomb_force` | Fc | N | > 0 |
/// | `exponent` | i | 1 | >= 0 |
///
/// ```
/// use piezotrack_control::hysteresis::{FirstOrderDahl, Operator};
///
/// let friction = FirstOrderDahl { rest_stiffness: 2.0, coulomb_force: 4.0, exponent: 1.0 };
/// let up = friction.branch(&friction.rest(), 1.0);
/// let there = friction.along(&up, 3.0);
/// assert!((there.value - 4.0 * (1.0 - (-1.5_f64).exp())).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrderDahl<N: Number> {
    /// Slope where the force is 0, sigma.
    pub rest_stiffness: N,
    /// Coulomb force Fc, reached after a long path in one direction.
    pub coulomb_force: N,
    /// Exponent i, the shape of the transition; the same for all lanes.
    pub exponent: N::Lane,
}

impl Cast for FirstOrderDahl<Unfused> {
    type In<T: Real> = FirstOrderDahl<Unfused<T>>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        Ok(FirstOrderDahl {
            rest_stiffness: Unfused(rounded("rest_stiffness", self.rest_stiffness.0, "N/m")?),
            coulomb_force: Unfused(rounded("coulomb_force", self.coulomb_force.0, "N")?),
            exponent: rounded("exponent", self.exponent, "")?,
        })
    }
}

impl<N: Number> FirstOrderDahl<N> {
    #[inline(always)]
    fn is_exponential(&self) -> bool {
        (self.exponent - N::Lane::of(1.0)).abs() <= N::Lane::ZERO
    }

    /// dF/dx at a force counted along the direction of motion.
    #[inline(always)]
    fn slope(&self, force: N) -> N {
        if self.is_exponential() {
            return self.rest_stiffness / self.coulomb_force * (self.coulomb_force - force);
        }
        let i = self.exponent;
        N::lanewise([force, self.rest_stiffness, self.coulomb_force], move |[f, sigma, limit]| {
            sigma * power(N::Lane::of(1.0) - f / limit, i)
        })
    }
}

impl<N: Number> Operator<N> for FirstOrderDahl<N> {
    type State = BoucWenState<N>;
    type Branch = BoucWenBranch<N>;

    #[inline(always)]
    fn rest(&self) -> BoucWenState<N> {
        BoucWenState { value: self.rest_stiffness.like(0.0), slope: self.rest_stiffness }
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
        if self.is_exponential() {
            let path = self.rest_stiffness / self.coulomb_force * (direction * distance);
            let force = (along - self.coulomb_force).mul_add(decay(path), along);
            return BoucWenState { value: direction * force, slope: self.slope(force) };
        }
        let i = self.exponent;
        let arguments = [along, direction * distance, self.rest_stiffness, self.coulomb_force];
        let force = N::lanewise(arguments, move |[f, length, sigma, limit]| {
            let left = N::Lane::of(1.0) - f / limit;
            // In this form a path of length 0 leaves the force unchanged to the last bit.
            f + limit * (left - remainder(left, sigma * length / limit, i))
        });
        BoucWenState { value: direction * force, slope: self.slope(force) }
    }
}

impl<N: Number> NonsmoothOperator<N> for FirstOrderDahl<N> {
    #[inline(always)]
    fn leaving(&self, state: &BoucWenState<N>, _distance: N, direction: N) -> BoucWenState<N> {
        BoucWenState { slope: self.slope(direction * state.value), ..*state }
    }
}

/// |w|^i sgn(w), 0 at the limit also for i = 0.
fn power<T: Real>(w: T, i: T) -> T {
    let share = if w.abs() > T::ZERO { w.abs().pow(i) } else { T::ZERO };
    share.copysign(w)
}

/// w after a path of `length` times Fc/sigma that begins at w = `left`, for i other than 1.
fn remainder<T: Real>(left: T, length: T, i: T) -> T {
    let (size, one) = (left.abs(), T::of(1.0));
    if size <= T::ZERO {
        return left;
    }
    // |w|^(1-i) falls by (1 - i) length; below 0 the limit has been reached.
    let change = (i - one) * size.pow(i - one) * length;
    if change <= -one {
        return T::ZERO;
    }
    left * (change.ln_1p() / (one - i)).exp()
}
