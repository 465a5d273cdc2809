//! Least squares in which unknowns lie between bounds.
//!
//! Lawson and Hanson 1974, Solving Least Squares Problems, chapter 23, with bounds on both sides
//! (Stark and Parker 1995, Computational Statistics 10, 129-141): unknowns enter the passive set
//! one by one, where the residual asks for them most, and leave it where they would pass a bound.
//! The subproblems go through a QR factorisation, not the normal equations.

use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};

/// Bounds of an unknown that must not fall below 0.
pub const NOT_NEGATIVE: (f64, f64) = (0.0, f64::INFINITY);

/// Bounds of an unknown that may have any value.
pub const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// Smallest pivot of a column of length 1 that counts as independent of those before it.
const INDEPENDENT: f64 = 1e-10;

/// The `x` with the smallest `|A x - b|` whose entries lie between their bounds.
///
/// An unknown whose column is 0, or depends on others in use, stays as near to 0 as it may.
#[must_use]
pub fn bounded(a: DMatrix<f64>, b: &DVector<f64>, bounds: &[(f64, f64)]) -> DVector<f64> {
    bounded_near(a, b, bounds, &[])
}

/// [`bounded`] beginning with the unknowns that `near` has between their bounds: those near the
/// solution make it one of few steps.
#[must_use]
pub fn bounded_near(
    mut a: DMatrix<f64>,
    b: &DVector<f64>,
    bounds: &[(f64, f64)],
    near: &[f64],
) -> DVector<f64> {
    let n = a.ncols();
    let scale: Vec<f64> = a.column_iter().map(|column| column.norm()).collect();
    for (mut column, &norm) in a.column_iter_mut().zip(&scale) {
        if norm > 0.0 {
            column /= norm;
        }
    }
    let factor = |j: usize| if scale[j] > 0.0 { scale[j] } else { 1.0 };
    let of = |j: usize| bounds.get(j).copied().unwrap_or(NOT_NEGATIVE);
    let (low, high): (Vec<f64>, Vec<f64>) =
        (0..n).map(|j| (of(j).0 * factor(j), of(j).1 * factor(j))).unzip();
    // min and max, not clamp, which panics where bounds cross.
    let within = |j: usize, x: f64| f64::min(f64::max(x, low[j]), high[j]);
    let beginning = |j: usize, _| within(j, near.get(j).map_or(0.0, |x| x * factor(j)));
    let nearest = DVector::from_fn(n, |j, _| within(j, 0.0));
    let x = DVector::from_fn(n, beginning);
    let mut set = Set { a, b, low, high, passive: Vec::new(), x };
    let free = |set: &Set<'_>| -> Vec<usize> {
        let open = |&j: &usize| set.low[j] < set.x[j] && set.x[j] < set.high[j];
        (0..n).filter(|&j| scale[j] > 0.0).filter(open).collect()
    };
    set.passive = free(&set);
    if set.least_squares().is_none() {
        // Some depend on others: one by one.
        set.x = nearest;
        set.passive.clear();
        for j in free(&set) {
            set.passive.push(j);
            if set.least_squares().is_none() {
                set.passive.pop();
            }
        }
    }
    set.descend();
    let mut barred = vec![false; n];
    // Each round lowers the residual, so that no set comes twice; the limit is for rounding.
    for _ in 0..10 * (n + 1) {
        let residual = set.b - &set.a * &set.x;
        let pull = set.a.tr_mul(&residual);
        let least = 1e-12 * residual.norm() + 1e-15 * b.norm();
        let open = |&j: &usize| {
            let way = if set.x[j] >= set.high[j] { -pull[j] } else { pull[j] };
            let room = set.low[j] < set.high[j];
            room && !barred[j] && !set.passive.contains(&j) && way > least
        };
        let more = |&i: &usize, &j: &usize| pull[i].abs().total_cmp(&pull[j].abs());
        let Some(next) = (0..n).filter(open).max_by(more) else { break };
        if set.enter(next) {
            barred.fill(false);
        } else {
            barred[next] = true;
        }
    }
    DVector::from_fn(n, |j, _| if scale[j] > 0.0 { set.x[j] / scale[j] } else { set.x[j] })
}

/// [`bounded`] of rows and their right sides.
///
/// # Errors
/// [`Error::Shape`] where there are not as many right sides as rows, or bounds as entries of a row.
pub fn bounded_rows(rows: &[Vec<f64>], right: &[f64], bounds: &[(f64, f64)]) -> Result<Vec<f64>> {
    if rows.len() != right.len() || rows.iter().any(|row| row.len() != bounds.len()) {
        return Err(Error::Shape {
            name: "rows".into(),
            found: format!("{} with {} right sides", rows.len(), right.len()),
            expected: format!("one of {} numbers for each right side", bounds.len()),
        });
    }
    let matrix = DMatrix::from_fn(rows.len(), bounds.len(), |i, j| rows[i][j]);
    let x = bounded(matrix, &DVector::from_column_slice(right), bounds);
    Ok(x.iter().copied().collect())
}

/// The unknowns in use, and the values of all.
struct Set<'a> {
    a: DMatrix<f64>,
    b: &'a DVector<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
    passive: Vec<usize>,
    x: DVector<f64>,
}

impl Set<'_> {
    /// Takes `next` into use, and others out of it; false where it has to stay where it is.
    fn enter(&mut self, next: usize) -> bool {
        let place = self.x[next];
        self.passive.push(next);
        let inward = self.least_squares().is_some_and(|goal| {
            if place >= self.high[next] { goal[next] < place } else { goal[next] > place }
        });
        if inward && self.descend() {
            return true;
        }
        self.passive.retain(|&j| j != next);
        self.x[next] = place;
        false
    }

    /// Goes to the solution in the unknowns in use; those that meet a bound stay there.
    fn descend(&mut self) -> bool {
        while let Some(goal) = self.least_squares() {
            let bound = |j: usize| if goal[j] > self.x[j] { self.high[j] } else { self.low[j] };
            let beyond = |&&j: &&usize| goal[j] < self.low[j] || goal[j] > self.high[j];
            let step = |&j: &usize| {
                let way = goal[j] - self.x[j];
                if way == 0.0 { 0.0 } else { (bound(j) - self.x[j]) / way }
            };
            let Some(part) = self.passive.iter().filter(beyond).map(step).min_by(f64::total_cmp)
            else {
                self.x = goal;
                return true;
            };
            let blocked: Vec<(usize, f64)> = (self.passive.iter().filter(beyond))
                .filter(|&j| step(j) <= part)
                .map(|&j| (j, bound(j)))
                .collect();
            self.x += part * (&goal - &self.x);
            for &(j, place) in &blocked {
                self.x[j] = place;
            }
            self.passive.retain(|j| !blocked.iter().any(|(other, _)| other == j));
        }
        false
    }

    /// The least squares solution in the unknowns in use; `None` where they are not independent.
    fn least_squares(&self) -> Option<DVector<f64>> {
        let k = self.passive.len();
        let mut x = self.x.clone();
        if k == 0 {
            return Some(x);
        }
        if k > self.a.nrows() {
            return None;
        }
        for &j in &self.passive {
            x[j] = 0.0;
        }
        let factors = self.a.select_columns(&self.passive).qr();
        let triangle = factors.r();
        if triangle.diagonal().iter().any(|pivot| pivot.abs() <= INDEPENDENT) {
            return None;
        }
        let mut right = self.b - &self.a * &x;
        factors.q_tr_mul(&mut right);
        let values = triangle.solve_upper_triangular(&right.rows(0, k).into_owned())?;
        for (&j, value) in self.passive.iter().zip(values.iter()) {
            x[j] = *value;
        }
        Some(x)
    }
}
