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

use crate::error::{Result, check, not_negative, positive};
use crate::feedback_law::{Feedback, FeedbackSample};

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
pub struct SampledSlidingMode {
    /// eta, V.
    switching: f64,
    /// eta/phi, V/m.
    gain: f64,
    /// Ts/Ti.
    integral: f64,
    /// Td/Ts.
    derivative: f64,
    /// Share of a new difference that enters the filtered one.
    fresh: f64,
}

/// State of sliding mode control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlidingModeState {
    /// Integral part of the surface, m.
    integral: f64,
    /// Filtered change of the error in a sample, m.
    change: f64,
    /// The last error, m; `None` before the first.
    error: Option<f64>,
    /// Voltage to begin with, V, and then the part of it beyond the switching gain.
    base: f64,
    /// The last output, V.
    volts: f64,
}

crate::snapshot!(SlidingModeState { integral, change, error, base, volts });

impl SampledSlidingMode {
    /// eta/phi in V/m, Ts/Ti, Td/Ts and the share of a new difference in the filtered one: the law
    /// inside its boundary layer.
    #[must_use]
    pub fn inside(&self) -> [f64; 4] {
        [self.gain, self.integral, self.derivative, self.fresh]
    }

    /// eta, V: the largest output.
    #[must_use]
    pub fn switching(&self) -> f64 {
        self.switching
    }

    /// The first output is the voltage to begin with: as much of it as can be is integral.
    #[inline]
    fn begin(&self, state: &mut SlidingModeState, error: f64) {
        let bounded = |volts: f64| volts.max(-self.switching).min(self.switching);
        if self.integral > 0.0 {
            state.integral = bounded(state.base) / self.gain - error * (1.0 + self.integral);
            state.base -= bounded(state.base);
        } else {
            state.base -= bounded(self.gain * error);
        }
    }
}

impl Feedback for SampledSlidingMode {
    type State = SlidingModeState;

    fn rest(&self) -> SlidingModeState {
        SlidingModeState { integral: 0.0, change: 0.0, error: None, base: 0.0, volts: 0.0 }
    }

    fn start(&self, volts: f64) -> SlidingModeState {
        // The sign of zero says that there is a voltage to begin with.
        SlidingModeState { base: volts, volts, change: -0.0, ..self.rest() }
    }

    fn adopt(&self, before: &Self, _state: &mut SlidingModeState) -> bool {
        self == before
    }

    #[inline]
    fn step(&self, state: &mut SlidingModeState, sample: &FeedbackSample) -> f64 {
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
            *state = SlidingModeState { error: None, change: 0.0, ..*state };
            return state.volts;
        }
        let asked = self.gain * surface;
        let volts = asked.max(-self.switching).min(self.switching);
        // Beyond the layer or the limits, the integral does not go further out.
        let outward = (volts - asked) * step < 0.0 || excess * step < 0.0;
        let integral = if outward { state.integral } else { integral };
        let volts = volts + state.base;
        *state = SlidingModeState { integral, change, error: Some(error), base: state.base, volts };
        volts
    }
}
