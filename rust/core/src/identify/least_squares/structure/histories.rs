//! Histories of a record: the fit with another one, and the voltage that the stage came from.

use crate::identify::least_squares::settings::{
    FIRST_SHARE, HISTORY_GAIN, ROUGH, STEPS, VOLTAGE_GAIN, VOLTAGE_GAIN_ABOVE_NOISE,
};
use crate::identify::least_squares::solving::fit::{Beginning, Fit};
use crate::identify::records::history::History;
use crate::signal::{index, range};

/// Steps of a trial among many: the best one is settled.
const FEW_STEPS: usize = 2;

/// Share of the deviation that a history has to take away beside that of a stage which never moved.
pub(super) fn history_gain(fit: &Fit<'_>, history: History) -> f64 {
    match history {
        History::Virgin => 0.0,
        History::Settled => HISTORY_GAIN,
        History::Fitted => {
            let above_noise = 1.0 - fit.common.noise / fit.rms;
            f64::max(VOLTAGE_GAIN, VOLTAGE_GAIN_ABOVE_NOISE * above_noise)
        }
    }
}

/// The fit with another history of record `r`, as good as it gets.
pub(super) fn with_history<'a>(
    fit: &Fit<'a>,
    r: usize,
    (history, from): (History, f64),
    steps: usize,
) -> Option<Fit<'a>> {
    let mut trial = fit.clone();
    trial.restructure(|trial| trial.begins[r] = Beginning { history, from });
    if history == History::Fitted {
        for share in trial.layout().creep_weights() {
            trial.x[share] = trial.x[share].max(FIRST_SHARE);
        }
    }
    if steps == STEPS {
        trial.settle(ROUGH)?;
    } else {
        trial.settle_rigid(steps)?;
    }
    Some(trial)
}

/// The voltage that the stage came from.
pub(super) fn fitted_history<'a>(fit: &Fit<'a>, r: usize) -> Option<Fit<'a>> {
    let drive = fit.common.records[r].drive;
    let (low, high) = range(drive.u);
    let (first, reach) = (drive.u[0], high - low);
    let parts = 16;
    let mut best = with_history(fit, r, (History::Fitted, first), STEPS)?;
    let width = 2.0 * reach / index(parts);
    for i in 0..=parts {
        let from = first - reach + width * index(i);
        let trial = with_history(&best, r, (History::Fitted, from), FEW_STEPS)?;
        if trial.rms < best.rms {
            best = trial;
        }
    }
    nearer(best, r, width)
}

/// The fit with the voltage that record `r` came from moved within `width`, V, to where it explains
/// most.
pub(super) fn nearer(mut best: Fit<'_>, r: usize, mut width: f64) -> Option<Fit<'_>> {
    for _ in 0..7 {
        width *= 0.5;
        let from = best.begins[r].from;
        for from in [from - width, from + width] {
            let trial = with_history(&best, r, (History::Fitted, from), FEW_STEPS)?;
            if trial.rms < best.rms {
                best = trial;
            }
        }
    }
    best.settle(ROUGH)?;
    Some(best)
}
