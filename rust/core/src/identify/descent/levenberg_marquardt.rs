//! Local refinement by the steps of [`super::damped_step`] without acceleration.

use super::damped_step::DampedStep;
use super::jacobian::product;
use crate::identify::cost::residual_sums::Costs;
use crate::identify::cost::several_records::Records;
use crate::identify::parameters::candidate::Point;
use crate::signal::Stop;

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
            let Some(normal) = self.records.normal(&best.place, creep_weights, self.stop) else {
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
}
