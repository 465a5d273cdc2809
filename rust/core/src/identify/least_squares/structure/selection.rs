//! Which structure a record asks for: plays, history, creep, dynamics.
//!
//! Each is decided in turn on the least squares so far, and has to earn its place.

use super::histories::{fitted_history, history_gain, with_history};
use super::lag::{best_lag, lag_gain, relaxes_as_well, smallest_lag};
use super::modes::{drop_modes, first_mode};
use super::nodes::{add_once, choose_nodes, drop_once, few_or_many, spread};
use super::refinement::{FIRST_ROUNDS, LEAST_GAIN, ROUNDS, Refinement};
use super::slow_parts::{choose_slow, creeps, drop_drifts, without_creep};
use super::trials::{side_by_side, with_each};
use crate::identify::least_squares::common::Common;
use crate::identify::least_squares::settings::{
    CreepKind, DynamicsKind, FIRST_SHARE, HISTORY_GAIN, MODE_GAIN, NodesKind, ROUGH, SAME, STEPS,
    Settings, Structure, UNSEEN_GAIN,
};
use crate::identify::least_squares::solving::fit::{Beginning, Fit};
use crate::identify::least_squares::solving::form::Form;
use crate::identify::least_squares::solving::judged::Judged;
use crate::identify::least_squares::weights_record::WeightsRecord;
use crate::identify::parameters::drift::DriftKind;
use crate::identify::records::history::History;
use crate::identify::records::thinned::{Thinned, thinning};
use crate::math::least;
use crate::models::Nodes;
use crate::signal::index;

/// Rounds over the numbers of an envelope, at most; and beside dynamics, where each takes longer.
const SHAPE_ROUNDS: usize = 20;
const FEW_SHAPE_ROUNDS: usize = 4;

/// Least share by which a number of an envelope has to lower the deviation before it leaves the
/// middle of its range: what a record does not determine is not changed.
const SHAPE_GAIN: f64 = 0.1;

/// How far a mode that no record shows is above the drive.
const ABOVE_DRIVE: f64 = 10.0;

/// Share of the deviation that dead zones in other places have to take away.
const CORNER_GAIN: f64 = 0.02;

/// Rows that choices are made on, about; of levels, whose weights are many.
const ROWS: usize = 2000;
const ROWS_OF_LEVELS: usize = 4000;

/// How many times as many of a record whose drive jumps: what follows a jump is soon over.
const OF_JUMPS: usize = 4;

/// Starts of one history each that are carried to the end, those of least cost: which of them ends
/// lower shows only with nodes and all parts chosen.
const REFINED: usize = 2;

/// Fits anew from the structure that was found, at most: weights and dead zones may stand where
/// they suited another one.
const ANEW: usize = 3;

/// The best stage; `None` where stopped.
pub(in crate::identify::least_squares) fn search<'a>(
    common: &'a Common<'a>,
    settings: &Settings,
) -> Option<Fit<'a>> {
    let rows = rows_of(common);
    let thin = |one: &WeightsRecord<'_>| {
        let every = thinning(&one.measures(), one.drive.dt, one.samples(), rows);
        Thinned::of(&one.drive, one.y, one.left_out, every)
    };
    let kept: Vec<Thinned> = common.records.iter().map(thin).collect();
    let few = common.thinned(&kept);
    let chosen = choose(&few, settings)?;
    common.count(few.evaluations());
    let mut fit = chosen.on(common);
    let kept = settings.start.as_ref().is_none_or(|start| start.kept);
    // Of a held drive, the last steps alone need all readings.
    let judged = kept.then(|| judged_of(common)).filter(|one| one.iter().any(Judged::stays));
    let all = judged.map(|judged| core::mem::replace(&mut fit.judged, judged));
    if kept {
        fit.settle(1e-4)?;
    }
    fit.exact = true;
    if let Some(all) = all {
        fit.settle(ROUGH)?;
        fit.judged = all;
    }
    fit.settle(if kept { 1e-8 } else { ROUGH })?;
    drop_modes(&mut fit)?;
    Some(fit)
}

/// Rows that choices are made on.
fn rows_of(common: &Common<'_>) -> usize {
    if common.of.nodes() == Nodes::Levels { ROWS_OF_LEVELS } else { ROWS }
}

/// Samples that are judged for choices, of each record.
fn judged_of(common: &Common<'_>) -> Vec<Judged> {
    let of = |one: &WeightsRecord<'_>| {
        let times = if one.jumps() { OF_JUMPS } else { 1 };
        Judged::thinned(one, times * rows_of(common))
    };
    common.records.iter().map(of).collect()
}

/// The structure, on records that may be thinned.
fn choose<'a>(common: &'a Common<'a>, settings: &Settings) -> Option<Fit<'a>> {
    let nodes = match &settings.nodes {
        NodesKind::Given(nodes) => nodes.clone(),
        NodesKind::Spread(count) => spread(common, (*count, 1.0), false),
        NodesKind::Auto => spread(common, (few_or_many(common), 1.0), false),
    };
    let mut fit = Fit::new(common, &nodes);
    fit.judged = judged_of(common);
    fit.settle(ROUGH)?;
    if settings.start.is_none() {
        search_shape(&mut fit)?;
    }
    place_corners(&mut fit, settings.zones);
    fit.settle(ROUGH)?;
    if let Some(start) = &settings.start {
        return resumed(fit, settings, start);
    }
    let mode = first_mode(&mut fit, settings)?;
    if mode {
        // What rings hides the shape.
        search_shape(&mut fit)?;
    }
    if let CreepKind::Times(times) = &settings.creep {
        fit.restructure(|fit| fit.times.clone_from(times));
        fit.settle(ROUGH)?;
    }
    let refinement = Refinement { settings, shown: mode };
    let first = fit.clone();
    let open = fit.common.records.len() == 1 && fit.common.records[0].history.is_none();
    let each = [History::Virgin, History::Settled, History::Fitted].map(Some);
    let starts = if open { each.to_vec() } else { vec![None] };
    let begun = with_each(&starts, |history| with_slow_and_late(&fit, settings, mode, *history))?;
    let mut begun = distinct(begun);
    begun.sort_by(|a, b| refinement.cost(a).total_cmp(&refinement.cost(b)));
    begun.truncate(REFINED);
    let refined = with_each(&begun, |start| {
        let mut trial = start.clone();
        refinement.refine(&mut trial, FIRST_ROUNDS)?;
        Some(trial)
    })?;
    let found = with_each(&distinct(refined), |start| completed(start, &refinement, &first))?;
    let better =
        |a: Fit<'a>, b: Fit<'a>| if refinement.cost(&b) < refinement.cost(&a) { b } else { a };
    let fit = found.into_iter().reduce(better)?;
    with_range_of_lags(fit, settings)
}

/// A start with its nodes and all parts chosen, and from there anew from the `first` fit while that
/// is better.
fn completed<'a>(start: &Fit<'a>, refinement: &Refinement<'_>, first: &Fit<'a>) -> Option<Fit<'a>> {
    let settings = refinement.settings;
    let mut fit = start.clone();
    choose_nodes(&mut fit, settings)?;
    refinement.refine(&mut fit, ROUNDS)?;
    drop_once(&mut fit, settings)?;
    drop_drifts(&mut fit)?;
    replace_corners(&mut fit)?;
    for _ in 0..ANEW {
        let anew = resumed(first.clone(), settings, &fit.structure())?;
        if refinement.cost(&anew) > refinement.cost(&fit) - LEAST_GAIN {
            break;
        }
        fit = anew;
    }
    Some(fit)
}

/// The fit with the smallest lag that explains the record as well, and the range of such lags.
fn with_range_of_lags<'a>(mut fit: Fit<'a>, settings: &Settings) -> Option<Fit<'a>> {
    fit.lags = None;
    if settings.dynamics != DynamicsKind::Auto || matches!(fit.form, Form::Modes(_)) {
        return Some(fit);
    }
    let mut still = fit;
    still.set_poles(Form::None, &[]);
    still.settle(ROUGH)?;
    let lagging = best_lag(&still)?;
    let mut chosen = smallest_lag(still.clone(), &lagging)?;
    let relaxes = settings.creep == CreepKind::Auto && chosen.form == Form::First;
    if relaxes && relaxes_as_well(&still, &lagging)? {
        chosen.lags = chosen.lags.map(|(_, longest)| (0.0, longest));
    }
    Some(chosen)
}

/// Fits of different structures, the first of each.
fn distinct(fits: Vec<Fit<'_>>) -> Vec<Fit<'_>> {
    let mut kept: Vec<Fit<'_>> = Vec::new();
    for fit in fits {
        let same = |other: &Fit<'_>| {
            let history =
                |of: &Fit<'_>| of.begins.iter().map(|one| one.history).collect::<Vec<_>>();
            let alike =
                (&other.times, other.form, &other.drifts) == (&fit.times, fit.form, &fit.drifts);
            alike
                && history(other) == history(&fit)
                && (other.rms / fit.rms - 1.0).abs() < SAME - 1.0
        };
        if !kept.iter().any(same) {
            kept.push(fit);
        }
    }
    kept
}

/// The structure from that of another fit.
fn resumed<'a>(mut fit: Fit<'a>, settings: &Settings, start: &Structure) -> Option<Fit<'a>> {
    let (form, poles) = Form::of(&start.dynamics);
    for (r, (history, drift)) in start.records.iter().enumerate().take(fit.begins.len()) {
        let record = &fit.common.records[r];
        let (history, from) = (record.history.unwrap_or(*history), record.drive.u[0]);
        let chosen = record.drift == DriftKind::Auto;
        fit.restructure(|fit| {
            fit.begins[r] = Beginning { history, from };
            fit.drifts[r] = if chosen { *drift } else { fit.drifts[r] };
        });
    }
    fit.restructure(|fit| fit.times.clone_from(&start.creep_times));
    for slot in fit.layout().creep_weights() {
        fit.x[slot] = FIRST_SHARE;
    }
    fit.set_poles(form, &poles);
    fit.settle(ROUGH)?;
    search_shape(&mut fit)?;
    for r in 0..fit.begins.len() {
        let history = fit.begins[r].history;
        fit = begun(&fit, settings, r, history)?;
    }
    let refinement = Refinement { settings, shown: matches!(form, Form::Modes(_)) };
    refinement.refine(&mut fit, ROUNDS)?;
    choose_nodes(&mut fit, settings)?;
    drop_once(&mut fit, settings)?;
    drop_drifts(&mut fit)?;
    replace_corners(&mut fit)?;
    if start.kept { with_range_of_lags(fit, settings) } else { Some(fit) }
}

/// History, creep, drifts and dynamics, one after the other, from a fit with a history that is held,
/// or is chosen among them.
fn with_slow_and_late<'a>(
    from: &Fit<'a>,
    settings: &Settings,
    mode: bool,
    history: Option<History>,
) -> Option<Fit<'a>> {
    let mut fit = from.clone();
    // With a lag, or what it does would be taken for a history.
    let lags = matches!(settings.dynamics, DynamicsKind::First | DynamicsKind::Auto) && !mode;
    if lags {
        fit = best_lag(&fit)?;
    }
    choose_histories(&mut fit, settings, history)?;
    if lags {
        fit.set_poles(Form::None, &[]);
        // Where the dead zones have moved beside the lag, they would stay.
        let corners = fit.layout().corners();
        fit.x[corners].copy_from_slice(&from.x[from.layout().corners()]);
        fit.settle(ROUGH)?;
    }
    choose_slow(&mut fit, settings)?;
    choose_dynamics_and_creep(&mut fit, settings, mode)?;
    Some(fit)
}

/// Spreads the dead zones over what comes out of the plays in the windows.
fn place_corners(fit: &mut Fit<'_>, count: usize) {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (r, record) in fit.common.records.iter().enumerate() {
        let mut path = fit.before(r);
        for (k, &volts) in record.drive.u.iter().enumerate() {
            fit.push(&mut path, volts, record.step(k));
            if k >= record.start {
                let value = fit.sum(&path.signals);
                (low, high) = (low.min(value), high.max(value));
            }
        }
    }
    let corner = |j: usize| low + (high - low) * index(j) / index(count + 1);
    fit.restructure(|fit| (fit.zones, fit.bent) = (count, (low, high)));
    for (j, slot) in fit.layout().corners().enumerate() {
        fit.x[slot] = corner(j + 1);
    }
}

/// Spreads the dead zones anew, where that is better: while other parts were missing, they may have
/// moved to where they cannot come back from.
fn replace_corners(fit: &mut Fit<'_>) -> Option<()> {
    if fit.zones == 0 {
        return Some(());
    }
    let mut anew = fit.clone();
    place_corners(&mut anew, fit.zones);
    anew.settle(ROUGH)?;
    if anew.rms < (1.0 - CORNER_GAIN) * fit.rms {
        *fit = anew;
    }
    Some(())
}

/// The numbers of the shape in turn, each from its range.
fn search_shape(fit: &mut Fit<'_>) -> Option<()> {
    let ranges: Vec<(f64, f64)> = fit.common.of.shapes().iter().map(|one| one.range).collect();
    let mut released = vec![false; ranges.len()];
    let (rounds, gain) =
        if fit.form == Form::None { (SHAPE_ROUNDS, 1e-5) } else { (FEW_SHAPE_ROUNDS, ROUGH) };
    for _ in 0..rounds {
        let round = fit.rms;
        for (i, &range) in ranges.iter().enumerate() {
            let here = fit.clone();
            let mut best = here.clone();
            least(range, 1e-4, |place| {
                let mut trial = best.clone();
                trial.reshape(i, place);
                trial.held = true;
                trial.settle(gain)?;
                trial.held = false;
                let rms = trial.rms;
                if rms < best.rms {
                    best = trial;
                }
                Some(rms)
            })?;
            let least = if released[i] { 0.0 } else { SHAPE_GAIN };
            if best.rms < (1.0 - least) * here.rms {
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

/// The histories that were set, or one that is held, or the simplest ones that explain the records.
fn choose_histories(fit: &mut Fit<'_>, settings: &Settings, held: Option<History>) -> Option<()> {
    let open = fit.common.records.iter().any(|one| one.history.is_none());
    if open && settings.creep == CreepKind::Auto {
        // With creep, or what it does would be taken for a history.
        let times = creeps(fit).pop().unwrap_or_default();
        fit.restructure(|fit| fit.times = times);
        fit.settle(ROUGH)?;
    }
    for r in 0..fit.common.records.len() {
        match fit.common.records[r].history.or(held) {
            Some(history) => *fit = begun(fit, settings, r, history)?,
            None => choose_history(fit, settings, r)?,
        }
    }
    Some(())
}

/// The fit with a history of one record, and with the play that moves once where that explains it.
fn begun<'a>(fit: &Fit<'a>, settings: &Settings, r: usize, history: History) -> Option<Fit<'a>> {
    let mut begun = match history {
        History::Fitted => fitted_history(fit, r)?,
        _ if fit.begins[r].history == history => fit.clone(),
        _ => with_history(fit, r, (history, 0.0), STEPS)?,
    };
    if history != History::Settled && settings.nodes == NodesKind::Auto {
        add_once(&mut begun, HISTORY_GAIN)?;
    }
    Some(begun)
}

/// The history of one record: more freedom has to explain more.
fn choose_history(fit: &mut Fit<'_>, settings: &Settings, r: usize) -> Option<()> {
    let tried = [History::Virgin, History::Settled, History::Fitted];
    for trial in with_each(&tried, |history| begun(fit, settings, r, *history))? {
        let gain = f64::max(HISTORY_GAIN, history_gain(fit, trial.begins[r].history));
        if trial.rms < fit.rms && trial.deviation_of(r) < (1.0 - gain) * fit.deviation_of(r) {
            *fit = trial;
        }
    }
    Some(())
}

/// Dynamics, and creep anew beside them, which was chosen before a lag for some of which it stood.
fn choose_dynamics_and_creep(fit: &mut Fit<'_>, settings: &Settings, mode: bool) -> Option<()> {
    let still = &*fit;
    let moving = || {
        let mut moving = still.clone();
        choose_dynamics(&mut moving, settings, mode)?;
        Some(moving)
    };
    let (Some(gain), CreepKind::Auto, false) =
        (fit.common.of.creep_gain(), &settings.creep, fit.times.is_empty())
    else {
        *fit = moving()?;
        return Some(());
    };
    let bare = || {
        let mut bare = without_creep(still.clone())?;
        choose_dynamics(&mut bare, settings, mode)?;
        Some(bare)
    };
    let [creeping, bare] = side_by_side([&moving, &bare])?;
    *fit = if (1.0 - gain) * bare.rms <= creeping.rms { bare } else { creeping };
    Some(())
}

/// Mode or lag where they are not set.
fn choose_dynamics(fit: &mut Fit<'_>, settings: &Settings, mode: bool) -> Option<()> {
    match settings.dynamics {
        DynamicsKind::None => {}
        DynamicsKind::First => *fit = best_lag(fit)?,
        DynamicsKind::Second if mode => {}
        DynamicsKind::Second => *fit = unseen_mode(fit)?,
        DynamicsKind::Auto => {
            let mut still = fit.clone();
            still.set_poles(Form::None, &[]);
            still.settle(ROUGH)?;
            let lagging = best_lag(&still)?;
            let (found, gain) =
                if mode { (fit.clone(), MODE_GAIN) } else { (unseen_mode(&still)?, UNSEEN_GAIN) };
            let lags = lagging.rms < (1.0 - lag_gain(&still)) * still.rms;
            *fit = if (mode || is_mode(&found)) && found.rms < (1.0 - gain) * lagging.rms {
                found
            } else if lags {
                lagging
            } else {
                still
            };
        }
    }
    Some(())
}

/// Whether what was found as a mode is one: far above the drive, where it does not stand for
/// what else the record shows at the drive's harmonics.
fn is_mode(fit: &Fit<'_>) -> bool {
    let rates = fit.common.records.iter().map(|one| one.measures().frequency);
    let drive = rates.fold(0.0, f64::max) / core::f64::consts::TAU;
    let Some(slot) = fit.layout().poles().next() else { return false };
    fit.poles_within() && libm::exp(fit.x[slot]) > ABOVE_DRIVE * drive
}

/// A mode that the record does not show: as high and as little damped as the record allows.
fn unseen_mode<'a>(fit: &Fit<'a>) -> Option<Fit<'a>> {
    let dt = fit.common.shortest_interval();
    let beginnings = [(0.4, 0.1), (0.4, 1.0), (0.1, 0.1), (0.1, 1.0), (0.02, 1.0)];
    let trials = with_each(&beginnings, |(frequency, damping_ratio)| {
        let mut trial = fit.clone();
        trial.set_poles(Form::Modes(1), &[libm::log(frequency / dt), libm::log(*damping_ratio)]);
        trial.settle_rigid(STEPS)?;
        Some(trial)
    })?;
    let better =
        |best: Fit<'a>, trial: Fit<'a>| if SAME * trial.rms < best.rms { trial } else { best };
    let mut best = trials.into_iter().reduce(better)?;
    best.settle(ROUGH)?;
    Some(best)
}
