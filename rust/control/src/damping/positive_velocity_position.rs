//! Positive velocity and position feedback.
//!
//! ```text
//! K(s) = (G1 s + G2)/(s^2 + 2 zc wc s + wc^2),   G1 = g1 wc,   G2 = g2 wc^2
//! ```
//!
//! Bhikkaji, Ratnam, Fleming and Moheimani 2007, High-performance control of piezoelectric tube
//! scanners, IEEE Transactions on Control Systems Technology 15: velocity and position through one
//! filter of second order, whose four numbers put all four poles of a mode with the filter where they
//! are wanted. Here both gains are in V/m, that of the velocity at the frequency of the filter.

use core::f64::consts::TAU;

use super::damped::Damped;
use super::tustin::second_order;
use crate::error::{Result, finite, positive};

/// Positive velocity and position feedback in continuous time.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `velocity_gain` | g1 | V/m | any |
/// | `position_gain` | g2 | V/m | any; times the static gain of the stage below 1 for a stable loop |
/// | `frequency` | wc/(2 pi) | Hz | > 0 |
/// | `damping_ratio` | zc | | > 0 |
///
/// ```
/// use piezotrack_control::{PositivePositionFeedback, PositiveVelocityPositionFeedback};
///
/// // Without the velocity it is positive position feedback.
/// let law = PositiveVelocityPositionFeedback::new(0.0, 0.4e6, 160.0, 0.5)?.around((), 2e-4)?;
/// assert_eq!(law, PositivePositionFeedback::new(0.4e6, 160.0, 0.5)?.around((), 2e-4)?);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositiveVelocityPositionFeedback {
    velocity_gain: f64,
    position_gain: f64,
    frequency: f64,
    damping_ratio: f64,
}

impl PositiveVelocityPositionFeedback {
    /// Gains of velocity and position (V/m), natural frequency (Hz) and damping ratio of the filter.
    ///
    /// # Errors
    /// Names the number that is out of its range.
    pub fn new(
        velocity_gain: f64,
        position_gain: f64,
        frequency: f64,
        damping_ratio: f64,
    ) -> Result<Self> {
        Ok(Self {
            velocity_gain: finite("velocity_gain", velocity_gain, "V/m")?,
            position_gain: finite("position_gain", position_gain, "V/m")?,
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
        let gains = [self.velocity_gain * wc, self.position_gain * wc * wc];
        let (poles, name) = ((wc, self.damping_ratio), ("frequency", self.frequency));
        Ok(Damped::new(inner, second_order(gains, poles, dt, name)?))
    }
}
