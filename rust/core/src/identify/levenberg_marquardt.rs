//! Local refinement: Jacobian, Levenberg-Marquardt, Cramer-Rao standard deviations.
//!
//! The polish is the method of Levenberg and Marquardt (Marquardt 1963, doi 10.1137/0111030)
//! in the unit box, with coordinates held while the descent would cross their bound. Standard
//! deviations are the Cramer-Rao bound: with the Jacobian J of the simulated displacement, the covariance of the
//! parameters is at least s^2 (J^T J)^-1 for independent deviations of variance s^2.
//! Correlated deviations, such as those of an inexact model, make the true spread larger: Ljung 1999, System Identification, section 9.4.

use nalgebra::{DMatrix, DVector};

use super::candidate::Candidate;
use super::coordinate::Coordinate;
use super::cost::Evaluator;
use super::information::{Spread, add_priors};
use super::problem::Problem;
use super::record::Record;
use super::residual_sums::Costs;
use crate::signal::{Stop, index};

/// Most samples in the Jacobian: more would hardly change the result.
const MOST_ROWS: usize = 200_000;

/// Most samples in the Jacobian of one of many descents.
const FEW_ROWS: usize = 50_000;

/// Change of a coordinate of the unit box, for the differences.
const CHANGE: f64 = 1e-4;

/// Least ratio of half the mean square of the differences to the variance: of what an inexact model
/// leaves, white deviations have no part worth the name.
const WHITE: f64 = 0.9;

/// Most iterations of the polish.
const ITERATIONS: usize = 60;

/// Normal equations about a candidate, in coordinates of the unit box.
pub(super) struct Normal {
    /// J^T J.
    square: DMatrix<f64>,
    /// J^T r, r being measured less simulated.
    slope: DVector<f64>,
    /// Samples that entered.
    rows: usize,
}

/// A candidate after the polish.
#[derive(Clone, Debug)]
pub struct Polished {
    /// Its place in the unit box.
    pub place: Vec<f64>,
    /// Its cost.
    pub costs: Costs,
    /// Simulations that the polish took.
    pub evaluations: usize,
}

/// What the data tell of one free parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensitivity {
    /// Index of the parameter.
    pub parameter: usize,
    /// Standard deviation, SI; infinite where the data say nothing of it.
    pub deviation: f64,
    /// Whether the candidate lies on a bound.
    pub at_bound: bool,
}

/// The neighbourhood of candidatees of one problem.
#[derive(Clone, Copy)]
pub struct LocalRefinement<'a> {
    /// The record.
    pub record: &'a Record<'a>,
    /// What is free, and where.
    pub problem: &'a Problem,
    /// Computes costs, with the sub-steps of the search.
    pub evaluator: &'a Evaluator<'a>,
    /// Asked whether to give up.
    pub stop: Stop<'a>,
}

impl LocalRefinement<'_> {
    /// Goes down to the minimum next to a candidate; never returns a worse one.
    #[must_use]
    pub fn polish(&self, place: &[f64], costs: Costs) -> Polished {
        let mut best = Polished { place: place.to_vec(), costs, evaluations: 0 };
        let mut damping = 1e-3;
        for _ in 0..ITERATIONS {
            let Some(normal) = self.normal(&best.place, 1.0) else {
                break;
            };
            best.evaluations += 2 * place.len() + 1;
            let before = best.costs.rms;
            while damping < 1e8 {
                let Some(next) = damped_step(&normal, &best.place, damping) else {
                    break;
                };
                let candidate =
                    Candidate { theta: self.problem.theta(&next), limit: best.costs.rms };
                let costs = self.evaluator.costs(&[candidate], self.stop);
                best.evaluations += 1;
                if let Some(&costs) = costs.first()
                    && costs.rms < best.costs.rms
                {
                    best.place = next;
                    best.costs = costs;
                    damping = (0.1 * damping).max(1e-12);
                    break;
                }
                damping *= 10.0;
            }
            let gained = before - best.costs.rms;
            if gained <= 1e-12 * before || (self.stop)() {
                break;
            }
        }
        best
    }

    /// Standard deviations of the free parameters at a candidate.
    ///
    /// Empty where the candidate or its neighbours cannot be simulated.
    #[must_use]
    pub fn sensitivities(&self, place: &[f64], rms: f64) -> Vec<Sensitivity> {
        let freedom = self.freedom(place.len());
        let Some(normal) = self.normal(place, index(self.record.window.len()) / freedom) else {
            return Vec::new();
        };
        let Self { problem, .. } = *self;
        let rms = rms / problem.relations.factor(&problem.theta(place));
        let (spreads, along) = self.spreads(&normal, rms, place);
        let free = problem.free().zip(place).zip(spreads);
        let found = free.map(|((parameter, &z), spread)| {
            let coordinate = problem.coordinates[parameter];
            let at_bound = !(1e-3..=1.0 - 1e-3).contains(&z);
            Sensitivity { parameter, deviation: spread * slope_at(coordinate, z), at_bound }
        });
        let mut found: Vec<Sensitivity> = found.collect();
        for (parameter, deviation) in along {
            match found.iter_mut().find(|one| one.parameter == parameter) {
                Some(one) => one.deviation = deviation,
                None => found.push(Sensitivity { parameter, deviation, at_bound: false }),
            }
        }
        found
    }

    /// Samples less what was fitted to them.
    fn freedom(&self, count: usize) -> f64 {
        index(self.record.window.len().saturating_sub(count + 1).max(1))
    }

    /// Normal equations at a place by central differences, with the priors, for which the mean
    /// square of the deviations times `samples_over_freedom` is the variance of one; `None` where a
    /// neighbour cannot be simulated.
    fn normal(&self, place: &[f64], samples_over_freedom: f64) -> Option<Normal> {
        let stride = self.stride(MOST_ROWS);
        let pairs: Vec<(f64, f64)> =
            place.iter().map(|z| ((z - CHANGE).max(0.0), (z + CHANGE).min(1.0))).collect();
        let ends = pairs.iter().enumerate().flat_map(|(d, &(low, high))| [(d, low), (d, high)]);
        let moved = ends.map(|(d, z)| with(place, d, z));
        let places: Vec<Vec<f64>> = [place.to_vec()].into_iter().chain(moved).collect();
        let [base, ends @ ..] = &self.readings(&places, stride)?[..] else { return None };
        let columns = ends.chunks_exact(2).zip(pairs).map(|(ends, (low, high))| {
            let scale = 1.0 / (high - low);
            ends[1].iter().zip(&ends[0]).map(|(x, below)| (x - below) * scale).collect()
        });
        Some(self.equations(place, columns.collect(), base, stride, samples_over_freedom))
    }

    /// Normal equations at each of some places by one-sided differences, all simulated side by
    /// side; `None` for one where a neighbour cannot be simulated.
    pub(super) fn normals(&self, places: &[Vec<f64>]) -> Vec<Option<Normal>> {
        let stride = self.stride(FEW_ROWS);
        let change = |z: f64| if z < 0.5 { CHANGE } else { -CHANGE };
        let neighbours = |place: &Vec<f64>| {
            let moved = place.iter().enumerate().map(|(d, z)| with(place, d, z + change(*z)));
            [place.clone()].into_iter().chain(moved).collect::<Vec<_>>()
        };
        let all: Vec<Candidate> =
            places.iter().flat_map(neighbours).map(|place| self.candidate(&place)).collect();
        let found = self.evaluator.readings(&all, stride, self.stop);
        let mut rest = found.as_slice();
        let normal = |place: &Vec<f64>| {
            let (own, others) = rest.split_at_checked(1 + place.len())?;
            rest = others;
            if own.iter().any(|one| one.reading.is_empty()) {
                return None;
            }
            let base = &own[0].reading;
            let columns = place.iter().zip(&own[1..]).map(|(z, one)| {
                let scale = 1.0 / change(*z);
                one.reading.iter().zip(base).map(|(x, base)| (x - base) * scale).collect()
            });
            Some(self.equations(place, columns.collect(), base, stride, 1.0))
        };
        places.iter().map(normal).collect()
    }

    /// Samples of the window to a row of the normal equations.
    fn stride(&self, most: usize) -> usize {
        self.record.window.len().div_ceil(most)
    }

    /// The normal equations of the columns of a Jacobian and what is read at their place.
    fn equations(
        &self,
        place: &[f64],
        mut columns: Vec<Vec<f64>>,
        read: &[f64],
        stride: usize,
        samples_over_freedom: f64,
    ) -> Normal {
        for column in &mut columns {
            self.centre(column);
        }
        let measured = self.record.y[self.record.window.clone()].iter().step_by(stride);
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
        let mut slope = DVector::from_fn(count, |i, _| product(&columns[i], &residual));
        let rows = residual.len();
        // Some rows stand for all of them, and weigh less against the priors by their share.
        let samples = index(self.record.window.len());
        let variance = product(&residual, &residual) / samples * samples_over_freedom;
        add_priors(self.problem, place, variance, &mut square, &mut slope);
        Normal { square, slope, rows }
    }

    /// Whether the deviations of a candidate are white: half the mean square of their differences
    /// from sample to sample is near their variance, and less of correlated ones (von Neumann 1941,
    /// doi 10.1214/aoms/1177731677).
    #[must_use]
    pub fn is_white(&self, place: &[f64]) -> bool {
        let Some(residual) = self.residual(place) else { return false };
        let squares = product(&residual, &residual);
        let differences = residual.windows(2).map(|pair| (pair[1] - pair[0]) * (pair[1] - pair[0]));
        0.5 * differences.sum::<f64>() / squares > WHITE
    }

    /// Measured less simulated, the mean taken off where an offset is fitted.
    fn residual(&self, place: &[f64]) -> Option<Vec<f64>> {
        let mut residual = self.evaluator.reading(&self.problem.theta(place), self.stop)?;
        let measured = &self.record.y[self.record.window.clone()];
        residual.iter_mut().zip(measured).for_each(|(x, y)| *x = y - *x);
        self.centre(&mut residual);
        Some(residual)
    }

    /// What is read at some places every `stride` samples, simulated as the search does, with the
    /// shares of the creep that suit each best; `None` where one cannot be simulated.
    fn readings(&self, places: &[Vec<f64>], stride: usize) -> Option<Vec<Vec<f64>>> {
        let candidates: Vec<Candidate> = places.iter().map(|place| self.candidate(place)).collect();
        let found = self.evaluator.readings(&candidates, stride, self.stop);
        let whole = found.len() == places.len() && found.iter().all(|one| !one.reading.is_empty());
        whole.then(|| found.into_iter().map(|one| one.reading).collect())
    }

    /// The candidate at a place, simulated to its end however bad.
    fn candidate(&self, place: &[f64]) -> Candidate {
        Candidate { theta: self.problem.theta(place), limit: f64::INFINITY }
    }

    /// Standard deviations in the unit box, from the eigenvalues of the scaled normal equations; and
    /// of parameters that depend on several coordinates, SI.
    fn spreads(&self, normal: &Normal, rms: f64, place: &[f64]) -> (Vec<f64>, Vec<(usize, f64)>) {
        let count = normal.slope.len();
        let sizes: Vec<f64> = (0..count).map(|d| normal.square[(d, d)].sqrt()).collect();
        let scaled = DMatrix::from_fn(count, count, |i, j| {
            let size = sizes[i] * sizes[j];
            if size > 0.0 { normal.square[(i, j)] / size } else { 0.0 }
        });
        let decomposed = scaled.symmetric_eigen();
        let samples = self.record.window.len();
        // Some rows stand for all of them.
        let kept = index(normal.rows) / index(samples);
        let noise = rms * (index(samples) / self.freedom(count) * kept).sqrt();
        let spread = |d: usize| {
            let variance: f64 = (0..count)
                .map(|k| {
                    let part = decomposed.eigenvectors[(d, k)];
                    part * part / decomposed.eigenvalues[k].max(0.0)
                })
                .sum();
            let spread = noise * variance.sqrt() / sizes[d];
            if spread.is_nan() { f64::INFINITY } else { spread }
        };
        let spreads = (0..count).map(spread).collect();
        let (eigenvalues, eigenvectors) = (&decomposed.eigenvalues, &decomposed.eigenvectors);
        let several = Spread { sizes: &sizes, eigenvalues, eigenvectors, noise };
        let searched = |&i: &usize| !matches!(self.problem.coordinates[i], Coordinate::Fixed(_));
        let along = self.problem.relations.dependent().filter(searched);
        let along = along.map(|parameter| (parameter, several.of(self.problem, place, parameter)));
        (spreads, along.collect())
    }

    /// Takes the mean off where an offset is fitted.
    fn centre(&self, values: &mut [f64]) {
        if self.problem.offset {
            let mean = values.iter().sum::<f64>() / index(values.len());
            for value in values {
                *value -= mean;
            }
        }
    }
}

/// A place with another value of one coordinate.
fn with(place: &[f64], d: usize, z: f64) -> Vec<f64> {
    let mut moved = place.to_vec();
    moved[d] = z;
    moved
}

/// A damped step that stays in the box; `None` where nothing can move.
///
/// A coordinate whose step would cross a bound goes to the bound, and the others take the step
/// that is best with it there.
pub(super) fn damped_step(normal: &Normal, place: &[f64], damping: f64) -> Option<Vec<f64>> {
    let presses = |d: usize, z: f64| {
        (z <= 0.0 && normal.slope[d] < 0.0) || (z >= 1.0 && normal.slope[d] > 0.0)
    };
    let mut moving: Vec<usize> = (0..place.len())
        .filter(|&d| normal.square[(d, d)] > 0.0 && !presses(d, place[d]))
        .collect();
    let mut change = DVector::zeros(place.len());
    while !moving.is_empty() {
        let square = DMatrix::from_fn(moving.len(), moving.len(), |i, j| {
            let value = normal.square[(moving[i], moving[j])];
            if i == j { value * (1.0 + damping) } else { value }
        });
        // What those at their bounds leave of the slope.
        let left = &normal.slope - &normal.square * &change;
        let slope = DVector::from_fn(moving.len(), |i, _| left[moving[i]]);
        let found = square.cholesky()?.solve(&slope);
        let mut inside = Vec::with_capacity(moving.len());
        for (&d, found) in moving.iter().zip(found.iter()) {
            let z = place[d] + found;
            if (0.0..=1.0).contains(&z) {
                inside.push((d, *found));
            } else {
                change[d] = z.clamp(0.0, 1.0) - place[d];
            }
        }
        if inside.len() == moving.len() {
            for (d, found) in inside {
                change[d] = found;
            }
            break;
        }
        moving = inside.into_iter().map(|(d, _)| d).collect();
    }
    let next: Vec<f64> =
        place.iter().zip(change.iter()).map(|(z, change)| (z + change).clamp(0.0, 1.0)).collect();
    (next != place).then_some(next)
}

/// Change of a parameter with its coordinate.
fn slope_at(coordinate: Coordinate, z: f64) -> f64 {
    let (low, high) = ((z - CHANGE).max(0.0), (z + CHANGE).min(1.0));
    (coordinate.value(high) - coordinate.value(low)) / (high - low)
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
