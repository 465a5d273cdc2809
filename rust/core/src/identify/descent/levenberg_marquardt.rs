//! Local refinement: Jacobian, Levenberg-Marquardt, Cramer-Rao standard deviations.
//!
//! The polish takes the steps of [`super::damped_step`] without acceleration. Standard
//! deviations are the Cramer-Rao bound: with the Jacobian J of the simulated displacement, the covariance of the
//! parameters is at least s^2 (J^T J)^-1 for independent deviations of variance s^2.
//! Correlated deviations, such as those of an inexact model, make the true spread larger: Ljung 1999, System Identification, section 9.4.

use nalgebra::DMatrix;

use super::damped_step::DampedStep;
use super::information::Spread;
use super::jacobian::{CHANGE, product};
use super::normal::Normal;
use crate::identify::cost::residual_sums::Costs;
use crate::identify::cost::several_records::Records;
use crate::identify::parameters::candidate::Point;
use crate::identify::parameters::coordinate::Coordinate;
use crate::signal::{Stop, index};

/// Least ratio of half the mean square of the differences to the variance: of what an inexact model
/// leaves, white deviations have no part worth the name.
const WHITE: f64 = 0.9;

/// Most iterations of the polish.
const ITERATIONS: usize = 60;

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

/// Sensitivity of the data to one free parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensitivity {
    /// Which of several records it belongs to, where each has its own; 0 for what they share.
    pub record: usize,
    /// Index of the parameter.
    pub parameter: usize,
    /// Standard deviation, SI; infinite where the data say nothing of it.
    pub deviation: f64,
    /// Whether the candidate lies on a bound.
    pub at_bound: bool,
}

/// The neighbourhood of candidates of one problem.
#[derive(Clone, Copy)]
pub struct LocalRefinement<'a> {
    /// The records with what is free, and what computes their costs.
    pub records: &'a Records<'a>,
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
            let creep_weights = best.costs.creep_weights;
            let Some(normal) = self.records.normal(&best.place, creep_weights, 1.0, self.stop)
            else {
                break;
            };
            best.evaluations += 2 * place.len() + 1;
            let before = best.costs.rms;
            while damping < 1e8 {
                let step = DampedStep::new(&normal, &best.place, damping);
                let Some(next) = step.and_then(|step| step.end(&best.place)) else {
                    break;
                };
                let point = Point { place: next, limit: best.costs.rms };
                let costs = self.records.costs(std::slice::from_ref(&point), self.stop);
                best.evaluations += 1;
                if let Some(&costs) = costs.first()
                    && costs.rms < best.costs.rms
                {
                    best.place = point.place;
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
    pub fn sensitivities(&self, place: &[f64], costs: Costs) -> Vec<Sensitivity> {
        let freedom = self.freedom(place.len());
        let Self { records, stop } = *self;
        let left = index(records.samples()) / freedom;
        let Some(normal) = records.normal(place, costs.creep_weights, left, stop) else {
            return Vec::new();
        };
        let rms = costs.rms / records.problem().relations.factor(&records.theta(place));
        let (spreads, along) = self.spreads(&normal, rms, place);
        let free = records.coordinates().iter().zip(place).zip(spreads);
        let found = free.map(|((&(record, parameter), &z), spread)| {
            let problem = records.members()[record].evaluator.problem();
            let deviation = spread * slope_at(problem.coordinates[parameter], z);
            let at_bound = !(1e-3..=1.0 - 1e-3).contains(&z);
            Sensitivity { record, parameter, deviation, at_bound }
        });
        let mut found: Vec<Sensitivity> = found.collect();
        for (parameter, deviation) in along {
            match found.iter_mut().find(|one| one.parameter == parameter) {
                Some(one) => one.deviation = deviation,
                None => {
                    found.push(Sensitivity { record: 0, parameter, deviation, at_bound: false });
                }
            }
        }
        found
    }

    /// Samples less what was fitted to them, with an offset of each record, and the size of its drift.
    pub(in crate::identify) fn freedom(&self, count: usize) -> f64 {
        let drifts = self.records.problems().filter(|problem| problem.has_drift()).count();
        let fitted = count + self.records.members().len() + drifts;
        index(self.records.samples().saturating_sub(fitted).max(1))
    }

    /// Whether the deviations of a candidate are white: half the mean square of their differences
    /// from sample to sample is near their variance, and less of correlated ones (von Neumann 1941,
    /// doi 10.1214/aoms/1177731677); those of every record.
    #[must_use]
    pub fn is_white(&self, place: &[f64], costs: &Costs) -> bool {
        self.records.members().iter().all(|one| {
            let own = one.own(place);
            let Some(residual) = one.evaluator.residual(&own, &costs.creep_weights, self.stop)
            else {
                return false;
            };
            let squares = product(&residual, &residual);
            let differences =
                residual.windows(2).map(|pair| (pair[1] - pair[0]) * (pair[1] - pair[0]));
            0.5 * differences.sum::<f64>() / squares > WHITE
        })
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
        let samples = self.records.samples();
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
        let problem = self.records.problem();
        let searched = |&i: &usize| !matches!(problem.coordinates[i], Coordinate::Fixed(_));
        let along = problem.relations.dependent().filter(searched);
        let along = along.map(|parameter| (parameter, several.of(self.records, place, parameter)));
        (spreads, along.collect())
    }
}

/// Change of a parameter with its coordinate.
fn slope_at(coordinate: Coordinate, z: f64) -> f64 {
    let (low, high) = ((z - CHANGE).max(0.0), (z + CHANGE).min(1.0));
    (coordinate.value(high) - coordinate.value(low)) / (high - low)
}
