//! Which structure a record asks for: plays, history, creep, dynamics.
//!
//! Each is decided in turn on the least squares so far, and has to earn its place.

use super::fit::{Common, Fit};
use super::form::Form;
use super::gauss_newton::STEPS;
use super::modes::{drop_modes, first_mode};
use super::plays::{add_once, choose_plays, plays_for, spread};
use super::{CreepKind, DynamicsKind, PlaysKind, Settings, WeightsRecord};
use crate::identify::history::History;
use crate::math::least;
use crate::models::WeightedPlays;
use crate::signal::{Drive, index, range};

/// Rounds over the numbers of an envelope, at most.
const SHAPE_ROUNDS: usize = 20;

/// Least share by which a number of an envelope has to lower the deviation before it leaves the
/// middle of its range: what a record does not determine is not changed.
const SHAPE_GAIN: f64 = 0.1;

/// Shares of the deviation that histories, creep and modes have to take away.
const HISTORY_GAIN: f64 = 0.02;
const CREEP_GAIN: f64 = 0.015;
pub(super) const MODE_GAIN: f64 = 0.02;

/// Deviations that differ by less than this share tell nothing.
const SAME: f64 = 1.01;

/// Gain of a step below which a choice is settled.
pub(super) const ROUGH: f64 = 1e-3;

/// Rows that choices are made on, about.
const ROWS: usize = 4000;

/// Longest interval of a thinned record, as a phase of the drive, rad: its peaks are then known to
/// a thousandth of the travel.
const LONGEST_PHASE: f64 = 0.06;

/// Steps of a trial among many: the best one is settled.
const FEW_STEPS: usize = 4;

/// Least time constant of the creep, relative to that of the drive.
const SLOWER: f64 = 0.5;

/// Longest lag that is as likely as creep, in samples: a reading may come late.
const LATE: f64 = 3.0;

/// Deviation of the lag that is taken, relative to the least.
const LAG_SAME: f64 = 1.003;

/// Share of a fitted creep to start from.
const FIRST_SHARE: f64 = 0.005;

/// A fit, and the range of lags that explain the record as well.
type Found<'a, M> = (Fit<'a, M>, Option<(f64, f64)>);

/// The best stage, and the lags that explain the record as well; `None` where stopped.
pub(super) fn search<'a, M: WeightedPlays>(
    common: &'a Common<'a>,
    settings: &Settings,
) -> Option<Found<'a, M>> {
    let every = thinning(common.record);
    let (mut fit, lags) = if every > 1 {
        choose_thinned(common, settings, every)?
    } else {
        let (chosen, lags) = choose::<M>(common, settings)?;
        (chosen.on(common), lags)
    };
    fit.settle(1e-4)?;
    fit.exact = true;
    fit.settle(1e-8)?;
    drop_modes(&mut fit)?;
    Some((fit, lags))
}

/// The structure that every so many of the samples ask for, on all of them.
fn choose_thinned<'a, M: WeightedPlays>(
    common: &'a Common<'a>,
    settings: &Settings,
    every: usize,
) -> Option<Found<'a, M>> {
    let WeightsRecord { drive, y, start } = *common.record;
    let thin = |values: &[f64]| values.iter().copied().step_by(every).collect::<Vec<f64>>();
    let (u, y) = (thin(drive.u), thin(y));
    let drive = Drive { u: &u, dt: drive.dt * index(every), ..drive };
    let record = WeightsRecord { drive, y: &y, start: start.div_ceil(every) };
    let few = Common::new(&record, common.offset, common.falls, common.stop);
    let (chosen, lags) = choose::<M>(&few, settings)?;
    common.evaluations.set(common.evaluations.get() + few.evaluations.get());
    Some((chosen.on(common), lags))
}

/// Every how many samples the choices are made on: where the drive is slow all the time, as many as
/// leave [`ROWS`].
fn thinning(record: &WeightsRecord<'_>) -> usize {
    let of = record.measures();
    let most = LONGEST_PHASE / (of.frequency * record.drive.dt);
    let every = (record.y.len() - record.start) / ROWS;
    let few = of.excited().is_none() && index(every) < most;
    if few { every.max(1) } else { 1 }
}

/// The structure, on a record that may be thinned.
fn choose<'a, M: WeightedPlays>(
    common: &'a Common<'a>,
    settings: &Settings,
) -> Option<Found<'a, M>> {
    let thresholds = match &settings.plays {
        PlaysKind::Thresholds(thresholds) => thresholds.clone(),
        PlaysKind::Spread(count) => spread(common, (*count, 1.0), false),
        PlaysKind::Auto => spread(common, (plays_for(common), 1.0), false),
    };
    let mut fit = Fit::<M>::new(common, &thresholds, settings.history.unwrap_or(History::Virgin));
    fit.every = (common.record.y.len() - common.record.start).div_ceil(ROWS);
    fit.settle(ROUGH)?;
    search_shape(&mut fit)?;
    place_corners(&mut fit, settings.zones);
    fit.settle(ROUGH)?;
    let mode = first_mode(&mut fit, settings)?;
    if let CreepKind::Times(times) = &settings.creep {
        fit.restructure(|fit| fit.times.clone_from(times));
        fit.settle(ROUGH)?;
    }
    // With a lag, or what it does would be taken for a history.
    let lags = matches!(settings.dynamics, DynamicsKind::First | DynamicsKind::Auto) && !mode;
    if lags {
        fit = best_lag(&fit)?;
    }
    choose_history(&mut fit, settings)?;
    if lags {
        fit.set_poles(Form::None, &[]);
        fit.settle(ROUGH)?;
    }
    choose_creep(&mut fit, settings)?;
    let lags = choose_dynamics(&mut fit, settings, mode)?;
    choose_plays(&mut fit, settings)?;
    Some((fit, lags))
}

/// Spreads the dead zones over what comes out of the plays in the window.
fn place_corners<M: WeightedPlays>(fit: &mut Fit<'_, M>, count: usize) {
    let record = fit.common.record;
    let mut plays = fit.plays_before();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (k, &volts) in record.drive.u.iter().enumerate() {
        fit.push(&mut plays, volts);
        if k >= record.start {
            let value = fit.sum(&plays);
            (low, high) = (low.min(value), high.max(value));
        }
    }
    let corner = |j: usize| low + (high - low) * index(j) / index(count + 1);
    fit.restructure(|fit| (fit.zones, fit.bent) = (count, (low, high)));
    for (j, slot) in fit.layout().corners().enumerate() {
        fit.x[slot] = corner(j + 1);
    }
}

/// The numbers of the envelope in turn, each from its range.
fn search_shape<M: WeightedPlays>(fit: &mut Fit<'_, M>) -> Option<()> {
    let ranges = M::shapes();
    let mut released = vec![false; ranges.len()];
    for _ in 0..SHAPE_ROUNDS {
        let round = fit.rms;
        for (i, &range) in ranges.iter().enumerate() {
            let here = fit.clone();
            let mut best = here.clone();
            least(range, 1e-4, |place| {
                let mut trial = here.clone();
                trial.reshape(i, place);
                trial.settle(1e-5)?;
                let rms = trial.rms;
                if rms < best.rms {
                    best = trial;
                }
                Some(rms)
            })?;
            let gain = if released[i] { 0.0 } else { SHAPE_GAIN };
            if best.rms < (1.0 - gain) * here.rms {
                released[i] = true;
                *fit = best;
            }
        }
        if fit.rms > 0.99 * round {
            break;
        }
    }
    Some(())
}

/// The fit with another history, as good as it gets.
fn with_history<'a, M: WeightedPlays>(
    fit: &Fit<'a, M>,
    (history, from): (History, f64),
    steps: usize,
) -> Option<Fit<'a, M>> {
    let mut trial = fit.clone();
    trial.restructure(|trial| (trial.history, trial.from) = (history, from));
    if history == History::Fitted {
        for share in trial.layout().shares() {
            trial.x[share] = trial.x[share].max(FIRST_SHARE);
        }
    }
    trial.settle_within(steps, ROUGH)?;
    Some(trial)
}

/// The voltage that the stage came from.
fn fitted_history<'a, M: WeightedPlays>(fit: &Fit<'a, M>) -> Option<Fit<'a, M>> {
    let drive = fit.common.record.drive;
    let (low, high) = range(drive.u);
    let (first, reach) = (drive.u[0], high - low);
    let parts = 16;
    let mut best = with_history(fit, (History::Fitted, first), STEPS)?;
    let mut width = 2.0 * reach / index(parts);
    for i in 0..=parts {
        let from = first - reach + width * index(i);
        let trial = with_history(&best, (History::Fitted, from), FEW_STEPS)?;
        if trial.rms < best.rms {
            best = trial;
        }
    }
    for _ in 0..7 {
        width *= 0.5;
        for from in [best.from - width, best.from + width] {
            let trial = with_history(&best, (History::Fitted, from), FEW_STEPS)?;
            if trial.rms < best.rms {
                best = trial;
            }
        }
    }
    best.settle(ROUGH)?;
    Some(best)
}

/// The history that was set, or the simplest one that explains the record.
fn choose_history<M: WeightedPlays>(fit: &mut Fit<'_, M>, settings: &Settings) -> Option<()> {
    let with_once = |fit: &mut Fit<'_, M>| {
        if settings.plays == PlaysKind::Auto { add_once(fit, HISTORY_GAIN) } else { Some(()) }
    };
    match settings.history {
        Some(History::Settled) => {}
        Some(History::Virgin) => with_once(fit)?,
        Some(History::Fitted) => {
            *fit = fitted_history(fit)?;
            with_once(fit)?;
        }
        None => {
            // With creep, or what it does would be taken for a history.
            if settings.creep == CreepKind::Auto {
                let times = creeps(fit).pop().unwrap_or_default();
                fit.restructure(|fit| fit.times = times);
                fit.settle(ROUGH)?;
            }
            let mut virgin = fit.clone();
            with_once(&mut virgin)?;
            let mut fitted = fitted_history(fit)?;
            with_once(&mut fitted)?;
            let other = if virgin.rms < fitted.rms { virgin } else { fitted };
            for trial in [with_history(fit, (History::Settled, 0.0), STEPS)?, other] {
                if trial.rms < (1.0 - HISTORY_GAIN) * fit.rms {
                    *fit = trial;
                }
            }
        }
    }
    Some(())
}

/// Time constants of the creep that a record may ask for, s: slower than the drive, whose phase a
/// faster one would turn as a lag does.
fn creeps<M: WeightedPlays>(fit: &Fit<'_, M>) -> Vec<Vec<f64>> {
    let WeightsRecord { drive, y, start } = *fit.common.record;
    let length = drive.dt * index(y.len() - start);
    let u = &drive.u[start..];
    let mean = u.iter().sum::<f64>() / index(u.len());
    let moved: f64 = u.iter().map(|u| (u - mean).powi(2)).sum();
    let changed: f64 = u.windows(2).map(|u| (u[1] - u[0]).powi(2)).sum();
    let shortest = f64::max(SLOWER * drive.dt * libm::sqrt(moved / changed), 10.0 * drive.dt);
    let pair = |divisor: f64| vec![length / divisor, 10.0 * length / divisor];
    let all = [3.0, 10.0, 30.0, 100.0, 300.0].into_iter().map(pair);
    all.filter(|times| times[0] >= shortest).collect()
}

/// Creep where it was not set: none, or the two relaxations that explain most.
fn choose_creep<M: WeightedPlays>(fit: &mut Fit<'_, M>, settings: &Settings) -> Option<()> {
    if settings.creep != CreepKind::Auto {
        return Some(());
    }
    let mut none = fit.clone();
    none.restructure(|none| none.times = Vec::new());
    none.settle(ROUGH)?;
    let mut best: Option<Fit<'_, M>> = None;
    for times in creeps(fit) {
        let mut trial = none.clone();
        trial.restructure(|trial| trial.times = times);
        for share in trial.layout().shares() {
            trial.x[share] = FIRST_SHARE;
        }
        trial.settle(ROUGH)?;
        if best.as_ref().is_none_or(|best| trial.rms < best.rms) {
            best = Some(trial);
        }
    }
    let Some(best) = best.filter(|best| best.rms < (1.0 - CREEP_GAIN) * none.rms) else {
        *fit = none;
        return Some(());
    };
    if settings.dynamics == DynamicsKind::Auto && none.form == Form::None {
        let late = best_lag(&none)?;
        let time = libm::exp(late.x[late.layout().poles().start]);
        if time < LATE * fit.common.record.drive.dt && late.rms < SAME * best.rms {
            *fit = none;
            return Some(());
        }
    }
    *fit = best;
    Some(())
}

/// Mode or lag where they are not set, and the lags that explain the record as well.
#[expect(clippy::option_option, reason = "stopped, or no lag to tell of")]
fn choose_dynamics<M: WeightedPlays>(
    fit: &mut Fit<'_, M>,
    settings: &Settings,
    mode: bool,
) -> Option<Option<(f64, f64)>> {
    match settings.dynamics {
        DynamicsKind::None => Some(None),
        DynamicsKind::First => {
            *fit = best_lag(fit)?;
            Some(None)
        }
        DynamicsKind::Second => {
            if !mode {
                *fit = unseen_mode(fit)?;
            }
            Some(None)
        }
        DynamicsKind::Auto => {
            let mut still = fit.clone();
            if mode {
                still.set_poles(Form::None, &[]);
                still.settle(ROUGH)?;
            }
            let lagging = best_lag(&still)?;
            if mode && fit.rms < (1.0 - MODE_GAIN) * lagging.rms {
                return Some(None);
            }
            let (chosen, lags) = smallest_lag(still, &lagging)?;
            *fit = chosen;
            Some(Some(lags))
        }
    }
}

/// The fit with the lag that explains most.
fn best_lag<'a, M: WeightedPlays>(fit: &Fit<'a, M>) -> Option<Fit<'a, M>> {
    let ranges = Form::First.ranges(&fit.common.record.drive, fit.common.record.start);
    let bounds = (libm::exp(ranges[0].0), libm::exp(ranges[0].1));
    let mut best: Option<Fit<'a, M>> = None;
    least(bounds, 0.1, |time| {
        let trial = at_lag(fit, time)?;
        let rms = trial.rms;
        if best.as_ref().is_none_or(|best| rms < best.rms) {
            best = Some(trial);
        }
        Some(rms)
    })?;
    let mut best = best?;
    best.settle(1e-5)?;
    Some(best)
}

/// The fit with a lag of so many seconds, which is held.
fn at_lag<'a, M: WeightedPlays>(fit: &Fit<'a, M>, time: f64) -> Option<Fit<'a, M>> {
    let mut trial = fit.clone();
    trial.set_poles(Form::First, &[libm::log(time)]);
    trial.held = true;
    trial.settle(ROUGH)?;
    trial.held = false;
    Some(trial)
}

/// The smallest lag that explains the record as well as the best one, and the range of such lags.
fn smallest_lag<'a, M: WeightedPlays>(
    still: Fit<'a, M>,
    best: &Fit<'a, M>,
) -> Option<(Fit<'a, M>, (f64, f64))> {
    let time = libm::exp(best.x[best.layout().poles().start]);
    let enough = SAME * f64::min(best.rms, still.rms);
    let as_good = |time: f64| Some(at_lag(best, time)?.rms <= enough);
    let longest = libm::exp(best.pole_ranges()[0].1);
    let mut high = time;
    while high < longest && as_good(1.5 * high)? {
        high *= 1.5;
    }
    let mut beyond = 1.5 * high;
    for _ in 0..4 {
        let middle = 0.5 * (high + beyond);
        if as_good(middle)? { high = middle } else { beyond = middle }
    }
    let shortest = |enough: f64| {
        let (mut low, mut short) = (time, 0.0);
        for _ in 0..6 {
            let middle = 0.5 * (low + short);
            if at_lag(best, middle)?.rms <= enough { low = middle } else { short = middle }
        }
        Some(low)
    };
    let low = if still.rms <= enough { 0.0 } else { shortest(enough)? };
    let least = LAG_SAME / SAME * enough;
    if still.rms <= least {
        return Some((still, (low, high)));
    }
    let mut chosen = at_lag(best, shortest(least)?)?;
    chosen.held = true;
    Some((chosen, (low, high)))
}

/// A mode that the record does not show: as high and as little damped as the record allows.
fn unseen_mode<'a, M: WeightedPlays>(fit: &Fit<'a, M>) -> Option<Fit<'a, M>> {
    let dt = fit.common.record.drive.dt;
    let mut best: Option<Fit<'a, M>> = None;
    for (frequency, damping_ratio) in [(0.4, 0.1), (0.4, 1.0), (0.1, 0.1), (0.1, 1.0), (0.02, 1.0)]
    {
        let mut trial = fit.clone();
        trial.set_poles(Form::Modes(1), &[libm::log(frequency / dt), libm::log(damping_ratio)]);
        trial.settle(ROUGH)?;
        if best.as_ref().is_none_or(|best| SAME * trial.rms < best.rms) {
            best = Some(trial);
        }
    }
    best
}
