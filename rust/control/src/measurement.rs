//! Validation of measurements: range check and jump check before a reading enters the loop.
//!
//! Instruments report "not a number" and overload as finite numbers too (SCPI: 9.91e37 and
//! 9.9e37). A displacement that the stage cannot have is no measurement, and is treated as NaN.

use crate::cast::{Cast, rounded};
use crate::error::{Result, check};
use crate::number::Real;

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
pub struct Span<T = f64> {
    low: T,
    high: T,
    pub(crate) max_jump: T,
}

impl<T: Real> Default for Span<T> {
    /// From -10 to 10 mm, further than piezo nanopositioners move, with jumps of any size.
    fn default() -> Self {
        Self { low: T::of(-0.01), high: T::of(0.01), max_jump: T::INFINITY }
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
}

/// Ends rounded as readings are: one within the span stays within it.
impl Cast for Span {
    type In<T: Real> = Span<T>;

    /// # Errors
    /// Names `span` where it is so narrow that its ends are the same in the real type.
    fn cast<T: Real>(&self) -> Result<Span<T>> {
        let (low, high): (T, T) =
            (rounded("span", self.low, "m")?, rounded("span", self.high, "m")?);
        check("span", self.high, "m", low < high, "an upper end above the lower in the real type")?;
        // A jump beyond what the type can hold is any.
        Ok(Span { low, high, max_jump: T::of(self.max_jump) })
    }
}

impl<T: Real> Span<T> {
    /// The lowest displacement, m.
    #[must_use]
    pub fn low(&self) -> T {
        self.low
    }

    /// The highest displacement, m.
    #[must_use]
    pub fn high(&self) -> T {
        self.high
    }

    /// Whether the stage can have this displacement (m); false for NaN.
    #[inline]
    #[must_use]
    pub fn contains(&self, displacement: T) -> bool {
        displacement >= self.low && displacement <= self.high
    }

    /// Whether a reference (m) may be meant: within the span, or outside it by its width at most;
    /// false for NaN.
    ///
    /// What is further away only saturates, and teaches a repetitive part what it forgets for ever
    /// after.
    #[inline]
    pub(crate) fn may_ask_for(&self, reference: T) -> bool {
        let (low, high) = self.references();
        reference >= low && reference <= high
    }

    /// The lowest and the highest reference that may be meant, m.
    #[inline]
    pub(crate) fn references(&self) -> (T, T) {
        let width = self.high - self.low;
        (self.low - width, self.high + width)
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
pub(crate) struct Readings<T = f64> {
    /// The last valid reading, m; infinite before the first.
    pub(crate) last: T,
    /// Samples since then.
    pub(crate) since: u32,
    pub(crate) refused: Refused,
}

crate::snapshot!([T: Real] Readings<T> { last, since, refused });

impl<T: Real> Readings<T> {
    pub(crate) const NONE: Self = Self {
        last: T::INFINITY,
        since: 0,
        refused: Refused { not_finite: 0, outside: 0, jumps: 0 },
    };

    /// The last valid reading, m.
    pub(crate) fn last(&self) -> Option<T> {
        self.last.is_finite().then_some(self.last)
    }

    #[inline]
    fn refuse(&mut self, reading: T, outside: bool) {
        self.since = self.since.saturating_add(1);
        let count = match (reading.is_finite(), outside) {
            (false, _) => &mut self.refused.not_finite,
            (true, true) => &mut self.refused.outside,
            (true, false) => &mut self.refused.jumps,
        };
        *count = count.saturating_add(1);
    }
}

impl<T: Real> Span<T> {
    /// Whether a reading (m) is a measurement; counts it where it is none.
    ///
    /// The allowed jump grows with the samples since the last valid reading, so that a stage that
    /// was moved meanwhile is found again.
    #[inline]
    pub(crate) fn accepts(&self, readings: &mut Readings<T>, reading: T) -> bool {
        let inside = self.contains(reading);
        if inside && (self.max_jump == T::INFINITY || self.is_near(readings, reading)) {
            (readings.last, readings.since) = (reading, 0);
            return true;
        }
        readings.refuse(reading, !inside);
        false
    }

    fn is_near(&self, readings: &Readings<T>, reading: T) -> bool {
        let samples = T::count(readings.since) + T::of(1.0);
        !readings.last.is_finite() || (reading - readings.last).abs() <= self.max_jump * samples
    }
}
