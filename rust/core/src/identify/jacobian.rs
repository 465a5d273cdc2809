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
        let mut found = found.into_iter();
        let base = found.next()?;
        let columns = pairs.into_iter().filter_map(|(low, high)| {
            let (below, above) = (found.next()?, found.next()?);
            Some(slope(above.reading, &below.reading, 1.0 / (high - low)))
        });
        let columns = columns.collect();
        Some(self.block(columns, with_creep(base, &shares), shares, stride))
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
        let mut found = self.simulated(&all, stride, stop).into_iter();
        let own = places.iter().map(|(place, _)| found.by_ref().take(1 + place.len()).collect());
        let own: Vec<Vec<Simulated>> = own.collect();
        let block = |(own, (place, shares)): (Vec<Simulated>, &(Vec<f64>, Shares))| {
            if own.iter().any(|one| one.reading.is_empty()) {
                return None;
            }
            let mut own = own.into_iter();
            let base = with_creep(own.next()?, shares);
            let columns = place.iter().zip(own);
            let columns =
                columns.map(|(z, one)| slope(one.reading, &base.reading, 1.0 / change(*z)));
            let columns = columns.collect();
            Some(self.block(columns, base, *shares, stride))
        };
        own.into_par_iter().zip(places).map(block).collect()
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
        base: Simulated,
        shares: Shares,
        stride: usize,
    ) -> Block {
        let (read, directions) = (base.reading, directions(&shares));
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

/// Change of what is read with a coordinate, from one place to another.
fn slope(mut read: Vec<f64>, from: &[f64], scale: f64) -> Vec<f64> {
    for (x, from) in read.iter_mut().zip(from) {
        *x = (*x - from) * scale;
    }
    read
}

/// A candidate whose creep was read apart, with these shares.
fn with_creep(mut base: Simulated, shares: &Shares) -> Simulated {
    add_creep(&mut base.reading, &base.outputs, shares);
    base
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
