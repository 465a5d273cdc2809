//! Identification of a stage from a record: bounds, search, local refinement, standard deviations.

use super::cost::Evaluator;
use super::descents::{as_low_as, descend};
use super::inertia::with_mass;
use super::lag::{LagRange, lag_range};
use super::levenberg_marquardt::{LocalRefinement, Sensitivity};
use super::plan::{Method, Plan};
use super::problem::{Problem, Spec};
use super::progress::{Monitor, Outcome, StopReason};
use super::record::Record;
use super::search::search;
use crate::error::Result;
use crate::integrator::Stepping;
use crate::math::available;
use crate::signal::{FractionalDelay, Stop};

/// An identified stage and how it was found.
#[derive(Clone, Debug)]
pub struct Identification {
    /// What was held, what was free, and between which bounds.
    pub problem: Problem,
    /// How finely the search stepped.
    pub stepping: Stepping,
    /// What each run found, in their order.
    pub runs: Vec<Outcome>,
    /// Which of the runs has the lowest cost; `None` where the search was stopped before its
    /// first cost.
    pub best: Option<usize>,
    /// Runs that ended as low as the best one: of descents before the refinement, which only the
    /// best one gets.
    pub agreeing: usize,
    /// Lags that fit as well as the one of the best run, where the drive is slow.
    pub lags: Option<LagRange>,
    /// Standard deviation of each free parameter; empty where the search was stopped.
    pub sensitivities: Vec<Sensitivity>,
}

/// Identifies a stage from a record: swarms, optional local refinement, standard deviations.
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
    plan.validate()?;
    let problem = Problem::new(record, spec, stop)?;
    enough_memory(record, &problem)?;
    let evaluator = Evaluator::new(record, &problem, stop);
    let local = LocalRefinement { record, problem: &problem, evaluator: &evaluator, stop };
    let (mut runs, polish) = match &plan.method {
        Method::Swarm(settings) => {
            let found = search(&evaluator, &problem, settings, plan.seed, plan.runs, monitor, stop);
            (found?, settings.polish)
        }
        Method::Descents(settings) => {
            (descend(&local, settings, plan.seed, plan.runs, monitor)?, true)
        }
    };
    let ended = runs.iter().all(|run| run.reason != StopReason::Interrupted);
    // Descents that ended elsewhere are not refined.
    let lowest = runs.iter().fold(f64::INFINITY, |low, run| low.min(run.costs.rms));
    let refined = |run: &Outcome| match plan.method {
        Method::Swarm(_) => run.costs.rms.is_finite(),
        Method::Descents(_) => run.costs.rms <= lowest,
    };
    let mut agreeing = agreeing_with(&runs, record);
    if ended && polish {
        for run in runs.iter_mut().filter(|run| refined(run)) {
            let polished = local.polish(&run.place, run.costs);
            run.polish_evaluations = polished.evaluations;
            run.costs = polished.costs;
            run.theta = problem.theta(&polished.place);
            run.place = polished.place;
        }
    }
    let best = (0..runs.len())
        .filter(|&i| runs[i].costs.rms.is_finite())
        .min_by(|&i, &j| runs[i].costs.rms.total_cmp(&runs[j].costs.rms));
    if matches!(plan.method, Method::Swarm(_)) {
        agreeing = agreeing_with(&runs, record);
    }
    let Told { lags, sensitivities, with_mass } =
        best.filter(|_| ended).map(|i| told_by(&local, &mut runs[i], polish)).unwrap_or_default();
    if stop() {
        for run in &mut runs {
            run.reason = StopReason::Interrupted;
        }
    }
    let stepping = evaluator.stepping;
    let problem = with_mass.unwrap_or(problem);
    Ok(Identification { problem, stepping, runs, best, agreeing, lags, sensitivities })
}

/// Runs that agree with the best one.
fn agreeing_with(runs: &[Outcome], record: &Record<'_>) -> usize {
    let lowest = runs.iter().fold(f64::INFINITY, |low, run| low.min(run.costs.rms));
    let near = as_low_as(lowest, record.stroke());
    runs.iter().filter(|run| run.costs.rms <= near).count()
}

/// What the record tells of the best candidate.
#[derive(Default)]
struct Told {
    lags: Option<LagRange>,
    sensitivities: Vec<Sensitivity>,
    /// The problem with the mass free, where the record shows it.
    with_mass: Option<Problem>,
}

/// Standard deviations of a candidate; of a `polished` one first the mass is taken where the record
/// shows it, else under a slow drive the least lag that fits.
fn told_by(local: &LocalRefinement<'_>, run: &mut Outcome, polished: bool) -> Told {
    if polished && let Some((problem, polished)) = with_mass(local, &run.place, run.costs) {
        run.polish_evaluations += polished.evaluations;
        (run.place, run.costs) = (polished.place, polished.costs);
        run.theta = problem.theta(&run.place);
        let evaluator = local.evaluator.of(&problem);
        let freed = LocalRefinement { problem: &problem, evaluator: &evaluator, ..*local };
        let sensitivities = freed.sensitivities(&run.place, run.costs.rms);
        return Told { sensitivities, with_mass: Some(problem), lags: None };
    }
    let slow = polished && local.problem.slow;
    let lags = slow.then(|| lag_range(local, &run.place, run.costs)).flatten();
    if let Some(found) = &lags {
        (run.place, run.costs) = (found.place.clone(), found.costs);
        run.theta = local.problem.theta(&run.place);
        run.polish_evaluations += found.evaluations;
    }
    let sensitivities = local.sensitivities(&run.place, run.costs.rms);
    Told { lags, sensitivities, with_mass: None }
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
