//! Sliding mode control with a boundary layer, around a feedforward.
//!
//! ```text
//! s = e + Td de/dt + (1/Ti) integral of e,   uFB = eta sat(s/phi)
//! ```
//!
//! Slotine and Li 1991, Applied Nonlinear Control, chapter 7: surface, saturation function in place
//! of the sign, and integral of the error. The surface is in metres, so that eta/phi is the gain in
//! V/m inside the boundary layer; there the law is linear, a PID with filtered derivative. The
//! feedforward is the equivalent control: eta bounds what it leaves to the feedback.

use crate::cast::{Cast, rounded};
use crate::error::{Result, check, not_negative, positive};
use crate::feedback_law::{Feedback, FeedbackSample};
use crate::number::Real;

/// Sliding mode control in continuous time.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `switching` | eta | V | > 0 |
/// | `layer` | phi | m | > 0 |
/// | `ti` | Ti | s | > 0, or infinite: no integral |
/// | `td` | Td | s | >= 0 |
/// | `tf` | Tf | s | >= 0, time constant of the derivative's filter |
///
/// ```
/// use piezotrack_control::{Feedback, FeedbackSample, SlidingMode};
///
/// let law = SlidingMode::new(2.0, 1e-6, f64::INFINITY, 0.0, 0.0)?.at(0.001)?;
/// let mut state = law.rest();
/// assert_eq!(law.step(&mut state, &FeedbackSample::new(0.5e-6)), 1.0);
/// assert_eq!(law.step(&mut state, &FeedbackSample::new(-9e-6)), -2.0);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlidingMode {
    switching: f64,
    layer: f64,
    ti: f64,
    td: f64,
    tf: f64,
}

impl SlidingMode {
    /// Switching gain (V), boundary layer (m) and times (s).
    ///
    /// # Errors
    /// Names the number that is out of its range.
    pub fn new(switching: f64, layer: f64, ti: f64, td: f64, tf: f64) -> Result<Self> {
        Ok(Self {
            switching: positive("switching", switching, "V")?,
            layer: positive("layer", layer, "m")?,
            ti: check("ti", ti, "s", ti > 0.0, "a time above 0, or infinity for no integral")?,
            td: not_negative("td", td, "s")?,
            tf: not_negative("tf", tf, "s")?,
        })
    }

    /// The law for a sampling interval `dt`, s.
    ///
    /// # Errors
    /// Names `dt` where it is not above 0; `layer` where a coefficient overflows.
    pub fn at(&self, dt: f64) -> Result<SampledSlidingMode> {
        positive("dt", dt, "s")?;
        let fresh = if self.tf > 0.0 { -libm::expm1(-dt / self.tf) } else { 1.0 };
        let law = SampledSlidingMode {
            switching: self.switching,
            gain: self.switching / self.layer,
            integral: dt / self.ti,
            derivative: self.td / dt,
            fresh,
        };
        let largest = law.gain * (1.0 + law.integral + law.derivative);
        let right = largest.is_finite() && fresh > 0.0;
        check("layer", self.layer, "m", right, "a layer and times with finite coefficients")?;
        Ok(law)
    }
}

/// Coefficients of sliding mode control for one sampling interval; see [`SlidingMode::at`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledSlidingMode<T = f64> {
    /// eta, V.
    switching: T,
    /// eta/phi, V/m.
    gain: T,
    /// Ts/Ti.
    integral: T,
    /// Td/Ts.
    derivative: T,
    /// Share of a new difference that enters the filtered one.
    fresh: T,
}

/// State of sliding mode control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlidingModeState<T = f64> {
    /// Integral part of the surface, m.
    integral: T,
    /// Filtered change of the error in a sample, m.
    change: T,
    /// The last error, m; `None` before the first.
    error: Option<T>,
    /// Voltage to begin with, V, and then the part of it beyond the switching gain.
    base: T,
    /// The last output, V.
    volts: T,
}

crate::snapshot!([T: Real] SlidingModeState<T> { integral, change, error, base, volts });

impl Cast for SampledSlidingMode {
    type In<T: Real> = SampledSlidingMode<T>;

    fn cast<T: Real>(&self) -> Result<SampledSlidingMode<T>> {
        Ok(SampledSlidingMode {
            switching: rounded("switching", self.switching, "V")?,
            gain: rounded("layer", self.gain, "V/m")?,
            integral: rounded("ti", self.integral, "")?,
            derivative: rounded("td", self.derivative, "")?,
            fresh: rounded("tf", self.fresh, "")?,
        })
    }
}

impl<T: Real> SampledSlidingMode<T> {
    /// eta/phi in V/m, Ts/Ti, Td/Ts and the share of a new difference in the filtered one: the law
    /// inside its boundary layer.
    #[must_use]
    pub fn inside(&self) -> [T; 4] {
        [self.gain, self.integral, self.derivative, self.fresh]
    }

    /// eta, V: the largest output.
    #[must_use]
    pub fn switching(&self) -> T {
        self.switching
    }

    /// The first output is the voltage to begin with: as much of it as can be is integral.
    #[inline]
    fn begin(&self, state: &mut SlidingModeState<T>, error: T) {
        let bounded = |volts: T| volts.larger(-self.switching).smaller(self.switching);
        if self.integral > T::ZERO {
            state.integral = bounded(state.base) / self.gain - error * (T::of(1.0) + self.integral);
            state.base = state.base - bounded(state.base);
        } else {
            state.base = state.base - bounded(self.gain * error);
        }
    }
}

impl<T: Real> Feedback<T> for SampledSlidingMode<T> {
    type State = SlidingModeState<T>;

    fn rest(&self) -> SlidingModeState<T> {
        let zero = T::ZERO;
        SlidingModeState { integral: zero, change: zero, error: None, base: zero, volts: zero }
    }

    fn start(&self, volts: T) -> SlidingModeState<T> {
        // The sign of zero says that there is a voltage to begin with.
        SlidingModeState { base: volts, volts, change: -T::ZERO, ..self.rest() }
    }

    fn adopt(&self, before: &Self, _state: &mut SlidingModeState<T>) -> bool {
        self == before
    }

    #[inline]
    fn step(&self, state: &mut SlidingModeState<T>, sample: &FeedbackSample<T>) -> T {
        let FeedbackSample { error, excess, .. } = *sample;
        let old = state.error.unwrap_or(error);
        if state.error.is_none() && state.change.is_sign_negative() {
            self.begin(state, error);
        }
        let change = state.change + self.fresh * (error - old - state.change);
        let step = self.integral * error;
        let integral = state.integral + step;
        let surface = error + self.derivative * change + integral;
        if !surface.is_finite() {
            *state = SlidingModeState { error: None, change: T::ZERO, ..*state };
            return state.volts;
        }
        let asked = self.gain * surface;
        let volts = asked.larger(-self.switching).smaller(self.switching);
        // Beyond the layer or the limits, the integral does not go further out.
        let outward = (volts - asked) * step < T::ZERO || excess * step < T::ZERO;
        let integral = if outward { state.integral } else { integral };
        let volts = volts + state.base;
        *state = SlidingModeState { integral, change, error: Some(error), base: state.base, volts };
        volts
    }
}
