//! Inner products of many columns, each summed in the order of its rows.

use crate::error::Result;
use crate::math::{room, zeros};

/// Columns beside each other in memory.
const WIDE: usize = 8;

/// Columns of the left side that are multiplied at once.
const TALL: usize = 4;

/// Columns of equal length, in panels of some beside each other.
pub(super) struct Columns {
    rows: usize,
    /// Panel after panel, each row by row.
    entries: Vec<f64>,
}

impl Columns {
    /// So many columns of 0.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory).
    pub fn new(rows: usize, columns: usize) -> Result<Self> {
        let panels = columns.div_ceil(WIDE);
        Ok(Self { rows, entries: zeros("the columns", panels * WIDE * rows)? })
    }

    /// Number of columns, with those that fill the last panel.
    pub fn width(&self) -> usize {
        self.entries.len().checked_div(self.rows).unwrap_or(0)
    }

    /// The entries of a column, in the order of its rows.
    #[inline(always)]
    pub fn column(&mut self, column: usize) -> impl Iterator<Item = &mut f64> {
        let first = column / WIDE * WIDE * self.rows;
        self.entries[first..][..WIDE * self.rows].iter_mut().skip(column % WIDE).step_by(WIDE)
    }
}

/// Inner products of the columns of two sides.
pub(super) struct Products {
    wide: usize,
    entries: Vec<f64>,
}

impl Products {
    /// Products of 0 of sides of these widths.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory).
    pub fn new(left: &Columns, right: &Columns) -> Result<Self> {
        let (tall, wide) = (left.width(), right.width());
        let mut entries = room("the inner products", tall.saturating_mul(wide))?;
        entries.resize(tall * wide, 0.0);
        Ok(Self { wide, entries })
    }

    /// Products that are 0 again.
    pub fn clear(&mut self) {
        self.entries.fill(0.0);
    }

    /// The product of a column of the left and one of the right side.
    #[inline(always)]
    pub fn get(&self, left: usize, right: usize) -> f64 {
        self.entries[left * self.wide + right]
    }

    /// Adds the products of all columns of the left side with all of the right side.
    #[inline(always)]
    pub fn add(&mut self, left: &Columns, right: &Columns) {
        self.accumulate(left, right, |_| 0);
    }

    /// Adds the products of columns among each other, of those at or above the diagonal.
    #[inline(always)]
    pub fn add_own(&mut self, columns: &Columns) {
        self.accumulate(columns, columns, |panel| panel);
    }

    #[inline(always)]
    fn accumulate(&mut self, left: &Columns, right: &Columns, from: impl Fn(usize) -> usize) {
        let size = WIDE * left.rows.max(1);
        for (i, a) in left.entries.chunks_exact(size).enumerate() {
            for (j, b) in right.entries.chunks_exact(size).enumerate().skip(from(i)) {
                for half in 0..WIDE / TALL {
                    let first = i * WIDE + half * TALL;
                    let mut sums = [[0.0; WIDE]; TALL];
                    for (row, sums) in sums.iter_mut().enumerate() {
                        let place = (first + row) * self.wide + j * WIDE;
                        sums.copy_from_slice(&self.entries[place..][..WIDE]);
                    }
                    tile(a, b, half * TALL, &mut sums);
                    for (row, sums) in sums.iter().enumerate() {
                        let place = (first + row) * self.wide + j * WIDE;
                        self.entries[place..][..WIDE].copy_from_slice(sums);
                    }
                }
            }
        }
    }
}

/// Adds the products of some columns of a panel with all of another.
#[inline(always)]
fn tile(a: &[f64], b: &[f64], first: usize, sums: &mut [[f64; WIDE]; TALL]) {
    let mut found = *sums;
    for (a, b) in a.chunks_exact(WIDE).zip(b.chunks_exact(WIDE)) {
        for (row, sums) in found.iter_mut().enumerate() {
            let factor = a[first + row];
            for (sum, value) in sums.iter_mut().zip(b) {
                *sum = factor.mul_add(*value, *sum);
            }
        }
    }
    *sums = found;
}
