//! Refinement of a structure: other histories, creep, drifts and dynamics beside those chosen.
//!
//! Choices in turn depend on their order: a lag may stand for creep, a history for a drift.
//! From the structure so far, neighbours in one part, or in two that stand for each other, are
//! settled side by side, and the one of least cost is taken, until none is better. The cost is the
//! logarithm of the RMS deviation and, for each part, the share of the deviation that it has to
//! take away: residuals of models are correlated, so that criteria that count independent samples,
//! as Akaike's, would take every part.

use super::histories::{fitted_history, history_gain, nearer, with_history};
use super::lag::{best_lag, lag_gain};
use super::slow_parts::{creeps, with_drift};
use super::trials::{Trial, settled_all, with_each};
use crate::identify::least_squares::settings::{
    CREEP_GAIN, CreepKind, DRIFT_GAIN, DynamicsKind, FIRST_SHARE, LAG_BESIDE_CREEP_GAIN, MODE_GAIN,
    ROUGH, Settings, UNSEEN_GAIN,
};
use crate::identify::least_squares::solving::fit::Fit;
use crate::identify::least_squares::solving::form::Form;
use crate::identify::parameters::drift::{DriftKind, turns_often};
use crate::identify::records::history::History;
use crate::signal::range;

/// Rounds through all parts, at most; and of starts, the best of which goes on.
pub(super) const ROUNDS: usize = 4;
pub(super) const FIRST_ROUNDS: usize = 1;

/// Share of the stroke below which no sensor shows a deviation.
const UNSEEN: f64 = 1e-6;

/// Least gain of a move: less is chance, and the structure of the moves before stays.
pub(super) const LEAST_GAIN: f64 = 3e-3;

/// Least gain of a drift or a lag in place of creep or the other way round: one explains a record as
/// well as the other, but goes on otherwise, and which of them foretells a part has been found
/// before.
const EXCHANGE_GAIN: f64 = LAG_BESIDE_CREEP_GAIN;

/// Steps of a neighbour, how many of the best are settled, and how far above the cost so far these
/// may be before.
const FEW_STEPS: usize = 3;
const SETTLED: usize = 2;
const WITHIN: f64 = 0.2;

/// Ratios by which time constants of the creep are moved.
const RATIOS: [f64; 3] = [3.0, 1.5, 1.2];

/// Refinement of a fit with some settings.
pub(super) struct Refinement<'s> {
    pub settings: &'s Settings,
    /// Whether a mode was shown by a record.
    pub shown: bool,
}

type Way<'t, 'a> = Box<dyn Fn() -> Option<Fit<'a>> + Sync + 't>;

impl Refinement<'_> {
    /// Penalised cost: logarithm of the RMS deviation and of what each part has to take away.
    pub fn cost(&self, fit: &Fit<'_>) -> f64 {
        let mut cost = libm::log(fit.rms + UNSEEN * fit.common.stroke);
        for (r, record) in fit.common.records.iter().enumerate() {
            // Each history with more freedom has to take its share away.
            if record.history.is_none() {
                cost += history_gain(fit, fit.begins[r].history);
            }
            if record.drift == DriftKind::Auto && fit.drifts[r].is_some() {
                cost += DRIFT_GAIN;
            }
        }
        if self.settings.creep == CreepKind::Auto && !fit.times.is_empty() {
            cost += CREEP_GAIN;
        }
        if self.settings.dynamics == DynamicsKind::Auto {
            cost += match fit.form {
                Form::None => 0.0,
                Form::First => lag_gain(fit),
                Form::Modes(_) if !self.shown => UNSEEN_GAIN,
                Form::Modes(1) => MODE_GAIN,
                Form::Modes(_) => 2.0 * MODE_GAIN,
            };
        }
        cost
    }

    /// Moves to better structures until there is none, or so many rounds are over.
    pub fn refine(&self, fit: &mut Fit<'_>, rounds: usize) -> Option<()> {
        for _ in 0..rounds {
            let before = self.cost(fit);
            self.histories(fit)?;
            self.slow_and_late(fit)?;
            self.creep_times(fit)?;
            self.dynamics(fit)?;
            if self.cost(fit) > before - LEAST_GAIN {
                break;
            }
        }
        Some(())
    }

    /// Takes the best of some ways where it is better than the fit.
    fn take<'a>(&self, fit: &mut Fit<'a>, ways: &[Way<'_, 'a>]) -> Option<bool> {
        let trials: Vec<Trial<'_, 'a>> = ways.iter().map(|way| way as Trial<'_, 'a>).collect();
        let mut tried = settled_all(&trials)?;
        tried.sort_by(|a, b| self.cost(a).total_cmp(&self.cost(b)));
        tried.truncate(SETTLED);
        let before = self.cost(fit);
        tried.retain(|trial| self.cost(trial) < before + WITHIN);
        let settled = with_each(&tried, |trial| {
            let mut trial = trial.clone();
            trial.settle(ROUGH)?;
            Some(trial)
        })?;
        let (mut least, mut better) = (before, None);
        for trial in settled {
            let cost = self.cost(&trial);
            let gain = if exchanges(fit, &trial) { EXCHANGE_GAIN } else { LEAST_GAIN };
            if cost < least && cost < before - gain {
                (least, better) = (cost, Some(trial));
            }
        }
        let found = better.is_some();
        if let Some(better) = better {
            *fit = better;
        }
        Some(found)
    }

    /// The other histories of each record, or another voltage that it came from.
    fn histories(&self, fit: &mut Fit<'_>) -> Option<()> {
        for r in 0..fit.common.records.len() {
            if fit.common.records[r].history.is_some() {
                continue;
            }
            let from = &fit.clone();
            let mut ways: Vec<Way<'_, '_>> = Vec::new();
            for history in [History::Virgin, History::Settled] {
                if from.begins[r].history != history {
                    ways.push(Box::new(move || with_history(from, r, (history, 0.0), FEW_STEPS)));
                }
            }
            if from.begins[r].history == History::Fitted {
                let (low, high) = range(from.common.records[r].drive.u);
                let width = 0.125 * (high - low);
                ways.push(Box::new(move || nearer(from.clone(), r, width)));
            } else {
                ways.push(Box::new(move || fitted_history(from, r)));
            }
            self.take(fit, &ways)?;
        }
        Some(())
    }

    /// Creep, drifts, and a lag, which stand for each other.
    fn slow_and_late(&self, fit: &mut Fit<'_>) -> Option<()> {
        let from = &fit.clone();
        let mut ways = self.other_creeps(from);
        for (r, record) in from.common.records.iter().enumerate() {
            if record.drift != DriftKind::Auto || !turns_often(&record.drive.u[record.start..]) {
                continue;
            }
            if from.drifts[r].is_some() {
                ways.push(Box::new(move || {
                    let mut bare = without_drift(from, r);
                    bare.settle(ROUGH)?;
                    Some(bare)
                }));
                // Its time constant anew, beside what has been chosen since.
                ways.push(Box::new(move || with_drift(&without_drift(from, r), r)));
                continue;
            }
            ways.push(Box::new(move || with_drift(from, r)));
            if self.settings.creep == CreepKind::Auto && !from.times.is_empty() {
                ways.push(Box::new(move || with_drift(&with_creep(from, &[])?, r)));
            }
        }
        self.take(fit, &ways)?;
        Some(())
    }

    /// Other creep, also in place of a lag or of a drift, or with a lag.
    fn other_creeps<'t, 'a>(&self, from: &'t Fit<'a>) -> Vec<Way<'t, 'a>> {
        let mut ways: Vec<Way<'t, 'a>> = Vec::new();
        if self.settings.creep != CreepKind::Auto {
            return ways;
        }
        let lags =
            self.settings.dynamics == DynamicsKind::Auto && !matches!(from.form, Form::Modes(_));
        let mut creep = creeps(from);
        creep.extend([decades(from), Vec::new()]);
        creep.retain(|times| *times != from.times);
        for times in creep {
            let (none, many) = (times.is_empty(), times.len() > 2);
            let other = times.clone();
            ways.push(Box::new(move || with_creep(from, &other)));
            if lags && !none && from.form == Form::First {
                let other = times.clone();
                ways.push(Box::new(move || {
                    let mut bare = from.clone();
                    bare.set_poles(Form::None, &[]);
                    with_creep(&bare, &other)
                }));
            }
            if lags && from.form == Form::None && (none || many) {
                let other = times.clone();
                ways.push(Box::new(move || best_lag(&with_creep(from, &other)?)));
            }
            for r in 0..from.common.records.len() {
                if from.common.records[r].drift == DriftKind::Auto && from.drifts[r].is_some() {
                    let other = times.clone();
                    ways.push(Box::new(move || with_creep(&without_drift(from, r), &other)));
                }
            }
        }
        ways
    }

    /// Time constants of the creep, moved one at a time and both.
    fn creep_times(&self, fit: &mut Fit<'_>) -> Option<()> {
        if self.settings.creep != CreepKind::Auto || fit.times.is_empty() {
            return Some(());
        }
        for ratio in RATIOS {
            for _ in 0..3 {
                let from = &fit.clone();
                let mut ways: Vec<Way<'_, '_>> = Vec::new();
                let count = from.times.len();
                for part in 0..=count {
                    for factor in [ratio, 1.0 / ratio] {
                        let mut times = from.times.clone();
                        for (i, time) in times.iter_mut().enumerate() {
                            if part == count || part == i {
                                *time *= factor;
                            }
                        }
                        if times.windows(2).any(|pair| pair[1] < 1.4 * pair[0])
                            || times[0] < 3.0 * from.common.shortest_interval()
                        {
                            continue;
                        }
                        ways.push(Box::new(move || with_times(from, &times)));
                    }
                }
                if !self.take(fit, &ways)? {
                    break;
                }
            }
        }
        Some(())
    }

    fn dynamics(&self, fit: &mut Fit<'_>) -> Option<()> {
        if self.settings.dynamics != DynamicsKind::Auto {
            return Some(());
        }
        let from = fit.clone();
        let mut still = from.clone();
        still.set_poles(Form::None, &[]);
        let (from, still) = (&from, &still);
        let mut ways: Vec<Way<'_, '_>> = Vec::new();
        if from.form != Form::None {
            ways.push(Box::new(move || {
                let mut still = still.clone();
                still.settle(ROUGH)?;
                Some(still)
            }));
        }
        if from.form != Form::First {
            ways.push(Box::new(move || best_lag(still)));
        }
        if let Form::Modes(count @ 2..) = from.form {
            ways.push(Box::new(move || {
                let mut trial = from.clone();
                let poles = from.x[from.layout().poles()].to_vec();
                let fewer = Form::Modes(count - 1);
                trial.set_poles(fewer, &poles[..fewer.numbers()]);
                trial.settle(ROUGH)?;
                Some(trial)
            }));
        }
        self.take(fit, &ways)?;
        Some(())
    }
}

/// The fit without the drift of record `r`.
fn without_drift<'a>(from: &Fit<'a>, r: usize) -> Fit<'a> {
    let mut bare = from.clone();
    bare.restructure(|bare| bare.drifts[r] = None);
    bare
}

/// Time constants of one relaxation a decade, s.
fn decades(fit: &Fit<'_>) -> Vec<f64> {
    let record = fit.common.longest();
    let (shortest, longest) = (10.0 * record.drive.dt, 0.5 * record.length());
    let mut times = Vec::new();
    let mut time = longest;
    while time >= shortest && times.len() < 6 {
        times.push(time);
        time /= 10.0;
    }
    times.reverse();
    times
}

/// Whether one fit has creep where the other has a drift or a lag.
fn exchanges(fit: &Fit<'_>, other: &Fit<'_>) -> bool {
    let drifts = |of: &Fit<'_>| of.drifts.iter().any(Option::is_some);
    let lags = |of: &Fit<'_>| of.form == Form::First;
    let creeps = |of: &Fit<'_>| !of.times.is_empty();
    let stands = drifts(fit) != drifts(other) || lags(fit) != lags(other);
    stands && creeps(fit) != creeps(other)
}

/// The fit with relaxations of these time constants, s, as good as it gets.
fn with_creep<'a>(from: &Fit<'a>, times: &[f64]) -> Option<Fit<'a>> {
    let mut trial = from.clone();
    trial.restructure(|trial| trial.times = times.to_vec());
    for share in trial.layout().creep_weights() {
        trial.x[share] = FIRST_SHARE;
    }
    trial.settle_rigid(FEW_STEPS)?;
    Some(trial)
}

/// The same with the weights of the relaxations kept.
fn with_times<'a>(from: &Fit<'a>, times: &[f64]) -> Option<Fit<'a>> {
    let mut trial = from.clone();
    let shares = from.x[from.layout().creep_weights()].to_vec();
    trial.restructure(|trial| trial.times = times.to_vec());
    let slots = trial.layout().creep_weights();
    trial.x[slots].copy_from_slice(&shares);
    trial.settle_rigid(FEW_STEPS)?;
    Some(trial)
}
