//! Gauss and Newton's method, whose steps are least squares within bounds.

use core::ops::Range;

use super::WeightsRecord;
use super::fit::Fit;
use super::follower::Follower;
use crate::error::Result;
use crate::math::Rows;
use crate::models::{Relaxation, RelaxationFlow, RelaxationState, WeightedPlays};
use crate::signal::Hold;

/// Change of a logarithm for a derivative by differences.
const NUDGE: f64 = 1e-5;

/// Weight of a row that holds a sum at its bound, relative to all others together.
const STIFF: f64 = 1e4;

/// Most steps.
pub(super) const STEPS: usize = 60;

impl<M: WeightedPlays> Fit<'_, M> {
    /// Gauss and Newton's method until a step gains less than `gain`; `None` where stopped.
    pub fn settle(&mut self, gain: f64) -> Option<()> {
        self.settle_within(STEPS, gain)
    }

    /// The same with so many steps at most.
    pub fn settle_within(&mut self, steps: usize, gain: f64) -> Option<()> {
        self.rms = self.deviation();
        for _ in 0..steps {
            if (self.common.stop)() {
                return None;
            }
            let (before, start) = (self.rms, self.x.clone());
            let goal = self.goal();
            let mut part = 1.0;
            loop {
                self.x = start.iter().zip(&goal).map(|(a, b)| a + part * (b - a)).collect();
                self.rms =
                    if self.layout().admits(&self.x) { self.deviation() } else { f64::INFINITY };
                if self.rms < before || part < 1e-3 {
                    break;
                }
                part *= 0.5;
            }
            if self.rms >= before || self.rms.is_nan() {
                (self.rms, self.x) = (before, start);
                break;
            }
            if before - self.rms <= gain * before {
                break;
            }
        }
        Some(())
    }

    /// The solution of the problem linearised about the present unknowns.
    fn goal(&self) -> Vec<f64> {
        let Ok(rows) = self.linearised() else { return self.x.clone() };
        let layout = self.layout();
        let ranges = self.pole_ranges();
        let bounds = layout.bounds(&self.x, self.held, self.bent, &ranges, self.common.stroke);
        let mut held = rows.clone();
        let mut x = held.solve(&bounds);
        // Sums beyond their bounds are held there, one more each time.
        let sums = layout.sums();
        for _ in 0..sums.len() {
            let sum = |part: &Range<usize>| x[part.clone()].iter().sum::<f64>();
            let beyond = sums.iter().find_map(|(part, (low, high))| {
                let sum = sum(part);
                let bound = if sum < low - 1e-9 { low } else { high };
                (sum < low - 1e-9 || sum > high + 1e-9).then(|| (part.clone(), *bound))
            });
            let Some((part, bound)) = beyond else { break };
            let mut row = vec![0.0; layout.count()];
            let stiff = STIFF * held.size();
            row[part].fill(stiff);
            held.push(&row, stiff * bound);
            x = held.solve(&bounds);
        }
        x
    }

    /// The rows of the linearised problem.
    fn linearised(&self) -> Result<Rows> {
        self.common.evaluations.set(self.common.evaluations.get() + 1);
        let WeightsRecord { drive, y, .. } = *self.common.record;
        let (layout, motion) = (self.layout(), self.motion()?);
        let parts = Parts::of(self)?;
        let inner = layout.weights + layout.bends + layout.corners;
        let mut signals = vec![0.0; inner + 1];
        let mut plays = self.plays_before();
        let mut columns = None;
        let mut rows = Rows::new(layout.count());
        let mut row = vec![1.0; layout.count()];
        for (k, &volts) in drive.u.iter().enumerate().take(self.window.end) {
            self.push(&mut plays, volts);
            self.inputs(&plays, &mut signals);
            let columns = match &mut columns {
                None => {
                    let departed = &self.x[layout.shares()][..layout.departures];
                    let creep = self.creep_before(inner + 1);
                    columns.insert(Columns::at_rest(&parts, &signals, &creep, departed))
                }
                Some(columns) => {
                    columns.next(&parts, drive.hold, &signals);
                    columns
                }
            };
            if !self.counts(k) {
                continue;
            }
            for (slot, value) in row.iter_mut().zip(columns.linear()) {
                *slot = value;
            }
            for (slot, slope) in row[layout.poles()].iter_mut().zip(columns.slopes()) {
                *slot = slope;
            }
            let known: f64 = row.iter().zip(&self.x).map(|(a, b)| a * b).sum();
            let offset: f64 = self.x[layout.offset()].iter().sum();
            rows.push(&row, y[k] - motion[k] - offset + known);
        }
        Ok(rows)
    }

    /// Creep and dynamics with each number of the dynamics changed a little.
    fn nudged(&self) -> Result<Vec<(Relaxation, RelaxationFlow)>> {
        let dt = self.common.record.drive.dt;
        let of = |i: usize| {
            let mut other = self.clone();
            let slot = other.layout().poles().start + i;
            other.x[slot] += NUDGE;
            let part = other.relaxation()?;
            Ok((part, part.flow(dt)))
        };
        (0..self.layout().poles).map(of).collect()
    }
}

/// What the columns go through.
struct Parts {
    whole: (Relaxation, RelaxationFlow),
    /// Behind the creep: what its relaxations have reached goes through the dynamics alone.
    bare: (Relaxation, RelaxationFlow),
    /// With each number of the dynamics changed a little.
    nudged: Vec<(Relaxation, RelaxationFlow)>,
    /// What a sampling interval leaves of each relaxation's departure.
    decay: Vec<f64>,
}

impl Parts {
    fn of<M: WeightedPlays>(fit: &Fit<'_, M>) -> Result<Self> {
        let dt = fit.common.record.drive.dt;
        let (whole, bare) = (fit.relaxation()?, Relaxation::new(&[], &[], fit.dynamics())?);
        let decay = fit.times.iter().map(|time| libm::exp(-dt / time)).collect();
        let nudged = fit.nudged()?;
        Ok(Self { whole: (whole, whole.flow(dt)), bare: (bare, bare.flow(dt)), nudged, decay })
    }
}

/// What the row of a sample is made of.
struct Columns {
    /// Of weights, dead zones and corners; last the stage's own input.
    inputs: Vec<Follower>,
    /// What each relaxation has reached, behind the dynamics.
    reached: Vec<Follower>,
    /// What is left of each departure, and that behind the dynamics.
    left: Vec<f64>,
    faded: Vec<Follower>,
    /// The stage with each number of the dynamics changed a little.
    nudged: Vec<Follower>,
}

impl Columns {
    /// At rest behind the inputs of the first sample, the creep where it stood.
    fn at_rest(parts: &Parts, signals: &[f64], creep: &[Vec<f64>], departed: &[f64]) -> Self {
        let ready = |(input, q): (&f64, &Vec<f64>)| Follower::at_rest(&parts.whole.0, *input, q);
        let bare = |q: &f64| Follower::at_rest(&parts.bare.0, *q, &[]);
        let inputs: Vec<Follower> = signals.iter().zip(creep).map(ready).collect();
        Self {
            reached: creep.last().map_or(&[][..], Vec::as_slice).iter().map(bare).collect(),
            left: departed.to_vec(),
            faded: departed.iter().map(bare).collect(),
            nudged: inputs.last().map_or_else(Vec::new, |last| vec![*last; parts.nudged.len()]),
            inputs,
        }
    }

    /// Where the stage itself is: its input is the last.
    fn stage(&self) -> RelaxationState {
        self.inputs[self.inputs.len() - 1].state
    }

    /// How each weight, dead zone, corner, creep share and departure moves the stage.
    fn linear(&self) -> impl Iterator<Item = f64> {
        let inputs = &self.inputs[..self.inputs.len() - 1];
        inputs.iter().chain(&self.reached).chain(&self.faded).map(|one| one.state.x)
    }

    /// How each number of the dynamics moves it.
    fn slopes(&self) -> impl Iterator<Item = f64> {
        let x = self.stage().x;
        self.nudged.iter().map(move |one| (one.state.x - x) / NUDGE)
    }

    fn next(&mut self, parts: &Parts, hold: Hold, signals: &[f64]) {
        let ((whole, flow), (bare, bare_flow)) = (&parts.whole, &parts.bare);
        for (column, signal) in self.inputs.iter_mut().zip(signals) {
            column.next(whole, flow, hold, *signal);
        }
        // These move from sample to sample whatever the hold.
        let reached = self.stage().creep;
        for (column, q) in self.reached.iter_mut().zip(reached) {
            bare.step(bare_flow, &mut column.state, q);
        }
        for ((column, left), factor) in self.faded.iter_mut().zip(&mut self.left).zip(&parts.decay)
        {
            *left *= factor;
            bare.step(bare_flow, &mut column.state, *left);
        }
        for (column, (part, flow)) in self.nudged.iter_mut().zip(&parts.nudged) {
            column.next(part, flow, hold, signals[signals.len() - 1]);
        }
    }
}
