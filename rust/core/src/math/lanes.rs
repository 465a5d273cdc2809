//! Several stages in lockstep: the number type of a swarm's kernel.

use core::ops::{Add, Div, Mul, Neg, Sub};

use piezotrack_control::Number;
use pulp::Simd;

/// `K` vectors of lanes that go through the same operations.
///
/// More than one vector hides the latency of the chain of operations within a step.
///
/// Aligned to a cache line: those that do not stay in registers would else be read from two.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Lanes<S: Simd, const K: usize> {
    simd: S,
    vectors: [S::f64s; K],
}

impl<S: Simd, const K: usize> Lanes<S, K> {
    /// Lanes in one bundle.
    pub const COUNT: usize = K * S::F64_LANES;

    /// `value` in every lane.
    #[inline(always)]
    pub fn splat(simd: S, value: f64) -> Self {
        Self { simd, vectors: [simd.splat_f64s(value); K] }
    }

    /// The value that `values` gives for each lane.
    #[inline(always)]
    pub fn gather(simd: S, values: impl Fn(usize) -> f64) -> Self {
        Self::splat(simd, 0.0).by_lane(values)
    }

    /// The lanes in order.
    #[inline(always)]
    pub fn as_slice(&self) -> &[f64] {
        pulp::bytemuck::cast_slice(&self.vectors)
    }

    #[inline(always)]
    fn as_mut_slice(&mut self) -> &mut [f64] {
        pulp::bytemuck::cast_slice_mut(&mut self.vectors)
    }
}

macro_rules! lanewise {
    ($trait:ident, $method:ident, $operation:ident) => {
        impl<S: Simd, const K: usize> $trait for Lanes<S, K> {
            type Output = Self;
            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                for k in 0..K {
                    self.vectors[k] = self.simd.$operation(self.vectors[k], other.vectors[k]);
                }
                self
            }
        }
    };
}
lanewise!(Add, add, add_f64s);
lanewise!(Sub, sub, sub_f64s);
lanewise!(Mul, mul, mul_f64s);
lanewise!(Div, div, div_f64s);

impl<S: Simd, const K: usize> Neg for Lanes<S, K> {
    type Output = Self;
    #[inline(always)]
    fn neg(mut self) -> Self {
        for k in 0..K {
            self.vectors[k] = self.simd.neg_f64s(self.vectors[k]);
        }
        self
    }
}

impl<S: Simd, const K: usize> Number for Lanes<S, K> {
    type Lane = f64;

    #[inline(always)]
    fn like(mut self, value: f64) -> Self {
        self.vectors = [self.simd.splat_f64s(value); K];
        self
    }

    #[inline(always)]
    fn each(self, value: f64) -> Self {
        self.like(value)
    }

    #[inline(always)]
    fn mul_add(mut self, factor: Self, term: Self) -> Self {
        for k in 0..K {
            self.vectors[k] =
                self.simd.mul_add_f64s(self.vectors[k], factor.vectors[k], term.vectors[k]);
        }
        self
    }

    #[inline(always)]
    fn sqrt(mut self) -> Self {
        for k in 0..K {
            self.vectors[k] = self.simd.sqrt_f64s(self.vectors[k]);
        }
        self
    }

    #[inline(always)]
    fn lanewise<const A: usize>(arguments: [Self; A], function: impl Fn([f64; A]) -> f64) -> Self {
        // Without an argument there is nothing to tell the lanes from.
        let mut out = arguments[0];
        for (lane, slot) in out.as_mut_slice().iter_mut().enumerate() {
            let mut values = [0.0; A];
            for (value, argument) in values.iter_mut().zip(&arguments) {
                *value = argument.as_slice()[lane];
            }
            *slot = function(values);
        }
        out
    }

    #[inline(always)]
    fn where_negative(mut self, yes: Self, no: Self) -> Self {
        let zero = self.simd.splat_f64s(0.0);
        for k in 0..K {
            let mask = self.simd.less_than_f64s(self.vectors[k], zero);
            self.vectors[k] = self.simd.select_f64s(mask, yes.vectors[k], no.vectors[k]);
        }
        self
    }

    #[inline(always)]
    fn any_negative(self) -> bool {
        let zero = self.simd.splat_f64s(0.0);
        let mut any = false;
        for k in 0..K {
            let mask = self.simd.less_than_f64s(self.vectors[k], zero);
            // Not M64_LANES, which is 0 where a mask is one bit a lane.
            any |= self.simd.first_true_m64s(mask) < S::F64_LANES;
        }
        any
    }

    #[inline(always)]
    fn all_within(self, low: Self, high: Self) -> bool {
        let mut all = self.simd.less_than_or_equal_f64s(low.vectors[0], self.vectors[0]);
        for k in 0..K {
            let above = self.simd.less_than_or_equal_f64s(low.vectors[k], self.vectors[k]);
            let below = self.simd.less_than_or_equal_f64s(self.vectors[k], high.vectors[k]);
            all = self.simd.and_m64s(all, self.simd.and_m64s(above, below));
        }
        self.simd.first_true_m64s(self.simd.not_m64s(all)) >= S::F64_LANES
    }

    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        self.as_slice()[lane]
    }

    #[inline(always)]
    fn by_lane(mut self, mut values: impl FnMut(usize) -> f64) -> Self {
        for (lane, slot) in self.as_mut_slice().iter_mut().enumerate() {
            *slot = values(lane);
        }
        self
    }

    #[inline(always)]
    fn larger(mut self, other: Self) -> Self {
        for k in 0..K {
            let (one, other) = (self.vectors[k], other.vectors[k]);
            let mask = self.simd.less_than_f64s(one, other);
            self.vectors[k] = self.simd.select_f64s(mask, other, one);
        }
        self
    }

    #[inline(always)]
    fn smaller(mut self, other: Self) -> Self {
        for k in 0..K {
            let (one, other) = (self.vectors[k], other.vectors[k]);
            let mask = self.simd.less_than_f64s(other, one);
            self.vectors[k] = self.simd.select_f64s(mask, other, one);
        }
        self
    }
}
