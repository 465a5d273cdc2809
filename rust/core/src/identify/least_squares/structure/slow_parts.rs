//! Which slow parts a record shows: creep of the stage, drift of the sensor.

use super::lag::best_lag;
use super::nodes::split;
use super::trials::{side_by_side, with_each};
use crate::identify::least_squares::settings::{
    CREEP_GAIN, CreepKind, DRIFT_GAIN, DynamicsKind, FIRST_SHARE, ROUGH, SAME, STEPS, Settings,
};
use crate::identify::least_squares::solving::fit::{Fit, known_drift};
use crate::identify::least_squares::solving::form::Form;
use crate::identify::parameters::drift::{DRIFT_TIMES, DriftKind, turns_often};
use crate::math::{least, on_all_threads};
use crate::signal::index;

/// Least time constant of the creep, relative to that of the drive.
const SLOWER: f64 = 0.5;

/// Longest lag that is as likely as creep, in samples: a reading may come late.
const LATE: f64 = 3.0;

/// Time constants of the creep that a record may ask for, s: slower than the drive, whose phase a
/// faster one would turn as a lag does.
pub(super) fn creeps(fit: &Fit<'_>) -> Vec<Vec<f64>> {
    let record = fit.common.longest();
    let (drive, length) = (record.drive, record.length());
    let u = &drive.u[record.start..];
    let mean = u.iter().sum::<f64>() / index(u.len());
    let moved: f64 = u.iter().map(|u| (u - mean).powi(2)).sum();
    let changed: f64 = u.windows(2).map(|u| (u[1] - u[0]).powi(2)).sum();
    let shortest = f64::max(SLOWER * drive.dt * libm::sqrt(moved / changed), 10.0 * drive.dt);
    let pair = |divisor: f64| vec![length / divisor, 10.0 * length / divisor];
    let all = [3.0, 10.0, 30.0, 100.0, 300.0].into_iter().map(pair);
    all.filter(|times| times[0] >= shortest).collect()
}

/// Creep and drift where they are not set: none, one of the two, or both where each explains
/// enough.
pub(super) fn choose_slow(fit: &mut Fit<'_>, settings: &Settings) -> Option<()> {
    let from = &*fit;
    let creeping = || {
        let mut crept = from.clone();
        choose_creep(&mut crept, settings)?;
        Some(crept)
    };
    if fit.common.records.iter().all(|one| one.drift != DriftKind::Auto) {
        *fit = creeping()?;
        return Some(());
    }
    let drifting = || {
        let mut drifted = from.clone();
        if settings.creep == CreepKind::Auto {
            drifted.restructure(|fit| fit.times = Vec::new());
            drifted.settle(ROUGH)?;
        }
        choose_drifts(&mut drifted)?;
        Some(drifted)
    };
    let [drifted, crept] = side_by_side([&drifting, &creeping])?;
    let then_creeping = || {
        let mut both = drifted.clone();
        if drifted.drifts != from.drifts {
            choose_creep(&mut both, settings)?;
        }
        Some(both)
    };
    let then_drifting = || {
        let mut both = crept.clone();
        choose_drifts(&mut both)?;
        Some(both)
    };
    let [drifted_first, crept_first] = side_by_side([&then_creeping, &then_drifting])?;
    let found = [drifted, drifted_first, crept_first, crept];
    // One explains a record as well as the other, but goes on otherwise.
    let mut least = f64::INFINITY;
    let later = on_all_threads(&found, &|one| foretold(one));
    for (one, later) in found.into_iter().zip(later) {
        let later = later?;
        if later < least {
            (least, *fit) = (later, one);
        }
    }
    Some(())
}

/// The same without creep, its drifts chosen anew.
pub(super) fn without_creep(mut fit: Fit<'_>) -> Option<Fit<'_>> {
    fit.restructure(|fit| {
        fit.times = Vec::new();
        fit.drifts = fit.common.records.iter().map(known_drift).collect();
    });
    fit.settle(ROUGH)?;
    choose_drifts(&mut fit)?;
    Some(fit)
}

/// RMS deviation on the last third of each window of a structure that is fitted to what is before
/// it, m.
fn foretold(fit: &Fit<'_>) -> Option<f64> {
    let mut early = fit.clone();
    early.windows = fit.windows.iter().map(|one| one.start..split(one)).collect();
    early.settle_rigid(STEPS)?;
    early.windows = fit.windows.iter().map(|one| split(one)..one.end).collect();
    Some(early.deviation())
}

/// The drift of each record of which nothing is said, where it explains enough.
fn choose_drifts(fit: &mut Fit<'_>) -> Option<()> {
    for r in 0..fit.common.records.len() {
        let record = &fit.common.records[r];
        if record.drift != DriftKind::Auto
            || fit.drifts[r].is_some()
            || !turns_often(&record.drive.u[record.start..])
        {
            continue;
        }
        let mut best = with_drift(fit, r)?;
        best.settle(ROUGH)?;
        let enough = (1.0 - DRIFT_GAIN) * fit.deviation_of(r);
        if best.deviation_of(r) < enough {
            *fit = best;
        }
    }
    Some(())
}

/// Leaves out the drifts that explain too little beside what was chosen after them, as creep and
/// nodes: what a drift stood for may be explained by now.
pub(super) fn drop_drifts(fit: &mut Fit<'_>) -> Option<()> {
    for r in 0..fit.common.records.len() {
        if fit.common.records[r].drift != DriftKind::Auto || fit.drifts[r].is_none() {
            continue;
        }
        let mut bare = fit.clone();
        bare.restructure(|bare| bare.drifts[r] = None);
        bare.settle(ROUGH)?;
        if (1.0 - DRIFT_GAIN) * bare.deviation_of(r) <= fit.deviation_of(r) {
            *fit = bare;
        }
    }
    Some(())
}

/// The fit with the drift of record `r` that explains most.
pub(super) fn with_drift<'a>(fit: &Fit<'a>, r: usize) -> Option<Fit<'a>> {
    let length = fit.common.records[r].length();
    let mut best: Option<Fit<'a>> = None;
    let tried = |time: f64| {
        let mut trial = best.as_ref().unwrap_or(fit).clone();
        trial.restructure(|trial| trial.drifts[r] = Some(time));
        trial.settle_rigid(STEPS)?;
        let rms = trial.rms;
        if best.as_ref().is_none_or(|best| rms < best.rms) {
            best = Some(trial);
        }
        Some(rms)
    };
    least((DRIFT_TIMES.0 * length, DRIFT_TIMES.1 * length), 0.02, tried)?;
    best
}

/// Creep where it was not set: none, or the two relaxations that explain most.
fn choose_creep<'a>(fit: &mut Fit<'a>, settings: &Settings) -> Option<()> {
    if settings.creep != CreepKind::Auto {
        return Some(());
    }
    let mut none = fit.clone();
    none.restructure(|none| none.times = Vec::new());
    none.settle(ROUGH)?;
    let trials = with_each(&creeps(fit), |times| {
        let mut trial = none.clone();
        trial.restructure(|trial| trial.times.clone_from(times));
        for share in trial.layout().creep_weights() {
            trial.x[share] = FIRST_SHARE;
        }
        trial.settle_rigid(STEPS)?;
        Some(trial)
    })?;
    let least = |best: Fit<'a>, trial: Fit<'a>| if trial.rms < best.rms { trial } else { best };
    let mut best = trials.into_iter().reduce(least);
    if let Some(best) = &mut best {
        best.settle(ROUGH)?;
    }
    let Some(best) = best.filter(|best| best.rms < (1.0 - CREEP_GAIN) * none.rms) else {
        *fit = none;
        return Some(());
    };
    if settings.dynamics == DynamicsKind::Auto && none.form == Form::None {
        let late = best_lag(&none)?;
        let time = libm::exp(late.x[late.layout().poles().start]);
        if time < LATE * fit.common.shortest_interval() && late.rms < SAME * best.rms {
            *fit = none;
            return Some(());
        }
    }
    *fit = best;
    Some(())
}
