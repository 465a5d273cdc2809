//! Positive position feedback.
//!
//! ```text
//! K(s) = g wc^2/(s^2 + 2 zc wc s + wc^2)
//! ```
//!
//! Fanson and Caughey 1990, doi 10.2514/3.10451: the displacement through a filter of second order,
//! which rolls off above the mode, in positive feedback.

use core::f64::consts::TAU;

use super::damped::Damped;
use super::tustin::second_order;
use crate::error::{Result, finite, positive};

/// Positive position feedback in continuous time.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `gain` | g | V/m | any; times the static gain of the stage below 1 for a stable loop |
/// | `frequency` | wc/(2 pi) | Hz | > 0 |
/// | `damping_ratio` | zc | | > 0 |
///
/// ```
/// use piezotrack_control::{Feedback, FeedbackSample, PositivePositionFeedback};
///
/// let law = PositivePositionFeedback::new(0.4e6, 160.0, 0.5)?.around((), 2e-4)?;
/// let mut state = law.rest();
/// law.step(&mut state, &FeedbackSample::default());
/// let sample = FeedbackSample { measured: 1e-6, ..FeedbackSample::default() };
/// // For slow motions it is g.
/// let volts = (0..1000).fold(0.0, |_, _| law.step(&mut state, &sample));
/// assert!((volts - 0.4).abs() < 1e-9);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositivePositionFeedback {
    gain: f64,
    frequency: f64,
    damping_ratio: f64,
}

impl PositivePositionFeedback {
    /// Static gain (V/m), natural frequency (Hz) and damping ratio of the filter.
    ///
    /// # Errors
    /// Names the number that is out of its range.
    pub fn new(gain: f64, frequency: f64, damping_ratio: f64) -> Result<Self> {
        Ok(Self {
            gain: finite("gain", gain, "V/m")?,
            frequency: positive("frequency", frequency, "Hz")?,
            damping_ratio: positive("damping_ratio", damping_ratio, "")?,
        })
    }

    /// The filter beside the law `inner`, both for the sampling interval `dt`, s.
    ///
    /// # Errors
    /// Names `dt` where it is not above 0; `frequency` where it is above 100 radians a sample.
    pub fn around<F>(&self, inner: F, dt: f64) -> Result<Damped<F>> {
        let wc = TAU * self.frequency;
        let (poles, name) = ((wc, self.damping_ratio), ("frequency", self.frequency));
        Ok(Damped::new(inner, second_order([0.0, self.gain * wc * wc], poles, dt, name)?))
    }
}
