//! Candidates whose motion the steps of the search resolve.
//!
//! The steps are chosen once, for the stages that the bounds allow. A candidate that is stiffer may
//! have a low cost with them that is none of its motion.

use super::progress::Outcome;
use crate::identify::cost::residual_sums::Costs;
use crate::identify::cost::several_records::Records;
use crate::identify::parameters::candidate::Point;
use crate::signal::Stop;

/// Growth of the cost with steps half as long that is not that of a motion which is resolved.
const GROWTH: f64 = 2.0;

/// Share of the stroke by which it may grow besides.
const SHARE: f64 = 1e-4;

/// Checks places with steps half as long.
pub(in crate::identify) struct Resolved<'a> {
    finer: Records<'a>,
    slack: f64,
    stop: Stop<'a>,
}

impl<'a> Resolved<'a> {
    /// Of the costs of these records.
    pub fn of(records: &Records<'a>, stop: Stop<'a>) -> Self {
        Self { finer: records.finer(), slack: SHARE * records.stroke(), stop }
    }

    /// Whether the cost of a place is that of its motion; also where the search was stopped.
    pub fn holds(&self, place: &[f64], cost: f64) -> bool {
        let point = Point { place: place.to_vec(), limit: f64::INFINITY };
        let costs = self.finer.costs(&[point], self.stop);
        let finer = costs.first().map_or(f64::INFINITY, |one| one.rms);
        (self.stop)() || finer <= GROWTH * cost + self.slack
    }

    /// Takes the costs of runs that end lowest in a motion that is not resolved; where none other is
    /// left, all stay.
    pub fn leave_out(&self, runs: &mut [Outcome]) {
        let before: Vec<Costs> = runs.iter().map(|run| run.costs).collect();
        while let Some(lowest) = runs
            .iter_mut()
            .filter(|run| run.costs.rms.is_finite())
            .min_by(|a, b| a.costs.rms.total_cmp(&b.costs.rms))
        {
            if self.holds(&lowest.place, lowest.costs.rms) {
                return;
            }
            lowest.costs = Costs::FAILED;
        }
        for (run, costs) in runs.iter_mut().zip(before) {
            run.costs = costs;
        }
    }
}
