//! Normal equations about a candidate, from central or one-sided differences, of all records.
//!
//! The shares of the creep are linear: they enter as coordinates, and are eliminated.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::candidate::Candidate;
use super::cost::Evaluator;
use super::creep_shares::{LEAST_PIVOT, Shares, directions};
use super::information::add_priors;
use super::journal::{Answer, remembered};
use super::records::{Member, Records};
use super::residual_sums::Simulated;
use crate::signal::{Stop, index};

/// Most samples of a record in the Jacobian: more would hardly change the result.
const MOST_ROWS: usize = 200_000;

/// Most samples of a record in the Jacobian of one of many descents.
const FEW_ROWS: usize = 50_000;

/// Change of a coordinate of the unit box, for the differences.
pub(super) const CHANGE: f64 = 1e-4;

/// Normal equations about a candidate, in coordinates of the unit box.
pub(super) struct Normal {
    /// J^T J.
    pub square: DMatrix<f64>,
    /// J^T r, r being measured less simulated.
    pub slope: DVector<f64>,
    /// Samples that entered.
    pub rows: usize,
}

/// First the rows, -1 where a neighbour could not be simulated.
impl Answer for Option<Normal> {
    fn length(coordinates: usize) -> usize {
        1 + coordinates + coordinates * coordinates
    }

    fn write(&self, numbers: &mut Vec<f64>, coordinates: usize) {
        if let Some(Normal { square, slope, rows }) = self {
            numbers.push(index(*rows));
            numbers.extend(slope.iter());
            numbers.extend(square.iter());
        } else {
            numbers.push(-1.0);
            numbers.resize(numbers.len() + Self::length(coordinates) - 1, 0.0);
        }
    }

    fn read(numbers: &[f64], coordinates: usize) -> Self {
        let (&rows, rest) = numbers.split_first()?;
        let (slope, square) = rest.split_at_checked(coordinates)?;
        if rows < 0.0 {
            return None;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count, written above"
        )]
        let rows = rows as usize;
        Some(Normal {
            square: DMatrix::from_column_slice(coordinates, coordinates, square),
            slope: DVector::from_column_slice(slope),
            rows,
        })
    }
}

/// What one record adds to them, in its own coordinates and after them the directions of the shares.
struct Block {
    square: DMatrix<f64>,
    slope: DVector<f64>,
    directions: usize,
    /// Sum of r^2.
    squares: f64,
    rows: usize,
}

impl Records<'_> {
    /// Normal equations at a place with its shares of the creep, by central differences, with the
    /// priors, for which the mean
    /// square of the deviations times `samples_over_freedom` is the variance of one; `None` where a
    /// neighbour cannot be simulated.
    pub(super) fn normal(
        &self,
        place: &[f64],
        shares: Shares,
        samples_over_freedom: f64,
        stop: Stop<'_>,
    ) -> Option<Normal> {
        let block = |one: &Member<'_>| one.evaluator.central(&one.own(place), shares, stop);
        let computed = || {
            let blocks: Option<Vec<Block>> = self.members().iter().map(block).collect();
            vec![blocks.map(|blocks| self.joined(place, &blocks, samples_over_freedom))]
        };
        remembered(self.journal(), (1, place.len()), stop, computed).pop().flatten()
    }

    /// Normal equations at each of some places with its shares of the creep, by one-sided
    /// differences, all simulated side by side; `None` for one where a neighbour cannot be simulated.
    pub(super) fn normals(
        &self,
        places: &[(Vec<f64>, Shares)],
        stop: Stop<'_>,
    ) -> Vec<Option<Normal>> {
        let questions = (places.len(), self.coordinates().len());
        remembered(self.journal(), questions, stop, || self.differentiated(places, stop))
    }

    fn differentiated(&self, places: &[(Vec<f64>, Shares)], stop: Stop<'_>) -> Vec<Option<Normal>> {
        let mut all: Vec<Option<Vec<Block>>> = places.iter().map(|_| Some(Vec::new())).collect();
        for one in self.members() {
            let own: Vec<(Vec<f64>, Shares)> =
                places.iter().map(|(place, shares)| (one.own(place), *shares)).collect();
            for (blocks, block) in all.iter_mut().zip(one.evaluator.one_sided(&own, stop)) {
                match (blocks.as_mut(), block) {
                    (Some(blocks), Some(block)) => blocks.push(block),
                    _ => *blocks = None,
                }
            }
        }
        let joined = |((place, _), blocks): (&(Vec<f64>, Shares), Option<Vec<Block>>)| {
            Some(self.joined(place, &blocks?, 1.0))
        };
        places.iter().zip(all).map(joined).collect()
    }

    /// The equations of all records, each as much as its share, about the best shares of the creep;
    /// and the priors.
    fn joined(&self, place: &[f64], blocks: &[Block], samples_over_freedom: f64) -> Normal {
        let count = place.len();
        let rows = blocks.iter().map(|block| block.rows).sum();
        let directions = blocks.first().map_or(0, |block| block.directions);
        let all = count + directions;
        let (mut square, mut slope) = (DMatrix::zeros(all, all), DVector::zeros(all));
        let mut squares = 0.0;
        for (one, block) in self.members().iter().zip(blocks) {
            let scale = one.share * index(rows) / index(block.rows);
            let slots: Vec<usize> = one.slots().iter().copied().chain(count..all).collect();
            for (i, &row) in slots.iter().enumerate() {
                slope[row] += scale * block.slope[i];
                for (j, &column) in slots.iter().enumerate() {
                    square[(row, column)] += scale * block.square[(i, j)];
                }
            }
            squares += scale * block.squares;
        }
        let (mut square, mut slope) = eliminated(square, slope, count);
        // Some rows stand for all samples, and weigh less against the priors by their share.
        let variance = squares / index(self.samples()) * samples_over_freedom;
        add_priors(self, place, variance, &mut square, &mut slope);
        Normal { square, slope, rows }
    }
}

impl Evaluator<'_> {
    /// By central differences.
    fn central(&self, place: &[f64], shares: Shares, stop: Stop<'_>) -> Option<Block> {
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
        Some(self.block(columns.collect(), base, &with_creep(base, &shares), shares, stride))
    }

    /// By one-sided differences, at each of some places.
    fn one_sided(&self, places: &[(Vec<f64>, Shares)], stop: Stop<'_>) -> Vec<Option<Block>> {
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
            Some(self.block(columns.collect(), &own[0], &read, *shares, stride))
        };
        places.par_iter().enumerate().map(block).collect()
    }

    /// Samples of the window to a row of the normal equations.
    fn stride(&self, most: usize) -> usize {
        self.record().window.len().div_ceil(most)
    }

    /// The candidate at a place of this record's problem, its creep read apart.
    fn at(&self, place: &[f64]) -> Candidate {
        Candidate::of(self.problem().theta(place))
    }

    /// One beside it, with the same shares of the creep.
    fn beside(&self, place: &[f64], shares: Shares) -> Candidate {
        Candidate { shares: Some(shares), ..self.at(place) }
    }

    /// The normal equations of the columns of a Jacobian, and of the directions in which the shares
    /// can move, with what is read at their place.
    fn block(
        &self,
        mut columns: Vec<Vec<f64>>,
        base: &Simulated,
        read: &[f64],
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
        let mut residual: Vec<f64> = measured.zip(read).map(|(y, x)| y - x).collect();
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
        let (squares, rows) = (product(&residual, &residual), residual.len());
        Block { square, slope, directions: directions.len(), squares, rows }
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

/// What is left of normal equations for the first `count` coordinates, about the best values of
/// those after them (Kaufman 1975, doi 10.1007/BF01932995): those that are combinations of others
/// stay where they are.
fn eliminated(
    mut square: DMatrix<f64>,
    mut slope: DVector<f64>,
    count: usize,
) -> (DMatrix<f64>, DVector<f64>) {
    let sizes = square.diagonal();
    for last in (count..slope.len()).rev() {
        let pivot = square[(last, last)];
        if pivot.is_nan() || pivot <= LEAST_PIVOT * sizes[last] {
            continue;
        }
        for row in 0..last {
            let factor = square[(row, last)] / pivot;
            slope[row] -= factor * slope[last];
            for column in 0..last {
                square[(row, column)] -= factor * square[(last, column)];
            }
        }
    }
    (square.resize(count, count, 0.0), slope.resize_vertically(count, 0.0))
}

/// What is read of a candidate whose creep was read apart, with these shares.
fn with_creep(base: &Simulated, shares: &Shares) -> Vec<f64> {
    let mut read = base.reading.clone();
    add_creep(&mut read, &base.outputs, shares);
    read
}

fn add_creep(values: &mut [f64], outputs: &[Vec<f64>], shares: &Shares) {
    for (output, share) in outputs.iter().zip(shares) {
        values.iter_mut().zip(output).for_each(|(x, q)| *x += share * q);
    }
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
