//! Disturbance observer around a feedback law.
//!
//! ```text
//! d = Q (Gn^-1 (y - r) - (u - uFF)),   uFB = uC - d,   Gn = g/(1 + T s),   Q = 1/(1 + s/wc)
//! ```
//!
//! After Ohnishi's disturbance observer, and Yi, Chang and Shen 2009 for the hysteresis of piezo
//! actuators, whose hysteresis is the disturbance of a linear nominal plant. Here plant and voltage
//! are counted from reference and feedforward: what a feedforward compensates, be it linear or the
//! inverse of the hysteresis, is not compensated twice. Without feedforward the two forms differ by
//! what the reference asks for only, and their loops are the same.
//!
//! Around a sliding mode law this is sliding mode control with perturbation estimation (Elmali and
//! Olgac 1992), in which the estimate takes the place of most of the switching gain.
//!
//! Sampled, with the voltage held: p = exp(-Ts/T), q = exp(-wc Ts),
//!
//! ```text
//! d[k] = q d[k-1] + (1 - q) (-(e[k] - p e[k-1])/(g (1 - p)) - (v[k-1] - uFF[k-1]))
//! ```
//!
//! where v is the voltage that was applied. While the command is clipped, the estimate takes no step
//! that makes it larger and moves the command further beyond the limit. A constant in the output of the law inside is not
//! observed: a law without an integral must not keep one, as an incremental PID does.

use core::f64::consts::TAU;

use crate::cast::{Cast, rounded};
use crate::error::{Result, check, finite, not_negative, positive};
use crate::feedback_law::{Feedback, FeedbackSample};
use crate::number::Real;

/// Nominal plant and filter of an observer, in continuous time.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `gain` | g | m/V | not 0 |
/// | `time` | T | s | >= 0 |
/// | `cutoff` | wc/(2 pi) | Hz | > 0, or infinite: no filter |
///
/// ```
/// use piezotrack_control::{DisturbanceObserver, Feedback, FeedbackSample};
///
/// let observer = DisturbanceObserver::new(1e-6, 0.0, f64::INFINITY)?;
/// let law = observer.around((), 0.001)?;
/// let mut state = law.rest();
/// law.step(&mut state, &FeedbackSample::new(0.0));
/// // 1 um short of the reference at 0 V: a disturbance of -1 V
/// let volts = law.step(&mut state, &FeedbackSample::new(1e-6));
/// assert!((volts - 1.0).abs() < 1e-12);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisturbanceObserver {
    gain: f64,
    time: f64,
    cutoff: f64,
}

impl DisturbanceObserver {
    /// Gain (m/V) and time constant (s) of the nominal plant, cutoff of the filter (Hz).
    ///
    /// # Errors
    /// Names the number that is out of its range.
    pub fn new(gain: f64, time: f64, cutoff: f64) -> Result<Self> {
        finite("plant_gain", gain, "m/V")?;
        check("plant_gain", gain, "m/V", gain.abs() > 0.0, "a gain other than 0")?;
        not_negative("plant_time", time, "s")?;
        let expected = "a frequency above 0, or infinity for no filter";
        check("cutoff", cutoff, "Hz", cutoff > 0.0, expected)?;
        Ok(Self { gain, time, cutoff })
    }

    /// The observer around the law `inner`, both for the sampling interval `dt`, s.
    ///
    /// # Errors
    /// Names `dt` where it is not above 0; `plant_gain` where a coefficient overflows.
    pub fn around<F>(&self, inner: F, dt: f64) -> Result<Observed<F>> {
        positive("dt", dt, "s")?;
        let fresh = -libm::expm1(-TAU * self.cutoff * dt);
        let rest = if self.time > 0.0 { -libm::expm1(-dt / self.time) } else { 1.0 };
        let inverse = 1.0 / (self.gain * rest);
        let expected = "a nominal plant whose sampled inverse is finite";
        check("plant_gain", self.gain, "m/V", inverse.is_finite() && fresh > 0.0, expected)?;
        Ok(Observed { inner, fresh, pole: 1.0 - rest, inverse })
    }
}

/// A feedback law with a disturbance observer, for one sampling interval; see
/// [`DisturbanceObserver::around`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observed<F, T = f64> {
    inner: F,
    /// 1 - q.
    fresh: T,
    /// p.
    pole: T,
    /// 1/(g (1 - p)), V/m.
    inverse: T,
}

/// State of an [`Observed`] law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedState<S, T = f64> {
    inner: S,
    /// d, V.
    disturbance: T,
    /// Error (m) and feedforward (V) of the last sample; `None` before the first.
    last: Option<[T; 2]>,
    /// Voltage to begin with, V.
    first: Option<T>,
    /// The last output, V.
    volts: T,
}

crate::snapshot!(
    [S: crate::Snapshot, T: Real]
    ObservedState<S, T> { inner, disturbance, last, first, volts }
);

impl<F: Cast> Cast for Observed<F> {
    type In<T: Real> = Observed<F::In<T>, T>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        Ok(Observed {
            inner: self.inner.cast()?,
            fresh: rounded("cutoff", self.fresh, "")?,
            pole: rounded("plant_time", self.pole, "")?,
            inverse: rounded("plant_gain", self.inverse, "V/m")?,
        })
    }
}

impl<F, T: Real> Observed<F, T> {
    /// The law inside.
    #[must_use]
    pub fn inner(&self) -> &F {
        &self.inner
    }

    /// 1 - q, p and 1/(g (1 - p)) in V/m.
    #[must_use]
    pub fn coefficients(&self) -> [T; 3] {
        [self.fresh, self.pole, self.inverse]
    }
}

impl<F: Feedback<T>, T: Real> Feedback<T> for Observed<F, T> {
    type State = ObservedState<F::State, T>;

    fn rest(&self) -> Self::State {
        let inner = self.inner.rest();
        ObservedState { inner, disturbance: T::ZERO, last: None, first: None, volts: T::ZERO }
    }

    fn start(&self, volts: T) -> Self::State {
        ObservedState { first: Some(volts), volts, ..self.rest() }
    }

    fn adopt(&self, before: &Self, state: &mut Self::State) -> bool {
        let same = self.coefficients() == before.coefficients();
        same && self.inner.adopt(&before.inner, &mut state.inner)
    }

    #[inline]
    fn step(&self, state: &mut Self::State, sample: &FeedbackSample<T>) -> T {
        let FeedbackSample { error, excess, applied, feedforward, .. } = *sample;
        if let Some([before, forward]) = state.last {
            let needed = -self.inverse * (error - self.pole * before);
            let found = needed - (applied - forward);
            let step = self.fresh * (found - state.disturbance);
            let next = state.disturbance + step;
            // One that gets smaller may step: it could keep the command clipped for ever otherwise.
            let outward = excess * step > T::ZERO && next.abs() > state.disturbance.abs();
            state.disturbance = if outward { state.disturbance } else { next };
        }
        let inside = self.inner.step(&mut state.inner, sample);
        if let Some(first) = state.first.take() {
            // A bumpless start is a disturbance that is forgotten as it is observed.
            state.disturbance = inside - first;
        }
        let volts = inside - state.disturbance;
        if volts.is_finite() {
            state.last = Some([error, feedforward]);
            state.volts = volts;
        } else {
            // Overflow: hold the output, and observe again from the next sample on.
            (state.disturbance, state.last) = (T::ZERO, None);
        }
        state.volts
    }
}
