//! Lag of a fit by least squares: the best one, and the smallest that explains a record as well.

use crate::identify::least_squares::settings::{ROUGH, SAME, STEPS};
use crate::identify::least_squares::solving::fit::Fit;
use crate::identify::least_squares::solving::form::Form;

/// Ratio of neighbouring lags that are tried.
const LAG_SPREAD: f64 = 2.5;

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
    let low = if still.rms <= enough { 0.0 } else { shortest(enough)? };
    let least = LAG_SAME / SAME * enough;
    if still.rms <= least {
        still.lags = Some((low, high));
        return Some(still);
    }
    let mut chosen = at_lag(best, shortest(least)?, STEPS)?;
    chosen.held = true;
    chosen.settle(ROUGH)?;
    chosen.lags = Some((low, high));
    Some(chosen)
}
