//! Modes that a record shows, whatever the hysteresis: frequencies and damping ratios.
//!
//! The displacement is compared with what modes make of the drive, of a few plays and of the
//! drive's square, whose weights are found by least squares for each trial. A grid of frequencies
//! and dampings comes first: a mode of damping ratio zeta shows only within a few zeta of its
//! frequency. The best places of the grid are then refined by Gauss and Newton's method.

use core::f64::consts::LN_2;

use super::sampled_dynamics::Steps;
use crate::math::{FREE, Rows};
use crate::models::{Dynamics, HIGHEST_MODE};
use crate::signal::{Drive, Stop, index, range};

/// Thresholds of the plays, as shares of the drive's range.
const THRESHOLDS: [f64; 4] = [0.02, 0.06, 0.15, 0.3];

/// Rows that are compared, at most.
const MOST_ROWS: usize = 6000;

/// Damping ratios of the grid, each with the ratio of neighbouring frequencies.
const GRID: [(f64, f64); 3] = [(0.02, 1.03), (0.07, 1.08), (0.25, 1.2)];

/// Fewest cycles of a mode in the window.
const CYCLES: f64 = 3.0;

/// Least frequency of further modes, relative to the first: a slower one stands in for creep and
/// hysteresis.
const SLOWEST: f64 = 0.125;

/// Damping ratios of what counts as a mode.
const DAMPING: (f64, f64) = (1e-3, 0.8);

/// Share of the deviation that a mode has to take away.
const LEAST_GAIN: f64 = 0.02;

/// Least swing that the drive itself excites, as a share of what the mode takes away: with less
/// it stands in for what the plays do not describe.
const LEAST_SWING: f64 = 0.1;

/// Places of the grid that are refined.
const STARTS: usize = 5;

/// A mode that a record shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resonance {
    /// Natural frequency, Hz.
    pub frequency: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Share of the static displacement that it has; of the first, what the others leave.
    pub weight: f64,
    /// Share of the deviation that it takes away.
    pub gain: f64,
}

/// The modes that a record shows from sample `start` on, the one that explains most first; none
/// where it is explained as well without, or with a lag. `None` where `stop` said so meanwhile.
#[must_use]
pub fn resonances(
    drive: &Drive<'_>,
    y: &[f64],
    start: usize,
    most: usize,
    stop: Stop<'_>,
) -> Option<Vec<Resonance>> {
    let mut found: Vec<Resonance> = Vec::new();
    if y.len() != drive.u.len() || y.len() < start + 40 {
        return Some(found);
    }
    let Some(trial) = Trial::new(drive, y, start) else { return Some(found) };
    let length = drive.dt * index(y.len() - start);
    let edges = (CYCLES / length, HIGHEST_MODE / drive.dt);
    while found.len() < most {
        let first = found.first().map_or(0.0, |mode| mode.frequency);
        let edges = (f64::max(edges.0, SLOWEST * first), edges.1);
        let known: Vec<Mode> = found.iter().map(Mode::of).collect();
        let before = if known.is_empty() { trial.without(stop)? } else { trial.cost(&known).0 };
        let mut best: Option<(f64, Vec<Mode>)> = None;
        for start in trial.grid(&known, edges, stop)? {
            let mut modes = known.clone();
            modes.push(start);
            let (cost, modes) = trial.refined(modes, edges, stop)?;
            // Beside a mode that is sure, what is none does not hide another.
            if !known.is_empty() && !modes.iter().all(|mode| mode.within(edges)) {
                continue;
            }
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, modes));
            }
        }
        let Some((cost, modes)) = best else { break };
        let gain = 1.0 - cost / before;
        let proper = |mode: &Mode| mode.within(edges);
        let taken = libm::sqrt(before * before - cost * cost);
        let Some(last) = modes.last() else { break };
        let shown = |mode: &Mode| trial.swings(*mode) > LEAST_SWING * taken;
        if !(gain > LEAST_GAIN && modes.iter().all(proper) && (!known.is_empty() || shown(last))) {
            break;
        }
        let weights = trial.weights(&modes);
        let gains = found.iter().map(|one| one.gain).chain([gain]);
        let all = modes.iter().zip(weights).zip(gains);
        found = all.map(|((mode, weight), gain)| mode.resonance(weight, gain)).collect();
    }
    Some(found)
}

/// Logarithms of frequency and damping ratio.
#[derive(Clone, Copy, Debug)]
struct Mode([f64; 2]);

impl Mode {
    fn at(frequency: f64, damping_ratio: f64) -> Self {
        Self([libm::log(frequency), libm::log(damping_ratio)])
    }

    fn of(resonance: &Resonance) -> Self {
        Self::at(resonance.frequency, resonance.damping_ratio)
    }

    fn dynamics(self) -> Dynamics {
        let [frequency, damping_ratio] = self.0.map(libm::exp);
        Dynamics::Second { frequency, damping_ratio }
    }

    fn resonance(self, weight: f64, gain: f64) -> Resonance {
        let [frequency, damping_ratio] = self.0.map(libm::exp);
        Resonance { frequency, damping_ratio, weight, gain }
    }

    fn within(&self, (low, high): (f64, f64)) -> bool {
        let [frequency, damping_ratio] = self.0.map(libm::exp);
        frequency > 1.01 * low
            && frequency < 0.99 * high
            && damping_ratio > 1.01 * DAMPING.0
            && damping_ratio < 0.99 * DAMPING.1
    }
}

/// Signals with which the displacement is compared.
struct Trial<'a> {
    drive: Drive<'a>,
    /// Samples that are compared.
    rows: Vec<usize>,
    y: Vec<f64>,
    /// Drive, its square, plays: all go through each mode.
    columns: [Vec<f64>; 2 + THRESHOLDS.len()],
    /// Best of them without dynamics, then the drive.
    few: [Vec<f64>; 2],
}

impl<'a> Trial<'a> {
    fn new(drive: &Drive<'a>, y: &[f64], start: usize) -> Option<Self> {
        let (low, high) = range(drive.u);
        let width = high - low;
        if width <= 0.0 || width.is_nan() {
            return None;
        }
        let scaled = |volts: &f64| (volts - 0.5 * (low + high)) / width;
        let u: Vec<f64> = drive.u.iter().map(scaled).collect();
        let squares = u.iter().map(|u| u * u).collect();
        let [first, second, third, fourth] = THRESHOLDS.map(|threshold| {
            let mut play = u[0];
            let follow = |u: &f64| {
                play = (u - threshold).max((u + threshold).min(play));
                play
            };
            u.iter().map(follow).collect()
        });
        let columns = [u.clone(), squares, first, second, third, fourth];
        let every = (y.len() - start).div_ceil(MOST_ROWS);
        let rows: Vec<usize> = (start..y.len()).step_by(every).collect();
        let y = rows.iter().map(|&k| y[k]).collect();
        let mut trial = Self { drive: *drive, rows, y, columns, few: [Vec::new(), u] };
        let (_, weights) = trial.fit(&[&trial.columns]);
        let still = |k: usize| trial.columns.iter().zip(&weights).map(|(one, w)| w * one[k]).sum();
        trial.few[0] = (0..drive.u.len()).map(still).collect();
        Some(trial)
    }

    /// RMS deviation and weights of groups of columns, a constant and a drift.
    fn fit(&self, groups: &[&[Vec<f64>]]) -> (f64, Vec<f64>) {
        let all: Vec<&Vec<f64>> = groups.iter().flat_map(|group| group.iter()).collect();
        let unknowns = all.len() + 2;
        let mut rows = Rows::new(unknowns);
        let mut row = vec![1.0; unknowns];
        for (&k, y) in self.rows.iter().zip(&self.y) {
            for (slot, column) in row.iter_mut().zip(&all) {
                *slot = column[k];
            }
            row[unknowns - 1] = index(k) / index(self.drive.u.len());
            rows.push(&row, *y);
        }
        let weights = rows.solve(&vec![FREE; unknowns]);
        (rows.rms(&weights, index(self.rows.len())), weights)
    }

    /// The columns behind each mode: all of them behind the first, the best behind others.
    fn behind(&self, modes: &[Mode]) -> Vec<Vec<Vec<f64>>> {
        let of = |(i, mode): (usize, &Mode)| {
            let steps = Steps::new(mode.dynamics(), &self.drive);
            match (steps, i) {
                (Some(steps), 0) => steps.of(self.columns.each_ref().map(Vec::as_slice)).to_vec(),
                (Some(steps), _) => steps.of([&self.few[0]]).to_vec(),
                (None, 0) => self.columns.to_vec(),
                (None, _) => self.few[..1].to_vec(),
            }
        };
        modes.iter().enumerate().map(of).collect()
    }

    /// Shares of the static displacement.
    fn weights(&self, modes: &[Mode]) -> Vec<f64> {
        let (_, all) = self.cost(modes);
        let further: Vec<f64> = (1..modes.len()).map(|i| all[self.columns.len() + i - 1]).collect();
        let rest = 1.0 - further.iter().sum::<f64>();
        [vec![rest], further].concat()
    }

    /// Response of a mode to the drive beyond the drive itself and its rate, rms, m.
    fn swings(&self, mode: Mode) -> f64 {
        let [_, u] = &self.few;
        let Some(steps) = Steps::new(mode.dynamics(), &self.drive) else { return 0.0 };
        let last = u.len() - 1;
        let rate = |k: usize| {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
            (u[after] - u[before]) / index(after - before)
        };
        let ([moved], mut rows) = (steps.of([u]), Rows::new(3));
        for &k in &self.rows {
            rows.push(&[u[k], rate(k), 1.0], moved[k]);
        }
        let (low, high) = range(&self.y);
        let weights = rows.solve(&[FREE; 3]);
        (high - low) * rows.rms(&weights, index(self.rows.len()))
    }

    fn cost(&self, modes: &[Mode]) -> (f64, Vec<f64>) {
        let behind = self.behind(modes);
        self.fit(&behind.iter().map(Vec::as_slice).collect::<Vec<_>>())
    }

    /// RMS deviation without a mode: the least with a lag of any length.
    fn without(&self, stop: Stop<'_>) -> Option<f64> {
        let mut least = self.fit(&[&self.columns]).0;
        let mut time = 0.1 * self.drive.dt;
        while time < 0.1 * self.drive.dt * index(self.drive.u.len()) {
            if stop() {
                return None;
            }
            let Some(steps) = Steps::new(Dynamics::First { time }, &self.drive) else { break };
            let behind = steps.of(self.columns.each_ref().map(Vec::as_slice));
            least = least.min(self.fit(&[&behind]).0);
            time *= 2.0;
        }
        Some(least)
    }

    /// The best places of the grid, as far from each other as neighbours are.
    fn grid(&self, known: &[Mode], edges: (f64, f64), stop: Stop<'_>) -> Option<Vec<Mode>> {
        let rest = self.rest(known);
        let mut places: Vec<(f64, Mode)> = Vec::new();
        for (damping_ratio, ratio) in GRID {
            let mut costs = Vec::new();
            let mut frequency = edges.0;
            while frequency < edges.1 {
                if stop() {
                    return None;
                }
                let mode = Mode::at(frequency, damping_ratio);
                costs.push((self.quick(mode, &rest), mode));
                frequency *= ratio;
            }
            let lowest = |i: usize| {
                let near = &costs[i.saturating_sub(1)..(i + 2).min(costs.len())];
                near.iter().all(|other| costs[i].0 <= other.0)
            };
            places.extend((0..costs.len()).filter(|&i| lowest(i)).map(|i| costs[i]));
        }
        places.sort_by(|one, other| one.0.total_cmp(&other.0));
        let mut starts: Vec<Mode> = Vec::new();
        for (_, mode) in places {
            let near = |other: &Mode| {
                (other.0[0] - mode.0[0]).abs() < 0.05 && (other.0[1] - mode.0[1]).abs() < 0.1
            };
            if starts.len() < STARTS && !starts.iter().any(near) {
                starts.push(mode);
            }
        }
        Some(starts)
    }

    /// Residual of the displacement beside the modes that are known.
    fn rest(&self, known: &[Mode]) -> Vec<f64> {
        if known.is_empty() {
            return self.y.clone();
        }
        let (behind, (_, weights)) = (self.behind(known), self.cost(known));
        let all: Vec<&Vec<f64>> = behind.iter().flatten().collect();
        let left = |(&k, y): (&usize, &f64)| {
            y - all.iter().zip(&weights).map(|(one, w)| w * one[k]).sum::<f64>()
        };
        self.rows.iter().zip(&self.y).map(left).collect()
    }

    /// Squares that two columns behind a mode leave of a signal, its mean left out.
    fn quick(&self, mode: Mode, rest: &[f64]) -> f64 {
        let Some(steps) = Steps::new(mode.dynamics(), &self.drive) else { return f64::INFINITY };
        let [one, two] = steps.of(self.few.each_ref().map(Vec::as_slice)).map(|all| {
            let picked: Vec<f64> = self.rows.iter().map(|&k| all[k]).collect();
            centred(picked)
        });
        let rest = centred(rest.to_vec());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (first, cross) = (dot(&one, &one), dot(&one, &two));
        let share = cross / first;
        let two: Vec<f64> = two.iter().zip(&one).map(|(b, a)| b - share * a).collect();
        let second = dot(&two, &two);
        let mut left = dot(&rest, &rest) - dot(&one, &rest).powi(2) / first;
        // Not of a column that depends on the other.
        if second > 1e-12 * first {
            left -= dot(&two, &rest).powi(2) / second;
        }
        if left.is_nan() { f64::INFINITY } else { left }
    }

    /// Gauss and Newton's method in the modes, with the weights solved for each.
    fn refined(
        &self,
        mut modes: Vec<Mode>,
        edges: (f64, f64),
        stop: Stop<'_>,
    ) -> Option<(f64, Vec<Mode>)> {
        let mut cost = self.cost(&modes).0;
        for _ in 0..25 {
            if stop() {
                return None;
            }
            let goal = self.goal(&modes, edges);
            let mut part = 1.0;
            let (mut next, mut now);
            loop {
                next = modes.iter().zip(&goal).map(|(a, b)| mix(*a, *b, part)).collect::<Vec<_>>();
                now = self.cost(&next).0;
                if now < cost || part < 0.01 {
                    break;
                }
                part *= 0.4;
            }
            if now >= cost || now.is_nan() {
                break;
            }
            let gained = cost - now;
            (modes, cost) = (next, now);
            if gained < 1e-4 * cost {
                break;
            }
        }
        Some((cost, modes))
    }

    /// Where the problem linearised in weights and modes has its solution.
    fn goal(&self, modes: &[Mode], edges: (f64, f64)) -> Vec<Mode> {
        let behind = self.behind(modes);
        let (_, weights) = self.fit(&behind.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let all: Vec<&Vec<f64>> = behind.iter().flatten().collect();
        let nudge = 1e-4;
        let mut slopes: Vec<Vec<f64>> = Vec::new();
        let mut first = 0;
        for (i, mode) in modes.iter().enumerate() {
            let count = behind[i].len();
            let input: Vec<f64> = {
                let inputs = if i == 0 { &self.columns[..] } else { &self.few[..1] };
                let part = &weights[first..first + count];
                let at = |k: usize| inputs.iter().zip(part).map(|(one, w)| w * one[k]).sum();
                (0..self.drive.u.len()).map(at).collect()
            };
            first += count;
            let run = |mode: Mode| {
                let steps = Steps::new(mode.dynamics(), &self.drive)?;
                let [moved] = steps.of([&input]);
                Some(moved)
            };
            for axis in 0..2 {
                let mut other = *mode;
                other.0[axis] += nudge;
                let pair = (run(other), run(*mode));
                let (Some(more), Some(less)) = pair else { return modes.to_vec() };
                slopes.push(more.iter().zip(&less).map(|(a, b)| (a - b) / nudge).collect());
            }
        }
        let unknowns = all.len() + 2 + slopes.len();
        let mut rows = Rows::new(unknowns);
        let mut row = vec![1.0; unknowns];
        for (&k, y) in self.rows.iter().zip(&self.y) {
            for (slot, column) in row.iter_mut().zip(&all) {
                *slot = column[k];
            }
            row[all.len() + 1] = index(k) / index(self.drive.u.len());
            for (slot, slope) in row[all.len() + 2..].iter_mut().zip(&slopes) {
                *slot = slope[k];
            }
            rows.push(&row, *y);
        }
        let mut bounds = vec![FREE; all.len() + 2];
        let lowest = [libm::log(edges.0), libm::log(DAMPING.0)];
        let highest = [libm::log(edges.1), libm::log(DAMPING.1)];
        for mode in modes {
            // A narrow peak is left by no more than a few of its widths.
            let wide = (3.0 * libm::exp(mode.0[1])).clamp(0.01, 0.3);
            for (axis, stride) in [wide, LN_2].into_iter().enumerate() {
                let at = mode.0[axis];
                bounds.push((
                    f64::max(lowest[axis] - at, -stride).min(0.0),
                    f64::min(highest[axis] - at, stride).max(0.0),
                ));
            }
        }
        let found = rows.solve(&bounds);
        let steps = found[all.len() + 2..].chunks(2);
        let moved = |(mode, step): (&Mode, &[f64])| {
            Mode([mode.0[0] + step[0], mode.0[1] + step.get(1).copied().unwrap_or(0.0)])
        };
        modes.iter().zip(steps).map(moved).collect()
    }
}

fn mix(a: Mode, b: Mode, part: f64) -> Mode {
    Mode([0, 1].map(|axis| a.0[axis] + part * (b.0[axis] - a.0[axis])))
}

/// A signal less its mean.
fn centred(mut signal: Vec<f64>) -> Vec<f64> {
    let mean = signal.iter().sum::<f64>() / index(signal.len());
    for value in &mut signal {
        *value -= mean;
    }
    signal
}
