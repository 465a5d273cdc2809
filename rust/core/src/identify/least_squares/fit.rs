//! A stage of plays on its way to the record, and how far it is from it.

use core::cell::Cell;
use core::ops::Range;

use super::follower::Follower;
use super::form::Form;
use super::layout::Layout;
use super::{LeastSquaresFit, WeightsRecord};
use crate::error::{Error, Result};
use crate::identify::history::{History, visited};
use crate::models::{
    Dynamics, Experiment, FittedPlays, Relaxation, Values, WeightedPlays, state_at_rest,
};
use crate::signal::{Stop, index, range};

/// Least share of the mean slope that passes without memory: with less the inverse is no use.
const LEAST_LINEAR: f64 = 1e-3;

/// What all fits of a record share.
pub(super) struct Common<'a> {
    pub record: &'a WeightsRecord<'a>,
    pub offset: bool,
    /// Whether the record is the mirror image of one that falls.
    pub falls: bool,
    pub stop: Stop<'a>,
    /// Range of the drive in the window, V.
    pub drive: (f64, f64),
    /// Range of the displacement in the window, m.
    pub stroke: f64,
    pub evaluations: Cell<usize>,
}

impl<'a> Common<'a> {
    pub fn new(record: &'a WeightsRecord<'a>, offset: bool, falls: bool, stop: Stop<'a>) -> Self {
        let (least, most) = range(&record.y[record.start..]);
        let drive = range(&record.drive.u[record.start..]);
        Self { record, offset, falls, stop, drive, stroke: most - least, evaluations: Cell::new(0) }
    }

    fn least_linear(&self) -> f64 {
        LEAST_LINEAR * self.stroke / (self.drive.1 - self.drive.0)
    }
}

/// A stage on its way to the best one of its structure.
pub(super) struct Fit<'a, M: WeightedPlays> {
    pub common: &'a Common<'a>,
    pub thresholds: Vec<f64>,
    /// Number of dead zones, and what comes to them, m.
    pub zones: usize,
    pub bent: (f64, f64),
    /// Time constants of the creep, s.
    pub times: Vec<f64>,
    pub form: Form,
    /// Whether the numbers of the dynamics stay as they are.
    pub held: bool,
    pub history: History,
    /// Voltage that a history which is fitted comes from, V.
    pub from: f64,
    /// Numbers of the envelope, and what they make.
    pub shape: Vec<f64>,
    envelope: M::Envelope,
    /// Whether the motion is that of the stage's simulation, exact between samples too.
    pub exact: bool,
    /// Window to be judged, and every how many samples.
    pub window: Range<usize>,
    pub every: usize,
    /// The unknowns, see [`Layout`].
    pub x: Vec<f64>,
    pub rms: f64,
}

impl<M: WeightedPlays> Clone for Fit<'_, M> {
    fn clone(&self) -> Self {
        Self {
            thresholds: self.thresholds.clone(),
            times: self.times.clone(),
            shape: self.shape.clone(),
            envelope: self.envelope.clone(),
            window: self.window.clone(),
            x: self.x.clone(),
            ..*self
        }
    }
}

impl<'a, M: WeightedPlays> Fit<'a, M> {
    pub fn new(common: &'a Common<'a>, thresholds: &[f64], history: History) -> Self {
        let middle = |(from, to): &(f64, f64)| libm::sqrt(from * to);
        let shape: Vec<f64> = M::shapes().iter().map(middle).collect();
        let mut fit = Self {
            envelope: M::envelope(&shape, common.drive),
            shape,
            common,
            thresholds: thresholds.to_vec(),
            zones: 0,
            bent: (0.0, 0.0),
            times: Vec::new(),
            form: Form::None,
            held: false,
            history,
            from: 0.0,
            exact: false,
            window: common.record.start..common.record.y.len(),
            every: 1,
            x: Vec::new(),
            rms: f64::INFINITY,
        };
        fit.x = vec![0.0; fit.layout().count()];
        fit
    }

    /// The same on all samples of another record.
    pub fn on<'b>(self, common: &'b Common<'b>) -> Fit<'b, M> {
        Fit {
            common,
            envelope: M::envelope(&self.shape, common.drive),
            thresholds: self.thresholds,
            times: self.times,
            shape: self.shape,
            window: common.record.start..common.record.y.len(),
            every: 1,
            x: self.x,
            zones: self.zones,
            bent: self.bent,
            form: self.form,
            held: self.held,
            history: self.history,
            from: self.from,
            exact: false,
            rms: f64::INFINITY,
        }
    }

    pub fn layout(&self) -> Layout {
        let departing = self.history == History::Fitted;
        Layout {
            weights: 1 + self.thresholds.len(),
            bends: self.zones,
            corners: self.zones,
            shares: self.times.len(),
            departures: if departing { self.times.len() } else { 0 },
            offset: usize::from(self.common.offset),
            poles: self.form.numbers(),
        }
    }

    /// Changes the structure; what both structures have stays.
    pub fn restructure(&mut self, change: impl FnOnce(&mut Self)) {
        let (before, kept) = (self.layout(), self.x.clone());
        let (times, plays) = (self.times.clone(), self.thresholds.clone());
        let form = self.form;
        change(self);
        let now = self.layout();
        self.x = vec![0.0; now.count()];
        let mut keep = |to: Range<usize>, from: Range<usize>, same: bool| {
            if same && to.len() == from.len() {
                self.x[to].copy_from_slice(&kept[from]);
            }
        };
        keep(now.weights(), before.weights(), plays == self.thresholds);
        keep(now.bends(), before.bends(), true);
        keep(now.corners(), before.corners(), true);
        keep(now.shares(), before.shares(), times == self.times);
        keep(now.departures(), before.departures(), times == self.times);
        keep(now.offset(), before.offset(), true);
        keep(now.poles(), before.poles(), form == self.form);
        self.rms = f64::INFINITY;
    }

    pub fn reshape(&mut self, i: usize, place: f64) {
        self.shape[i] = place;
        self.envelope = M::envelope(&self.shape, self.common.drive);
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
        self.form.ranges(&self.common.record.drive, self.common.record.start)
    }

    /// Plays that were taken through the voltages before the record.
    pub fn plays_before(&self) -> Vec<f64> {
        let mut plays = vec![0.0; 1 + self.thresholds.len()];
        for volts in visited(&self.common.record.drive, self.history, self.from) {
            self.push(&mut plays, volts);
        }
        plays
    }

    /// Moves the plays to `volts`: that of the drive, then those with thresholds.
    #[inline(always)]
    pub fn push(&self, plays: &mut [f64], volts: f64) {
        let (up, down) = M::edges(&self.envelope, volts);
        plays[0] = up.max(down.min(plays[0]));
        for (play, threshold) in plays[1..].iter_mut().zip(&self.thresholds) {
            *play = (up - threshold).max((down + threshold).min(*play));
        }
    }

    /// What comes out of the plays, m.
    #[inline(always)]
    pub fn sum(&self, plays: &[f64]) -> f64 {
        let weighted: f64 = plays.iter().zip(&self.x).map(|(play, weight)| weight * play).sum();
        self.common.least_linear().mul_add(plays[0], weighted)
    }

    fn corners(&self) -> &[f64] {
        &self.x[self.layout().corners()]
    }

    /// What the dead zones make of it.
    #[inline(always)]
    pub fn bent(&self, value: f64) -> f64 {
        let zones = self.corners().iter().zip(&self.x[self.layout().bends()]);
        value + zones.map(|(corner, bend)| bend * beyond(value, *corner)).sum::<f64>()
    }

    /// Creep and dynamics as they are now.
    pub fn relaxation(&self) -> Result<Relaxation> {
        let shares: Vec<f64> =
            self.x[self.layout().shares()].iter().map(|share| share.max(0.0)).collect();
        Relaxation::new(&shares, &self.times, self.dynamics())
    }

    /// Inputs of the columns of weights and dead zones, then that of the stage.
    #[inline(always)]
    pub fn inputs(&self, plays: &[f64], signals: &mut [f64]) {
        let value = self.sum(plays);
        let bends = &self.x[self.layout().bends()];
        let passed = |(corner, bend): (&f64, &f64)| if value > *corner { *bend } else { 0.0 };
        let corners = self.corners();
        let slope = 1.0 + corners.iter().zip(bends).map(passed).sum::<f64>();
        for (signal, play) in signals.iter_mut().zip(plays) {
            *signal = slope * play;
        }
        let (bent, moved) = signals[plays.len()..].split_at_mut(corners.len());
        for (signal, corner) in bent.iter_mut().zip(corners) {
            *signal = beyond(value, *corner);
        }
        for ((signal, corner), bend) in moved.iter_mut().zip(corners).zip(bends) {
            let through = |on: bool| if on { *bend } else { 0.0 };
            *signal = through(*corner < 0.0) - through(value > *corner);
        }
        if let Some(last) = signals.last_mut() {
            *last = self.bent(value);
        }
    }

    /// Where the creep stands before the record behind each of the inputs.
    pub fn creep_before(&self, width: usize) -> Vec<Vec<f64>> {
        let drive = self.common.record.drive;
        let mut plays = self.plays_before();
        let mut signals = vec![0.0; width];
        let whole_only = width == 1;
        let take = |fit: &Self, plays: &mut Vec<f64>, volts: f64, signals: &mut Vec<f64>| {
            fit.push(plays, volts);
            if whole_only {
                signals[0] = fit.bent(fit.sum(plays));
            } else {
                fit.inputs(plays, signals);
            }
        };
        take(self, &mut plays, drive.u[0], &mut signals);
        let relaxed = |signal: &f64| vec![*signal; self.times.len()];
        if self.history != History::Settled || self.times.is_empty() {
            let mut reached: Vec<Vec<f64>> = signals.iter().map(relaxed).collect();
            let departures = &self.x[self.layout().departures()];
            if let Some(whole) = reached.last_mut() {
                whole.iter_mut().zip(departures).for_each(|(q, departure)| *q += departure);
            }
            return reached;
        }
        // From 0 through the record; q repeats that begins at its end / (1 - exp(-T / tau)).
        let Ok(creep) = Relaxation::new(&vec![0.0; self.times.len()], &self.times, Dynamics::None)
        else {
            return signals.iter().map(relaxed).collect();
        };
        let flow = creep.flow(drive.dt);
        let mut followers: Vec<Follower> =
            signals.iter().map(|signal| Follower::at_rest(&creep, *signal, &[])).collect();
        for &volts in &drive.u[1..] {
            take(self, &mut plays, volts, &mut signals);
            for (follower, signal) in followers.iter_mut().zip(&signals) {
                follower.next(&creep, &flow, drive.hold, *signal);
            }
        }
        let length = drive.dt * index(drive.u.len() - 1);
        let repeats = |time: &f64| -libm::expm1(-length / time);
        let factors: Vec<f64> = self.times.iter().map(repeats).collect();
        let of = |follower: &Follower| {
            follower.state.creep.iter().zip(&factors).map(|(end, factor)| end / factor).collect()
        };
        followers.iter().map(of).collect()
    }

    pub fn counts(&self, k: usize) -> bool {
        self.window.contains(&k) && (k - self.window.start).is_multiple_of(self.every)
    }

    /// RMS deviation in the window, m.
    pub fn deviation(&self) -> f64 {
        self.common.evaluations.set(self.common.evaluations.get() + 1);
        let Ok(motion) = self.motion() else { return f64::INFINITY };
        let offset: f64 = self.x[self.layout().offset()].iter().sum();
        let (mut sum, mut count) = (0.0, 0);
        for (k, (y, x)) in self.common.record.y.iter().zip(&motion).enumerate() {
            if self.counts(k) {
                let error = y - x - offset;
                sum += error * error;
                count += 1;
            }
        }
        libm::sqrt(sum / index(count))
    }

    /// What is left of the displacement, m.
    pub fn rest(&self) -> Result<Vec<f64>> {
        let offset: f64 = self.x[self.layout().offset()].iter().sum();
        let left = self.common.record.y.iter().zip(self.motion()?);
        Ok(left.map(|(y, x)| y - x - offset).collect())
    }

    /// Displacement up to the end of the window, m.
    pub fn motion(&self) -> Result<Vec<f64>> {
        let relaxation = self.relaxation()?;
        let drive = self.common.record.drive;
        if self.exact {
            let (values, start) = self.stage(false)?;
            let experiment =
                Experiment { initial: Some(&start), ..Experiment::of(&drive, self.common.stop) };
            let stopped = || Error::Numerical("the simulation was stopped".into());
            return Ok(M::build(&values)?.simulate(&experiment)?.ok_or_else(stopped)?.x);
        }
        let flow = relaxation.flow(drive.dt);
        let mut plays = self.plays_before();
        let creep = self.creep_before(1);
        let mut follower: Option<Follower> = None;
        let through = |volts: &f64| {
            self.push(&mut plays, *volts);
            let output = self.bent(self.sum(&plays));
            match &mut follower {
                Some(follower) => follower.next(&relaxation, &flow, drive.hold, output),
                none => none.insert(Follower::at_rest(&relaxation, output, &creep[0])).state.x,
            }
        };
        Ok(drive.u.iter().take(self.window.end).map(through).collect())
    }

    /// Parameters of the stage, and its state before the first sample; those of its mirror image
    /// where it is to fall.
    fn stage(&self, falls: bool) -> Result<(Values, Values)> {
        let layout = self.layout();
        let sign = if falls { -1.0 } else { 1.0 };
        // Either the drive was turned or the displacement.
        let (of_drive, of_motion) = if M::DEAD_ZONES { (sign, 1.0) } else { (1.0, sign) };
        let relaxation = self.relaxation()?;
        let fitted = FittedPlays {
            linear: sign * (self.common.least_linear() + self.x[0]),
            thresholds: self.thresholds.clone(),
            weights: self.x[1..layout.weights]
                .iter()
                .map(|weight| sign * weight.max(0.0))
                .collect(),
            dead_zone_thresholds: self.corners().to_vec(),
            dead_zone_weights: self.x[layout.bends()].to_vec(),
            shape: self.shape.clone(),
            drive: self.common.drive,
            relaxation,
        };
        let first = self.common.record.drive.u[0];
        let mut plays = self.plays_before();
        self.push(&mut plays, first);
        let creep = &self.creep_before(1)[0];
        let rest = Follower::at_rest(&relaxation, self.bent(self.sum(&plays)), creep).state.x;
        let modes = self.dynamics().further().len();
        for play in &mut plays {
            *play *= of_drive;
        }
        let creep: Vec<f64> = creep.iter().map(|q| of_motion * q).collect();
        let (x, volts) = (of_motion * rest, of_drive * first);
        let start = state_at_rest::<M>(x, volts, &plays, &creep, modes);
        Ok((M::values(&fitted), start))
    }

    /// What was found.
    pub fn result(&self) -> Result<LeastSquaresFit> {
        let layout = self.layout();
        let (values, start) = self.stage(self.common.falls)?;
        let of_motion = if self.common.falls && !M::DEAD_ZONES { -1.0 } else { 1.0 };
        M::build(&values)?;
        Ok(LeastSquaresFit {
            values,
            offset: of_motion * self.x[layout.offset()].iter().sum::<f64>(),
            rms: self.rms,
            evaluations: self.common.evaluations.get(),
            at_bound: layout.at_bound(&self.x, self.form, &self.pole_ranges()),
            history: self.history,
            start,
            lag_range: None,
        })
    }
}

/// What a dead zone passes, less what it passes of 0.
#[inline(always)]
fn beyond(value: f64, corner: f64) -> f64 {
    (value - corner).max(0.0) - (-corner).max(0.0)
}
