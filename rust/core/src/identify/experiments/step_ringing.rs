//! The ringing after a step: peaks, period, decay and the level it ends at.

use crate::error::{Error, Result};
use crate::signal::index;

/// Overshoots below this share of the steady state are not read.
const SMALLEST: f64 = 0.02;
/// Nor are those below so many times the noise.
const ABOVE_NOISE: f64 = 5.0;
/// Number of time constants after which nothing is read.
const LATEST: f64 = 12.0;
/// Nor what comes later than so many periods.
const MOST_PERIODS: f64 = 1000.0;

/// A point where the displacement turns back, beyond the steady state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Time from the first sample, s.
    pub time: f64,
    /// Displacement from rest, m.
    pub displacement: f64,
}

/// A damped oscillation about a level.
#[derive(Clone, Debug)]
pub struct Ringing {
    /// The level, m.
    pub steady: f64,
    /// Overshoot peaks, two or more.
    pub peaks: Vec<Peak>,
    /// Period, s.
    pub period: f64,
    /// Logarithmic decrement.
    pub decrement: f64,
    /// Samples that were read.
    pub used: usize,
    /// Samples at their end that gave the level.
    pub settled: usize,
}

/// Logarithmic decrement of successive overshoots: their own for two, else the straight line
/// through the logarithms, weighted as equal errors of the overshoots ask.
pub(in crate::identify) fn decrement(over: &[f64]) -> f64 {
    -slope(over, |k| libm::log(over[k]))
}

/// Slope of a value over the number of the peak, weighted with the overshoot squared.
fn slope(over: &[f64], value: impl Fn(usize) -> f64) -> f64 {
    let weight = |k: usize| over[k] * over[k] / (over[0] * over[0]);
    let sum = |of: &dyn Fn(usize) -> f64| (0..over.len()).map(|k| weight(k) * of(k)).sum::<f64>();
    let total = sum(&|_| 1.0);
    let (middle, level) = (sum(&index) / total, sum(&value) / total);
    let spread = sum(&|k| (index(k) - middle) * (index(k) - middle));
    sum(&|k| (index(k) - middle) * (value(k) - level)) / spread
}

/// Mean, 0 of nothing.
pub fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { values.iter().sum::<f64>() / index(values.len()) }
}

impl Ringing {
    /// Reads a response from rest at 0, its first sample the last one before the step.
    ///
    /// # Errors
    /// [`Error::Data`] where fewer than two peaks stand out, or they do not decay.
    pub fn read(x: &[f64], dt: f64, noise: f64) -> Result<Self> {
        let quarter = (x.len() / 4).max(1);
        let mut found = Self {
            steady: mean(&x[x.len() - quarter..]),
            peaks: Vec::new(),
            period: 0.0,
            decrement: 0.0,
            used: x.len(),
            settled: quarter,
        };
        if found.steady.abs() <= ABOVE_NOISE * noise {
            return Err(Error::Data(format!(
                "the displacement does not answer the step: it ends {:.3e} m from where it was, \
                 in a noise of {noise:.3e} m: the sensor seems dead or not connected",
                found.steady
            )));
        }
        // Period and decay say where to look for the level, and the level where the peaks are.
        for _ in 0..3 {
            found.look(x, dt, noise)?;
            found.settle(x, dt);
        }
        found.look(x, dt, noise)?;
        Ok(found)
    }

    /// Finds the peaks about the present level.
    fn look(&mut self, x: &[f64], dt: f64, noise: f64) -> Result<()> {
        let sign = self.steady.signum();
        let least = f64::max(SMALLEST * self.steady.abs(), ABOVE_NOISE * noise);
        let over: Vec<f64> = x[..self.used].iter().map(|v| sign * (v - self.steady)).collect();
        let tops = tops(&over, least);
        let half = (0.08 * self.period / dt).max(1.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        let half = half.round() as usize;
        let fine: Vec<(f64, f64)> = tops.iter().map(|&k| vertex(&over, k, half)).collect();
        // Noise can make a peak near the end higher than the one before: the series ends there.
        let falling = 1 + fine.windows(2).take_while(|pair| pair[1].1 < pair[0].1).count();
        let fine = &fine[..falling.min(fine.len())];
        if fine.len() < 2 {
            return Err(self.refusal(&over, fine.len(), tops.len(), dt));
        }
        let heights: Vec<f64> = fine.iter().map(|peak| peak.1).collect();
        self.period = dt * slope(&heights, |k| fine[k].0);
        self.decrement = decrement(&heights);
        self.peaks = fine
            .iter()
            .map(|&(at, height)| Peak { time: dt * at, displacement: self.steady + sign * height })
            .collect();
        Ok(())
    }

    /// Takes the level from the whole periods at the end of the usable part.
    fn settle(&mut self, x: &[f64], dt: f64) {
        let period = self.period / dt;
        let most = f64::min(LATEST * period / self.decrement, MOST_PERIODS * period);
        let until = |samples: f64| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
            let samples = samples.min(index(x.len())).round() as usize;
            samples.max(2)
        };
        self.used = until(most);
        let periods = (0.25 * index(self.used) / period).floor().max(1.0);
        self.settled = until((periods * period).min(index(self.used)));
        self.steady = mean(&x[self.used - self.settled..self.used]);
    }

    /// Why there are too few peaks.
    fn refusal(&self, over: &[f64], falling: usize, tops: usize, dt: f64) -> Error {
        let (n, steady) = (over.len(), self.steady.abs());
        let (late, later) = (mean(&over[3 * n / 4..7 * n / 8]), mean(&over[7 * n / 8..]));
        let moves = (later - late).abs() > SMALLEST * steady;
        if tops > falling {
            return Error::Data(
                "the ringing after the step does not decay: its second peak is as high as the \
                 first; (9) and (13) need one that does"
                    .into(),
            );
        }
        let length = dt * index(n);
        if moves || falling == 1 {
            let seen = if falling == 1 { "one overshoot" } else { "no overshoot" };
            let why = if moves {
                "and still moves at its end: the record is too short"
            } else {
                "and no second one stands out: the record is too short, or the stage too strongly \
                 damped; a1 and a2 need two, (9) to (13)"
            };
            return Error::Data(format!(
                "the displacement shows {seen} in the {length:.4} s after the step {why}"
            ));
        }
        Error::Data(format!(
            "the displacement goes to {:.4} um without an overshoot: the stage is overdamped, and \
             (9) to (13), which read a1, a2 and b1 off the overshoot, cannot be used; identify \
             from a drive that goes up and down instead",
            1e6 * self.steady
        ))
    }
}

/// Largest sample of each stretch above `least`, stretches separated by one below `-least`.
///
/// A stretch that has not turned back is none.
fn tops(over: &[f64], least: f64) -> Vec<usize> {
    let mut out = Vec::new();
    let mut top: Option<usize> = None;
    for (k, &value) in over.iter().enumerate() {
        if value < -least {
            out.extend(top.take());
        } else if value > least && top.is_none_or(|best| value > over[best]) {
            top = Some(k);
        }
    }
    out.extend(top.filter(|&best| over[best] - over[over.len() - 1] > 0.5 * least));
    out
}

/// Place and height of the parabola through the samples around a peak, by least squares.
fn vertex(over: &[f64], at: usize, half: usize) -> (f64, f64) {
    let plain = (index(at), over[at]);
    if at < half || at + half >= over.len() {
        return plain;
    }
    let reach = index(half);
    let (mut s2, mut s4, mut y0, mut y1, mut y2) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (k, &value) in over[at - half..=at + half].iter().enumerate() {
        let place = index(k) - reach;
        let square = place * place;
        s2 += square;
        s4 += square * square;
        y0 += value;
        y1 += place * value;
        y2 += square * value;
    }
    let s0 = 2.0 * reach + 1.0;
    let bend = (s0 * y2 - s2 * y0) / (s0 * s4 - s2 * s2);
    let (level, tilt) = ((y0 - bend * s2) / s0, y1 / s2);
    let shift = -tilt / (2.0 * bend);
    if bend < 0.0 && shift.abs() <= reach {
        (plain.0 + shift, level - tilt * tilt / (4.0 * bend))
    } else {
        plain
    }
}
