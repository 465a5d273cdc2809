//! Validation of measurements: range check and jump check before a reading enters the loop.
//!
//! Instruments report "not a number" and overload as finite numbers too (SCPI: 9.91e37 and
//! 9.9e37). A displacement that the stage cannot have is no measurement, and is treated as NaN.

use crate::error::{Result, check};

/// Longest displacement that any range may have, m.
pub const LONGEST: f64 = 1.0;

/// Displacements that the stage can have, and how far it can move in a sample.
///
/// ```
/// use piezotrack_control::Span;
///
/// let span = Span::new(-10e-6, 120e-6)?;
/// assert!(span.contains(50e-6) && !span.contains(f64::NAN) && !span.contains(9.91e37));
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    low: f64,
    high: f64,
    max_jump: f64,
}

impl Default for Span {
    /// From -10 to 10 mm, further than piezo nanopositioners move, with jumps of any size.
    fn default() -> Self {
        Self { low: -0.01, high: 0.01, max_jump: f64::INFINITY }
    }
}

impl Span {
    /// Displacements from `low` to `high`, m.
    ///
    /// # Errors
    /// Names `span` where an end is not finite or beyond a metre, or `high` is not above `low`.
    pub fn new(low: f64, high: f64) -> Result<Self> {
        for end in [low, high] {
            let right = end.abs() <= LONGEST;
            check("span", end, "m", right, "a displacement in m, at most a metre")?;
        }
        check("span", high, "m", low < high, "an upper end above the lower one")?;
        Ok(Self { low, high, ..Self::default() })
    }

    /// The same range for a stage that moves at most `max_jump` (m) in a sample.
    ///
    /// # Errors
    /// Names `max_jump` where it is not above 0.
    pub fn with_max_jump(self, max_jump: f64) -> Result<Self> {
        let right = max_jump > 0.0;
        check("max_jump", max_jump, "m", right, "a displacement above 0, in m")?;
        Ok(Self { max_jump, ..self })
    }

    /// The lowest displacement, m.
    #[must_use]
    pub fn low(&self) -> f64 {
        self.low
    }

    /// The highest displacement, m.
    #[must_use]
    pub fn high(&self) -> f64 {
        self.high
    }

    /// Whether the stage can have this displacement (m); false for NaN.
    #[inline]
    #[must_use]
    pub fn contains(&self, displacement: f64) -> bool {
        displacement >= self.low && displacement <= self.high
    }
}

impl Span {
    /// Whether a reference (m) may be meant: within the span, or outside it by its width at most;
    /// false for NaN.
    ///
    /// What is further away only saturates, and teaches a repetitive part what it forgets for ever
    /// after.
    #[inline]
    pub(crate) fn may_ask_for(&self, reference: f64) -> bool {
        let width = self.high - self.low;
        reference >= self.low - width && reference <= self.high + width
    }
}

/// Number of readings that were refused since the start, by the reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Refused {
    /// NaN or infinite.
    pub not_finite: u32,
    /// Finite, outside the span.
    pub outside: u32,
    /// Further from the last valid reading than the stage can have moved since.
    pub jumps: u32,
}

crate::snapshot!(Refused { not_finite, outside, jumps });

/// State of the validation: the last valid reading, and what was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Readings {
    /// The last valid reading, m; infinite before the first.
    last: f64,
    /// Samples since then.
    since: u32,
    pub(crate) refused: Refused,
}

crate::snapshot!(Readings { last, since, refused });

impl Readings {
    pub(crate) const NONE: Self = Self {
        last: f64::INFINITY,
        since: 0,
        refused: Refused { not_finite: 0, outside: 0, jumps: 0 },
    };

    /// The last valid reading, m.
    pub(crate) fn last(&self) -> Option<f64> {
        self.last.is_finite().then_some(self.last)
    }

    #[inline]
    fn refuse(&mut self, reading: f64, outside: bool) {
        self.since = self.since.saturating_add(1);
        let count = match (reading.is_finite(), outside) {
            (false, _) => &mut self.refused.not_finite,
            (true, true) => &mut self.refused.outside,
            (true, false) => &mut self.refused.jumps,
        };
        *count = count.saturating_add(1);
    }
}

impl Span {
    /// Whether a reading (m) is a measurement; counts it where it is none.
    ///
    /// The allowed jump grows with the samples since the last valid reading, so that a stage that
    /// was moved meanwhile is found again.
    #[inline]
    pub(crate) fn accepts(&self, readings: &mut Readings, reading: f64) -> bool {
        let inside = self.contains(reading);
        if inside && (self.max_jump == f64::INFINITY || self.is_near(readings, reading)) {
            (readings.last, readings.since) = (reading, 0);
            return true;
        }
        readings.refuse(reading, !inside);
        false
    }

    fn is_near(&self, readings: &Readings, reading: f64) -> bool {
        let samples = f64::from(readings.since) + 1.0;
        readings.last.is_infinite() || (reading - readings.last).abs() <= self.max_jump * samples
    }
}
