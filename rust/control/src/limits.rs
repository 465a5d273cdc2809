//! Saturation limits of the amplifier.

use crate::cast::{Cast, rounded};
use crate::error::{Result, check, finite, usable};
use crate::number::Real;

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
pub struct Limits<T = f64> {
    low: T,
    high: T,
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
}

/// The limits nearest to these, as those of a converter on the board are.
impl Cast for Limits {
    type In<T: Real> = Limits<T>;

    /// # Errors
    /// Names `low` or `high` where the real type cannot hold it, and `high` where it is not above
    /// `low` in that type.
    fn cast<T: Real>(&self) -> Result<Limits<T>> {
        let (low, high): (T, T) =
            (rounded("low", self.low, "V")?, rounded("high", self.high, "V")?);
        for (name, value, volts) in [("low", self.low, low), ("high", self.high, high)] {
            check(name, value, "V", volts.is_usable(), "a voltage that the real type can add up")?;
        }
        check("high", self.high, "V", low < high, "a voltage above low in the real type")?;
        Ok(Limits { low, high })
    }
}

impl<T: Real> Limits<T> {
    /// The lowest voltage, V.
    #[must_use]
    pub fn low(&self) -> T {
        self.low
    }

    /// The highest voltage, V.
    #[must_use]
    pub fn high(&self) -> T {
        self.high
    }

    /// The voltage within the limits nearest to `volts` (V); nearest to 0 V where that is NaN.
    ///
    /// `v = clip(u)` before equation (24) of Xu and Li 2010, doi 10.1115/1.4001712.
    #[inline]
    #[must_use]
    pub fn clip(&self, volts: T) -> T {
        let volts = if volts.is_nan() { T::ZERO } else { volts };
        if volts < self.low {
            self.low
        } else if volts > self.high {
            self.high
        } else {
            volts
        }
    }
}
