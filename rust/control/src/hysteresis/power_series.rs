//! Power series of a function and of a power of it, in lanes.

use crate::{Number, Real};

/// Terms of a series.
pub(super) const TERMS: usize = 11;

/// A function and its n-th power, with the length of the path in each term.
pub(super) struct PowerSeries<N> {
    terms: [N; TERMS],
    count: usize,
    raised: [N; TERMS],
}

impl<N: Number> PowerSeries<N> {
    /// The series whose first terms are these.
    #[inline(always)]
    pub(super) fn new(first: N, raised: N) -> Self {
        let zero = first.like(0.0);
        let mut series = Self { terms: [zero; TERMS], count: 1, raised: [zero; TERMS] };
        (series.terms[0], series.raised[0]) = (first, raised);
        series
    }

    /// Adds the next term of the function.
    #[inline(always)]
    pub(super) fn push(&mut self, term: N) {
        self.terms[self.count] = term;
        self.count += 1;
    }

    /// The next term of the power v of a function z whose first term has the reciprocal `inverse`:
    /// z v' = n v z'.
    #[inline(always)]
    pub(super) fn raise(&mut self, n: N::Lane, inverse: N) -> N {
        let k = self.count - 1;
        let zero = inverse.like(0.0);
        let (mut sum, mut counted) = (zero, zero);
        for (j, (term, count)) in self.terms.iter().zip(&COUNT).enumerate().take(k + 1).skip(1) {
            let product = *term * self.raised[k - j];
            sum = sum + product;
            counted = product.mul_add(zero.like(*count), counted);
        }
        let share = zero.each(n + N::Lane::of(1.0)) * zero.like(RECIPROCAL[k]);
        self.raised[k] = counted.mul_add(share, -sum) * inverse;
        self.raised[k]
    }

    /// The value of the function.
    #[inline(always)]
    pub(super) fn sum(&self) -> N {
        let mut sum = self.terms[TERMS - 1];
        for term in self.terms[..TERMS - 1].iter().rev() {
            sum = sum + *term;
        }
        sum
    }
}

/// k
const COUNT: [f64; TERMS] = {
    let mut out = [0.0; TERMS];
    let mut k = 1;
    while k < TERMS {
        out[k] = out[k - 1] + 1.0;
        k += 1;
    }
    out
};

/// 1/k
pub(super) const RECIPROCAL: [f64; TERMS] = {
    let mut out = COUNT;
    let mut k = 1;
    while k < TERMS {
        out[k] = 1.0 / out[k];
        k += 1;
    }
    out
};
