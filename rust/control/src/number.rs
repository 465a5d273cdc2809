//! The number type of a kernel: one `f64`, or a vector of lanes.

use core::ops::{Add, Div, Mul, Neg, Sub};

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
