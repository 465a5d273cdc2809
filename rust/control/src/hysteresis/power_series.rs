//! Power series of a function and of a power of it, in lanes.

use crate::{Number, Real};

/// Terms of a series.
pub(super) const LENGTH: usize = 11;

/// A function and its n-th power, with the length of the path in each term.
pub(super) struct PowerSeries<N: Number> {
    terms: [N; LENGTH],
    raised: [N; LENGTH],
    /// Number of the latest term of the function: an index, and a number of a step in any precision.
    latest: usize,
    order: N::Lane,
}

impl<N: Number> PowerSeries<N> {
    /// The series whose first terms are these.
    #[inline(always)]
    pub(super) fn new(first: N, raised: N) -> Self {
        let zero = first.like(0.0);
        let order = N::Lane::ZERO;
        let mut series = Self { terms: [zero; LENGTH], raised: [zero; LENGTH], latest: 0, order };
        (series.terms[0], series.raised[0]) = (first, raised);
        series
    }

    /// Adds the next term of the function.
    #[inline(always)]
    pub(super) fn push(&mut self, term: N) {
        self.latest += 1;
        self.order = self.order + N::Lane::of(1.0);
        self.terms[self.latest] = term;
    }

    /// Adds the next term of the function, whose slope has this latest term.
    #[inline(always)]
    pub(super) fn integrate(&mut self, slope: N) {
        let one = N::Lane::of(1.0);
        self.push(slope * slope.each(one / (self.order + one)));
    }

    /// The next term of the power v of a function z whose first term has the reciprocal `inverse`:
    /// z v' = n v z'.
    #[inline(always)]
    pub(super) fn raise(&mut self, n: N::Lane, inverse: N) -> N {
        let (k, one) = (self.latest, N::Lane::of(1.0));
        let zero = inverse.like(0.0);
        let (mut sum, mut counted, mut count) = (zero, zero, one);
        for j in 1..=k {
            let product = self.terms[j] * self.raised[k - j];
            sum = sum + product;
            counted = product.mul_add(zero.each(count), counted);
            count = count + one;
        }
        let share = zero.each((n + one) / self.order);
        self.raised[k] = counted.mul_add(share, -sum) * inverse;
        self.raised[k]
    }

    /// The value of the function.
    #[inline(always)]
    pub(super) fn sum(&self) -> N {
        let mut sum = self.terms[LENGTH - 1];
        for term in self.terms[..LENGTH - 1].iter().rev() {
            sum = sum + *term;
        }
        sum
    }
}
