//! A number type without fused multiply-add, for firmware.

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::number::Number;
use crate::snapshot::Snapshot;

/// A number whose `mul_add` is a multiplication and an addition, each rounded. On a target
/// without a fused instruction `f64::mul_add` is a call of a slow library function, and those of
/// one step would take longer than the rest of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unfused(pub f64);

impl Add for Unfused {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Sub for Unfused {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl Mul for Unfused {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

impl Div for Unfused {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(self.0 / other.0)
    }
}

impl Neg for Unfused {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Number for Unfused {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self(value)
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(libm::sqrt(self.0))
    }

    #[inline]
    fn lanewise<const A: usize>(arguments: [Self; A], function: impl Fn([f64; A]) -> f64) -> Self {
        Self(function(arguments.map(|argument| argument.0)))
    }

    #[inline(always)]
    fn where_negative(self, yes: Self, no: Self) -> Self {
        if self.0 < 0.0 { yes } else { no }
    }

    #[inline(always)]
    fn any_negative(self) -> bool {
        self.0 < 0.0
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        Self(self.0.larger(other.0))
    }

    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        Self(self.0.smaller(other.0))
    }
}

impl Snapshot for Unfused {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        write(self.0);
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        self.0.load(read)
    }
}
