//! Which modes a fit has.

use crate::identify::least_squares::settings::{DynamicsKind, MODE_GAIN, ROUGH, Settings};
use crate::identify::least_squares::solving::fit::Fit;
use crate::identify::least_squares::solving::form::Form;
use crate::identify::least_squares::weights_record::WeightsRecord;
use crate::identify::records::resonances::{Resonance, resonances};

/// Modes that are looked for.
const MOST_SHOWN: usize = 2;

/// Share of the static displacement that a further mode begins with.
const FURTHER_WEIGHT: f64 = 0.1;

/// Whether a mode was found, which is then part of the fit.
pub(super) fn first_mode(fit: &mut Fit<'_>, settings: &Settings) -> Option<bool> {
    if !matches!(settings.dynamics, DynamicsKind::Auto | DynamicsKind::Second) {
        return Some(false);
    }
    let common = fit.common;
    let chosen = settings.dynamics == DynamicsKind::Auto;
    let most = if chosen { MOST_SHOWN } else { 1 };
    let mut found = Vec::new();
    for record in &common.records {
        // What a mode would explain of one slow sine is creep, or what the plays do not.
        if !(found.is_empty() && (!chosen || record.measures().excited().is_some())) {
            continue;
        }
        found = resonances(&record.drive, record.y, record.start, most, common.stop)?;
    }
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
fn another_mode<'a>(fit: &Fit<'a>, count: usize) -> Option<Option<Fit<'a>>> {
    let mut found = Vec::new();
    for (r, WeightsRecord { drive, start, .. }) in fit.common.records.iter().enumerate() {
        let Ok(rest) = fit.rest(r) else { return Some(None) };
        if found.is_empty() {
            found = resonances(drive, &rest, *start, 1, fit.common.stop)?;
        }
    }
    let Some(mode) = found.first() else { return Some(None) };
    let mut best: Option<Fit<'a>> = None;
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
    let better = |trial: &Fit<'_>| trial.poles_within() && trial.rms < (1.0 - MODE_GAIN) * fit.rms;
    Some(best.filter(better))
}

/// Leaves out further modes that the stepping between the samples has made needless.
pub(super) fn drop_modes(fit: &mut Fit<'_>) -> Option<()> {
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
