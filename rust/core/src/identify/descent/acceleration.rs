//! Curvature of the displacement along the steps of many descents, for [`super::damped_step`].
//!
//! ```text
//! x_vv = 2 / p ((x(z + p v) - x(z)) / p - J v)
//! ```
//!
//! for a part p of the step v: the geodesic acceleration of Transtrum and Sethna 2012, doi
//! 10.48550/arXiv.1201.5885.

use nalgebra::DVector;
use rayon::prelude::*;

use super::damped_step::DampedStep;
use super::jacobian::{FEW_ROWS, product};
use super::normal::{Block, Extended, Normal, Spot};
use crate::identify::cost::residual_sums::Simulated;
use crate::identify::cost::several_records::Records;
use crate::identify::parameters::candidate::Candidate;
use crate::signal::Stop;

/// Part of a step at which the displacement is compared with its tangent.
const PART: f64 = 0.1;

/// Derivatives and residuals around a place, as far as they are known.
pub(in crate::identify) struct Neighbourhood {
    /// Of each record.
    pub blocks: Vec<Block>,
    /// Of all records.
    pub extended: Extended,
    pub normal: Normal,
}

/// A step of which the curvature is asked.
struct Along {
    /// Which place it begins at, and which of its steps it is.
    spot: usize,
    step: usize,
    change: DVector<f64>,
    /// `J^T x_vv`, with the directions of the weights; NaN where a simulation failed.
    bend: DVector<f64>,
}

impl Records<'_> {
    /// The normal equations, with the curvature along the steps from each place.
    pub(in crate::identify) fn with_bends(
        &self,
        spots: &[Spot],
        mut local: Vec<Option<Neighbourhood>>,
        stop: Stop<'_>,
    ) -> Vec<Option<Normal>> {
        let mut steps: Vec<Along> = Vec::new();
        for (i, (spot, near)) in spots.iter().zip(&local).enumerate() {
            let Some(near) = near else { continue };
            for (step, damping) in spot.dampings.into_iter().enumerate() {
                if let Some(found) = DampedStep::new(&near.normal, &spot.place, damping) {
                    let bend = DVector::zeros(near.extended.size());
                    steps.push(Along { spot: i, step, change: found.change, bend });
                }
            }
        }
        self.add_curvature(spots, &local, &mut steps, stop);
        for Along { spot, step, bend, .. } in steps {
            if let Some(near) = &mut local[spot] {
                let (_, bend) = near.extended.eliminated(&bend);
                near.normal.bends[step] =
                    bend.iter().all(|value| value.is_finite()).then_some(bend);
            }
        }
        local.into_iter().map(|near| Some(near?.normal)).collect()
    }

    fn add_curvature(
        &self,
        spots: &[Spot],
        local: &[Option<Neighbourhood>],
        steps: &mut [Along],
        stop: Stop<'_>,
    ) {
        for (r, one) in self.members().iter().enumerate() {
            let candidate = |along: &Along| {
                let Spot { place, creep_weights, .. } = &spots[along.spot];
                let moved = place.iter().zip(&along.change).map(|(z, change)| z + PART * change);
                one.evaluator.beside(&one.own(&moved.collect::<Vec<f64>>()), *creep_weights)
            };
            let candidates: Vec<Candidate> = steps.iter().map(candidate).collect();
            let stride = one.evaluator.stride(FEW_ROWS);
            let found = one.evaluator.simulated(&candidates, stride, stop);
            let each = steps.par_iter_mut().zip(found).zip(&candidates);
            each.for_each(|((along, mut simulated), candidate)| {
                let Some(near) = &local[along.spot] else { return };
                let Neighbourhood { blocks, extended, .. } = near;
                let (block, slots) = (&blocks[r], extended.slots_of(one));
                let scale = extended.scale_of(one, block);
                let time = candidate.theta.drift_time();
                let read = &mut simulated.reading;
                one.evaluator.change_drift(read, block.drift, time, block.stride);
                let bends = curvature(block, &slots, &along.change, &simulated);
                for (&slot, bend) in slots.iter().zip(bends.iter()) {
                    along.bend[slot] += scale * bend;
                }
            });
        }
    }
}

/// `J^T x_vv` of a record, a column each; NaN where the simulation failed.
fn curvature(
    block: &Block,
    slots: &[usize],
    change: &DVector<f64>,
    simulated: &Simulated,
) -> DVector<f64> {
    let count = block.columns.len();
    if simulated.reading.is_empty() {
        return DVector::from_element(count, f64::NAN);
    }
    let ends = simulated.reading.iter().zip(&block.read);
    let moved: Vec<f64> = ends.map(|(x, base)| x - base).collect();
    let secant = DVector::from_fn(count, |i, _| product(&block.columns[i], &moved) / PART);
    // The weights are held.
    let change = DVector::from_fn(count, |i, _| change.get(slots[i]).copied().unwrap_or(0.0));
    (secant - &block.square * change) * (2.0 / PART)
}
