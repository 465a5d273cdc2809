//! The number type of a kernel: a vector of lanes, or one real number in double or single precision.

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::snapshot::Snapshot;

/// A real number, or a vector of them (lanes) on which every operation acts lane by lane.
///
/// A kernel that is generic over this trait gives the same bits for one lane and for many, on
/// every instruction set: its operations are correctly rounded, its choices are made per lane,
/// and [`Number::lanewise`] calls the same scalar function for each lane.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// `value` in every lane.
    #[must_use]
    fn like(self, value: f64) -> Self;

    /// `self * factor + term`, rounded once.
    #[must_use]
    fn mul_add(self, factor: Self, term: Self) -> Self;

    /// Square root, correctly rounded.
    #[must_use]
    fn sqrt(self) -> Self;

    /// Calls a scalar function for every lane, for functions other than those above.
    #[must_use]
    fn lanewise<const A: usize>(arguments: [Self; A], function: impl Fn([f64; A]) -> f64) -> Self;

    /// `yes` in the lanes where `self < 0`, `no` in the others (and where `self` is NaN).
    #[must_use]
    fn where_negative(self, yes: Self, no: Self) -> Self;

    /// Whether `self < 0` in any lane.
    fn any_negative(self) -> bool;

    /// The larger of two numbers, lane by lane; `self` where one is NaN.
    #[must_use]
    fn larger(self, other: Self) -> Self;

    /// The smaller of two numbers, lane by lane; `self` where one is NaN.
    #[must_use]
    fn smaller(self, other: Self) -> Self;
}

/// A real number in floating point: `f64` or `f32`.
///
/// Functions other than the operations of [`Number`] are those of libm for that type.
pub trait Real: Number + PartialOrd + Default + Debug + Into<f64> + Snapshot {
    /// Zero.
    const ZERO: Self;
    /// Infinity.
    const INFINITY: Self;
    /// Numbers this far from 0 soon overflow, and enter no state.
    const HUGE: Self;

    /// The number nearest to `value`.
    fn of(value: f64) -> Self;

    /// A count, rounded where it has more digits than the type.
    fn count(count: u32) -> Self;

    /// The magnitude.
    #[must_use]
    fn abs(self) -> Self;

    /// Whether the sign is negative, that of zero too.
    fn is_sign_negative(self) -> bool;

    /// The natural logarithm.
    #[must_use]
    fn ln(self) -> Self;

    /// Whether it is not a number.
    #[inline(always)]
    fn is_nan(self) -> bool {
        self.partial_cmp(&self).is_none()
    }

    /// False for infinity and NaN.
    #[inline(always)]
    fn is_finite(self) -> bool {
        self.abs() < Self::INFINITY
    }

    /// Whether the number may enter a state: NaN, infinity and numbers that soon overflow may not.
    #[inline(always)]
    fn is_usable(self) -> bool {
        self.abs() < Self::HUGE
    }
}

impl Number for f64 {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        #[cfg(feature = "std")]
        return f64::mul_add(self, factor, term);
        #[cfg(not(feature = "std"))]
        return libm::fma(self, factor, term);
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }

    #[inline]
    fn lanewise<const A: usize>(arguments: [Self; A], function: impl Fn([f64; A]) -> f64) -> Self {
        function(arguments)
    }

    #[inline(always)]
    fn where_negative(self, yes: Self, no: Self) -> Self {
        if self < 0.0 { yes } else { no }
    }

    #[inline(always)]
    fn any_negative(self) -> bool {
        self < 0.0
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self < other { other } else { self }
    }

    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const INFINITY: Self = Self::INFINITY;
    const HUGE: Self = 1e100;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn count(count: u32) -> Self {
        Self::from(count)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn is_sign_negative(self) -> bool {
        self.is_sign_negative()
    }

    #[inline]
    fn ln(self) -> Self {
        libm::log(self)
    }
}

impl Number for f32 {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Real::of(value)
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        #[cfg(feature = "std")]
        return f32::mul_add(self, factor, term);
        #[cfg(not(feature = "std"))]
        return libm::fmaf(self, factor, term);
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }

    #[inline]
    fn lanewise<const A: usize>(arguments: [Self; A], function: impl Fn([f64; A]) -> f64) -> Self {
        Real::of(function(arguments.map(f64::from)))
    }

    #[inline(always)]
    fn where_negative(self, yes: Self, no: Self) -> Self {
        if self < 0.0 { yes } else { no }
    }

    #[inline(always)]
    fn any_negative(self) -> bool {
        self < 0.0
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self < other { other } else { self }
    }

    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const INFINITY: Self = Self::INFINITY;
    const HUGE: Self = 1e30;

    #[expect(clippy::cast_possible_truncation, reason = "rounded to the nearest")]
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as Self
    }

    #[expect(clippy::cast_precision_loss, reason = "rounded to the nearest")]
    #[inline(always)]
    fn count(count: u32) -> Self {
        count as Self
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn is_sign_negative(self) -> bool {
        self.is_sign_negative()
    }

    #[inline]
    fn ln(self) -> Self {
        libm::logf(self)
    }
}
