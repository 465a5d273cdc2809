//! Least squares in which some unknowns must not fall below 0.
//!
//! Lawson and Hanson 1974, Solving Least Squares Problems, chapter 23: unknowns enter the
//! passive set one by one, where the residual asks for them most, and leave it where they would
//! turn negative. The subproblems go through a QR factorisation, not the normal equations.

use nalgebra::{DMatrix, DVector};

/// A least squares problem `min |A x - b|`, its rows `[A b]` compressed as they come.
///
/// The rows are triangularised in blocks, so that a record of any length needs no more memory
/// than a few times the square of the number of unknowns.
#[derive(Clone, Debug)]
pub struct Rows {
    block: DMatrix<f64>,
    filled: usize,
}

/// Rows that are triangularised at once, besides those of the triangle.
const BLOCK: usize = 256;

/// Smallest pivot of a column of length 1 that counts as independent of those before it.
const INDEPENDENT: f64 = 1e-10;

impl Rows {
    /// A problem with so many unknowns and no rows yet.
    #[must_use]
    pub fn new(unknowns: usize) -> Self {
        let columns = unknowns + 1;
        Self { block: DMatrix::zeros(columns + BLOCK, columns), filled: 0 }
    }

    /// Takes a row of A and the entry of b.
    pub fn push(&mut self, row: &[f64], right: f64) {
        let columns = self.block.ncols();
        if self.filled == self.block.nrows() {
            let triangle = self.block.clone().qr().r();
            self.block.rows_mut(0, columns).copy_from(&triangle);
            self.filled = columns;
        }
        for (slot, value) in self.block.row_mut(self.filled).iter_mut().zip(row) {
            *slot = *value;
        }
        self.block[(self.filled, columns - 1)] = right;
        self.filled += 1;
    }

    /// The unknowns; those marked in `free` may have any sign.
    #[must_use]
    pub fn solve(&self, free: &[bool]) -> Vec<f64> {
        let unknowns = self.block.ncols() - 1;
        let rows = self.block.rows(0, self.filled);
        let a = rows.columns(0, unknowns).into_owned();
        let b = rows.column(unknowns).into_owned();
        nnls(a, &b, free).as_slice().to_vec()
    }
}

/// The `x` with the smallest `|A x - b|` whose entries are 0 or above, but for those in `free`.
///
/// An unknown whose column is 0, or depends on others in use, stays 0.
#[must_use]
pub fn nnls(mut a: DMatrix<f64>, b: &DVector<f64>, free: &[bool]) -> DVector<f64> {
    let n = a.ncols();
    let scale: Vec<f64> = a.column_iter().map(|column| column.norm()).collect();
    for (mut column, &norm) in a.column_iter_mut().zip(&scale) {
        if norm > 0.0 {
            column /= norm;
        }
    }
    let is_free = |j: usize| free.get(j).copied().unwrap_or(false);
    let mut set = Set { a, b, passive: Vec::new(), x: DVector::zeros(n) };
    for j in (0..n).filter(|&j| is_free(j) && scale[j] > 0.0) {
        set.passive.push(j);
        match set.least_squares() {
            Some(x) => set.x = x,
            None => drop(set.passive.pop()),
        }
    }
    let mut barred = vec![false; n];
    // Each round lowers the residual, so that no set comes twice; the limit is for rounding.
    for _ in 0..10 * (n + 1) {
        let residual = set.b - &set.a * &set.x;
        let pull = set.a.tr_mul(&residual);
        let least = 1e-12 * residual.norm() + 1e-15 * b.norm();
        let open =
            |&j: &usize| !is_free(j) && !barred[j] && !set.passive.contains(&j) && pull[j] > least;
        let Some(next) = (0..n).filter(open).max_by(|&i, &j| pull[i].total_cmp(&pull[j])) else {
            break;
        };
        if set.enter(next, &is_free) {
            barred.fill(false);
        } else {
            barred[next] = true;
        }
    }
    for (value, norm) in set.x.iter_mut().zip(&scale) {
        *value = if *norm > 0.0 { *value / norm } else { 0.0 };
    }
    set.x
}

/// The unknowns in use, and their values.
struct Set<'a> {
    a: DMatrix<f64>,
    b: &'a DVector<f64>,
    passive: Vec<usize>,
    x: DVector<f64>,
}

impl Set<'_> {
    /// Takes `next` into use, and others out of it; false where it has to stay 0.
    fn enter(&mut self, next: usize, is_free: &impl Fn(usize) -> bool) -> bool {
        self.passive.push(next);
        let mut first = true;
        while let Some(goal) = self.least_squares() {
            if first && goal[next] <= 0.0 {
                break;
            }
            first = false;
            let below = |&&j: &&usize| !is_free(j) && goal[j] <= 0.0;
            let step = |&j: &usize| {
                let way = self.x[j] - goal[j];
                if way > 0.0 { self.x[j] / way } else { 0.0 }
            };
            let Some(part) = self.passive.iter().filter(below).map(step).min_by(f64::total_cmp)
            else {
                self.x = goal;
                return true;
            };
            let blocked: Vec<usize> =
                (self.passive.iter().filter(below)).filter(|&j| step(j) <= part).copied().collect();
            self.x += part * (goal - &self.x);
            for &j in &blocked {
                self.x[j] = 0.0;
            }
            self.passive.retain(|j| !blocked.contains(j));
        }
        self.passive.retain(|&j| j != next);
        self.x[next] = 0.0;
        false
    }

    /// The least squares solution in the unknowns in use; `None` where they are not independent.
    fn least_squares(&self) -> Option<DVector<f64>> {
        let k = self.passive.len();
        let mut x = DVector::zeros(self.a.ncols());
        if k == 0 {
            return Some(x);
        }
        if k > self.a.nrows() {
            return None;
        }
        let factors = self.a.select_columns(&self.passive).qr();
        let triangle = factors.r();
        if triangle.diagonal().iter().any(|pivot| pivot.abs() <= INDEPENDENT) {
            return None;
        }
        let mut right = self.b.clone();
        factors.q_tr_mul(&mut right);
        let values = triangle.solve_upper_triangular(&right.rows(0, k).into_owned())?;
        for (&j, value) in self.passive.iter().zip(values.iter()) {
            x[j] = *value;
        }
        Some(x)
    }
}
