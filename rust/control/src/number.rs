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
    /// The real type of a lane.
    type Lane: Real;

    /// A constant in every lane.
    #[must_use]
    fn like(self, value: f64) -> Self;

    /// `value` in every lane.
    #[must_use]
    fn each(self, value: Self::Lane) -> Self;

    /// `self * factor + term`, rounded once.
    #[must_use]
    fn mul_add(self, factor: Self, term: Self) -> Self;

    /// Square root, correctly rounded.
    #[must_use]
    fn sqrt(self) -> Self;

    /// Calls a scalar function for every lane, for functions other than those above.
    #[must_use]
    fn lanewise<const A: usize>(
        arguments: [Self; A],
        function: impl Fn([Self::Lane; A]) -> Self::Lane,
    ) -> Self;

    /// `yes` in the lanes where `self < 0`, `no` in the others (and where `self` is NaN).
    #[must_use]
    fn where_negative(self, yes: Self, no: Self) -> Self;

    /// Whether `self < 0` in any lane.
    fn any_negative(self) -> bool;

    /// Whether `low <= self <= high` in all lanes; false where a lane is NaN.
    fn all_within(self, low: Self, high: Self) -> bool;

    /// The number in a lane.
    fn lane(&self, lane: usize) -> Self::Lane;

    /// The numbers that a function gives for each lane, called in their order.
    #[must_use]
    fn by_lane(self, values: impl FnMut(usize) -> Self::Lane) -> Self;

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
pub trait Real: Number<Lane = Self> + PartialOrd + Default + Debug + Into<f64> + Snapshot {
    /// Zero.
    const ZERO: Self;
    /// Infinity.
    const INFINITY: Self;
    /// Not a number.
    const NAN: Self;
    /// Distance from 1 to the next larger number.
    const EPSILON: Self;
    /// The smallest number above 0 with all its digits.
    const MIN_POSITIVE: Self;
    /// Numbers this far from 0 soon overflow, and enter no state: 1e100, 1e30 in single precision.
    const HUGE: Self;
    /// The least exponent of 2 of a number with all its digits; the most is 1 less this one.
    const LEAST_EXPONENT: Self;
    /// Added to a number of a smaller size and subtracted again, it rounds that to the nearest whole
    /// number.
    const WHOLE: Self;

    /// The number nearest to `value`.
    fn of(value: f64) -> Self;

    /// A count, rounded where it has more digits than the type.
    fn count(count: u32) -> Self;

    /// The mantissa of a number from [`Self::MIN_POSITIVE`] up, from the root of 1/2 to that of 2.
    #[must_use]
    fn mantissa(self) -> Self;

    /// The exponent of 2 that goes with [`Self::mantissa`].
    #[must_use]
    fn exponent(self) -> Self;

    /// 2 to a whole power, from [`Self::LEAST_EXPONENT`] to 1 less it.
    #[must_use]
    fn two_to(self) -> Self;

    /// The magnitude.
    #[must_use]
    fn abs(self) -> Self;

    /// Whether the sign is negative, that of zero too.
    fn is_sign_negative(self) -> bool;

    /// The natural logarithm.
    #[must_use]
    fn ln(self) -> Self;

    /// The natural logarithm of 1 and this number.
    #[must_use]
    fn ln_1p(self) -> Self;

    /// The exponential function.
    #[must_use]
    fn exp(self) -> Self;

    /// The exponential function less 1.
    #[must_use]
    fn exp_m1(self) -> Self;

    /// This number to a power.
    #[must_use]
    fn pow(self, exponent: Self) -> Self;

    /// The hyperbolic tangent.
    #[must_use]
    fn tanh(self) -> Self;

    /// This magnitude with the sign of `other`.
    #[must_use]
    fn copysign(self, other: Self) -> Self;

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

/// The exponent in the bits of a number whose mantissa is from the root of 1/2 to that of 2.
macro_rules! biased_exponent {
    ($real:ident, $bits:expr) => {{
        let more = (1.0 as $real).to_bits() - core::$real::consts::FRAC_1_SQRT_2.to_bits();
        $bits.wrapping_add(more) >> ($real::MANTISSA_DIGITS - 1)
    }};
}

/// Implements both traits for a real type, with functions of libm by their names, and items that only
/// that type has.
macro_rules! real {
    (
        $real:ident, $huge:literal, $fma:ident, $sqrt:ident, $ln:ident, $ln_1p:ident, $exp:ident,
        $exp_m1:ident, $pow:ident, $tanh:ident, $copysign:ident, { $($own:item)* }
    ) => {
        impl Number for $real {
            type Lane = Self;

            #[inline(always)]
            fn like(self, value: f64) -> Self {
                Real::of(value)
            }

            #[inline(always)]
            fn each(self, value: Self) -> Self {
                value
            }

            #[inline(always)]
            fn mul_add(self, factor: Self, term: Self) -> Self {
                #[cfg(feature = "std")]
                return $real::mul_add(self, factor, term);
                #[cfg(not(feature = "std"))]
                return libm::$fma(self, factor, term);
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                libm::$sqrt(self)
            }

            #[inline]
            fn lanewise<const A: usize>(
                arguments: [Self; A],
                function: impl Fn([Self; A]) -> Self,
            ) -> Self {
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
            fn all_within(self, low: Self, high: Self) -> bool {
                low <= self && self <= high
            }

            #[inline(always)]
            fn lane(&self, _lane: usize) -> Self {
                *self
            }

            #[inline(always)]
            fn by_lane(self, mut values: impl FnMut(usize) -> Self) -> Self {
                values(0)
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

        impl Real for $real {
            const ZERO: Self = 0.0;
            const INFINITY: Self = Self::INFINITY;
            const NAN: Self = Self::NAN;
            const EPSILON: Self = Self::EPSILON;
            const MIN_POSITIVE: Self = Self::MIN_POSITIVE;
            const HUGE: Self = $huge;
            const WHOLE: Self = 1.5 / Self::EPSILON;

            $($own)*

            #[inline(always)]
            fn mantissa(self) -> Self {
                let bits = self.to_bits();
                let whole = biased_exponent!($real, bits) << ($real::MANTISSA_DIGITS - 1);
                $real::from_bits(bits.wrapping_sub(whole).wrapping_add((1.0 as $real).to_bits()))
            }

            #[inline(always)]
            fn exponent(self) -> Self {
                // In the last digits of 1/EPSILON a whole number is its bits.
                let zero = 1.0 / Self::EPSILON;
                let biased = biased_exponent!($real, self.to_bits());
                let bias = 1.0 - Self::LEAST_EXPONENT;
                $real::from_bits(zero.to_bits() | biased) - zero - bias
            }

            #[inline(always)]
            fn two_to(self) -> Self {
                let last = (self + Self::WHOLE).to_bits() << ($real::MANTISSA_DIGITS - 1);
                $real::from_bits(last.wrapping_add((1.0 as $real).to_bits()))
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
                libm::$ln(self)
            }

            #[inline]
            fn ln_1p(self) -> Self {
                libm::$ln_1p(self)
            }

            #[inline]
            fn exp(self) -> Self {
                libm::$exp(self)
            }

            #[inline]
            fn exp_m1(self) -> Self {
                libm::$exp_m1(self)
            }

            #[inline]
            fn pow(self, exponent: Self) -> Self {
                libm::$pow(self, exponent)
            }

            #[inline]
            fn tanh(self) -> Self {
                libm::$tanh(self)
            }

            #[inline]
            fn copysign(self, other: Self) -> Self {
                libm::$copysign(self, other)
            }
        }
    };
}

real!(f64, 1e100, fma, sqrt, log, log1p, exp, expm1, pow, tanh, copysign, {
    const LEAST_EXPONENT: Self = -1022.0;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn count(count: u32) -> Self {
        Self::from(count)
    }
});

real!(f32, 1e30, fmaf, sqrtf, logf, log1pf, expf, expm1f, powf, tanhf, copysignf, {
    const LEAST_EXPONENT: Self = -126.0;

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
});
