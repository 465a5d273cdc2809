//! Feedforward: the inverse of a stage whose hysteresis acts on the displacement, sample by sample.
//!
//! ```text
//! uFF = (M xd'' + D xd' + K xd + F(xd))/T
//! ```
//!
//! Xu and Li 2010, equation (21), doi 10.1115/1.4001712, for first-order Dahl friction, one
//! element or several, and the Bouc-Wen oscillator: the force F depends on the path of the reference only, so the inverse is
//! explicit. Reversals between two samples are treated as in [`crate::DahlInverse`].

use super::Inverse;
use crate::cast::{Cast, rounded};
use crate::cubic_segment::{is_straight, legs};
use crate::error::{Result, check, finite, not_negative, positive};
use crate::hysteresis::{
    BoucWen, BoucWenState, FRICTION_ELEMENTS, FirstOrderDahl, Operator, ParallelDahl,
};
use crate::number::Real;
use crate::unfused::Unfused;

/// Inverse of a stage with first-order Dahl friction.
pub type FirstOrderDahlInverse<T = f64> = FeedbackInverse<FirstOrderDahl<Unfused<T>>, T>;

/// Inverse of a stage with first-order Dahl elements in parallel.
pub type ParallelDahlInverse<T = f64> = FeedbackInverse<ParallelDahl<Unfused<T>>, T>;

/// Inverse of a Bouc-Wen oscillator; its drive is a force, N.
pub type OscillatorInverse<T = f64> = FeedbackInverse<BoucWen<Unfused<T>>, T>;

/// Inverse of a stage with the operator `O` in feedback, for one sampling interval.
///
/// ```
/// use piezotrack_control::FirstOrderDahlInverse;
///
/// let inverse = FirstOrderDahlInverse::new(0.18, 50.0, 2.6e4, 0.0468, (1e4, 0.3, 1.0), 2e-4)?;
/// let mut state = inverse.rest();
/// let volts = inverse.step(&mut state, 1e-6, 0.0, 0.0);
/// assert!(volts > 2.6e4 * 1e-6 / 0.0468);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FeedbackInverse<O, T = f64> {
    /// M/T, D/T and K/T.
    inertia: T,
    damping: T,
    stiffness: T,
    /// T, N for one unit of the drive.
    gain: T,
    operator: O,
    dt: T,
}

/// State of a [`FeedbackInverse`]: the last sample of the reference and the operator's state.
#[derive(Clone, Copy, Debug)]
pub struct FeedbackInverseState<M = BoucWenState<Unfused>, T = f64> {
    x: T,
    /// x' times the sampling interval, m; `None` before the first sample.
    w: Option<T>,
    memory: M,
}

crate::snapshot!([M: crate::Snapshot, T: Real] FeedbackInverseState<M, T> { x, w, memory });

impl FirstOrderDahlInverse {
    /// The inverse of the stage with this mass (kg), damping (N s/m), stiffness (N/m) and piezo
    /// coefficient (N/V), and with rest stiffness (N/m), Coulomb force (N) and exponent of the
    /// friction, for samples every `dt` seconds.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(
        mass: f64,
        damping: f64,
        stiffness: f64,
        piezo_coefficient: f64,
        (rest_stiffness, coulomb_force, exponent): (f64, f64, f64),
        dt: f64,
    ) -> Result<Self> {
        let operator = FirstOrderDahl {
            rest_stiffness: Unfused(not_negative("rest_stiffness", rest_stiffness, "N/m")?),
            coulomb_force: Unfused(positive("coulomb_force", coulomb_force, "N")?),
            exponent: not_negative("exponent", exponent, "")?,
        };
        Self::with([mass, damping, stiffness], not_zero(piezo_coefficient)?, operator, dt)
    }
}

impl ParallelDahlInverse {
    /// The inverse of the stage with this mass (kg), damping (N s/m), stiffness (N/m) and piezo
    /// coefficient (N/V), and with rest stiffnesses (N/m), shortest yield path (m) and ratio of
    /// the paths of the friction, as in [`ParallelDahl::geometric`], for samples every `dt` seconds.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(
        mass: f64,
        damping: f64,
        stiffness: f64,
        piezo_coefficient: f64,
        (rest_stiffnesses, yield_path, path_ratio): ([f64; FRICTION_ELEMENTS], f64, f64),
        dt: f64,
    ) -> Result<Self> {
        for one in rest_stiffnesses {
            not_negative("rest_stiffness", one, "N/m")?;
        }
        let operator = ParallelDahl::geometric(
            rest_stiffnesses.map(Unfused),
            Unfused(positive("yield_path", yield_path, "m")?),
            Unfused(positive("path_ratio", path_ratio, "")?),
        );
        Self::with([mass, damping, stiffness], not_zero(piezo_coefficient)?, operator, dt)
    }
}

impl OscillatorInverse {
    /// The inverse of the oscillator with this mass (kg), damping (N s/m) and stiffness (N/m), and
    /// with alpha (N/m), beta gamma (1/m), beta delta (1/m) and exponent of the hysteresis, for
    /// samples every `dt` seconds.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(
        mass: f64,
        damping: f64,
        stiffness: f64,
        (alpha, dissipating, storing, exponent): (f64, f64, f64, f64),
        dt: f64,
    ) -> Result<Self> {
        let right = exponent >= 1.0 && exponent.is_finite();
        let operator = BoucWen {
            rise: Unfused(finite("alpha", alpha, "N/m")?),
            beta: Unfused(finite("beta gamma", dissipating, "1/m")?),
            gamma: Unfused(finite("beta delta", storing, "1/m")?),
            exponent: check("exponent", exponent, "", right, "1 or more")?,
        };
        Self::with([mass, damping, stiffness], 1.0, operator, dt)
    }
}

/// A piezo coefficient that drives.
pub(super) fn not_zero(piezo_coefficient: f64) -> Result<f64> {
    finite("piezo_coefficient", piezo_coefficient, "N/V")?;
    let right = piezo_coefficient.abs() > 0.0;
    check("piezo_coefficient", piezo_coefficient, "N/V", right, "a value other than 0")
}

impl<O: Operator<Unfused>> FeedbackInverse<O> {
    fn with([mass, damping, stiffness]: [f64; 3], gain: f64, operator: O, dt: f64) -> Result<Self> {
        Ok(Self {
            inertia: not_negative("mass", mass, "kg")? / gain,
            damping: not_negative("damping", damping, "N s/m")? / gain,
            stiffness: not_negative("stiffness", stiffness, "N/m")? / gain,
            gain,
            operator,
            dt: positive("dt", dt, "s")?,
        })
    }
}

impl<O: Cast> Cast for FeedbackInverse<O> {
    type In<T: Real> = FeedbackInverse<O::In<T>, T>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        Ok(FeedbackInverse {
            inertia: rounded("mass", self.inertia, "")?,
            damping: rounded("damping", self.damping, "")?,
            stiffness: rounded("stiffness", self.stiffness, "")?,
            gain: rounded("piezo_coefficient", self.gain, "N/V")?,
            operator: self.operator.cast()?,
            dt: rounded("dt", self.dt, "s")?,
        })
    }
}

impl<O: Operator<Unfused<T>>, T: Real> FeedbackInverse<O, T> {
    /// The state for a stage at rest at 0 that never moved.
    #[must_use]
    pub fn rest(&self) -> FeedbackInverseState<O::State, T> {
        FeedbackInverseState { x: T::ZERO, w: None, memory: self.operator.rest() }
    }

    /// The drive for displacement `x` (m), velocity `v` (m/s) and acceleration `a` (m/s^2) of the
    /// reference. The first sample is taken to be reached in a monotone move from 0.
    ///
    /// NaN, with the state unchanged, where an input is not finite (or beyond 1e100), or the
    /// hysteresis force grows without bound; a controller holds its feedforward then.
    pub fn step(&self, state: &mut FeedbackInverseState<O::State, T>, x: T, v: T, a: T) -> T {
        if !(x.is_usable() && v.is_usable() && a.is_usable()) {
            return T::NAN;
        }
        let (rise, w) = (x - state.x, v * self.dt);
        let legs = match state.w {
            Some(w0) if !is_straight(w0, rise, w) => legs(w0, rise, w),
            _ => [rise, T::ZERO, T::ZERO],
        };
        let memory = legs.iter().fold(state.memory, |memory, &leg| {
            if leg == T::ZERO {
                return memory;
            }
            let branch = self.operator.branch(&memory, Unfused(T::of(1.0).copysign(leg)));
            self.operator.along(&branch, Unfused(leg))
        });
        let linear = self.inertia * a + self.damping * v + self.stiffness * x;
        let drive = linear + self.operator.output(&memory).0.0 / self.gain;
        if !drive.is_finite() {
            return T::NAN;
        }
        *state = FeedbackInverseState { x, w: Some(w), memory };
        drive
    }
}

impl<O: Operator<Unfused<T>>, T: Real> Inverse<T> for FeedbackInverse<O, T> {
    type State = FeedbackInverseState<O::State, T>;

    fn rest(&self) -> Self::State {
        self.rest()
    }

    #[inline]
    fn step(&self, state: &mut Self::State, x: T, v: T, a: T) -> T {
        self.step(state, x, v, a)
    }
}
