//! Series of the exponential and the logarithm, in lanes.

use crate::Number;

/// Terms of the exponential's series: for 0.5 the next is below 0.5^14 / 15! = 5e-17.
pub(super) const TERMS: usize = 14;
/// Terms of the logarithm's series: the next is below 0.25^26 / 27 = 1e-17.
const LOG_TERMS: usize = 13;

/// (e^x - 1)/x by its series: with [`TERMS`] terms for |x| up to 0.5.
#[inline(always)]
pub(super) fn growth<N: Number, const TERMS: usize>(x: N) -> N {
    let mut sum = x.like(RECIPROCAL_FACTORIAL[TERMS]);
    for k in (1..TERMS).rev() {
        sum = sum.mul_add(x, x.like(RECIPROCAL_FACTORIAL[k]));
    }
    sum
}

/// ln(1 + y)/y for y from e^-0.5 - 1 to e^0.5 - 1, by ln(1 + y) = 2 artanh(y/(2 + y)).
#[inline(always)]
pub(super) fn logarithm<N: Number>(y: N) -> N {
    let below = y + y.like(2.0);
    let w = y / below;
    let square = w * w;
    let mut sum = y.like(RECIPROCAL_ODD[LOG_TERMS - 1]);
    for k in (0..LOG_TERMS - 1).rev() {
        sum = sum.mul_add(square, y.like(RECIPROCAL_ODD[k]));
    }
    sum * y.like(2.0) / below
}

/// 1/k!
pub(super) const RECIPROCAL_FACTORIAL: [f64; TERMS + 1] = reciprocal_factorials();

const fn reciprocal_factorials() -> [f64; TERMS + 1] {
    let mut out = [1.0; TERMS + 1];
    let (mut k, mut number, mut product) = (1, 1.0, 1.0);
    while k <= TERMS {
        product *= number;
        out[k] = 1.0 / product;
        number += 1.0;
        k += 1;
    }
    out
}

/// 1/(2 k + 1)
const RECIPROCAL_ODD: [f64; LOG_TERMS] = reciprocal_odds();

const fn reciprocal_odds() -> [f64; LOG_TERMS] {
    let mut out = [1.0; LOG_TERMS];
    let (mut k, mut odd) = (0, 1.0);
    while k < LOG_TERMS {
        out[k] = 1.0 / odd;
        odd += 2.0;
        k += 1;
    }
    out
}
