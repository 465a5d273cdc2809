//! Identification of a Prandtl-Ishlinskii stage: weights by non-negative least squares.
//!
//! Weights, dead zones, shares of the creep and the offset are found by Gauss and Newton's
//! method, whose linear step is a non-negative least squares problem and, without dead zones and
//! creep, all there is to it (Kuhnen 2003, doi 10.3166/ejc.9.407-418, has the linear problem;
//! he identifies the dead zones of the inverse, which here would amplify the sensor's noise).
//! The time constant, or frequency and lag of a mode, is searched along one line at a time.

use crate::error::{Error, Result};
use crate::math::{Rows, least};
use crate::models::{
    Dynamics, PrandtlIshlinskiiStage, Relaxation, RelaxationFlow, RelaxationState, plays,
};
use crate::signal::{Drive, Hold, Stop, index, range, turns};

/// What is to be found.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaysSettings {
    /// Thresholds of the plays, V, ascending.
    pub thresholds: Vec<f64>,
    /// Number of dead zones.
    pub zones: usize,
    /// Time constants of the creep, s.
    pub times: Vec<f64>,
    /// Which dynamics.
    pub dynamics: DynamicsKind,
    /// Whether the sensor shows something where the stage is at rest.
    pub offset: bool,
}

/// Linear dynamics that can be searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DynamicsKind {
    /// None.
    None,
    /// A first-order lag.
    First,
    /// A mode.
    Second,
}

/// A record: the displacement under a drive, judged from sample `start` on.
#[derive(Clone, Copy, Debug)]
pub struct PlaysRecord<'a> {
    /// Drive, V.
    pub drive: Drive<'a>,
    /// Displacement, m.
    pub y: &'a [f64],
    /// First sample that counts; those before are warm-up.
    pub start: usize,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaysFit {
    /// The stage.
    pub stage: PrandtlIshlinskiiStage,
    /// Displacement that the sensor shows at rest, m.
    pub offset: f64,
    /// Root mean square of the deviations, m.
    pub rms: f64,
    /// Simulations of the record.
    pub evaluations: usize,
    /// Whether a time constant or a frequency lies on the edge of what was searched.
    pub at_bound: bool,
}

/// Least share of the mean slope that passes without memory: with less the inverse is no use.
const LEAST_LINEAR: f64 = 1e-3;

/// Least slope of the dead zones while they are searched.
const LEAST_SLOPE: f64 = 0.05;

/// Finds the stage; `None` where `stop` said so meanwhile.
///
/// # Errors
/// [`Error`] where the settings or the record cannot be used.
pub fn identify_plays(
    record: &PlaysRecord<'_>,
    settings: &PlaysSettings,
    stop: Stop<'_>,
) -> Result<Option<PlaysFit>> {
    // What the settings are refused for, before anything else.
    let zeros = |count: usize| vec![0.0; count];
    plays(
        1.0,
        &settings.thresholds,
        &zeros(settings.thresholds.len()),
        &zeros(settings.zones),
        &zeros(settings.zones),
    )?;
    Relaxation::new(&zeros(settings.times.len()), &settings.times, Dynamics::None)?;
    check(record, settings)?;
    let mut fit = Fit::new(record, settings, stop);
    fit.run().then(|| fit.result()).transpose()
}

/// Refuses records that tell nothing of a hysteresis.
fn check(record: &PlaysRecord<'_>, settings: &PlaysSettings) -> Result<()> {
    let PlaysRecord { drive, y, start } = *record;
    if y.len() != drive.u.len() {
        return Err(Error::Shape {
            name: "y".into(),
            found: format!("{} samples", y.len()),
            expected: format!("{}, as many as u", drive.u.len()),
        });
    }
    let unknowns = 2 + settings.thresholds.len() + settings.zones + settings.times.len();
    let count = y.len().saturating_sub(start);
    if count < 2 * unknowns {
        return Err(Error::Data(format!(
            "the window has {count} samples: expected at least {}, twice the number of unknowns",
            2 * unknowns
        )));
    }
    let (u, y) = (&drive.u[start..], &y[start..]);
    let (low, high) = range(u);
    if high <= low {
        return Err(Error::Data(format!("the drive stays at {low} V: nothing can be identified")));
    }
    let (least, most) = range(y);
    if most <= least {
        return Err(Error::Data(format!(
            "the displacement stays at {least:e} m: is the sensor alive?"
        )));
    }
    if turns(drive.u, 0.01 * (high - low)).is_empty() {
        return Err(Error::Data(
            "the drive never reverses: hysteresis shows where it does, so record a full cycle"
                .into(),
        ));
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / index(values.len());
    let (middle, centre) = (mean(u), mean(y));
    let together: f64 = u.iter().zip(y).map(|(u, y)| (u - middle) * (y - centre)).sum();
    if together <= 0.0 {
        return Err(Error::Data(
            "the displacement falls as the drive rises: turn the sign of one of them".into(),
        ));
    }
    Ok(())
}

/// Creep and dynamics behind one signal of a record.
struct Follower {
    state: RelaxationState,
    before: Option<f64>,
}

impl Follower {
    fn new() -> Self {
        Self { state: RelaxationState::default(), before: None }
    }

    /// What comes out at the sample where `input` comes in, as the stage's simulation does.
    fn next(&mut self, part: &Relaxation, flow: &RelaxationFlow, hold: Hold, input: f64) -> f64 {
        match (hold, self.before) {
            (Hold::First, None) => part.jump(&mut self.state, input),
            (Hold::First, Some(_)) => part.step(flow, &mut self.state, input),
            (Hold::Zero, None) => {}
            (Hold::Zero, Some(held)) => {
                part.jump(&mut self.state, held);
                part.step(flow, &mut self.state, held);
            }
        }
        self.before = Some(input);
        self.state.x
    }
}

/// The unknowns but for the dynamics.
#[derive(Clone, Debug)]
struct Theta {
    /// w0 above its least value, then the weights, m/V.
    weights: Vec<f64>,
    bends: Vec<f64>,
    shares: Vec<f64>,
    offset: f64,
}

impl Theta {
    /// The way from `self` to `goal`, gone by a part.
    fn towards(&self, goal: &Self, part: f64) -> Self {
        let mix = |a: &[f64], b: &[f64]| -> Vec<f64> {
            a.iter().zip(b).map(|(a, b)| a + part * (b - a)).collect()
        };
        Self {
            weights: mix(&self.weights, &goal.weights),
            bends: mix(&self.bends, &goal.bends),
            shares: mix(&self.shares, &goal.shares),
            offset: self.offset + part * (goal.offset - self.offset),
        }
    }

    fn rises(&self) -> bool {
        let mut slope = 1.0;
        self.bends.iter().all(|bend| {
            slope += bend;
            slope >= LEAST_SLOPE
        })
    }
}

/// A fit under way.
struct Fit<'a> {
    record: &'a PlaysRecord<'a>,
    settings: &'a PlaysSettings,
    stop: Stop<'a>,
    least_linear: f64,
    corners: Vec<f64>,
    theta: Theta,
    dynamics: Dynamics,
    rms: f64,
    evaluations: usize,
    at_bound: bool,
}

impl<'a> Fit<'a> {
    fn new(record: &'a PlaysRecord<'a>, settings: &'a PlaysSettings, stop: Stop<'a>) -> Self {
        let (low, high) = range(&record.drive.u[record.start..]);
        let (least, most) = range(&record.y[record.start..]);
        let theta = Theta {
            weights: vec![0.0; 1 + settings.thresholds.len()],
            bends: Vec::new(),
            shares: vec![0.0; settings.times.len()],
            offset: 0.0,
        };
        Self {
            record,
            settings,
            stop,
            least_linear: LEAST_LINEAR * (most - least) / (high - low),
            corners: Vec::new(),
            theta,
            dynamics: Dynamics::None,
            rms: f64::INFINITY,
            evaluations: 0,
            at_bound: false,
        }
    }

    /// False where it was stopped.
    fn run(&mut self) -> bool {
        self.search().is_some()
    }

    fn search(&mut self) -> Option<()> {
        self.settle(1e-3)?;
        self.place_corners();
        let dt = self.record.drive.dt;
        let length = dt * index(self.record.y.len() - self.record.start);
        let times = (0.02 * dt, 0.1 * length);
        match self.settings.dynamics {
            DynamicsKind::None => {}
            DynamicsKind::First => {
                let time = self.along(times, 1e-5, |time| Dynamics::First { time })?;
                self.dynamics = Dynamics::First { time };
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
            let lag = self.along(lags, 1e-4, |lag| mode(frequency, lag))?;
            let edge = self.at_bound;
            frequency = self.along(frequencies, 1e-4, |frequency| mode(frequency, lag))?;
            self.at_bound |= edge;
            self.dynamics = mode(frequency, lag);
            if self.rms > 0.999 * before {
                break;
            }
            before = self.rms;
        }
        Some(())
    }

    /// The best place along a line of dynamics.
    fn along(
        &mut self,
        bounds: (f64, f64),
        accuracy: f64,
        dynamics: impl Fn(f64) -> Dynamics,
    ) -> Option<f64> {
        let mut best = (f64::INFINITY, self.theta.clone());
        let place = least(bounds, accuracy, |place| {
            self.dynamics = dynamics(place);
            self.rms = f64::INFINITY;
            self.settle(1e-5)?;
            if self.rms < best.0 {
                best = (self.rms, self.theta.clone());
            }
            Some(self.rms)
        })?;
        (self.rms, self.theta) = best;
        self.at_bound = place < 1.01 * bounds.0 || place > bounds.1 / 1.01;
        Some(place)
    }

    /// Spreads the dead zones over what comes out of the plays in the window.
    fn place_corners(&mut self) {
        let mut plays = self.plays();
        let count = self.settings.zones;
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (k, &volts) in self.record.drive.u.iter().enumerate() {
            let value = self.lead(&mut plays, volts);
            if k >= self.record.start {
                (low, high) = (low.min(value), high.max(value));
            }
        }
        self.corners =
            (1..=count).map(|j| low + (high - low) * index(j) / index(count + 1)).collect();
        self.theta.bends = vec![0.0; count];
    }

    /// The drive, then what the plays would stand at: all at rest.
    fn plays(&self) -> Vec<f64> {
        vec![0.0; 1 + self.settings.thresholds.len()]
    }

    /// Moves the plays to `volts` and returns p, m.
    fn lead(&self, plays: &mut [f64], volts: f64) -> f64 {
        let mut value = (self.least_linear + self.theta.weights[0]) * volts;
        plays[0] = volts;
        for (i, threshold) in self.settings.thresholds.iter().enumerate() {
            let play = &mut plays[i + 1];
            *play = (volts - threshold).max((volts + threshold).min(*play));
            value += self.theta.weights[i + 1] * *play;
        }
        value
    }

    /// What the dead zones make of p.
    fn bent(&self, value: f64) -> f64 {
        let zones = self.corners.iter().zip(&self.theta.bends);
        value + zones.map(|(corner, bend)| bend * beyond(value, *corner)).sum::<f64>()
    }

    /// Creep and dynamics as they are now.
    fn relaxation(&self) -> Option<Relaxation> {
        Relaxation::new(&self.theta.shares, &self.settings.times, self.dynamics).ok()
    }

    /// Gauss and Newton's method in all but the dynamics, until a step gains less than `gain`.
    fn settle(&mut self, gain: f64) -> Option<()> {
        self.rms = self.deviation();
        for _ in 0..50 {
            if (self.stop)() {
                return None;
            }
            let (before, start) = (self.rms, self.theta.clone());
            let goal = self.linear_step()?;
            let mut part = 1.0;
            loop {
                self.theta = start.towards(&goal, part);
                self.rms = if self.theta.rises() { self.deviation() } else { f64::INFINITY };
                if self.rms < before || part < 1e-3 {
                    break;
                }
                part *= 0.5;
            }
            if self.rms >= before || self.rms.is_nan() {
                (self.rms, self.theta) = (before, start);
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
        let PlaysRecord { drive, y, start } = *self.record;
        let flow = relaxation.flow(drive.dt);
        let (mut plays, mut follower) = (self.plays(), Follower::new());
        let mut sum = 0.0;
        for (k, &volts) in drive.u.iter().enumerate() {
            let output = self.bent(self.lead(&mut plays, volts));
            let x = follower.next(&relaxation, &flow, drive.hold, output);
            if k >= start {
                let error = y[k] - x - self.theta.offset;
                sum += error * error;
            }
        }
        libm::sqrt(sum / index(y.len() - start))
    }

    /// The least squares solution of the problem linearised about the present unknowns.
    fn linear_step(&mut self) -> Option<Theta> {
        self.evaluations += 1;
        let relaxation = self.relaxation()?;
        let PlaysRecord { drive, y, start } = *self.record;
        let flow = relaxation.flow(drive.dt);
        // The creep's own part of the displacement, for the derivatives by its shares.
        let parts: Vec<Relaxation> = (0..self.settings.times.len())
            .map(|_| Relaxation::new(&[], &[], self.dynamics))
            .collect::<Result<_>>()
            .ok()?;
        let (n, zones, times) = (self.theta.weights.len(), self.corners.len(), parts.len());
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
            let value = self.lead(&mut plays, volts);
            let zone = self.corners.iter().zip(&self.theta.bends);
            let slope: f64 =
                zone.map(|(d, s)| if value > *d { *s } else { 0.0 }).sum::<f64>() + 1.0;
            let x = whole.next(&relaxation, &flow, drive.hold, self.bent(value));
            for j in 0..n {
                row[j] = columns[j].next(&relaxation, &flow, drive.hold, slope * plays[j]);
            }
            for (j, corner) in self.corners.iter().enumerate() {
                let input = beyond(value, *corner);
                row[n + j] = columns[n + j].next(&relaxation, &flow, drive.hold, input);
            }
            for (j, part) in parts.iter().enumerate() {
                row[n + zones + j] =
                    crept(&mut columns[n + zones + j], part, &flow, whole.state.creep[j]);
            }
            if k >= start {
                let linear: f64 = row.iter().zip(&now).map(|(a, b)| a * b).sum();
                rows.push(&row, y[k] - x - self.theta.offset + linear);
            }
        }
        let found = rows.solve(&free);
        let (weights, rest) = found.split_at(n);
        let (bends, rest) = rest.split_at(zones);
        let (shares, rest) = rest.split_at(times);
        Some(Theta {
            weights: weights.to_vec(),
            bends: bends.to_vec(),
            shares: shares.to_vec(),
            offset: rest.first().copied().unwrap_or(0.0),
        })
    }

    /// The unknowns in the order of the columns.
    fn flat(&self) -> Vec<f64> {
        let Theta { weights, bends, shares, offset } = &self.theta;
        let mut all = [&weights[..], bends, shares].concat();
        if self.settings.offset {
            all.push(*offset);
        }
        all
    }

    fn result(&self) -> Result<PlaysFit> {
        let PlaysSettings { thresholds, times, .. } = self.settings;
        let Theta { weights, bends, shares, offset } = &self.theta;
        let linear = self.least_linear + weights[0];
        Ok(PlaysFit {
            stage: PrandtlIshlinskiiStage {
                count: thresholds.len(),
                plays: plays(linear, thresholds, &weights[1..], &self.corners, bends)?,
                relaxation: Relaxation::new(shares, times, self.dynamics)?,
            },
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

/// The dynamics behind what one relaxation has reached, which moves from sample to sample.
fn crept(column: &mut Follower, part: &Relaxation, flow: &RelaxationFlow, reached: f64) -> f64 {
    part.step(flow, &mut column.state, reached);
    column.state.x
}
