//! Which lags a record allows: those with which the other parameters fit as well.
//!
//! Under one slow sine the loop of a lag D/K and that of hysteresis or creep are alike. The cost is
//! followed along the damping, all else fitted again: a profile (Pawitan 2001, In All Likelihood,
//! section 3.4), with a tolerance on the cost where the residuals are correlated, as those of an
//! inexact model are. Where they are white, chance decides, and a lag that differs from 0 is kept.

use super::levenberg_marquardt::LocalRefinement;
use crate::identify::cost::residual_sums::Costs;
use crate::identify::parameters::coordinate::Coordinate;
use crate::identify::problem::Problem;
use crate::models::position;
use crate::signal::index;

/// Share by which the cost may rise.
const AS_WELL: f64 = 0.01;

/// Rise of twice the logarithm of the likelihood within which a parameter lies in 95 of 100 cases.
const LIKELY: f64 = 3.84;

/// Bisections towards an end of the range.
const BISECTIONS: usize = 7;

/// A candidate at the least lag, and the range of lags.
#[derive(Clone, Debug)]
pub struct LagRange {
    /// Least and largest lag D/K with which the cost is within a hundredth of its least, s.
    pub lags: (f64, f64),
    /// Whether all lags below the least one searched fit too.
    pub from_zero: bool,
    /// Place of the candidate with the least lag.
    pub place: Vec<f64>,
    /// Its cost.
    pub costs: Costs,
    /// Simulations.
    pub evaluations: usize,
}

/// A profile along the damping.
struct Profile<'a> {
    local: LocalRefinement<'a>,
    /// Place of the damping in the unit box.
    damping: usize,
    limit: f64,
    evaluations: usize,
}

/// Follows the cost along the damping from the best candidate; `None` where it is not searched, or
/// where the deviations are white and a lag of 0 is unlikely.
pub(in crate::identify) fn lag_range(
    local: &LocalRefinement<'_>,
    place: &[f64],
    costs: Costs,
) -> Option<LagRange> {
    let infos = local.records.problem().model.info().parameters;
    let parameter = position(infos, "parameters", "damping").ok()?;
    let place_of = |&(_, free): &(usize, usize)| free == parameter;
    let damping = local.records.coordinates().iter().position(place_of)?;
    let by_chance = libm::exp(0.5 * LIKELY / index(local.records.samples())) - 1.0;
    let white = local.is_white(place, &costs);
    let limit = costs.rms * (1.0 + if white { by_chance.min(AS_WELL) } else { AS_WELL });
    let mut profile = Profile { local: *local, damping, limit, evaluations: 0 };
    let (least, least_costs) = profile.towards(place, costs, 0.0);
    let from_zero = least[damping] <= 0.0;
    if white && !from_zero {
        return None;
    }
    let (most, _) = profile.towards(place, costs, 1.0);
    let lag = |place: &[f64]| {
        let [_, damping, stiffness, ..] = local.records.theta(place).parameters();
        damping / stiffness
    };
    Some(LagRange {
        lags: (lag(&least), lag(&most)),
        from_zero,
        costs: least_costs,
        place: least,
        evaluations: profile.evaluations,
    })
}

impl Profile<'_> {
    /// The candidate nearest to an end of the range, 0 or 1, that fits as well.
    fn towards(&mut self, place: &[f64], costs: Costs, end: f64) -> (Vec<f64>, Costs) {
        let mut best = (place.to_vec(), costs);
        let (mut fits, mut fails) = (place[self.damping], end);
        if let Some(found) = self.fit_at(&best, end) {
            return found;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (fits + fails);
            if let Some(found) = self.fit_at(&best, middle) {
                (fits, best) = (middle, found);
            } else {
                fails = middle;
            }
        }
        best
    }

    /// The best candidate with the damping held, from one beside it; `None` where it costs more.
    fn fit_at(&mut self, from: &(Vec<f64>, Costs), damping: f64) -> Option<(Vec<f64>, Costs)> {
        let local = self.local;
        let &(_, parameter) = local.records.coordinates().get(self.damping)?;
        let value = local.records.problem().coordinates[parameter].value(damping);
        let mut problems: Vec<Problem> = local.records.problems().cloned().collect();
        for problem in &mut problems {
            problem.coordinates[parameter] = Coordinate::Fixed(value);
        }
        let records = local.records.of(&problems);
        let held = LocalRefinement { records: &records, ..local };
        let mut others = from.0.clone();
        others.remove(self.damping);
        let start = Costs { rms: f64::INFINITY, ..from.1 };
        let polished = held.polish(&others, start);
        self.evaluations += polished.evaluations;
        let mut place = polished.place;
        place.insert(self.damping, damping);
        (polished.costs.rms <= self.limit).then_some((place, polished.costs))
    }
}
