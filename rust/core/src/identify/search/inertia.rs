//! Whether a record without a visible mode shows the mass after all.
//!
//! A search on such a record holds the mass where it has no effect, as what it would take for a
//! mode is mostly creep or what the model lacks. Where the record is fitted down to white noise
//! with the mass free, and not without, the mass is what was missing.

use crate::identify::cost::residual_sums::Costs;
use crate::identify::descent::levenberg_marquardt::{LocalRefinement, Polished};
use crate::identify::parameters::candidate::Point;
use crate::identify::problem::Problem;
use crate::models::position;
use crate::signal::index;

/// Least twice the logarithm of a likelihood that the mass has to gain: chance alone gives 1.
const GAIN: f64 = 25.0;

/// Masses from which the best one is refined.
const STARTS: usize = 32;

/// The problems with the mass free and the best candidate next to `place`, where the mass shows.
pub(in crate::identify) fn with_mass(
    local: &LocalRefinement<'_>,
    place: &[f64],
    costs: Costs,
) -> Option<(Vec<Problem>, Polished)> {
    let range = local.records.problem().mass_if_shown?;
    let infos = local.records.problem().model.info().parameters;
    let mass = position(infos, "parameters", "mass").ok()?;
    let mut problems: Vec<Problem> = local.records.problems().cloned().collect();
    for problem in &mut problems {
        (problem.mass_if_shown, problem.slow) = (None, false);
        problem.coordinates[mass] = range;
    }
    let records = local.records.of(&problems);
    let slot = records.coordinates().iter().position(|&(_, free)| free == mass)?;
    let freed = LocalRefinement { records: &records, ..*local };
    let beside = |k: usize| {
        let mut start = place.to_vec();
        start.insert(slot, index(k) / index(STARTS - 1));
        start
    };
    let point = |k| Point { place: beside(k), limit: f64::INFINITY };
    let starts: Vec<Point> = (0..STARTS).map(point).collect();
    let found = records.costs(&starts, local.stop);
    let (k, costs_beside) =
        found.into_iter().enumerate().min_by(|(_, a), (_, b)| a.rms.total_cmp(&b.rms))?;
    let best = freed.polish(&beside(k), costs_beside);
    let samples = index(local.records.samples());
    let gain = 2.0 * samples * libm::log(costs.rms / best.costs.rms);
    if gain > GAIN && freed.is_white(&best.place, &best.costs) {
        return Some((problems, Polished { evaluations: best.evaluations + STARTS, ..best }));
    }
    None
}
