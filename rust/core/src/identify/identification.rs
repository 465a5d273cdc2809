//! Identification of a stage from a record: bounds, search, local refinement.

use super::cost::evaluator::Evaluator;
use super::cost::residual_sums::Costs;
use super::cost::several_records::Records;
use super::descent::lag::{LagRange, lag_range};
use super::descent::levenberg_marquardt::LocalRefinement;
use super::parameters::bounds::measures;
use super::parameters::candidate::{Point, Theta};
use super::problem::{Problem, Spec};
use super::records::record::Record;
use super::records::thinned::{Thinned, thinning};
use super::search::descents::{as_low_as, descend};
use super::search::inertia::with_mass;
use super::search::plan::{Method, Plan};
use super::search::progress::{Monitor, Outcome, StopReason};
use super::search::resolved::Resolved;
use super::search::swarms::search;
use crate::error::Result;
use crate::integrator::Stepping;
use crate::math::available;
use crate::signal::{FractionalDelay, Hold, Stop};

/// An identified stage and how it was found.
#[derive(Clone, Debug)]
pub struct Identification {
    /// Parameters held and free, and the bounds of these; of several records, for the first.
    pub problem: Problem,
    /// How finely the search stepped through the first record.
    pub stepping: Stepping,
    /// Quantities of each record alone in the best run, in their order; empty where there is none.
    pub records: Vec<OwnResult>,
    /// Outcome of each run, in their order.
    pub runs: Vec<Outcome>,
    /// Which of the runs has the lowest cost; `None` where the search was stopped before its
    /// first cost.
    pub best: Option<usize>,
    /// Runs that ended as low as the best one: of descents before the refinement, which only the
    /// best one gets.
    pub agreeing: usize,
    /// Lags that fit as well as the one of the best run, where the drive is slow.
    pub lags: Option<LagRange>,
    /// Record, 0 for what they share, and parameter of each that lies on a bound; empty where the
    /// search was stopped.
    pub at_bound: Vec<(usize, usize)>,
}

/// Quantities of one of the records in the best run.
#[derive(Clone, Debug)]
pub struct OwnResult {
    /// Parameters held and free, with its own delay, voltage before and drift.
    pub problem: Problem,
    /// The parameters, and what [`super::parameters::candidate::ITS_OWN`] has.
    pub theta: Theta,
    /// Its RMS deviation, m, without priors, its offset and its drift.
    pub costs: Costs,
}

/// Identifies a stage from a record: swarms or descents, local refinement.
///
/// # Errors
/// [`crate::Error::Parameter`] for a specification or setting that cannot be used,
/// [`crate::Error::Numerical`] where no candidate could be simulated, [`crate::Error::Memory`] where
/// there is no room for its threads.
pub fn identify(
    record: &Record<'_>,
    spec: &Spec,
    plan: &Plan,
    monitor: &mut dyn Monitor,
    stop: Stop<'_>,
) -> Result<Identification> {
    identify_together(&[(record, spec)], plan, monitor, stop)
}

/// Identifies one stage from several records, each with its own offset, delay, drift, history and weight,
/// as [`Problem::of_records`] and [`Records`] say: no state goes from one record to the next. The
/// creep has the same weights in all.
///
/// # Errors
/// As [`identify`]; [`crate::Error::Parameter`] where there is no record.
pub fn identify_together(
    asked: &[(&Record<'_>, &Spec)],
    plan: &Plan,
    monitor: &mut dyn Monitor,
    stop: Stop<'_>,
) -> Result<Identification> {
    plan.validate()?;
    let problems = Problem::of_records(asked, stop)?;
    let each = || asked.iter().map(|&(record, _)| record).zip(&problems);
    for (record, problem) in each() {
        enough_memory(record, problem).map_err(|error| record.named(error))?;
    }
    let evaluators = each().map(|(record, problem)| Evaluator::new(record, problem, stop));
    let records = Records::new(evaluators.collect()).kept(monitor.journal());
    let local = LocalRefinement { records: &records, stop };
    let (mut runs, polish) = match &plan.method {
        Method::Swarm(settings) => {
            let found = search(&records, settings, plan.seed, plan.runs, monitor, stop);
            (found?, settings.polish)
        }
        Method::Descents(settings) => {
            let kept: Vec<Thinned> = each().map(|one| thinned(one.0, one.1)).collect();
            let few: Vec<Record<'_>> =
                each().zip(&kept).map(|(one, few)| one.0.thinned(few)).collect();
            let thin = few.iter().zip(&problems).map(|(one, of)| Evaluator::new(one, of, stop));
            let thin = Records::new(thin.collect()).kept(monitor.journal());
            let thin = LocalRefinement { records: &thin, stop };
            let mut found = descend(&thin, settings, plan, monitor)?;
            if kept.iter().any(|one| one.every > 1) && !stop() {
                judge(&mut found, &local);
            }
            (found, true)
        }
    };
    let resolved = Resolved::of(&records, stop);
    resolved.leave_out(&mut runs);
    let ended = runs.iter().all(|run| run.reason != StopReason::Interrupted);
    // Descents that ended elsewhere are not refined.
    let lowest = runs.iter().fold(f64::INFINITY, |low, run| low.min(run.costs.rms));
    let refined = |run: &Outcome| match plan.method {
        Method::Swarm(_) => run.costs.rms.is_finite(),
        Method::Descents(_) => run.costs.rms <= lowest,
    };
    let mut agreeing = agreeing_with(&runs, &records);
    if ended && polish {
        for run in runs.iter_mut().filter(|run| refined(run)) {
            let polished = local.polish(&run.place, run.costs);
            run.polish_evaluations = polished.evaluations;
            if !resolved.holds(&polished.place, polished.costs.rms) {
                continue;
            }
            run.costs = polished.costs;
            run.theta = records.theta(&polished.place);
            run.place = polished.place;
        }
    }
    let best = (0..runs.len())
        .filter(|&i| runs[i].costs.rms.is_finite())
        .min_by(|&i, &j| runs[i].costs.rms.total_cmp(&runs[j].costs.rms));
    if matches!(plan.method, Method::Swarm(_)) {
        agreeing = agreeing_with(&runs, &records);
    }
    let Told { lags, at_bound, with_mass } =
        best.filter(|_| ended).map(|i| told_by(&local, &mut runs[i], polish)).unwrap_or_default();
    if stop() {
        for run in &mut runs {
            run.reason = StopReason::Interrupted;
        }
    }
    let stepping = records.members()[0].evaluator.stepping;
    let searched = with_mass.unwrap_or_else(|| problems.clone());
    let problem = searched[0].clone();
    let owns = best.map_or_else(Vec::new, |i| {
        let each = records.of(&searched).each(&runs[i].place, runs[i].costs);
        let own = |(problem, (theta, costs))| OwnResult { problem, theta, costs };
        searched.into_iter().zip(each).map(own).collect()
    });
    Ok(Identification { problem, stepping, records: owns, runs, best, agreeing, lags, at_bound })
}

/// Distance from a bound, in the unit box, that counts as on it.
const NEAR: f64 = 1e-3;

/// Rows that descents are made on, about.
const ROWS: usize = 2000;

/// The record with as many samples as descents need where its drive is slow.
fn thinned(record: &Record<'_>, problem: &Problem) -> Thinned {
    let Record { drive, y, left_out, .. } = record;
    let every = thinning(&measures(record), drive.dt, record.window.len(), ROWS);
    let whole = problem.has_delay() || drive.hold == Hold::Zero;
    Thinned::of(drive, y, left_out, if whole { 1 } else { every })
}

/// Costs of runs on all samples.
fn judge(runs: &mut [Outcome], on: &LocalRefinement<'_>) {
    let places = runs.iter().map(|run| Point { place: run.place.clone(), limit: f64::INFINITY });
    let costs = on.records.costs(&places.collect::<Vec<_>>(), on.stop);
    for (run, costs) in runs.iter_mut().zip(costs) {
        run.costs = costs;
        run.evaluations += 1;
    }
}

/// Runs that agree with the best one.
fn agreeing_with(runs: &[Outcome], records: &Records<'_>) -> usize {
    let lowest = runs.iter().fold(f64::INFINITY, |low, run| low.min(run.costs.rms));
    let near = as_low_as(lowest, records.stroke());
    runs.iter().filter(|run| run.costs.rms <= near).count()
}

/// Information of the record on the best candidate.
#[derive(Default)]
struct Told {
    lags: Option<LagRange>,
    at_bound: Vec<(usize, usize)>,
    /// The problems with the mass free, where the records show it.
    with_mass: Option<Vec<Problem>>,
}

/// Lags and bounds of a candidate; of a `polished` one first the mass is taken where the record shows it,
/// else under a slow drive the least lag that fits.
fn told_by(local: &LocalRefinement<'_>, run: &mut Outcome, polished: bool) -> Told {
    if polished && let Some((problems, polished)) = with_mass(local, &run.place, run.costs) {
        run.polish_evaluations += polished.evaluations;
        (run.place, run.costs) = (polished.place, polished.costs);
        let records = local.records.of(&problems);
        run.theta = records.theta(&run.place);
        let at_bound = on_bounds(&records, &run.place);
        return Told { at_bound, with_mass: Some(problems), lags: None };
    }
    let slow = polished && local.records.problem().slow;
    let lags = slow.then(|| lag_range(local, &run.place, run.costs)).flatten();
    if let Some(found) = &lags {
        (run.place, run.costs) = (found.place.clone(), found.costs);
        run.theta = local.records.theta(&run.place);
        run.polish_evaluations += found.evaluations;
    }
    Told { lags, at_bound: on_bounds(local.records, &run.place), with_mass: None }
}

/// Coordinates of a place that lie on a bound.
fn on_bounds(records: &Records<'_>, place: &[f64]) -> Vec<(usize, usize)> {
    let inside = NEAR..=1.0 - NEAR;
    let each = records.coordinates().iter().zip(place);
    each.filter(|(_, z)| !inside.contains(z)).map(|(&which, _)| which).collect()
}

/// Bytes of a thread for each sample: five motions' columns in the refinement.
const COLUMNS: usize = 5 * size_of::<f64>();

/// Bytes of a thread for each sample and relaxation of the creep: two columns, and one read.
const RELAXATION: usize = 3 * size_of::<f64>();

/// Bytes of a thread for each sample of the delay: displacement and velocity in eight lanes.
const RING: usize = 16 * size_of::<f64>();

/// Asks for the memory of the threads before they start, who could only fail silently.
fn enough_memory(record: &Record<'_>, problem: &Problem) -> Result<()> {
    let threads = rayon::current_num_threads();
    let samples = record.drive.u.len();
    let delay = FractionalDelay::new(problem.longest_delay(), record.drive.dt).whole.min(samples);
    let relaxations = problem.creep_times.len();
    let columns = (COLUMNS + RELAXATION * relaxations) * samples;
    available("the search", columns + RING * (1 + relaxations) * delay, threads)
}
