//! Gauss and Newton's method, whose steps are least squares within bounds.

use core::ops::Range;
use std::collections::VecDeque;

use super::fit::Fit;
use super::follower::Follower;
use super::record_path::Late;
use super::{WeightsDelay, WeightsRecord};
use crate::error::Result;
use crate::math::Rows;
use crate::models::{Relaxation, RelaxationFlow, RelaxationState};
use crate::signal::Hold;

/// Change of a logarithm for a derivative by differences.
const NUDGE: f64 = 1e-5;

/// Weight of a row that holds a sum at its bound, relative to all others together.
const STIFF: f64 = 1e4;

/// RMS deviation that a difference of two weights that are to be alike counts as, relative to it.
const ALIKE: f64 = 1e-4;

/// Most steps.
pub(super) const STEPS: usize = 60;

impl Fit<'_> {
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
        let bounds = self.bounds();
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
            let mut row = vec![0.0; self.unknowns()];
            let stiff = STIFF * held.size();
            row[part].fill(stiff);
            held.push(&row, stiff * bound);
            x = held.solve(&bounds);
        }
        x
    }

    /// Bounds of all unknowns for a step.
    fn bounds(&self) -> Vec<(f64, f64)> {
        let ranges = self.pole_ranges();
        let mut bounds = self.layout().bounds(&self.x, self.held, self.bent, &ranges);
        for (r, record) in self.common.records.iter().enumerate() {
            let delay = match record.delay {
                WeightsDelay::Known(delay) => (delay, delay),
                WeightsDelay::Fitted(low, high) => (low, high),
            };
            bounds.extend(self.own(r).bounds(self.common.stroke, delay));
        }
        bounds
    }

    /// The rows of the linearised problem.
    fn linearised(&self) -> Result<Rows> {
        self.common.evaluations.set(self.common.evaluations.get() + 1);
        let mut rows = Rows::new(self.unknowns());
        for r in 0..self.common.records.len() {
            self.push_rows(r, &mut rows)?;
        }
        self.push_alike(&mut rows);
        Ok(rows)
    }

    /// Rows that draw weights of neighbours together where the model asks for it.
    fn push_alike(&self, rows: &mut Rows) {
        let size = ALIKE * libm::sqrt(self.counted());
        for (one, other) in self.signals.alike() {
            let mut row = vec![0.0; self.unknowns()];
            (row[one], row[other]) = (size, -size);
            rows.push(&row, 0.0);
        }
    }

    /// The rows of one record.
    fn push_rows(&self, r: usize, rows: &mut Rows) -> Result<()> {
        let WeightsRecord { drive, y, start, .. } = self.common.records[r];
        let (layout, own) = (self.layout(), self.own(r));
        let (motion, added, fades) = (self.undelayed(r)?, self.added(r), self.fading(r));
        let parts = Parts::of(self, drive.dt)?;
        let inner = layout.weights + layout.bends + layout.corners;
        let mut inputs = vec![0.0; inner + 1];
        let mut path = self.before(r);
        let mut columns: Option<Columns> = None;
        let late = Late::new(self.delay(r), drive.dt);
        let factor = libm::sqrt(self.weight(r));
        let mut recent = Recent::new(layout.count() + own.departures.len(), late);
        let mut row = vec![0.0; self.unknowns()];
        let mut judged = self.judged(r).peekable();
        for (k, &volts) in drive.u.iter().enumerate().take(self.windows[r].end) {
            self.push(&mut path, volts, self.common.records[r].step(k));
            self.inputs(&path.signals, &mut inputs);
            let columns = match &mut columns {
                None => {
                    let departed = &self.x[layout.shares()][..own.departures.len()];
                    let creep = self.creep_before(r, inner + 1);
                    columns.insert(Columns::at_rest(&parts, &inputs, &creep, departed))
                }
                Some(columns) => {
                    columns.next(&parts, drive.hold, &inputs);
                    columns
                }
            };
            let counts = judged.next_if_eq(&k).is_some();
            if !counts && late.is_none() {
                continue;
            }
            let now = recent.next();
            columns.write(now);
            if !counts {
                continue;
            }
            recent.read(&mut row[..layout.count()], 0);
            recent.read(&mut row[own.departures.clone()], layout.count());
            row[own.offset.clone()].fill(1.0);
            row[own.drift.clone()].fill(fades(k, start));
            let (before, after) = late.between(k);
            row[own.delay.clone()].fill((motion[before] - motion[after]) / drive.dt);
            let known: f64 = row.iter().zip(&self.x).map(|(a, b)| a * b).sum();
            let left = y[k] - late.of(k, |k| motion[k]) - added(k);
            for entry in &mut row {
                *entry *= factor;
            }
            rows.push(&row, factor * (left + known));
        }
        Ok(())
    }

    /// Creep and dynamics with each number of the dynamics changed a little.
    fn nudged(&self, dt: f64) -> Result<Vec<(Relaxation, RelaxationFlow)>> {
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
    fn of(fit: &Fit<'_>, dt: f64) -> Result<Self> {
        let (whole, bare) = (fit.relaxation()?, Relaxation::new(&[], &[], fit.dynamics())?);
        let decay = fit.times.iter().map(|time| libm::exp(-dt / time)).collect();
        let nudged = fit.nudged(dt)?;
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

    /// How each weight, dead zone, corner, creep share, number of the dynamics and departure
    /// moves the stage.
    fn write(&self, row: &mut [f64]) {
        let x = self.stage().x;
        let moved = |one: &Follower| one.state.x;
        let inputs = self.inputs[..self.inputs.len() - 1].iter().chain(&self.reached).map(moved);
        let slopes = self.nudged.iter().map(|one| (one.state.x - x) / NUDGE);
        for (slot, value) in
            row.iter_mut().zip(inputs.chain(slopes).chain(self.faded.iter().map(moved)))
        {
            *slot = value;
        }
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

/// The rows of the latest samples, as many as a late reading needs.
struct Recent {
    rows: VecDeque<Vec<f64>>,
    length: usize,
    late: Late,
}

impl Recent {
    fn new(length: usize, late: Late) -> Self {
        Self { rows: VecDeque::new(), length, late }
    }

    /// Room for the row of the next sample.
    fn next(&mut self) -> &mut Vec<f64> {
        let oldest =
            if self.rows.len() < self.late.whole() + 2 { None } else { self.rows.pop_front() };
        self.rows.push_back(oldest.unwrap_or_else(|| vec![0.0; self.length]));
        let last = self.rows.len() - 1;
        &mut self.rows[last]
    }

    /// The entries from `from` on as they are read at the latest sample.
    fn read(&self, entries: &mut [f64], from: usize) {
        let last = self.rows.len() - 1;
        for (i, entry) in entries.iter_mut().enumerate() {
            let at = |k: usize| self.rows[k][from + i];
            *entry = if self.late.is_none() { at(last) } else { self.late.of(last, at) };
        }
    }
}
