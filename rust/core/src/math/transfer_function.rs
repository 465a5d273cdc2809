//! Functions of z with their derivative, and ratios of polynomials in `z - 1`.

use core::ops::{Add, Mul, Sub};

use nalgebra::{Complex, DMatrix, DVector};

use crate::error::{Error, Result};

/// A complex number.
pub(crate) type C = Complex<f64>;

/// Value and derivative with respect to z of a function at one z.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jet {
    pub value: C,
    pub slope: C,
}

impl Jet {
    /// A constant.
    pub fn constant(value: f64) -> Self {
        Self { value: C::new(value, 0.0), slope: C::new(0.0, 0.0) }
    }

    /// A real multiple.
    pub fn scale(self, by: f64) -> Self {
        Self { value: self.value * by, slope: self.slope * by }
    }

    /// 1/f.
    pub fn inverse(self) -> Self {
        let value = C::new(1.0, 0.0) / self.value;
        Self { value, slope: -self.slope * value * value }
    }

    /// The power `f^n`, and the sum `1 + f + ... + f^(n-1)`, without dividing by `1 - f`.
    ///
    /// By doubling: `f^2n = f^n f^n`, and the sum of twice as many is `s (1 + f^n)`.
    pub fn power(self, n: usize) -> (Self, Self) {
        let one = Self::constant(1.0);
        let (mut power, mut sum) = (one, Self::constant(0.0));
        for bit in (0..usize::BITS - n.leading_zeros()).rev() {
            sum = sum * (one + power);
            power = power * power;
            if (n >> bit) & 1 == 1 {
                sum = sum + power;
                power = power * self;
            }
        }
        (power, sum)
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, slope: self.slope + other.slope }
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, slope: self.slope - other.slope }
    }
}

impl Mul for Jet {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            slope: self.slope * other.value + self.value * other.slope,
        }
    }
}

/// A transfer function: polynomials in `delta = z - 1`, the constant term first.
///
/// Around z = 1, where slow poles of a fast loop crowd, `delta` keeps the digits that z loses
/// (Middleton and Goodwin, Digital Control and Estimation, 1990). The denominator is monic and of
/// a degree not below the numerator's.
#[derive(Clone, Debug)]
pub(crate) struct Ratio {
    pub above: Vec<f64>,
    pub below: Vec<f64>,
}

impl Ratio {
    /// A number.
    pub fn constant(value: f64) -> Self {
        Self { above: vec![value], below: vec![1.0] }
    }

    /// `c (delta I - E)^-1 b + d` by the recursion of Faddeev and Le Verrier (Gantmacher, The
    /// Theory of Matrices, chapter IV.5).
    pub fn of_matrices(e: &DMatrix<f64>, b: &DVector<f64>, c: &DVector<f64>, d: f64) -> Self {
        let n = e.nrows();
        let mut above = vec![0.0; n + 1];
        let mut below = vec![0.0; n + 1];
        below[n] = 1.0;
        let mut adjoint = DMatrix::<f64>::identity(n, n);
        let mut order = 0.0;
        for k in (0..n).rev() {
            above[k] = c.dot(&(&adjoint * b));
            adjoint = e * adjoint;
            order += 1.0;
            below[k] = -adjoint.trace() / order;
            for i in 0..n {
                adjoint[(i, i)] += below[k];
            }
        }
        for (above, below) in above.iter_mut().zip(&below) {
            *above += d * below;
        }
        Self { above, below }
    }

    /// Numerator and denominator at a point.
    pub fn at(&self, delta: Jet) -> (Jet, Jet) {
        (horner(&self.above, delta), horner(&self.below, delta))
    }

    /// Degree of the denominator.
    pub fn degree(&self) -> usize {
        self.below.len() - 1
    }

    /// The ratio of `above + w other` to the same denominator, w = 1/z.
    pub fn and_later(&self, other: &[f64]) -> Self {
        let mut above = times_z(&self.above);
        for (above, other) in above.iter_mut().zip(other) {
            *above += other;
        }
        Self { above, below: times_z(&self.below) }
    }

    /// Takes common roots at z = 1 out; how many there were.
    pub fn cancel_integrators(&mut self) -> usize {
        let mut count = 0;
        while self.degree() > 0 && zero_at_one(&self.above) && zero_at_one(&self.below) {
            self.above.remove(0);
            self.below.remove(0);
            count += 1;
        }
        if self.above.is_empty() {
            self.above.push(0.0);
        }
        count
    }

    /// Whether there is a pole at exactly 1, up to rounding.
    pub fn integrates(&self) -> bool {
        self.degree() > 0 && zero_at_one(&self.below)
    }

    /// Without the pole at 1 that [`Self::integrates`] found.
    pub fn without_integrator(&self) -> Self {
        Self { above: self.above.clone(), below: self.below[1..].to_vec() }
    }

    /// Refuses coefficients that are too large to be numbers.
    pub fn checked(self, name: &str) -> Result<Self> {
        if self.above.iter().chain(&self.below).all(|c| c.abs() < 1e150) {
            return Ok(self);
        }
        Err(Error::Numerical(format!("the transfer function of the {name} has no finite numbers")))
    }
}

fn zero_at_one(polynomial: &[f64]) -> bool {
    let size = polynomial.iter().fold(0.0_f64, |most, c| most.max(c.abs()));
    polynomial.first().is_none_or(|first| first.abs() <= 1e-15 * size)
}

fn times_z(polynomial: &[f64]) -> Vec<f64> {
    let mut out = polynomial.to_vec();
    out.push(0.0);
    for (out, c) in out.iter_mut().skip(1).zip(polynomial) {
        *out += c;
    }
    out
}

fn horner(polynomial: &[f64], x: Jet) -> Jet {
    polynomial.iter().rev().fold(Jet::constant(0.0), |sum, &c| sum * x + Jet::constant(c))
}
