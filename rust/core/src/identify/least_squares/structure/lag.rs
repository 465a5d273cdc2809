//! Lag of a fit by least squares: the best one, and the smallest that explains a record as well.

use crate::identify::least_squares::settings::{
    FIRST_SHARE, LAG_BESIDE_CREEP_GAIN, LAG_GAIN, ROUGH, SAME, STEPS,
};
use crate::identify::least_squares::solving::fit::Fit;
use crate::identify::least_squares::solving::form::Form;

/// Ratio of neighbouring lags that are tried.
const LAG_SPREAD: f64 = 2.5;

/// Time constants of relaxations that turn the phase of a drive as a lag does, as shares of its
/// period.
const FAST_CREEP: [f64; 3] = [0.03, 0.1, 0.3];

/// Least ratio of the time constants of relaxations.
const SLOWER: f64 = 1.4;

/// Deviation of the lag that is taken, relative to the least.
const LAG_SAME: f64 = 1.003;

/// The fit with the lag that explains most: the best of some, and from there on with the lag as one
/// of the unknowns.
pub(super) fn best_lag<'a>(fit: &Fit<'a>) -> Option<Fit<'a>> {
    let ranges = Form::First.ranges(fit.common.longest().length(), fit.common.shortest_interval());
    let (mut time, longest) = (libm::exp(ranges[0].0), libm::exp(ranges[0].1));
    let mut trial = fit.clone();
    let mut best: Option<Fit<'a>> = None;
    while time < longest {
        // Each from the one before: their weights differ little.
        trial = at_lag(&trial, time, 1)?;
        if best.as_ref().is_none_or(|best| trial.rms < best.rms) {
            best = Some(trial.clone());
        }
        time *= LAG_SPREAD;
    }
    let mut best = best?;
    best.settle(1e-5)?;
    Some(best)
}

/// The fit with a lag of so many seconds, which is held, after so many steps at most.
fn at_lag<'a>(fit: &Fit<'a>, time: f64, steps: usize) -> Option<Fit<'a>> {
    let mut trial = fit.clone();
    trial.set_poles(Form::First, &[libm::log(time)]);
    trial.held = true;
    trial.settle_rigid(steps)?;
    trial.held = false;
    Some(trial)
}

/// Share of the deviation that a lag has to take away.
pub(super) fn lag_gain(fit: &Fit<'_>) -> f64 {
    if fit.times.is_empty() { LAG_GAIN } else { LAG_BESIDE_CREEP_GAIN }
}

/// Whether a relaxation faster than the drive explains the record nearly as well as a lag.
pub(super) fn relaxes_as_well(still: &Fit<'_>, lagging: &Fit<'_>) -> Option<bool> {
    let record = still.common.longest();
    let period = core::f64::consts::TAU / record.measures().frequency;
    for time in FAST_CREEP.map(|share| share * period) {
        let mut trial = still.clone();
        trial.restructure(|trial| {
            trial.times.retain(|other| *other > SLOWER * time);
            trial.times.insert(0, time);
        });
        for weight in trial.layout().creep_weights() {
            trial.x[weight] = FIRST_SHARE;
        }
        trial.settle_rigid(STEPS)?;
        if (1.0 - LAG_BESIDE_CREEP_GAIN) * trial.rms <= lagging.rms {
            return Some(true);
        }
    }
    Some(false)
}

/// The fit with the smallest lag that explains the record as well as the best one, and with the range
/// of such lags.
pub(super) fn smallest_lag<'a>(mut still: Fit<'a>, best: &Fit<'a>) -> Option<Fit<'a>> {
    let time = libm::exp(best.x[best.layout().poles().start]);
    let enough = SAME * f64::min(best.rms, still.rms);
    let as_good = |time: f64| Some(at_lag(best, time, STEPS)?.rms <= enough);
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
            if at_lag(best, middle, STEPS)?.rms <= enough { low = middle } else { short = middle }
        }
        Some(low)
    };
    if (1.0 - lag_gain(&still)) * still.rms <= best.rms {
        still.lags = Some((0.0, high));
        return Some(still);
    }
    let low = if still.rms <= enough { 0.0 } else { shortest(enough)? };
    let least = LAG_SAME / SAME * enough;
    let mut chosen = at_lag(best, shortest(least)?, STEPS)?;
    chosen.held = true;
    chosen.settle(ROUGH)?;
    chosen.lags = Some((low, high));
    Some(chosen)
}
