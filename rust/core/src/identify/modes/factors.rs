//! Factors of symmetric matrices: Cholesky's, with the largest pivots first.

use pulp::{Simd, WithSimd};

use crate::error::Result;
use crate::math::{dispatch_fused, room};

/// A factorised positive semidefinite matrix.
///
/// Unknowns whose pivots are not above a least one depend on the others and are 0 in every
/// solution: a generalised inverse (Higham 2002, Accuracy and Stability of Numerical Algorithms,
/// 2nd ed., section 10.3).
pub(super) struct Factors {
    size: usize,
    rank: usize,
    /// The unknown of each row.
    order: Vec<usize>,
    /// The upper factor, row by row.
    upper: Vec<f64>,
}

impl Factors {
    /// Factors of a matrix of which the part at and above the diagonal is read, row by row.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory).
    pub fn new(matrix: &[f64], size: usize, least: f64) -> Result<Self> {
        let mut upper = room("the factors", matrix.len())?;
        upper.extend_from_slice(matrix);
        let mut found = Self { size, rank: 0, order: (0..size).collect(), upper };
        dispatch_fused(Elimination { factors: &mut found, least });
        Ok(found)
    }

    /// The solution for a right side.
    pub fn solve(&self, right: &[f64]) -> Vec<f64> {
        let n = self.size;
        let mut x: Vec<f64> = self.order.iter().map(|&k| right[k]).collect();
        for j in 0..self.rank {
            let row = &self.upper[j * n..][..self.rank];
            let value = x[j] / row[j];
            x[j] = value;
            for (slot, factor) in x[j + 1..].iter_mut().zip(&row[j + 1..]) {
                *slot -= factor * value;
            }
        }
        for j in (0..self.rank).rev() {
            let row = &self.upper[j * n..][..self.rank];
            let known: f64 = row[j + 1..].iter().zip(&x[j + 1..]).map(|(a, x)| a * x).sum();
            x[j] = (x[j] - known) / row[j];
        }
        let mut found = vec![0.0; n];
        for (&k, value) in self.order.iter().zip(&x).take(self.rank) {
            found[k] = *value;
        }
        found
    }

    /// Exchanges two unknowns that are not eliminated yet.
    fn exchange(&mut self, j: usize, p: usize) {
        if j == p {
            return;
        }
        let n = self.size;
        self.order.swap(j, p);
        let upper = &mut self.upper;
        for row in 0..j {
            upper.swap(row * n + j, row * n + p);
        }
        upper.swap(j * n + j, p * n + p);
        for k in j + 1..p {
            upper.swap(j * n + k, k * n + p);
        }
        for k in p + 1..n {
            upper.swap(j * n + k, p * n + k);
        }
    }
}

/// Divides a matrix by the scales of its rows and columns.
pub(super) fn scale_matrix(matrix: &mut [f64], scale: &[f64]) {
    for (row, by) in matrix.chunks_exact_mut(scale.len()).zip(scale) {
        for (value, other) in row.iter_mut().zip(scale) {
            *value /= by * other;
        }
    }
}

struct Elimination<'a> {
    factors: &'a mut Factors,
    least: f64,
}

impl WithSimd for Elimination<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { factors, least } = self;
        let n = factors.size;
        for j in 0..n {
            let (mut place, mut pivot) = (j, least);
            for k in j..n {
                let here = factors.upper[k * n + k];
                if here > pivot {
                    (place, pivot) = (k, here);
                }
            }
            // NaN is above nothing.
            if pivot.is_nan() || pivot <= least {
                return;
            }
            factors.exchange(j, place);
            let (done, rest) = factors.upper.split_at_mut((j + 1) * n);
            let top = &mut done[j * n + j..];
            let root = libm::sqrt(pivot);
            top[0] = root;
            let top = &mut top[1..];
            for entry in top.iter_mut() {
                *entry /= root;
            }
            for (i, row) in rest.chunks_exact_mut(n).enumerate() {
                let factor = -top[i];
                for (entry, by) in row[j + 1 + i..].iter_mut().zip(&top[i..]) {
                    *entry = factor.mul_add(*by, *entry);
                }
            }
            factors.rank = j + 1;
        }
    }
}
