//! A number type without fused multiply-add, for firmware.

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::cast::{Cast, rounded};
use crate::error::Result;
use crate::number::{Number, Real};
use crate::snapshot::Snapshot;

/// A number whose `mul_add` is a multiplication and an addition, each rounded. On a target
/// without a fused instruction for this type, or without a way to it where there is no `std`, `mul_add` is a call of a slow library function, and those of
/// one step would take longer than the rest of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unfused<T = f64>(pub T);

impl<T: Real> Add for Unfused<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl<T: Real> Sub for Unfused<T> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl<T: Real> Mul for Unfused<T> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

impl<T: Real> Div for Unfused<T> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(self.0 / other.0)
    }
}

impl<T: Real> Neg for Unfused<T> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl<T: Real> Number for Unfused<T> {
    type Lane = T;

    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self(T::of(value))
    }

    #[inline(always)]
    fn each(self, value: T) -> Self {
        Self(value)
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }

    #[inline]
    fn lanewise<const A: usize>(arguments: [Self; A], function: impl Fn([T; A]) -> T) -> Self {
        Self(function(arguments.map(|argument| argument.0)))
    }

    #[inline(always)]
    fn where_negative(self, yes: Self, no: Self) -> Self {
        if self.0 < T::ZERO { yes } else { no }
    }

    #[inline(always)]
    fn any_negative(self) -> bool {
        self.0 < T::ZERO
    }

    #[inline(always)]
    fn all_within(self, low: Self, high: Self) -> bool {
        self.0.all_within(low.0, high.0)
    }

    #[inline(always)]
    fn lane(&self, _lane: usize) -> T {
        self.0
    }

    #[inline(always)]
    fn by_lane(self, mut values: impl FnMut(usize) -> T) -> Self {
        Self(values(0))
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

impl<T: Real> Snapshot for Unfused<T> {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        self.0.save(write);
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        self.0.load(read)
    }
}

impl Cast for Unfused {
    type In<T: Real> = Unfused<T>;

    fn cast<T: Real>(&self) -> Result<Unfused<T>> {
        rounded("parameter", self.0, "").map(Unfused)
    }
}
