//! Jacobian of a record about a candidate, by central or one-sided differences.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::candidate::Candidate;
use super::cost::Evaluator;
use super::creep_shares::{Shares, directions};
use super::normal::Block;
use super::residual_sums::{Simulated, add_creep};
use crate::signal::{Stop, index};

/// Most samples of a record in the Jacobian: more would hardly change the result.
const MOST_ROWS: usize = 200_000;

/// Most samples of a record in the Jacobian of one of many descents.
pub(super) const FEW_ROWS: usize = 50_000;

/// Change of a coordinate of the unit box, for the differences.
pub(super) const CHANGE: f64 = 1e-4;

impl Evaluator<'_> {
    /// By central differences.
    pub(super) fn central(&self, place: &[f64], shares: Shares, stop: Stop<'_>) -> Option<Block> {
        let stride = self.stride(MOST_ROWS);
        let pairs: Vec<(f64, f64)> =
            place.iter().map(|z| ((z - CHANGE).max(0.0), (z + CHANGE).min(1.0))).collect();
        let ends = pairs.iter().enumerate().flat_map(|(d, &(low, high))| [(d, low), (d, high)]);
        let moved = ends.map(|(d, z)| self.beside(&with(place, d, z), shares));
        let candidates: Vec<Candidate> = [self.at(place)].into_iter().chain(moved).collect();
        let found = self.simulated(&candidates, stride, stop);
        if found.iter().any(|one| one.reading.is_empty()) {
            return None;
        }
        let [base, ends @ ..] = &found[..] else { return None };
        let columns = ends.chunks_exact(2).zip(pairs).map(|(ends, (low, high))| {
            let scale = 1.0 / (high - low);
            let (above, below) = (&ends[1].reading, &ends[0].reading);
            above.iter().zip(below).map(|(x, below)| (x - below) * scale).collect()
        });
        Some(self.block(columns.collect(), base, with_creep(base, &shares), shares, stride))
    }

    /// By one-sided differences, at each of some places.
    pub(super) fn one_sided(
        &self,
        places: &[(Vec<f64>, Shares)],
        stop: Stop<'_>,
    ) -> Vec<Option<Block>> {
        let stride = self.stride(FEW_ROWS);
        let change = |z: f64| if z < 0.5 { CHANGE } else { -CHANGE };
        let neighbours = |(place, shares): &(Vec<f64>, Shares)| {
            let moved = place.iter().enumerate().map(|(d, z)| with(place, d, z + change(*z)));
            let moved = moved.map(|place| self.beside(&place, *shares));
            [self.at(place)].into_iter().chain(moved).collect::<Vec<_>>()
        };
        let all: Vec<Candidate> = places.iter().flat_map(neighbours).collect();
        let found = self.simulated(&all, stride, stop);
        let block = |(i, (place, shares)): (usize, &(Vec<f64>, Shares))| {
            let each = 1 + place.len();
            let own = found.get(i * each..(i + 1) * each)?;
            if own.iter().any(|one| one.reading.is_empty()) {
                return None;
            }
            let read = with_creep(&own[0], shares);
            let columns = place.iter().zip(&own[1..]).map(|(z, one)| {
                let scale = 1.0 / change(*z);
                one.reading.iter().zip(&read).map(|(x, base)| (x - base) * scale).collect()
            });
            let columns: Vec<Vec<f64>> = columns.collect();
            Some(self.block(columns, &own[0], read, *shares, stride))
        };
        places.par_iter().enumerate().map(block).collect()
    }

    /// Samples of the window to a row of the normal equations.
    pub(super) fn stride(&self, most: usize) -> usize {
        self.record().window.len().div_ceil(most)
    }

    /// The candidate at a place of this record's problem, its creep read apart.
    fn at(&self, place: &[f64]) -> Candidate {
        Candidate::of(self.problem().theta(place))
    }

    /// One beside it, with the same shares of the creep.
    pub(super) fn beside(&self, place: &[f64], shares: Shares) -> Candidate {
        Candidate { shares: Some(shares), ..self.at(place) }
    }

    /// The normal equations of the columns of a Jacobian, and of the directions in which the shares
    /// can move, with what is read at their place.
    fn block(
        &self,
        mut columns: Vec<Vec<f64>>,
        base: &Simulated,
        read: Vec<f64>,
        shares: Shares,
        stride: usize,
    ) -> Block {
        let directions = directions(&shares);
        for direction in &directions {
            let mut column = vec![0.0; read.len()];
            add_creep(&mut column, &base.outputs, direction);
            columns.push(column);
        }
        for column in &mut columns {
            self.centre(column);
        }
        let record = self.record();
        let measured = record.y[record.window.clone()].iter().step_by(stride);
        let mut residual: Vec<f64> = measured.zip(&read).map(|(y, x)| y - x).collect();
        self.centre(&mut residual);
        let count = columns.len();
        let mut square = DMatrix::zeros(count, count);
        for i in 0..count {
            for j in 0..=i {
                square[(i, j)] = product(&columns[i], &columns[j]);
                square[(j, i)] = square[(i, j)];
            }
        }
        let slope = DVector::from_fn(count, |i, _| product(&columns[i], &residual));
        let squares = product(&residual, &residual);
        Block { square, slope, columns, read, directions: directions.len(), squares }
    }

    /// Measured less simulated at a place with its shares of the creep, the mean taken off where an
    /// offset is fitted.
    pub(super) fn residual(
        &self,
        place: &[f64],
        shares: &Shares,
        stop: Stop<'_>,
    ) -> Option<Vec<f64>> {
        let record = self.record();
        let mut residual = self.reading(&self.problem().theta(place), shares, stop)?;
        let measured = &record.y[record.window.clone()];
        residual.iter_mut().zip(measured).for_each(|(x, y)| *x = y - *x);
        self.centre(&mut residual);
        Some(residual)
    }

    /// Takes the mean off where an offset is fitted.
    fn centre(&self, values: &mut [f64]) {
        if self.problem().offset {
            let mean = mean(values);
            for value in values {
                *value -= mean;
            }
        }
    }
}

/// What is read of a candidate whose creep was read apart, with these shares.
fn with_creep(base: &Simulated, shares: &Shares) -> Vec<f64> {
    let mut read = base.reading.clone();
    add_creep(&mut read, &base.outputs, shares);
    read
}

/// A place with another value of one coordinate.
fn with(place: &[f64], d: usize, z: f64) -> Vec<f64> {
    let mut moved = place.to_vec();
    moved[d] = z;
    moved
}

/// Sums side by side, which the processor adds at once.
const SUMS: usize = 8;

/// Product of two columns.
pub(super) fn product(a: &[f64], b: &[f64]) -> f64 {
    let (a, a_rest) = a.as_chunks::<SUMS>();
    let (b, b_rest) = b.as_chunks::<SUMS>();
    let mut sums = [0.0; SUMS];
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let rest = a_rest.iter().zip(b_rest).map(|(a, b)| a * b);
    sums.into_iter().chain(rest).sum()
}

/// Mean of a column.
fn mean(values: &[f64]) -> f64 {
    let (all, rest) = values.as_chunks::<SUMS>();
    let mut sums = [0.0; SUMS];
    for values in all {
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += value;
        }
    }
    sums.iter().chain(rest).sum::<f64>() / index(values.len())
}
