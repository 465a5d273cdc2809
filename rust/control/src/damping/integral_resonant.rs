//! Integral resonant control.
//!
//! ```text
//! K(s) = k/(s + k d)
//! ```
//!
//! Aphale, Fleming and Moheimani 2007, doi 10.1088/0964-1726/16/2/023: a feedthrough of -d added to
//! the displacement turns poles and zeros of a collocated mode about, and an integrator k/s in
//! negative feedback around both damps it. Written around the stage alone that is positive feedback
//! of the low-passed displacement.

use super::damped::Damped;
use super::tustin::first_order;
use crate::error::{Result, check, finite};

/// Integral resonant control in continuous time.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `gain` | k | V/(m s) | of the sign of d; 0 for no damping |
/// | `feedthrough` | d | m/V | not 0; beyond the static gain of the stage for a stable loop |
///
/// ```
/// use piezotrack_control::{Feedback, FeedbackSample, IntegralResonantControl};
///
/// let law = IntegralResonantControl::new(1e9, 2e-6)?.around((), 2e-4)?;
/// let mut state = law.rest();
/// law.step(&mut state, &FeedbackSample::default());
/// let sample = FeedbackSample { measured: 1e-6, ..FeedbackSample::default() };
/// // For slow motions it is 1/d.
/// let volts = (0..100).fold(0.0, |_, _| law.step(&mut state, &sample));
/// assert!((volts - 0.5).abs() < 1e-9);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegralResonantControl {
    gain: f64,
    feedthrough: f64,
}

impl IntegralResonantControl {
    /// Gain k of the integrator, V/(m s), and feedthrough d, m/V.
    ///
    /// # Errors
    /// Names the number that is out of its range.
    pub fn new(gain: f64, feedthrough: f64) -> Result<Self> {
        finite("gain", gain, "V/m/s")?;
        finite("feedthrough", feedthrough, "m/V")?;
        let right = feedthrough.abs() > 0.0;
        check("feedthrough", feedthrough, "m/V", right, "a gain other than 0")?;
        let corner = gain * feedthrough;
        let right = corner.is_finite() && corner >= 0.0;
        check("gain", gain, "V/m/s", right, "one of the sign of the feedthrough, or 0")?;
        Ok(Self { gain, feedthrough })
    }

    /// The filter beside the law `inner`, both for the sampling interval `dt`, s.
    ///
    /// # Errors
    /// Names `dt` where it is not above 0; `gain` where k d is above 100 radians a sample.
    pub fn around<F>(&self, inner: F, dt: f64) -> Result<Damped<F>> {
        let Self { gain, feedthrough } = *self;
        // Without gain there is no integrator either, which would be on its own for ever.
        let corner = if gain.abs() > 0.0 { gain * feedthrough } else { 1.0 / dt };
        Ok(Damped::new(inner, first_order(gain, corner, dt, ("gain", gain))?))
    }
}
