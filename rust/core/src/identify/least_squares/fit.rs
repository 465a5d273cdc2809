//! Gauss-Newton method with non-negative least squares in each step.

use super::follower::{Follower, crept};
use super::{DynamicsKind, LeastSquaresFit, Settings, WeightsRecord};
use crate::error::Result;
use crate::math::{Rows, least};
use crate::models::{Dynamics, FittedPlays, Relaxation, WeightedPlays};
use crate::signal::{Stop, index, range};

/// Least share of the mean slope that passes without memory: with less the inverse is no use.
const LEAST_LINEAR: f64 = 1e-3;

/// Rounds over the numbers of an envelope, at most.
const SHAPE_ROUNDS: usize = 20;

/// Least share by which a number of an envelope has to lower the deviation before it leaves the
/// middle of its range: what a record does not determine is not changed.
const LEAST_GAIN: f64 = 0.1;

/// Least slope of the dead zones while they are searched.
const LEAST_SLOPE: f64 = 0.05;

/// The unknowns but for the dynamics.
#[derive(Clone, Debug)]
struct Unknowns {
    /// w0 above its least value, then the weights, m/V.
    weights: Vec<f64>,
    dead_zone_weights: Vec<f64>,
    shares: Vec<f64>,
    offset: f64,
}

impl Unknowns {
    /// Interpolates from `self` to `goal` by a share.
    fn towards(&self, goal: &Self, part: f64) -> Self {
        let mix = |a: &[f64], b: &[f64]| -> Vec<f64> {
            a.iter().zip(b).map(|(a, b)| a + part * (b - a)).collect()
        };
        Self {
            weights: mix(&self.weights, &goal.weights),
            dead_zone_weights: mix(&self.dead_zone_weights, &goal.dead_zone_weights),
            shares: mix(&self.shares, &goal.shares),
            offset: self.offset + part * (goal.offset - self.offset),
        }
    }

    fn rises(&self) -> bool {
        let mut slope = 1.0;
        self.dead_zone_weights.iter().all(|bend| {
            slope += bend;
            slope >= LEAST_SLOPE
        })
    }
}

/// State of a fit.
pub(super) struct Fit<'a, M: WeightedPlays> {
    record: &'a WeightsRecord<'a>,
    settings: &'a Settings,
    stop: Stop<'a>,
    least_linear: f64,
    dead_zone_thresholds: Vec<f64>,
    unknowns: Unknowns,
    dynamics: Dynamics,
    /// Numbers of the envelope, and what they make.
    shape: Vec<f64>,
    envelope: M::Envelope,
    /// Range of the drive in the window, V.
    drive: (f64, f64),
    rms: f64,
    evaluations: usize,
    at_bound: bool,
}

impl<'a, M: WeightedPlays> Fit<'a, M> {
    pub fn new(record: &'a WeightsRecord<'a>, settings: &'a Settings, stop: Stop<'a>) -> Self {
        let (low, high) = range(&record.drive.u[record.start..]);
        let (least, most) = range(&record.y[record.start..]);
        let unknowns = Unknowns {
            weights: vec![0.0; 1 + settings.thresholds.len()],
            dead_zone_weights: Vec::new(),
            shares: vec![0.0; settings.times.len()],
            offset: 0.0,
        };
        let middle = |(from, to): &(f64, f64)| libm::sqrt(from * to);
        let shape: Vec<f64> = M::shapes().iter().map(middle).collect();
        Self {
            envelope: M::envelope(&shape, (low, high)),
            shape,
            drive: (low, high),
            record,
            settings,
            stop,
            least_linear: LEAST_LINEAR * (most - least) / (high - low),
            dead_zone_thresholds: Vec::new(),
            unknowns,
            dynamics: Dynamics::None,
            rms: f64::INFINITY,
            evaluations: 0,
            at_bound: false,
        }
    }

    /// False where it was stopped.
    pub fn run(&mut self) -> bool {
        self.search().is_some()
    }

    fn search(&mut self) -> Option<()> {
        self.settle(1e-3)?;
        self.search_shape()?;
        self.place_corners();
        let dt = self.record.drive.dt;
        let length = dt * index(self.record.y.len() - self.record.start);
        let times = (0.02 * dt, 0.1 * length);
        match self.settings.dynamics {
            DynamicsKind::None => {}
            DynamicsKind::First => {
                let first = |time| Dynamics::First { time };
                let time = self.along(times, 1e-5, |fit, time| fit.dynamics = first(time))?;
                self.dynamics = first(time);
            }
            DynamicsKind::Second => self.search_mode(times, (0.02 / dt, 0.5 / dt))?,
        }
        self.rms = f64::INFINITY;
        self.settle(1e-10)
    }

    /// Frequency and lag of the mode in turn: the lag is what a slow record shows.
    ///
    /// Lower frequencies than a fiftieth of the sampling rate are left out: there a mode would
    /// stand in for what the plays do not describe.
    fn search_mode(&mut self, lags: (f64, f64), frequencies: (f64, f64)) -> Option<()> {
        let mode = |frequency: f64, lag: f64| Dynamics::Second {
            frequency,
            damping_ratio: core::f64::consts::PI * frequency * lag,
        };
        let mut frequency = 0.5 * frequencies.1;
        let mut before = f64::INFINITY;
        for _ in 0..6 {
            let lag = self.along(lags, 1e-4, |fit, lag| fit.dynamics = mode(frequency, lag))?;
            let edge = self.at_bound;
            frequency = self
                .along(frequencies, 1e-4, |fit, frequency| fit.dynamics = mode(frequency, lag))?;
            self.at_bound |= edge;
            self.dynamics = mode(frequency, lag);
            if self.rms > 0.999 * before {
                break;
            }
            before = self.rms;
        }
        Some(())
    }

    /// The numbers of the envelope in turn, each from its range.
    fn search_shape(&mut self) -> Option<()> {
        let ranges = M::shapes();
        let mut released = vec![false; ranges.len()];
        for _ in 0..SHAPE_ROUNDS {
            let round = self.rms;
            for (i, &range) in ranges.iter().enumerate() {
                let (before, unknowns, here) = (self.rms, self.unknowns.clone(), self.shape[i]);
                let place = self.along(range, 1e-4, |fit, place| fit.reshape(i, place))?;
                let least = if released[i] { 0.0 } else { LEAST_GAIN };
                if self.rms < (1.0 - least) * before {
                    released[i] = true;
                    self.reshape(i, place);
                } else {
                    (self.rms, self.unknowns) = (before, unknowns);
                    self.reshape(i, here);
                }
            }
            if self.rms > 0.99 * round {
                break;
            }
        }
        self.at_bound = false;
        Some(())
    }

    fn reshape(&mut self, i: usize, place: f64) {
        self.shape[i] = place;
        self.envelope = M::envelope(&self.shape, self.drive);
    }

    /// The best place along a line, which `set` takes the fit to.
    fn along(
        &mut self,
        bounds: (f64, f64),
        accuracy: f64,
        set: impl Fn(&mut Self, f64),
    ) -> Option<f64> {
        let mut best = (f64::INFINITY, self.unknowns.clone());
        let place = least(bounds, accuracy, |place| {
            set(self, place);
            self.rms = f64::INFINITY;
            self.settle(1e-5)?;
            if self.rms < best.0 {
                best = (self.rms, self.unknowns.clone());
            }
            Some(self.rms)
        })?;
        (self.rms, self.unknowns) = best;
        self.at_bound = place < 1.01 * bounds.0 || place > bounds.1 / 1.01;
        Some(place)
    }

    /// Spreads the dead zones over what comes out of the plays in the window.
    fn place_corners(&mut self) {
        let mut plays = self.plays();
        let count = self.settings.zones;
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (k, &volts) in self.record.drive.u.iter().enumerate() {
            let value = self.follow(&mut plays, volts);
            if k >= self.record.start {
                (low, high) = (low.min(value), high.max(value));
            }
        }
        self.dead_zone_thresholds =
            (1..=count).map(|j| low + (high - low) * index(j) / index(count + 1)).collect();
        self.unknowns.dead_zone_weights = vec![0.0; count];
    }

    /// The drive, then what the plays would stand at: all at rest.
    fn plays(&self) -> Vec<f64> {
        vec![0.0; 1 + self.settings.thresholds.len()]
    }

    /// Moves the plays to `volts` and returns p, m.
    fn follow(&self, plays: &mut [f64], volts: f64) -> f64 {
        let (up, down) = M::edges(&self.envelope, volts);
        plays[0] = up.max(down.min(plays[0]));
        let mut value = (self.least_linear + self.unknowns.weights[0]) * plays[0];
        for (i, threshold) in self.settings.thresholds.iter().enumerate() {
            let play = &mut plays[i + 1];
            *play = (up - threshold).max((down + threshold).min(*play));
            value += self.unknowns.weights[i + 1] * *play;
        }
        value
    }

    /// What the dead zones make of p.
    fn bent(&self, value: f64) -> f64 {
        let zones = self.dead_zone_thresholds.iter().zip(&self.unknowns.dead_zone_weights);
        value + zones.map(|(corner, bend)| bend * beyond(value, *corner)).sum::<f64>()
    }

    /// Creep and dynamics as they are now.
    fn relaxation(&self) -> Option<Relaxation> {
        Relaxation::new(&self.unknowns.shares, &self.settings.times, self.dynamics).ok()
    }

    /// Gauss and Newton's method in all but the dynamics, until a step gains less than `gain`.
    fn settle(&mut self, gain: f64) -> Option<()> {
        self.rms = self.deviation();
        for _ in 0..50 {
            if (self.stop)() {
                return None;
            }
            let (before, start) = (self.rms, self.unknowns.clone());
            let goal = self.linear_step()?;
            let mut part = 1.0;
            loop {
                self.unknowns = start.towards(&goal, part);
                self.rms = if self.unknowns.rises() { self.deviation() } else { f64::INFINITY };
                if self.rms < before || part < 1e-3 {
                    break;
                }
                part *= 0.5;
            }
            if self.rms >= before || self.rms.is_nan() {
                (self.rms, self.unknowns) = (before, start);
                break;
            }
            if before - self.rms <= gain * before {
                break;
            }
        }
        Some(())
    }

    /// RMS deviation in the window, m.
    fn deviation(&mut self) -> f64 {
        self.evaluations += 1;
        let Some(relaxation) = self.relaxation() else { return f64::INFINITY };
        let WeightsRecord { drive, y, start } = *self.record;
        let flow = relaxation.flow(drive.dt);
        let (mut plays, mut follower) = (self.plays(), Follower::new());
        let mut sum = 0.0;
        for (k, &volts) in drive.u.iter().enumerate() {
            let output = self.bent(self.follow(&mut plays, volts));
            let x = follower.next(&relaxation, &flow, drive.hold, output);
            if k >= start {
                let error = y[k] - x - self.unknowns.offset;
                sum += error * error;
            }
        }
        libm::sqrt(sum / index(y.len() - start))
    }

    /// The least squares solution of the problem linearised about the present unknowns.
    fn linear_step(&mut self) -> Option<Unknowns> {
        self.evaluations += 1;
        let relaxation = self.relaxation()?;
        let WeightsRecord { drive, y, start } = *self.record;
        let flow = relaxation.flow(drive.dt);
        // The creep's own part of the displacement, for the derivatives by its shares.
        let parts: Vec<Relaxation> = (0..self.settings.times.len())
            .map(|_| Relaxation::new(&[], &[], self.dynamics))
            .collect::<Result<_>>()
            .ok()?;
        let (n, zones, times) =
            (self.unknowns.weights.len(), self.dead_zone_thresholds.len(), parts.len());
        let unknowns = n + zones + times + usize::from(self.settings.offset);
        let mut free = vec![false; unknowns];
        free[n..n + zones].fill(true);
        free[n + zones + times..].fill(true);
        let mut columns: Vec<Follower> = (0..n + zones + times).map(|_| Follower::new()).collect();
        let (mut plays, mut whole) = (self.plays(), Follower::new());
        let mut rows = Rows::new(unknowns);
        let mut row = vec![1.0; unknowns];
        let now = self.flat();
        for (k, &volts) in drive.u.iter().enumerate() {
            let value = self.follow(&mut plays, volts);
            let zone = self.dead_zone_thresholds.iter().zip(&self.unknowns.dead_zone_weights);
            let slope: f64 =
                zone.map(|(d, s)| if value > *d { *s } else { 0.0 }).sum::<f64>() + 1.0;
            let x = whole.next(&relaxation, &flow, drive.hold, self.bent(value));
            for j in 0..n {
                row[j] = columns[j].next(&relaxation, &flow, drive.hold, slope * plays[j]);
            }
            for (j, corner) in self.dead_zone_thresholds.iter().enumerate() {
                let input = beyond(value, *corner);
                row[n + j] = columns[n + j].next(&relaxation, &flow, drive.hold, input);
            }
            for (j, part) in parts.iter().enumerate() {
                row[n + zones + j] =
                    crept(&mut columns[n + zones + j], part, &flow, whole.state.creep[j]);
            }
            if k >= start {
                let linear: f64 = row.iter().zip(&now).map(|(a, b)| a * b).sum();
                rows.push(&row, y[k] - x - self.unknowns.offset + linear);
            }
        }
        let found = rows.solve(&free);
        let (weights, rest) = found.split_at(n);
        let (dead_zone_weights, rest) = rest.split_at(zones);
        let (shares, rest) = rest.split_at(times);
        Some(Unknowns {
            weights: weights.to_vec(),
            dead_zone_weights: dead_zone_weights.to_vec(),
            shares: shares.to_vec(),
            offset: rest.first().copied().unwrap_or(0.0),
        })
    }

    /// The unknowns in the order of the columns.
    fn flat(&self) -> Vec<f64> {
        let Unknowns { weights, dead_zone_weights, shares, offset } = &self.unknowns;
        let mut all = [&weights[..], dead_zone_weights, shares].concat();
        if self.settings.offset {
            all.push(*offset);
        }
        all
    }

    pub fn result(&self) -> Result<LeastSquaresFit> {
        let Settings { thresholds, times, .. } = self.settings;
        let Unknowns { weights, dead_zone_weights, shares, offset } = &self.unknowns;
        let fitted = FittedPlays {
            linear: self.least_linear + weights[0],
            thresholds: thresholds.clone(),
            weights: weights[1..].to_vec(),
            dead_zone_thresholds: self.dead_zone_thresholds.clone(),
            dead_zone_weights: dead_zone_weights.clone(),
            shape: self.shape.clone(),
            drive: self.drive,
            relaxation: Relaxation::new(shares, times, self.dynamics)?,
        };
        let values = M::values(&fitted);
        M::build(&values)?;
        Ok(LeastSquaresFit {
            values,
            offset: *offset,
            rms: self.rms,
            evaluations: self.evaluations,
            at_bound: self.at_bound,
        })
    }
}

/// What a dead zone passes, less what it passes of 0.
fn beyond(value: f64, corner: f64) -> f64 {
    (value - corner).max(0.0) - (-corner).max(0.0)
}
