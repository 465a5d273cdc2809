//! Saturation limits of the amplifier.

use crate::error::{Result, check, finite, usable};

/// Voltage range of the actuator, for example 0 to 75 V for the stage of Xu and Li 2010.
///
/// ```
/// use piezotrack_control::Limits;
///
/// let limits = Limits::new(0.0, 75.0)?;
/// assert_eq!(limits.clip(80.0), 75.0);
/// assert_eq!(limits.clip(f64::NAN), 0.0);
/// assert!(Limits::new(75.0, 0.0).is_err());
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    low: f64,
    high: f64,
}

impl Limits {
    /// Limits in V.
    ///
    /// # Errors
    /// Names `low` or `high` where it is not finite or 1e100 V or more from 0, so that sums of
    /// voltages soon overflow, and `high` where it is not above `low`.
    pub fn new(low: f64, high: f64) -> Result<Self> {
        for (name, volts) in [("low", low), ("high", high)] {
            finite(name, volts, "V")?;
            check(name, volts, "V", usable(volts), "a voltage below 1e100 V")?;
        }
        check("high", high, "V", low < high, "a voltage above low")?;
        Ok(Self { low, high })
    }

    /// The lowest voltage, V.
    #[must_use]
    pub fn low(&self) -> f64 {
        self.low
    }

    /// The highest voltage, V.
    #[must_use]
    pub fn high(&self) -> f64 {
        self.high
    }

    /// The voltage within the limits nearest to `volts` (V); nearest to 0 V where that is NaN.
    ///
    /// `v = clip(u)` before equation (24) of Xu and Li 2010, doi 10.1115/1.4001712.
    #[inline]
    #[must_use]
    pub fn clip(&self, volts: f64) -> f64 {
        let volts = if volts.is_nan() { 0.0 } else { volts };
        if volts < self.low {
            self.low
        } else if volts > self.high {
            self.high
        } else {
            volts
        }
    }
}
