//! A stage of weighted signals on its way to the records, and how far it is from them.

use core::ops::Range;
use std::sync::{Arc, OnceLock};

use super::form::Form;
use super::judged::{Judged, Reading};
use super::layout::{Layout, Own};
use crate::error::{Error, Result};
use crate::identify::least_squares::common::Common;
use crate::identify::least_squares::result::{LeastSquaresFit, RecordFit};
use crate::identify::least_squares::settings::Structure;
use crate::identify::least_squares::weights_record::{WeightsDelay, WeightsRecord};
use crate::identify::parameters::drift::DriftKind;
use crate::identify::records::history::History;
use crate::models::{Dynamics, FittedWeights, Relaxation, Signals, SignalsOf, Values};
use crate::signal::index;

/// Where a record begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::identify::least_squares) struct Beginning {
    pub history: History,
    /// Voltage that a history which is fitted comes from, V.
    pub from: f64,
}

/// Signals of a record after each change of its drive, one after the other.
pub(in crate::identify::least_squares) type Kept = OnceLock<Arc<[f64]>>;

/// A stage on its way to the best one of its structure.
#[derive(Clone)]
pub(in crate::identify::least_squares) struct Fit<'a> {
    pub common: &'a Common<'a>,
    /// Thresholds of plays, or levels, V.
    pub nodes: Vec<f64>,
    /// Number of dead zones, and what comes to them, m.
    pub zones: usize,
    pub bent: (f64, f64),
    /// Time constants of the creep, s.
    pub times: Vec<f64>,
    pub form: Form,
    /// Whether the numbers of the dynamics stay as they are.
    pub held: bool,
    /// Whether the thresholds of the dead zones stay as they are.
    pub rigid: bool,
    /// Where each record begins.
    pub begins: Vec<Beginning>,
    /// Time constant of the drift of each record, s; `None` where there is none.
    pub drifts: Vec<Option<f64>>,
    /// Numbers of the shape, and what shape and nodes make.
    pub shape: Vec<f64>,
    pub signals: Arc<dyn Signals>,
    /// Signals of each record, once they were needed.
    pub kept: Vec<Kept>,
    /// Whether the motion is that of the stage's simulation, exact between samples too.
    pub exact: bool,
    /// Window of each record that is judged, and which of its samples.
    pub windows: Vec<Range<usize>>,
    pub judged: Vec<Judged>,
    /// The unknowns: those of the stage, see [`Layout`], then those of each record, see [`Own`].
    pub x: Vec<f64>,
    pub rms: f64,
    /// Lags that explain the records as well, s, where one was looked for.
    pub lags: Option<(f64, f64)>,
}

impl<'a> Fit<'a> {
    pub fn new(common: &'a Common<'a>, nodes: &[f64]) -> Self {
        let shape: Vec<f64> = common.of.shapes().iter().map(|one| one.neutral).collect();
        let begin = |history: Option<History>| Beginning {
            history: history.unwrap_or(History::Virgin),
            from: 0.0,
        };
        let mut fit = Self {
            signals: signals(common, &shape, nodes),
            shape,
            common,
            nodes: nodes.to_vec(),
            zones: 0,
            bent: (0.0, 0.0),
            times: Vec::new(),
            form: Form::None,
            held: false,
            rigid: false,
            begins: common.records.iter().map(|one| begin(one.history)).collect(),
            drifts: common.records.iter().map(known_drift).collect(),
            kept: none_kept(common),
            exact: false,
            windows: windows(common),
            judged: common.records.iter().map(Judged::all).collect(),
            x: Vec::new(),
            rms: f64::INFINITY,
            lags: None,
        };
        fit.x = vec![0.0; fit.unknowns()];
        for r in 0..common.records.len() {
            fit.set_delay(r);
        }
        fit
    }

    /// The same on all samples of the records from which those of `self` were thinned.
    pub fn on<'b>(self, common: &'b Common<'b>) -> Fit<'b> {
        Fit {
            common,
            signals: signals(common, &self.shape, &self.nodes),
            kept: none_kept(common),
            nodes: self.nodes,
            times: self.times,
            shape: self.shape,
            windows: windows(common),
            judged: common.records.iter().map(Judged::all).collect(),
            x: self.x,
            zones: self.zones,
            bent: self.bent,
            form: self.form,
            held: self.held,
            rigid: self.rigid,
            begins: self.begins,
            drifts: self.drifts,
            exact: false,
            rms: f64::INFINITY,
            lags: self.lags,
        }
    }

    pub fn layout(&self) -> Layout {
        Layout {
            weights: self.signals.count(),
            bends: self.zones,
            corners: self.zones,
            creep_weights: self.times.len(),
            poles: self.form.numbers(),
        }
    }

    /// Where the unknowns of record `r` are.
    pub fn own(&self, r: usize) -> Own {
        let mut start = self.layout().count();
        for before in 0..r {
            start += self.own_from(0, before).end();
        }
        self.own_from(start, r)
    }

    fn own_from(&self, start: usize, r: usize) -> Own {
        let departing = self.begins[r].history == History::Fitted;
        let record = &self.common.records[r];
        let delayed = matches!(record.delay, WeightsDelay::Fitted(..));
        let departures = if departing { self.times.len() } else { 0 };
        Own::new(start, departures, [record.offset, self.drifts[r].is_some(), delayed])
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        match self.common.records.len() {
            0 => self.layout().count(),
            count => self.own(count - 1).end(),
        }
    }

    /// Changes the structure; what both structures have stays.
    pub fn restructure(&mut self, change: impl FnOnce(&mut Self)) {
        let before = self.clone();
        change(self);
        if self.nodes != before.nodes {
            self.signals = signals(self.common, &self.shape, &self.nodes);
            self.kept = none_kept(self.common);
        }
        for ((kept, now), was) in self.kept.iter_mut().zip(&self.begins).zip(&before.begins) {
            if now != was {
                *kept = Kept::new();
            }
        }
        let (was, now) = (before.layout(), self.layout());
        self.x = vec![0.0; self.unknowns()];
        let mut keep = |to: Range<usize>, from: Range<usize>, same: bool| {
            if same && to.len() == from.len() {
                self.x[to].copy_from_slice(&before.x[from]);
            }
        };
        let timed = before.times == self.times;
        keep(now.weights(), was.weights(), before.nodes == self.nodes);
        keep(now.bends(), was.bends(), true);
        keep(now.corners(), was.corners(), true);
        keep(now.creep_weights(), was.creep_weights(), timed);
        keep(now.poles(), was.poles(), before.form == self.form);
        for r in 0..self.common.records.len() {
            let (to, from) = (self.own(r).parts(), before.own(r).parts());
            for (i, (to, from)) in to.into_iter().zip(from).enumerate() {
                let same =
                    if i == 0 { timed } else { i != 2 || before.drifts[r] == self.drifts[r] };
                if same && to.len() == from.len() {
                    self.x[to].copy_from_slice(&before.x[from]);
                }
            }
        }
        self.rms = f64::INFINITY;
    }

    pub fn reshape(&mut self, i: usize, place: f64) {
        self.shape[i] = place;
        self.signals = signals(self.common, &self.shape, &self.nodes);
        self.kept = none_kept(self.common);
    }

    /// Sets the numbers of the dynamics, logarithms.
    pub fn set_poles(&mut self, form: Form, poles: &[f64]) {
        self.restructure(|fit| fit.form = form);
        let part = self.layout().poles();
        self.x[part].copy_from_slice(poles);
    }

    pub fn dynamics(&self) -> Dynamics {
        self.form.dynamics(&self.x[self.layout().poles()])
    }

    /// Whether no number of the dynamics lies on a bound.
    pub fn poles_within(&self) -> bool {
        let poles = &self.x[self.layout().poles()];
        let inside = |(at, (low, high)): (&f64, &(f64, f64))| at - low > 0.05 && high - at > 0.05;
        poles.iter().zip(&self.pole_ranges()).all(inside)
    }

    pub fn pole_ranges(&self) -> Vec<(f64, f64)> {
        self.form.ranges(self.common.longest().length(), self.common.shortest_interval())
    }

    /// Begins the delay of a record that is to be found with one sample.
    fn set_delay(&mut self, r: usize) {
        let record = &self.common.records[r];
        if let (Some(slot), WeightsDelay::Fitted(low, high)) =
            (self.own(r).delay.next(), record.delay)
        {
            self.x[slot] = record.drive.dt.max(low).min(high);
        }
    }

    /// Delay of the reading of a record, s.
    pub fn delay(&self, r: usize) -> f64 {
        match self.common.records[r].delay {
            WeightsDelay::Known(delay) => delay,
            WeightsDelay::Fitted(..) => self.x[self.own(r).delay].iter().sum(),
        }
    }

    /// Level that the sensor adds to the displacement at each sample of a record, m.
    pub fn added(&self, r: usize) -> impl Fn(usize) -> f64 + use<> {
        let (own, record) = (self.own(r), &self.common.records[r]);
        let offset: f64 = self.x[own.offset].iter().sum();
        let drift: f64 = self.x[own.drift].iter().sum();
        let (start, fades) = (record.start, self.fading(r));
        move |k| drift.mul_add(fades(k, start), offset)
    }

    /// Remainder of a drift of 1 at sample `k` of a record that counts from `start` on.
    pub fn fading(&self, r: usize) -> impl Fn(usize, usize) -> f64 + use<> {
        let rate = self.drifts[r].map_or(0.0, |time| self.common.records[r].drive.dt / time);
        move |k, start| {
            if rate == 0.0 { 1.0 } else { libm::exp(rate * (index(start) - index(k))) }
        }
    }

    /// Sum of the weighted signals, m.
    #[inline(always)]
    pub fn sum(&self, signals: &[f64]) -> f64 {
        let weighted: f64 =
            signals.iter().zip(&self.x).map(|(signal, weight)| weight * signal).sum();
        self.common.least_linear().mul_add(signals[0], weighted)
    }

    pub fn corners(&self) -> &[f64] {
        &self.x[self.layout().corners()]
    }

    /// Output of the dead zones.
    #[inline(always)]
    pub fn bent(&self, value: f64) -> f64 {
        let zones = self.corners().iter().zip(&self.x[self.layout().bends()]);
        value + zones.map(|(corner, bend)| bend * beyond(value, *corner)).sum::<f64>()
    }

    /// Creep and dynamics as they are now.
    pub fn relaxation(&self) -> Result<Relaxation> {
        let creep_weights: Vec<f64> =
            self.x[self.layout().creep_weights()].iter().map(|share| share.max(0.0)).collect();
        Relaxation::new(&creep_weights, &self.times, self.dynamics())
    }

    /// Inputs of the columns of weights and dead zones, then that of the stage.
    #[inline(always)]
    pub fn inputs(&self, signals: &[f64], inputs: &mut [f64]) {
        let value = self.sum(signals);
        let bends = &self.x[self.layout().bends()];
        let passed = |(corner, bend): (&f64, &f64)| if value > *corner { *bend } else { 0.0 };
        let corners = self.corners();
        let slope = 1.0 + corners.iter().zip(bends).map(passed).sum::<f64>();
        for (input, signal) in inputs.iter_mut().zip(signals) {
            *input = slope * signal;
        }
        let (bent, moved) = inputs[signals.len()..].split_at_mut(corners.len());
        for (input, corner) in bent.iter_mut().zip(corners) {
            *input = beyond(value, *corner);
        }
        for ((input, corner), bend) in moved.iter_mut().zip(corners).zip(bends) {
            let through = |on: bool| if on { *bend } else { 0.0 };
            *input = through(*corner < 0.0) - through(value > *corner);
        }
        if let Some(last) = inputs.last_mut() {
            *last = self.bent(value);
        }
    }

    /// Readings of a record that are judged.
    pub fn judged(&self, r: usize) -> impl Iterator<Item = &Reading> + Clone {
        self.judged[r].within(&self.windows[r])
    }

    /// Samples that are judged, each as often as it counts.
    pub fn counted(&self) -> f64 {
        let of = |r: usize| self.judged(r).map(|one| one.share).sum::<f64>();
        (0..self.windows.len()).map(|r| self.common.weights[r] * of(r)).sum()
    }

    /// RMS deviation in the windows, m.
    pub fn deviation(&self) -> f64 {
        self.common.count(1);
        let (mut sum, mut count) = (0.0, 0.0);
        for r in 0..self.common.records.len() {
            let Ok((squares, counted)) = self.squares(r) else { return f64::INFINITY };
            sum += self.common.weights[r] * squares;
            count += self.common.weights[r] * counted;
        }
        libm::sqrt(sum / count)
    }

    /// RMS deviation in the window of one record, m.
    pub fn deviation_of(&self, r: usize) -> f64 {
        self.squares(r).map_or(f64::INFINITY, |(sum, count)| libm::sqrt(sum / count))
    }

    /// Sum of the squares of the deviations of a record, and how many.
    fn squares(&self, r: usize) -> Result<(f64, f64)> {
        let (motion, added) = (self.motion(r)?, self.added(r));
        let (mut sum, mut count) = (0.0, 0.0);
        for &Reading { place, share, y, scatter } in self.judged(r) {
            let error = y - motion[place] - added(place);
            sum += share * error * error + scatter;
            count += share;
        }
        Ok((sum, count))
    }

    /// Residual of the displacement of a record, m.
    pub fn rest(&self, r: usize) -> Result<Vec<f64>> {
        let added = self.added(r);
        let judged = self.common.records.iter().map(Judged::all).collect();
        let all = Self { judged, ..self.clone() };
        let left = self.common.records[r].y.iter().zip(all.motion(r)?).enumerate();
        Ok(left.map(|(k, (y, x))| y - x - added(k)).collect())
    }

    /// Parameters of the stage; those of its mirror image where it is to fall.
    pub fn values(&self, falls: bool) -> Result<Values> {
        let layout = self.layout();
        let sign = if falls { -1.0 } else { 1.0 };
        let fitted = FittedWeights {
            linear: sign * (self.common.least_linear() + self.x[0]),
            nodes: self.nodes.clone(),
            weights: self.x[1..layout.weights]
                .iter()
                .map(|weight| sign * weight.max(0.0))
                .collect(),
            dead_zone_thresholds: self.corners().to_vec(),
            dead_zone_weights: self.x[layout.bends()].to_vec(),
            shape: self.shape.clone(),
            drive: self.common.drive,
            relaxation: self.relaxation()?,
        };
        Ok(self.common.of.values(&fitted))
    }

    /// Result of the fit.
    pub fn result(&self) -> Result<LeastSquaresFit> {
        let values = self.values(self.common.falls)?;
        self.common.model.build(&values)?;
        let mirrored = self.common.falls && !self.common.of.has_dead_zones();
        let of_motion = if mirrored { -1.0 } else { 1.0 };
        let record = |r: usize| {
            let own = self.own(r);
            let sum = |part: Range<usize>| self.x[part].iter().sum::<f64>();
            Ok(RecordFit {
                offset: of_motion * sum(own.offset),
                drift: self.drifts[r].map(|time| (of_motion * sum(own.drift), time)),
                delay: self.delay(r),
                rms: self.deviation_of(r),
                history: self.begins[r].history,
                start: self.start(r, self.common.falls)?,
            })
        };
        let records: Result<Vec<RecordFit>> = (0..self.common.records.len()).map(record).collect();
        Ok(LeastSquaresFit {
            values,
            rms: self.rms,
            evaluations: self.common.evaluations(),
            at_bound: self.layout().at_bound(&self.x, self.form, &self.pole_ranges()),
            records: records?,
            lag_range: self.lags,
        })
    }

    /// Structure of the fit, from which another one begins that is not kept.
    pub fn structure(&self) -> Structure {
        let histories = self.begins.iter().map(|one| one.history);
        Structure {
            records: histories.zip(self.drifts.iter().copied()).collect(),
            creep_times: self.times.clone(),
            dynamics: self.dynamics(),
            kept: false,
        }
    }

    /// That a simulation was stopped.
    pub(in crate::identify::least_squares) fn stopped() -> Error {
        Error::Numerical("the simulation was stopped".into())
    }
}

fn none_kept(common: &Common<'_>) -> Vec<Kept> {
    vec![Kept::new(); common.records.len()]
}

fn signals(common: &Common<'_>, shape: &[f64], nodes: &[f64]) -> Arc<dyn Signals> {
    Arc::from(common.of.signals(&SignalsOf { shape, nodes, drive: common.drive }))
}

/// Time constant of a drift of which the caller says so, s.
pub(in crate::identify::least_squares) fn known_drift(record: &WeightsRecord<'_>) -> Option<f64> {
    match record.drift {
        DriftKind::Time(time) => Some(time),
        DriftKind::None | DriftKind::Auto => None,
    }
}

fn windows(common: &Common<'_>) -> Vec<Range<usize>> {
    common.records.iter().map(|one| one.start..one.y.len()).collect()
}

/// Output of a dead zone, less its output at 0.
#[inline(always)]
fn beyond(value: f64, corner: f64) -> f64 {
    (value - corner).max(0.0) - (-corner).max(0.0)
}
