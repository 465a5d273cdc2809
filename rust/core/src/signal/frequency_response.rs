//! Frequency response from a step response, at any frequency.

use core::f64::consts::{PI, TAU};

use super::drive::{Hold, index};

/// Share of the record over which the window falls to zero.
const TAPER: f64 = 0.2;

/// Gain from drive to displacement, from the Fourier transforms of their changes.
///
/// The change from sample to sample of a step response is the response to an impulse. It is
/// there from the first sample on and dies out, so only the end of the record is windowed, by
/// half a cosine over the last fifth. Dividing by the transform of the drive's own change takes
/// out what its rise, seen in the record, does.
pub struct Spectrum {
    /// Windowed changes of drive and displacement.
    changes: Vec<(f64, f64)>,
    dt: f64,
    hold: Hold,
}

impl Spectrum {
    /// From the samples of a step, the first the last one before it.
    pub fn new(u: &[f64], x: &[f64], dt: f64, hold: Hold) -> Self {
        let n = u.len().saturating_sub(1);
        let from = (1.0 - TAPER) * index(n);
        let weight = |k: usize| {
            let over = (index(k) - from) / (TAPER * index(n));
            if over > 0.0 { 0.5 + 0.5 * libm::cos(PI * over) } else { 1.0 }
        };
        let changes = u
            .windows(2)
            .zip(x.windows(2))
            .enumerate()
            .map(|(k, (u, x))| (weight(k) * (u[1] - u[0]), weight(k) * (x[1] - x[0])))
            .collect();
        Self { changes, dt, hold }
    }

    /// Gain at a frequency in Hz.
    pub fn gain(&self, frequency: f64) -> f64 {
        let angle = TAU * frequency * self.dt;
        let (turn_re, turn_im) = (libm::cos(angle), -libm::sin(angle));
        let (mut re, mut im) = (1.0, 0.0);
        let (mut u, mut x) = ((0.0, 0.0), (0.0, 0.0));
        for &(du, dx) in &self.changes {
            u = (u.0 + du * re, u.1 + du * im);
            x = (x.0 + dx * re, x.1 + dx * im);
            (re, im) = (re * turn_re - im * turn_im, re * turn_im + im * turn_re);
        }
        let plain = libm::hypot(x.0, x.1) / libm::hypot(u.0, u.1);
        // A change from sample to sample is spread over the interval; so is the drive's on a
        // line, and none at an instant.
        let half = angle / 2.0;
        let spread = if half == 0.0 { 1.0 } else { libm::sin(half) / half };
        match self.hold {
            Hold::First | Hold::Jump => plain / (spread * spread),
            Hold::Zero => plain / spread,
        }
    }

    /// Frequency, Hz, and gain of the highest point near a frequency.
    pub fn peak(&self, near: f64) -> (f64, f64) {
        let top = f64::min(1.8 * near, 0.49 / self.dt);
        let grid = self.grid(0.4 * near, top, 4000);
        let (mut best, mut most) = (near, 0.0);
        for &frequency in &grid {
            let gain = self.gain(frequency);
            if gain > most {
                (best, most) = (frequency, gain);
            }
        }
        let step = grid.get(1).map_or(0.0, |second| second - grid[0]);
        // Golden section between the neighbours.
        let share = (5.0_f64.sqrt() - 1.0) / 2.0;
        let (mut low, mut high) = (best - step, best + step);
        for _ in 0..40 {
            let width = share * (high - low);
            if self.gain(high - width) < self.gain(low + width) {
                low = high - width;
            } else {
                high = low + width;
            }
        }
        let frequency = 0.5 * (low + high);
        (frequency, self.gain(frequency))
    }

    /// Frequencies, Hz, and gains of a curve to draw, up to four times a frequency.
    pub fn curve(&self, near: f64) -> (Vec<f64>, Vec<f64>) {
        let grid = self.grid(0.0, f64::min(4.0 * near, 0.5 / self.dt), 1000);
        let gains = grid.iter().map(|&frequency| self.gain(frequency)).collect();
        (grid, gains)
    }

    /// Frequencies four to each step that the record's length resolves.
    fn grid(&self, low: f64, high: f64, most: usize) -> Vec<f64> {
        let wanted = 4.0 * (high - low) * self.dt * index(self.changes.len());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        let count = (wanted.ceil() as usize).clamp(200, most);
        (0..=count).map(|k| low + (high - low) * index(k) / index(count)).collect()
    }
}
