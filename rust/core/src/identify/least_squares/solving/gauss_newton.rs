//! Gauss and Newton's method, whose steps are least squares within bounds.

use core::ops::Range;
use std::collections::VecDeque;

use super::columns::Columns;
use super::fit::Fit;
use super::judged::Reading;
use super::late::Late;
use crate::error::Result;
use crate::identify::least_squares::settings::{ROUGH, STEPS};
use crate::identify::least_squares::weights_record::{WeightsDelay, WeightsRecord};
use crate::math::Rows;

/// Weight of a row that holds a sum at its bound, relative to all others together.
const STIFF: f64 = 1e4;

/// RMS deviation that a difference of two weights that are to be alike counts as, relative to it.
const ALIKE: f64 = 1e-4;

/// Where a step goes.
struct Goal {
    x: Vec<f64>,
    /// RMS deviation that the linear problem has there, m, and that before the step.
    rms: f64,
    before: f64,
    /// Whether no bound of this step alone keeps it from going further.
    free: bool,
}

impl Fit<'_> {
    /// Gauss and Newton's method until a step gains less than `gain`; `None` where stopped.
    pub fn settle(&mut self, gain: f64) -> Option<()> {
        self.settle_within(STEPS, gain)
    }

    /// The same for one trial of many, the best of which is settled after: the thresholds of dead
    /// zones, which take many steps, stay as they are.
    pub fn settle_rigid(&mut self, steps: usize) -> Option<()> {
        self.rigid = true;
        let settled = self.settle_within(steps, ROUGH);
        self.rigid = false;
        settled
    }

    /// The same with so many steps at most.
    pub fn settle_within(&mut self, steps: usize, gain: f64) -> Option<()> {
        for _ in 0..steps {
            if (self.common.stop)() {
                return None;
            }
            let (start, goal) = (self.x.clone(), self.goal());
            // Rounding alone may forbid a step from which nothing is to be gained.
            let worth = goal.before - goal.rms > gain * goal.before;
            let mut part = 1.0;
            loop {
                self.x = start.iter().zip(&goal.x).map(|(a, b)| a + part * (b - a)).collect();
                self.rms =
                    if self.layout().admits(&self.x) { self.deviation() } else { f64::INFINITY };
                if self.rms < goal.before || part < 1e-3 || !worth {
                    break;
                }
                part *= 0.5;
            }
            if self.rms >= goal.before || self.rms.is_nan() {
                (self.rms, self.x) = (goal.before, start);
                break;
            }
            if goal.before - self.rms <= gain * goal.before {
                break;
            }
            // What the linear problem foretold: the next one would be the same.
            if part > 0.9 && goal.free && (self.rms - goal.rms).abs() <= gain * self.rms {
                break;
            }
        }
        Some(())
    }

    /// The solution of the problem linearised about the present unknowns.
    fn goal(&self) -> Goal {
        let Ok((mut rows, before, scatter)) = self.linearised() else {
            let none = f64::INFINITY;
            return Goal { x: self.x.clone(), rms: none, before: none, free: false };
        };
        let layout = self.layout();
        let bounds = self.bounds();
        // Other unknowns than weights begin at 0: one that nothing determines stays there.
        let weights = layout.weights();
        let mut x = rows.solve_near(&bounds, &self.x[weights.clone()]);
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
            let stiff = STIFF * rows.size();
            row[part].fill(stiff);
            rows.push(&row, stiff * bound);
            x = rows.solve_near(&bounds, &x[weights.clone()]);
        }
        // A number that may only move so far in one step goes on in the next.
        let moving = |still: bool, part: Range<usize>| if still { 0..0 } else { part };
        let corners = moving(self.rigid, layout.corners());
        let mut stops = corners.chain(moving(self.held, layout.poles()));
        let free = stops.all(|slot| bounds[slot].0 < x[slot] && x[slot] < bounds[slot].1);
        let rms = libm::hypot(rows.rms(&x, self.counted()), scatter);
        Goal { x, rms, before, free }
    }

    /// Bounds of all unknowns for a step.
    fn bounds(&self) -> Vec<(f64, f64)> {
        let ranges = self.pole_ranges();
        // Nothing moves yet where all weights are 0, and nothing determines the dynamics.
        let still = self.x[self.layout().weights()].iter().all(|weight| *weight == 0.0);
        let held = self.held || still;
        let mut bounds = self.layout().bounds(&self.x, held, self.bent, &ranges);
        for slot in if self.rigid { self.layout().corners() } else { 0..0 } {
            bounds[slot] = (self.x[slot], self.x[slot]);
        }
        for (r, record) in self.common.records.iter().enumerate() {
            let delay = match record.delay {
                WeightsDelay::Known(delay) => (delay, delay),
                WeightsDelay::Fitted(low, high) => (low, high),
            };
            bounds.extend(self.own(r).bounds(self.common.stroke, delay));
        }
        bounds
    }

    /// The rows of the linearised problem, the RMS deviation, and that of readings from their means, m.
    fn linearised(&self) -> Result<(Rows, f64, f64)> {
        self.common.count(1);
        let mut rows = Rows::new(self.unknowns());
        let mut squares = 0.0;
        for r in 0..self.common.records.len() {
            squares += self.push_rows(r, &mut rows)?;
        }
        self.push_alike(&mut rows);
        let of = |r: usize| {
            let scatter = self.judged(r).map(|one| one.scatter).sum::<f64>();
            self.common.weights[r] * scatter
        };
        let scatter: f64 = (0..self.common.records.len()).map(of).sum();
        let rms = |squares: f64| libm::sqrt(squares / self.counted());
        Ok((rows, rms(squares + scatter), rms(scatter)))
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

    /// The rows of one record; the sum of the squares of what is left, each as often as it counts.
    fn push_rows(&self, r: usize, rows: &mut Rows) -> Result<f64> {
        let WeightsRecord { drive, start, .. } = self.common.records[r];
        let (layout, own) = (self.layout(), self.own(r));
        let (added, fades) = (self.added(r), self.fading(r));
        let mut columns = Columns::of(self, r)?;
        let exact = if self.exact { Some(self.undelayed(r)?) } else { None };
        let late = Late::new(self.delay(r), drive.dt);
        let mut recent = Recent::new(columns.count(), late);
        let mut row = vec![0.0; self.unknowns()];
        let mut judged = self.judged(r).peekable();
        let mut motion = Vec::with_capacity(self.windows[r].end);
        let mut squares = 0.0;
        while let Some(places) = columns.next() {
            for (i, k) in places.into_iter().enumerate() {
                motion.resize(k, motion.last().copied().unwrap_or_default());
                motion.push(exact.as_ref().map_or(columns.displacement(i), |exact| exact[k]));
                let counts = judged.next_if(|one| one.place == k);
                if !late.is_none() {
                    recent.push(k, columns.row(i));
                }
                let Some(&Reading { share, y, .. }) = counts else { continue };
                if late.is_none() {
                    let (stage, departures) = columns.row(i).split_at(layout.count());
                    row[..layout.count()].copy_from_slice(stage);
                    row[own.departures.clone()].copy_from_slice(departures);
                } else {
                    recent.read(k, &mut row[..layout.count()], 0);
                    recent.read(k, &mut row[own.departures.clone()], layout.count());
                }
                row[own.offset.clone()].fill(1.0);
                row[own.drift.clone()].fill(fades(k, start));
                let (before, after) = late.between(k);
                row[own.delay.clone()].fill((motion[before] - motion[after]) / drive.dt);
                let known: f64 = row.iter().zip(&self.x).map(|(a, b)| a * b).sum();
                let factor = libm::sqrt(self.common.weights[r] * share);
                let left = factor * (y - late.of(k, |k| motion[k]) - added(k));
                squares += left * left;
                for entry in &mut row {
                    *entry *= factor;
                }
                rows.push(&row, factor.mul_add(known, left));
            }
        }
        Ok(squares)
    }
}
/// The rows of the latest samples, as many as a late reading needs.
struct Recent {
    rows: VecDeque<(usize, Vec<f64>)>,
    length: usize,
    late: Late,
}

impl Recent {
    fn new(length: usize, late: Late) -> Self {
        Self { rows: VecDeque::new(), length, late }
    }

    /// Takes the row of sample `k`.
    fn push(&mut self, k: usize, row: &[f64]) {
        let (oldest, _) = self.late.between(k);
        let mut slot = match self.rows.front() {
            Some((first, _)) if *first < oldest => self.rows.pop_front().map(|(_, row)| row),
            _ => None,
        }
        .unwrap_or_else(|| vec![0.0; self.length]);
        slot.copy_from_slice(row);
        self.rows.push_back((k, slot));
    }

    /// The entries from `from` on as they are read at the latest sample, `k`.
    fn read(&self, k: usize, entries: &mut [f64], from: usize) {
        let part = from..from + entries.len();
        let row = |k: usize| {
            let place = self.rows.partition_point(|(at, _)| *at < k);
            &self.rows[place].1[part.clone()]
        };
        let (before, after) = self.late.between(k);
        for ((entry, before), after) in entries.iter_mut().zip(row(before)).zip(row(after)) {
            *entry = self.late.mixed(*before, *after);
        }
    }
}
