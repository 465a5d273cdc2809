//! Jacobian of a record about a candidate, by central or one-sided differences.
//!
//! Offset and drift are eliminated: their part is taken off every column (Kaufman 1975, doi
//! 10.1007/BF01932995).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::normal::Block;
use crate::identify::cost::evaluator::Evaluator;
use crate::identify::cost::residual_sums::{Simulated, add_creep};
use crate::identify::parameters::candidate::{Candidate, Theta};
use crate::identify::parameters::drift::{Drift, Fading};
use crate::identify::records::creep_weights::{CreepWeights, directions};
use crate::signal::{Stop, index};

/// Most samples of a record in the Jacobian: more would hardly change the result.
const MOST_ROWS: usize = 200_000;

/// Most samples of a record in the Jacobian of one of many descents.
pub(in crate::identify) const FEW_ROWS: usize = 50_000;

/// Change of a coordinate of the unit box, for the differences.
pub(in crate::identify) const CHANGE: f64 = 1e-4;

impl Evaluator<'_> {
    /// By central differences.
    pub(in crate::identify) fn central(
        &self,
        place: &[f64],
        creep_weights: CreepWeights,
        stop: Stop<'_>,
    ) -> Option<Block> {
        let stride = self.stride(MOST_ROWS);
        let pairs: Vec<(f64, f64)> =
            place.iter().map(|z| ((z - CHANGE).max(0.0), (z + CHANGE).min(1.0))).collect();
        let ends = pairs.iter().enumerate().flat_map(|(d, &(low, high))| [(d, low), (d, high)]);
        let moved = ends.map(|(d, z)| self.beside(&with(place, d, z), creep_weights));
        let candidates: Vec<Candidate> = [self.at(place)].into_iter().chain(moved).collect();
        let found = self.simulated(&candidates, stride, stop);
        if found.iter().any(|one| one.reading.is_empty()) {
            return None;
        }
        let mut found = candidates.iter().zip(found);
        let base = self.base(found.next()?, &creep_weights, stride);
        let mut moved =
            found.map(|(one, found)| self.read_beside(&base, &one.theta, found.reading));
        let columns = pairs.into_iter().filter_map(|(low, high)| {
            let (below, above) = (moved.next()?, moved.next()?);
            Some(slope(above, &below, 1.0 / (high - low)))
        });
        let columns = columns.collect();
        Some(base.block(columns, &creep_weights))
    }

    /// By one-sided differences, at each of some places.
    pub(in crate::identify) fn one_sided(
        &self,
        places: &[(Vec<f64>, CreepWeights)],
        stop: Stop<'_>,
    ) -> Vec<Option<Block>> {
        let stride = self.stride(FEW_ROWS);
        let change = |z: f64| if z < 0.5 { CHANGE } else { -CHANGE };
        let neighbours = |(place, creep_weights): &(Vec<f64>, CreepWeights)| {
            let moved = place.iter().enumerate().map(|(d, z)| with(place, d, z + change(*z)));
            let moved = moved.map(|place| self.beside(&place, *creep_weights));
            [self.at(place)].into_iter().chain(moved).collect::<Vec<_>>()
        };
        let all: Vec<Candidate> = places.iter().flat_map(neighbours).collect();
        let mut found = all.iter().zip(self.simulated(&all, stride, stop));
        let own = places.iter().map(|(place, _)| found.by_ref().take(1 + place.len()).collect());
        let own: Vec<Vec<(&Candidate, Simulated)>> = own.collect();
        let block = |(own, (place, creep_weights)): (Vec<_>, &(Vec<f64>, CreepWeights))| {
            if own.iter().any(|(_, one): &(&Candidate, Simulated)| one.reading.is_empty()) {
                return None;
            }
            let mut own = own.into_iter();
            let base = self.base(own.next()?, creep_weights, stride);
            let columns = place.iter().zip(own).map(|(z, (one, found))| {
                let moved = self.read_beside(&base, &one.theta, found.reading);
                slope(moved, &base.read, 1.0 / change(*z))
            });
            let columns = columns.collect();
            Some(base.block(columns, creep_weights))
        };
        own.into_par_iter().zip(places).map(block).collect()
    }

    /// Rows of the normal equations of one of many descents.
    pub(in crate::identify) fn rows(&self) -> usize {
        self.record().window.len().div_ceil(self.stride(FEW_ROWS))
    }

    /// Samples of the window to a row of the normal equations.
    pub(in crate::identify) fn stride(&self, most: usize) -> usize {
        self.record().window.len().div_ceil(most)
    }

    /// The candidate at a place of this record's problem, its creep read apart.
    fn at(&self, place: &[f64]) -> Candidate {
        Candidate::of(self.problem().theta(place))
    }

    /// One beside it, with the same weights of the creep.
    pub(in crate::identify) fn beside(
        &self,
        place: &[f64],
        creep_weights: CreepWeights,
    ) -> Candidate {
        Candidate { creep_weights: Some(creep_weights), ..self.at(place) }
    }

    /// Reading at a place, simulated with its creep apart, and the residual of the record.
    fn base(
        &self,
        (at, found): (&Candidate, Simulated),
        creep_weights: &CreepWeights,
        stride: usize,
    ) -> Base {
        let Simulated { reading: mut read, outputs, .. } = found;
        add_creep(&mut read, &outputs, creep_weights);
        let record = self.record();
        let measured = record.y[record.window.clone()].iter().step_by(stride);
        let mut residual: Vec<f64> = measured.zip(&read).map(|(y, x)| y - x).collect();
        let level = self.level(at.theta.drift_time(), stride);
        let drift = level.fallen(&residual);
        level.take_off(&mut residual);
        Base { stride, read, outputs, residual, level, drift }
    }

    /// Reading beside a place: with the drift that suits the place, and its own time constant.
    fn read_beside(&self, base: &Base, theta: &Theta, mut reading: Vec<f64>) -> Vec<f64> {
        self.change_drift(&mut reading, base.drift, theta.drift_time(), base.stride);
        reading
    }

    /// Adds what a drift changes by with another time constant.
    pub(in crate::identify) fn change_drift(
        &self,
        reading: &mut [f64],
        drift: Option<Drift>,
        time: Option<f64>,
        stride: usize,
    ) {
        let (Some(drift), Some(time)) = (drift, time) else { return };
        if (time - drift.time).abs() > 0.0 {
            let ends = self.faded(time, stride).into_iter().zip(self.faded(drift.time, stride));
            for (x, (to, from)) in reading.iter_mut().zip(ends) {
                *x += drift.fallen * (to - from);
            }
        }
    }

    /// A drift of 1 with this time constant, at every `stride`-th sample of the window.
    fn faded(&self, time: f64, stride: usize) -> Vec<f64> {
        let samples = self.record().window.len();
        Fading::new(time, self.record().drive.dt, samples).shape(samples, stride)
    }

    /// Level that the sensor adds to a displacement: offset, and drift with this time constant.
    fn level(&self, time: Option<f64>, stride: usize) -> Level {
        let offset = self.problem().offset;
        let left_out = self.left_out(stride);
        let drift = time.map(|time| {
            let mut shape = self.faded(time, stride);
            centre(&mut shape, &left_out);
            clear(&mut shape, &left_out);
            (time, product(&shape, &shape), shape)
        });
        Level { offset, drift, left_out }
    }

    /// Rows whose displacement does not count, of every `stride`-th sample of the window.
    fn left_out(&self, stride: usize) -> Vec<usize> {
        let record = self.record();
        let samples = record.window.clone().step_by(stride).enumerate();
        let rows = samples.filter(|(_, k)| !record.counts(*k)).map(|(row, _)| row);
        if record.left_out.is_empty() { Vec::new() } else { rows.collect() }
    }

    /// Measured less simulated at a place with its weights of the creep, less what the sensor adds.
    pub(in crate::identify) fn residual(
        &self,
        place: &[f64],
        creep_weights: &CreepWeights,
        stop: Stop<'_>,
    ) -> Option<Vec<f64>> {
        let (record, theta) = (self.record(), self.problem().theta(place));
        let mut residual = self.reading(&theta, creep_weights, stop)?;
        let measured = &record.y[record.window.clone()];
        residual.iter_mut().zip(measured).for_each(|(x, y)| *x = y - *x);
        self.level(theta.drift_time(), 1).take_off(&mut residual);
        Some(residual)
    }
}

/// A place that was simulated.
struct Base {
    /// Samples of the window to a row.
    stride: usize,
    read: Vec<f64>,
    /// Reading of each relaxation of the creep.
    outputs: Vec<Vec<f64>>,
    /// Residual of the record.
    residual: Vec<f64>,
    level: Level,
    /// The drift that suits the place best.
    drift: Option<Drift>,
}

impl Base {
    /// The normal equations of the columns of a Jacobian, and of the directions in which the weights
    /// can move, with what is read at their place.
    fn block(self, mut columns: Vec<Vec<f64>>, creep_weights: &CreepWeights) -> Block {
        let Self { stride, read, outputs, residual, level, drift } = self;
        let directions = directions(creep_weights);
        for direction in &directions {
            let mut column = vec![0.0; read.len()];
            add_creep(&mut column, &outputs, direction);
            columns.push(column);
        }
        for column in &mut columns {
            level.take_off(column);
        }
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
        let directions = directions.len();
        let rows = read.len() - level.left_out.len();
        Block { square, slope, columns, read, drift, rows, stride, directions, squares }
    }
}

/// Level that a sensor adds to a displacement, of the size that suits best.
struct Level {
    /// Whether an offset is fitted; with a drift always.
    offset: bool,
    /// Time constant of a drift, s, the sum of the squares of a drift of 1, and its values, about
    /// their mean.
    drift: Option<(f64, f64, Vec<f64>)>,
    /// Rows that do not count.
    left_out: Vec<usize>,
}

impl Level {
    /// Takes it off a column, whose rows that do not count become 0.
    fn take_off(&self, values: &mut [f64]) {
        if self.offset {
            centre(values, &self.left_out);
        }
        clear(values, &self.left_out);
        if let Some((_, square, shape)) = &self.drift {
            let part = product(shape, values) / square;
            for (value, g) in values.iter_mut().zip(shape) {
                *value -= part * g;
            }
        }
    }

    /// The drift that suits a residual best.
    fn fallen(&self, residual: &[f64]) -> Option<Drift> {
        let (time, square, shape) = self.drift.as_ref()?;
        Some(Drift { time: *time, fallen: product(shape, residual) / square })
    }
}

/// Sets rows to 0.
fn clear(values: &mut [f64], rows: &[usize]) {
    for &row in rows {
        values[row] = 0.0;
    }
}

/// Takes the mean of the rows that count off.
fn centre(values: &mut [f64], left_out: &[usize]) {
    clear(values, left_out);
    let mean = mean(values, values.len() - left_out.len());
    for value in values {
        *value -= mean;
    }
}

/// Change of what is read with a coordinate, from one place to another.
fn slope(mut read: Vec<f64>, from: &[f64], scale: f64) -> Vec<f64> {
    for (x, from) in read.iter_mut().zip(from) {
        *x = (*x - from) * scale;
    }
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
pub(in crate::identify) fn product(a: &[f64], b: &[f64]) -> f64 {
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

/// Sum of a column over a count.
fn mean(values: &[f64], count: usize) -> f64 {
    let (all, rest) = values.as_chunks::<SUMS>();
    let mut sums = [0.0; SUMS];
    for values in all {
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += value;
        }
    }
    sums.iter().chain(rest).sum::<f64>() / index(count)
}
