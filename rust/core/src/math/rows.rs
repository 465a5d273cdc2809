//! Rows of a least squares problem, compressed to a triangle as they come.
//!
//! Householder's reflections (Golub and Van Loan 2013, Matrix Computations, section 5.2) take the
//! triangle of the rows so far and a block of further ones to the triangle of all.

use nalgebra::DMatrix;
use pulp::{Simd, WithSimd};

use super::bounded_least_squares::bounded_near;
use super::dispatch::dispatch_fused;

/// A least squares problem `min |A x - b|`, its rows `[A b]` compressed as they come.
///
/// A record of any length needs no more memory than a few times the square of the number of
/// unknowns.
#[derive(Clone, Debug)]
pub struct Rows {
    columns: usize,
    /// Row by row, each from its start on; what is left of the diagonal is 0.
    triangle: Vec<f64>,
    /// Column by column.
    block: Vec<f64>,
    filled: usize,
}

/// Rows that are triangularised at once.
const BLOCK: usize = 256;

/// Distance of columns in a block: not a power of two, by which the columns would share few places
/// of the processor's cache.
const PITCH: usize = BLOCK + 8;

/// Sums that a scalar product is split in, as many as keep a processor's vectors busy.
const SUMS: usize = 16;

impl Rows {
    /// A problem with so many unknowns and no rows yet.
    #[must_use]
    pub fn new(unknowns: usize) -> Self {
        let columns = unknowns + 1;
        let (triangle, block) = (vec![0.0; columns * columns], vec![0.0; columns * PITCH]);
        Self { columns, triangle, block, filled: 0 }
    }

    /// Takes a row of A and the entry of b.
    pub fn push(&mut self, row: &[f64], right: f64) {
        if self.filled == BLOCK {
            self.compress();
        }
        let places = self.block.iter_mut().skip(self.filled).step_by(PITCH);
        for (slot, value) in places.zip(row) {
            *slot = *value;
        }
        self.block[(self.columns - 1) * PITCH + self.filled] = right;
        self.filled += 1;
    }

    /// Root of the mean square that `x` leaves of so many rows.
    #[must_use]
    pub fn rms(&mut self, x: &[f64], count: f64) -> f64 {
        self.compress();
        let left = |row: &[f64]| {
            let known: f64 = row.iter().zip(x).map(|(a, x)| a * x).sum();
            let left = row.get(x.len()).unwrap_or(&0.0) - known;
            left * left
        };
        let squares: f64 = self.triangle.chunks_exact(self.columns).map(left).sum();
        libm::sqrt(squares / count.max(1.0))
    }

    /// Largest entry of A's triangle, at least the smallest positive number.
    #[must_use]
    pub fn size(&mut self) -> f64 {
        self.compress();
        let of_a = self.triangle.chunks_exact(self.columns).flat_map(|row| &row[..row.len() - 1]);
        of_a.fold(f64::MIN_POSITIVE, |most, entry| most.max(entry.abs()))
    }

    /// The unknowns, each between its bounds.
    #[must_use]
    pub fn solve(&mut self, bounds: &[(f64, f64)]) -> Vec<f64> {
        self.solve_near(bounds, &[])
    }

    /// The same, beginning with those of `near`.
    #[must_use]
    pub fn solve_near(&mut self, bounds: &[(f64, f64)], near: &[f64]) -> Vec<f64> {
        self.compress();
        let rows = DMatrix::from_row_slice(self.columns, self.columns, &self.triangle);
        let unknowns = self.columns - 1;
        let (a, b) = (rows.columns(0, unknowns).into_owned(), rows.column(unknowns).into_owned());
        bounded_near(a, &b, bounds, near).as_slice().to_vec()
    }

    /// Takes the block into the triangle.
    fn compress(&mut self) {
        if self.filled > 0 {
            dispatch_fused(Compression(self));
            self.filled = 0;
        }
    }
}

/// The reflections of a block.
struct Compression<'a>(&'a mut Rows);

impl WithSimd for Compression<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Rows { columns, triangle, block, filled } = self.0;
        for (j, top) in triangle.chunks_exact_mut(*columns).enumerate() {
            let (done, after) = block.split_at_mut((j + 1) * PITCH);
            let below = &done[j * PITCH..][..*filled];
            let size = product(below, below);
            if size <= 0.0 {
                continue;
            }
            let corner = top[j];
            let norm = libm::sqrt(corner.mul_add(corner, size));
            let diagonal = if corner > 0.0 { -norm } else { norm };
            let first = corner - diagonal;
            let twice = 2.0 / (first * first + size);
            top[j] = diagonal;
            for (entry, column) in top[j + 1..].iter_mut().zip(after.chunks_exact_mut(PITCH)) {
                let column = &mut column[..*filled];
                let part = twice * (first * *entry + product(below, column));
                *entry -= part * first;
                for (value, by) in column.iter_mut().zip(below) {
                    *value -= part * by;
                }
            }
        }
    }
}

/// Scalar product; the order of its sums is the same on every processor.
#[inline(always)]
fn product(one: &[f64], other: &[f64]) -> f64 {
    let (mut ones, mut others) = (one.chunks_exact(SUMS), other.chunks_exact(SUMS));
    let mut sums = [0.0; SUMS];
    for (one, other) in ones.by_ref().zip(others.by_ref()) {
        for ((sum, one), other) in sums.iter_mut().zip(one).zip(other) {
            *sum += one * other;
        }
    }
    let rest = ones.remainder().iter().zip(others.remainder());
    sums.iter().sum::<f64>() + rest.map(|(one, other)| one * other).sum::<f64>()
}
