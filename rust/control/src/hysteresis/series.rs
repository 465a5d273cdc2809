//! Series of the exponential and the logarithm, and the power made of them, in lanes.

use core::f64::consts::{LN_2, LOG2_E};

use crate::{Number, Real};

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

/// A number from 0 up to a power above 0: 2^(a log2 x), to a few roundings of that exponent.
///
/// 0 for a number below the smallest one with all its digits, and NaN for infinity.
#[inline(always)]
pub(super) fn power<N: Number>(x: N, a: N::Lane) -> N {
    let one = x.like(1.0);
    let mantissa = N::lanewise([x], |[x]| x.mantissa());
    let exponent = N::lanewise([x], |[x]| x.exponent());
    let w = (mantissa - one) / (mantissa + one);
    let log = w.mul_add(polynomial(w * w, &LOG2), exponent);
    let least = x.each(N::Lane::LEAST_EXPONENT);
    let log = (log * x.each(a)).larger(least).smaller(one - least);
    let whole = x.each(N::Lane::WHOLE);
    let exponent = (log + whole) - whole;
    let part = log - exponent;
    let mantissa = part.mul_add(polynomial(part, &EXP2), one);
    let result = mantissa * N::lanewise([exponent], |[exponent]| exponent.two_to());
    // NaN of infinity.
    let zero = x * x.like(0.0);
    (x - x.each(N::Lane::MIN_POSITIVE)).where_negative(zero, result + zero)
}

/// A polynomial, even and odd terms apart: half as long a chain of operations.
#[inline(always)]
pub(super) fn polynomial<N: Number, const TERMS: usize>(x: N, terms: &[f64; TERMS]) -> N {
    const { assert!(TERMS.is_multiple_of(2)) };
    let square = x * x;
    let (mut even, mut odd) = (x.like(terms[TERMS - 2]), x.like(terms[TERMS - 1]));
    for k in (0..TERMS - 2).step_by(2).rev() {
        even = even.mul_add(square, x.like(terms[k]));
        odd = odd.mul_add(square, x.like(terms[k + 1]));
    }
    odd.mul_add(x, even)
}

/// log2((1 + w)/(1 - w))/w in w^2, for w^2 up to (3 - 2 sqrt 2)^2: the next term is below 1e-17.
const LOG2: [f64; 10] = {
    let mut out = [0.0; 10];
    let mut k = 0;
    while k < out.len() {
        out[k] = 2.0 * LOG2_E * RECIPROCAL_ODD[k];
        k += 1;
    }
    out
};

/// (2^x - 1)/x, for |x| up to 1/2: the next term is below 1e-17.
const EXP2: [f64; 14] = {
    let mut out = [0.0; 14];
    let (mut k, mut power) = (0, LN_2);
    while k < out.len() {
        out[k] = power * RECIPROCAL_FACTORIAL[k + 1];
        power *= LN_2;
        k += 1;
    }
    out
};

/// (e^x - 1)/x, for |x| up to 1/2.
pub(super) const GROWTH: [f64; TERMS] = {
    let mut out = [0.0; TERMS];
    let mut k = 0;
    while k < TERMS {
        out[k] = RECIPROCAL_FACTORIAL[k + 1];
        k += 1;
    }
    out
};

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

#[cfg(test)]
mod tests {
    use super::power;
    use crate::Real;

    #[test]
    fn powers_are_those_of_libm() {
        for exponent in [0.02_f64, 0.3, 0.6, 1.0, 2.5, 19.0] {
            for k in -560..=560 {
                let number = 10.0_f64.powf(f64::from(k) / 37.0);
                let expected = libm::pow(number, exponent);
                let logarithm = 1.0 + (exponent * number.ln()).abs();
                let error = (power(number, exponent) / expected - 1.0).abs();
                assert!(error < 4e-16 * logarithm, "{number} {exponent} {error}");
                if (1e-30..1e30).contains(&expected) {
                    let single = f64::from(power(f32::of(number), f32::of(exponent)));
                    let error = (single / expected - 1.0).abs();
                    assert!(error < 3e-7 * logarithm, "{number} {exponent} {error}");
                }
            }
            assert!(power(0.0_f64, exponent).abs() <= 0.0);
            assert!(power(f64::NAN, exponent).is_nan());
        }
    }
}
