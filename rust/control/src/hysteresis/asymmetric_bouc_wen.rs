//! The Bouc-Wen operator whose rising and falling branches differ: drive in, hysteretic part out.
//!
//! ```text
//! h' = A u' - |h| psi u',   psi = beta sgn(u' h) + gamma + delta sgn(h) + epsilon sgn(u')
//! ```
//!
//! The generalised shape function of Song and Der Kiureghian 2006, J. Eng. Mech. 132(6), 610-618,
//! doi 10.1061/(ASCE)0733-9399(2006)132:6(610), with exponent 1, and without its three terms in the
//! sign of the input: of a drive that keeps its sign they are constant, or repeat the others. The
//! signs of u' and h have four combinations, and four coefficients give each of them a rate of its
//! own. With s the direction, p the length of the path and z = s h the output along it,
//!
//! ```text
//! dz/dp = A - kappa z,   kappa = (beta + s delta) + sgn(z) (gamma + s epsilon)
//! ```
//!
//! which is the symmetric operator with one pair of coefficients for each direction.

use super::{BoucWen, BoucWenBranch, BoucWenState, NonsmoothOperator, Operator};
use crate::{Number, Real};

/// Asymmetric Bouc-Wen operator.
///
/// It is passive where no sum of a rate away from h = 0 and the rate back is negative, and bounded
/// where both rates away from it are above 0: `beta + gamma` more than `|delta + epsilon|`.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `rise` | A | output per input | any |
/// | `beta` | beta | 1 over input | any |
/// | `gamma` | gamma | 1 over input | any |
/// | `asymmetry` | delta | 1 over input | any |
/// | `sign_asymmetry` | epsilon | 1 over input | any |
///
/// ```
/// use piezotrack_control::hysteresis::{AsymmetricBoucWen, Operator};
///
/// let hysteresis = AsymmetricBoucWen {
///     rise: 1.0,
///     beta: 0.5,
///     gamma: 0.5,
///     asymmetry: 0.25,
///     sign_asymmetry: 0.0,
/// };
/// let reached = |direction: f64| {
///     let branch = hysteresis.branch(&hysteresis.rest(), direction);
///     hysteresis.along(&branch, 100.0 * direction).value
/// };
/// assert!((reached(1.0) - 1.0 / 1.25).abs() < 1e-12);
/// assert!((reached(-1.0) + 1.0 / 0.75).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsymmetricBoucWen<N> {
    /// Slope where the output is 0, A.
    pub rise: N,
    /// Coefficient of the dissipative term, beta.
    pub beta: N,
    /// Coefficient of the non-dissipative term, gamma.
    pub gamma: N,
    /// By how much the rates are higher while the input rises, and lower while it falls, delta.
    pub asymmetry: N,
    /// By how much the rates are higher above h = 0, and lower below it, epsilon.
    pub sign_asymmetry: N,
}

impl<N: Number> AsymmetricBoucWen<N> {
    /// The symmetric operator that this one is as long as the input keeps its direction, +1 or -1.
    #[inline(always)]
    pub fn toward(&self, direction: N) -> BoucWen<N> {
        BoucWen {
            rise: self.rise,
            beta: direction.mul_add(self.asymmetry, self.beta),
            gamma: direction.mul_add(self.sign_asymmetry, self.gamma),
            exponent: N::Lane::of(1.0),
        }
    }
}

impl<N: Number> Operator<N> for AsymmetricBoucWen<N> {
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
        self.toward(branch.direction).along(branch, distance)
    }
}

impl<N: Number> NonsmoothOperator<N> for AsymmetricBoucWen<N> {
    #[inline(always)]
    fn leaving(&self, state: &BoucWenState<N>, distance: N, direction: N) -> BoucWenState<N> {
        self.toward(direction).leaving(state, distance, direction)
    }
}
