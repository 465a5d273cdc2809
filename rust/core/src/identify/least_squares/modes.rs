//! Which modes a fit has.

use super::choices::{MODE_GAIN, ROUGH};
use super::fit::Fit;
use super::form::Form;
use super::{DynamicsKind, Settings, WeightsRecord};
use crate::identify::resonances::{Resonance, resonances};
use crate::models::WeightedPlays;

/// Modes that are looked for.
const MOST_SHOWN: usize = 2;

/// Share of the static displacement that a further mode begins with.
const FURTHER_WEIGHT: f64 = 0.1;

/// Whether a mode was found, which is then part of the fit.
pub(super) fn first_mode<M: WeightedPlays>(
    fit: &mut Fit<'_, M>,
    settings: &Settings,
) -> Option<bool> {
    if !matches!(settings.dynamics, DynamicsKind::Auto | DynamicsKind::Second) {
        return Some(false);
    }
    let common = fit.common;
    let record = common.record;
    let most = if settings.dynamics == DynamicsKind::Auto { MOST_SHOWN } else { 1 };
    if record.measures().excited().is_none() && settings.dynamics == DynamicsKind::Auto {
        // What a mode would explain of one slow sine is creep, or what the plays do not.
        return Some(false);
    }
    let found = resonances(&record.drive, record.y, record.start, most, common.stop)?;
    let mut better = false;
    for count in 1..=found.len() {
        let mut trial = fit.clone();
        trial.set_poles(Form::Modes(count), &poles(&found[..count]));
        trial.settle(ROUGH)?;
        // A further mode on a bound stands for something else.
        let proper = count == 1 || trial.poles_within();
        if proper && trial.rms < (1.0 - MODE_GAIN) * fit.rms {
            *fit = trial;
            better = true;
        }
    }
    if better && settings.dynamics == DynamicsKind::Auto {
        while let Form::Modes(count) = fit.form
            && count < MOST_SHOWN
        {
            let Some(more) = another_mode(fit, count)? else { break };
            *fit = more;
        }
    }
    Some(better)
}

/// The fit with one mode more, where what the others leave shows it: beside hysteresis, it is seen
/// only once the plays and the first mode are fitted together.
#[expect(clippy::option_option, reason = "stopped, or none")]
fn another_mode<'a, M: WeightedPlays>(
    fit: &Fit<'a, M>,
    count: usize,
) -> Option<Option<Fit<'a, M>>> {
    let WeightsRecord { drive, start, .. } = *fit.common.record;
    let Ok(rest) = fit.rest() else { return Some(None) };
    let found = resonances(&drive, &rest, start, 1, fit.common.stop)?;
    let Some(mode) = found.first() else { return Some(None) };
    let mut best: Option<Fit<'a, M>> = None;
    for weight in [FURTHER_WEIGHT, -FURTHER_WEIGHT] {
        let mut trial = fit.clone();
        let mut poles = fit.x[fit.layout().poles()].to_vec();
        poles.extend([weight, libm::log(mode.frequency), libm::log(mode.damping_ratio)]);
        trial.set_poles(Form::Modes(count + 1), &poles);
        trial.settle(ROUGH)?;
        if best.as_ref().is_none_or(|best| trial.rms < best.rms) {
            best = Some(trial);
        }
    }
    let better =
        |trial: &Fit<'_, M>| trial.poles_within() && trial.rms < (1.0 - MODE_GAIN) * fit.rms;
    Some(best.filter(better))
}

/// Leaves out further modes that the stepping between the samples has made needless.
pub(super) fn drop_modes<M: WeightedPlays>(fit: &mut Fit<'_, M>) -> Option<()> {
    while let Form::Modes(count @ 2..) = fit.form {
        let mut trial = fit.clone();
        let poles = fit.x[fit.layout().poles()].to_vec();
        let fewer = Form::Modes(count - 1);
        trial.set_poles(fewer, &poles[..fewer.numbers()]);
        trial.settle(1e-8)?;
        if fit.poles_within() && fit.rms < (1.0 - MODE_GAIN) * trial.rms {
            break;
        }
        *fit = trial;
    }
    Some(())
}

/// Numbers of modes in the order of [`Form::names`].
fn poles(modes: &[Resonance]) -> Vec<f64> {
    let numbers = |(k, mode): (usize, &Resonance)| {
        let logarithms = [libm::log(mode.frequency), libm::log(mode.damping_ratio)];
        if k == 0 { logarithms.to_vec() } else { [&[mode.weight], &logarithms[..]].concat() }
    };
    modes.iter().enumerate().flat_map(numbers).collect()
}
