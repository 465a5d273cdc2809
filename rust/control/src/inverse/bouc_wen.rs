//! Feedforward: the inverse of the Bouc-Wen stage, symmetric or not, sample by sample.
//!
//! ```text
//! d u - h(u) = y,   y = (m xd'' + b xd' + k xd)/k
//! ```
//!
//! from Xu and Li 2010, equations (19) and (20), doi 10.1115/1.4001712. The hysteresis h depends
//! on the drive u, so this is an implicit equation for u. Along a monotone section its left side
//! is a monotone function of u, and a few Newton steps solve it. Between two samples y is taken
//! to be monotone.

use super::Inverse;
use crate::cast::{Cast, rounded};
use crate::error::{Result, check, finite, not_negative, positive};
use crate::hysteresis::{AsymmetricBoucWen, BoucWen, BoucWenState, Operator};
use crate::unfused::Unfused;
use crate::{Number, Real};

/// A number of one lane: a real number, with fused multiply-add or without.
pub trait Scalar: Number {
    /// The number with this value.
    fn scalar(value: Self::Lane) -> Self;

    /// Its value.
    fn value(self) -> Self::Lane;
}

impl<T: Real> Scalar for T {
    #[inline(always)]
    fn scalar(value: T) -> T {
        value
    }

    #[inline(always)]
    fn value(self) -> T {
        self
    }
}

impl<T: Real> Scalar for Unfused<T> {
    #[inline(always)]
    fn scalar(value: T) -> Self {
        Self(value)
    }

    #[inline(always)]
    fn value(self) -> T {
        self.0
    }
}

/// Parameters of the inverse of a Bouc-Wen stage.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `mass`, `damping`, `stiffness` | m, b, k | kg, N s/m, N/m | >= 0, >= 0, > 0 |
/// | `piezo_coefficient` | d | m/V | not 0 |
/// | `alpha` | alpha | 1 | below 1, and see [`BoucWenInverse::new`] |
/// | `beta`, `gamma` | beta, gamma | 1/(V m^(n-1)) | beta + gamma >= 0, beta >= gamma |
/// | `exponent` | n | 1 | >= 1 |
///
/// Computed in `f64` with fused multiply-add; [`Cast::cast`] makes one without, in any real type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoucWenInverse<O = BoucWen<f64>, N: Number = f64> {
    mass: N::Lane,
    damping: N::Lane,
    stiffness: N::Lane,
    piezo_coefficient: N::Lane,
    operator: O,
}

/// Inverse of an asymmetric Bouc-Wen stage.
pub type AsymmetricBoucWenInverse<N = f64> = BoucWenInverse<AsymmetricBoucWen<N>, N>;

impl BoucWenInverse {
    /// The inverse of the stage with these parameters, in SI units.
    ///
    /// # Errors
    /// Names the parameter that is out of its range. `alpha` is refused where the left side of
    /// the equation is not increasing: the slope of the hysteresis, relative to d, is alpha at
    /// h = 0 and 2 alpha beta/(beta + gamma) after a reversal in saturation; both must stay
    /// below 1.
    #[expect(clippy::too_many_arguments, reason = "the stage's eight numbers, in their order")]
    pub fn new(
        mass: f64,
        damping: f64,
        stiffness: f64,
        piezo_coefficient: f64,
        alpha: f64,
        beta: f64,
        gamma: f64,
        exponent: f64,
    ) -> Result<Self> {
        finite("beta", beta, "1/V")?;
        finite("gamma", gamma, "1/V")?;
        let passive = gamma.abs() <= beta;
        check("gamma", gamma, "1/V", passive, "a value within +-beta, for an inverse")?;
        let right = finite("alpha", alpha, "")?.max(steepest(alpha, beta, gamma)) < 1.0;
        let expected = "alpha and 2 alpha beta/(beta + gamma) below 1, for an inverse";
        check("alpha", alpha, "", right && alpha >= 0.0, expected)?;
        let right = exponent >= 1.0 && exponent.is_finite();
        check("exponent", exponent, "", right, "a finite number, 1 or above")?;
        let rise = alpha * piezo_coefficient;
        let operator = BoucWen { rise, beta, gamma, exponent };
        Self::with([mass, damping, stiffness, piezo_coefficient], operator)
    }
}

impl AsymmetricBoucWenInverse {
    /// The inverse of the stage with this mass (kg), damping (N s/m), stiffness (N/m) and piezo
    /// coefficient (m/V), with alpha, and with beta, gamma, delta and epsilon (1/V).
    ///
    /// # Errors
    /// Names the parameter that is out of its range: `sign_asymmetry` where one of the four rates
    /// is below 0, `alpha` as in [`BoucWenInverse::new`], with the rates above h = 0 and with those
    /// below it.
    pub fn asymmetric(
        [mass, damping, stiffness, piezo_coefficient]: [f64; 4],
        alpha: f64,
        [beta, gamma, delta, epsilon]: [f64; 4],
    ) -> Result<Self> {
        finite("beta", beta, "1/V")?;
        finite("gamma", gamma, "1/V")?;
        finite("asymmetry", delta, "1/V")?;
        finite("sign_asymmetry", epsilon, "1/V")?;
        // A loop above h = 0 goes away from it rising and back falling, one below it the other way.
        let sides = [(beta + epsilon, gamma + delta), (beta - epsilon, gamma - delta)];
        let right = sides.iter().all(|(beta, gamma)| gamma.abs() <= *beta);
        let expected = "asymmetries with which no rate beta +- epsilon +- (gamma + delta) or \
                        beta - epsilon +- (gamma - delta) is negative, for an inverse";
        check("sign_asymmetry", epsilon, "1/V", right, expected)?;
        let slopes = sides.map(|(beta, gamma)| steepest(alpha, beta, gamma));
        let right = finite("alpha", alpha, "")?.max(slopes[0]).max(slopes[1]) < 1.0;
        let expected = "alpha and 2 alpha beta/(beta + gamma) below 1, above and below h = 0, for \
                        an inverse";
        check("alpha", alpha, "", right && alpha >= 0.0, expected)?;
        let operator = AsymmetricBoucWen {
            rise: alpha * piezo_coefficient,
            beta,
            gamma,
            asymmetry: delta,
            sign_asymmetry: epsilon,
        };
        Self::with([mass, damping, stiffness, piezo_coefficient], operator)
    }
}

/// Slope of the hysteresis relative to d after a reversal in saturation.
fn steepest(alpha: f64, beta: f64, gamma: f64) -> f64 {
    let limit = beta + gamma;
    if limit > 0.0 { 2.0 * alpha * beta / limit } else { alpha }
}

impl<O: Operator<f64, State = BoucWenState<f64>>> BoucWenInverse<O> {
    fn with([mass, damping, stiffness, piezo_coefficient]: [f64; 4], operator: O) -> Result<Self> {
        finite("piezo_coefficient", piezo_coefficient, "m/V")?;
        let right = piezo_coefficient.abs() > 0.0;
        check("piezo_coefficient", piezo_coefficient, "m/V", right, "a value other than 0")?;
        Ok(Self {
            mass: not_negative("mass", mass, "kg")?,
            damping: not_negative("damping", damping, "N s/m")?,
            stiffness: positive("stiffness", stiffness, "N/m")?,
            piezo_coefficient,
            operator,
        })
    }
}

impl<O> BoucWenInverse<O> {
    fn rounded<T: Real, P>(&self, operator: P) -> Result<BoucWenInverse<P, Unfused<T>>> {
        Ok(BoucWenInverse {
            mass: rounded("mass", self.mass, "kg")?,
            damping: rounded("damping", self.damping, "N s/m")?,
            stiffness: rounded("stiffness", self.stiffness, "N/m")?,
            piezo_coefficient: rounded("piezo_coefficient", self.piezo_coefficient, "m/V")?,
            operator,
        })
    }
}

/// Without fused multiply-add.
impl Cast for BoucWenInverse {
    type In<T: Real> = BoucWenInverse<BoucWen<Unfused<T>>, Unfused<T>>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        let BoucWen { rise, beta, gamma, exponent } = self.operator;
        let [rise, beta, gamma] = [rise, beta, gamma].map(Unfused);
        self.rounded(BoucWen { rise, beta, gamma, exponent }.cast()?)
    }
}

/// Without fused multiply-add.
impl Cast for AsymmetricBoucWenInverse {
    type In<T: Real> = AsymmetricBoucWenInverse<Unfused<T>>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        let of = |name, value| Ok(Unfused(rounded(name, value, "")?));
        self.rounded(AsymmetricBoucWen {
            rise: of("alpha", self.operator.rise)?,
            beta: of("beta", self.operator.beta)?,
            gamma: of("gamma", self.operator.gamma)?,
            asymmetry: of("asymmetry", self.operator.asymmetry)?,
            sign_asymmetry: of("sign_asymmetry", self.operator.sign_asymmetry)?,
        })
    }
}

impl<N: Scalar, O: Operator<N, State = BoucWenState<N>>> BoucWenInverse<O, N> {
    /// The state for a stage at rest that never moved.
    #[must_use]
    pub fn rest(&self) -> BoucWenInverseState<N> {
        BoucWenInverseState { u: N::scalar(N::Lane::ZERO), memory: self.operator.rest() }
    }

    /// The voltage for displacement `x` (m), velocity `v` (m/s) and acceleration `a` (m/s^2) of
    /// the reference.
    ///
    /// NaN, with the state unchanged, where an input is not finite (or beyond 1e100), the
    /// iteration did not converge or the voltage is not finite; a controller holds its feedforward then.
    #[inline]
    pub fn step(
        &self,
        state: &mut BoucWenInverseState<N>,
        x: N::Lane,
        v: N::Lane,
        a: N::Lane,
    ) -> N::Lane {
        if !(x.is_usable() && v.is_usable() && a.is_usable()) {
            return N::Lane::NAN;
        }
        let (zero, one) = (N::Lane::ZERO, N::Lane::of(1.0));
        let near = N::Lane::of(1e-15).larger(N::Lane::of(4.0) * N::Lane::EPSILON);
        let (last, value) = (state.u.value(), state.memory.value.value());
        let d = self.piezo_coefficient;
        let wanted = (self.mass * a + self.damping * v) / self.stiffness + x;
        let rise = wanted - (d * last - value);
        // The change of u without hysteresis: a lower bound of its size, for alpha >= 0.
        let plain = rise / d;
        let direction = if plain < zero { -one } else { one };
        let branch = self.operator.branch(&state.memory, N::scalar(direction));
        let (mut low, mut high) = (zero, N::Lane::INFINITY);
        let mut way = plain.abs();
        for _ in 0..MOST_TRIES {
            let there = self.operator.along(&branch, N::scalar(direction * way));
            let short = rise - (d * direction * way - (there.value.value() - value));
            if !short.is_finite() {
                return N::Lane::NAN;
            }
            let done = short.abs() <= near * (wanted.abs() + (d * last).abs());
            if short / d * direction > zero {
                low = way;
            } else {
                high = way;
            }
            let newton = way + short / (d - there.slope.value()) * direction;
            let inside = newton > low && newton < high;
            let beyond = high.smaller(N::Lane::of(2.0) * way + one);
            let next = if inside { newton } else { N::Lane::of(0.5) * (low + beyond) };
            if done || (next - way).abs() <= near * (way + last.abs()) {
                let u = last + direction * way;
                if !u.is_finite() {
                    return N::Lane::NAN;
                }
                *state = BoucWenInverseState { u: N::scalar(u), memory: there };
                return u;
            }
            way = next;
        }
        N::Lane::NAN
    }
}

/// Most iterations: Newton steps, or bisection where a Newton step leaves the bracket.
const MOST_TRIES: usize = 100;

/// State of a [`BoucWenInverse`]: the last drive (V) and the state of the operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoucWenInverseState<N = f64> {
    u: N,
    memory: BoucWenState<N>,
}

crate::snapshot!([N: crate::Snapshot] BoucWenInverseState<N> { u, memory });

impl<N: Scalar, O: Operator<N, State = BoucWenState<N>>> Inverse<N::Lane> for BoucWenInverse<O, N> {
    type State = BoucWenInverseState<N>;

    fn rest(&self) -> Self::State {
        self.rest()
    }

    #[inline]
    fn step(&self, state: &mut Self::State, x: N::Lane, v: N::Lane, a: N::Lane) -> N::Lane {
        self.step(state, x, v, a)
    }
}
