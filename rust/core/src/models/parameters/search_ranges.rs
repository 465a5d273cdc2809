//! Ranges in which parameters are searched where the caller gave none, from the record.
//!
//! Voltage and displacement determine ratios: the gain T/K, the viscous time D/K, the mass over
//! the stiffness, and the hysteresis force relative to the elastic one. Each ratio gets a generous
//! range from the stroke, the drive and the sampling, and the stiffness turns it into a range of
//! the parameter.

use super::values::Held;
use crate::signal::{Drive, index, range};

/// Stiffness held where nothing in the input determines a force, N/m.
pub const NOMINAL_STIFFNESS: f64 = 1e6;

/// Least lag D/K that is searched, as a share of the sampling interval.
const LEAST_LAG: f64 = 0.05;

/// Least phase of a lag under the drive, rad: its part of the travel.
const LEAST_PHASE: f64 = 1e-4;

/// Highest natural frequency of a mode, in cycles a sample: above half of one, the drive between the
/// samples distinguishes it from the slower mode that rings alike at them.
pub const HIGHEST_MODE: f64 = 0.75;

/// Natural frequencies over that of a mode which the record shows: hysteresis stiffens a stage.
const NEAR_MODE: Range = (0.6, 1.3);

/// Damping ratios of a mode which the record shows.
const MODE_DAMPING: Range = (0.003, 2.0);
/// Quickness of a drive over its frequency up to which it is one sine: a chirp has 1.3, whatever
/// its ends.
const SINE: f64 = 1.15;
/// Samples before the window of a record that begins with a jump.
const JUMP: usize = 2;

/// Lower and upper end of a range.
pub type Range = (f64, f64);

/// Ranges by the names of the parameters.
pub type Ranges = Vec<(&'static str, Range)>;

/// Mode as a record shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ModeShown {
    /// It was not looked through for one.
    NotLooked,
    /// No mode.
    Absent,
    /// Something that may be one.
    Faint,
    /// A mode, of this natural frequency, rad/s.
    Clear(f64),
}

/// Measures of a record from which the ranges are built.
#[derive(Clone, Copy, Debug)]
pub struct Measures {
    /// Range of the displacement, m.
    pub stroke: f64,
    /// Stroke over the range of the drive, m/V.
    pub gain: f64,
    /// Whether the displacement falls where the drive rises.
    pub inverted: bool,
    /// Rate of change of the drive over its size, rad/s: the frequency of a sine.
    pub frequency: f64,
    /// The lower of that and two periods in the window, rad/s: of steps, the former is far above
    /// what moves the stage.
    pub slow: f64,
    /// Rate of change of the drive's rate over that rate, rad/s: the frequency of a sine, far more
    /// where the drive jumps or sweeps.
    pub quickness: f64,
    /// Whether the caller asks for a mode, whatever the record shows.
    pub wants_mode: bool,
    /// Mode as the record shows it.
    pub mode: ModeShown,
    /// Sampling interval, s.
    pub dt: f64,
    /// RMS of the drive about its mean, V or N.
    pub drive_size: f64,
    /// RMS of the displacement about its mean, m.
    pub displacement_size: f64,
    /// Rate of change of the displacement over its size, rad/s.
    pub displacement_rate: f64,
}

impl Measures {
    /// Measures a drive and the displacement `y` (m) under it, in the samples that count.
    #[must_use]
    pub fn of(drive: &Drive<'_>, y: &[f64], window: core::ops::Range<usize>) -> Self {
        let (u, y, dt) = (&drive.u[window.clone()], &y[window.clone()], drive.dt);
        let ((low, high), (least, most)) = (range(u), range(y));
        let stroke = most - least;
        let mean = u.iter().sum::<f64>() / index(u.len());
        let (drive_size, frequency) = size_and_rate(u, dt);
        let (displacement_size, displacement_rate) = size_and_rate(y, dt);
        let level = y.iter().sum::<f64>() / index(y.len());
        let together: f64 = u.iter().zip(y).map(|(u, y)| (u - mean) * (y - level)).sum();
        let gain = stroke / (high - low);
        let twice = 2.0 * core::f64::consts::TAU / (index(u.len()) * dt);
        // A jump at the beginning of a record moves the stage, though its window begins after it.
        let begun = if window.start <= JUMP { 0 } else { window.start };
        let quickness = quickness(&drive.u[begun..window.end], dt);
        // One sine moves at its own rate, however long it is.
        let slow = if quickness < SINE * frequency { frequency } else { frequency.min(twice) };
        Self {
            stroke,
            gain,
            inverted: together < 0.0,
            frequency,
            slow,
            quickness,
            wants_mode: false,
            mode: ModeShown::NotLooked,
            dt,
            drive_size,
            displacement_size,
            displacement_rate,
        }
    }

    /// Whether numbers of this size can be computed with.
    #[must_use]
    pub fn usable(&self) -> bool {
        let usable = |value: f64| (1e-60..1e60).contains(&value);
        [self.stroke, self.gain, self.frequency, self.dt].into_iter().all(usable)
    }

    /// Longest delay that is searched, s: twenty samples or a tenth of the drive's period.
    #[must_use]
    pub fn longest_delay(&self) -> f64 {
        (20.0 * self.dt).min(0.1 * core::f64::consts::TAU / self.frequency)
    }

    /// Natural frequencies at which the drive could excite a mode, rad/s: from three times the
    /// slowest motion to [`HIGHEST_MODE`]. `None` for a drive that is slow
    /// all the time, and where the record shows no mode.
    #[must_use]
    pub fn excited(&self) -> Option<Range> {
        let slowest = 3.0 * self.slow;
        let highest = HIGHEST_MODE * core::f64::consts::TAU / self.dt;
        let fastest = highest.min(10.0 * self.quickness);
        if self.wants_mode {
            return Some((slowest, fastest.max(8.0 * slowest)));
        }
        let quick = fastest > 8.0 * slowest && self.mode != ModeShown::Absent;
        // What may be a mode may also be what hysteresis makes of a stage far quicker.
        let faint = self.mode == ModeShown::Faint;
        let fastest = if faint { highest } else { fastest };
        quick.then_some((slowest, fastest))
    }

    /// Ranges of mass, damping and stiffness between a soft and a hard stiffness, N/m.
    ///
    /// Where the record does not show a mode, the mass is that of a mode so fast that it does not
    /// matter, and the damping, a lag D/K, down to a twentieth of the sampling interval
    /// or to what hardly moves the phase of the drive.
    #[must_use]
    pub fn mechanical(&self, (soft, hard): Range) -> [Range; 3] {
        if let ModeShown::Clear(mode) = self.mode {
            let (slowest, fastest) = (mode * NEAR_MODE.0, mode * NEAR_MODE.1);
            let mass = (soft / (fastest * fastest), hard / (slowest * slowest));
            let (least, most) = MODE_DAMPING;
            return [
                mass,
                (2.0 * least * soft / fastest, 2.0 * most * hard / slowest),
                (soft, hard),
            ];
        }
        let least = (LEAST_LAG * self.dt).min(LEAST_PHASE / self.frequency);
        let mass = self.excited().map_or_else(
            || {
                let mass = libm::sqrt(soft * hard) * (0.5 * least) * (0.5 * least);
                (mass, mass)
            },
            |(slowest, fastest)| (soft / (fastest * fastest), hard / (slowest * slowest)),
        );
        [mass, (soft * least, hard / self.slow), (soft, hard)]
    }

    /// Range of a piezo coefficient of about `least` to `most`, of the sign that the record shows.
    #[must_use]
    pub fn piezo(&self, least: f64, most: f64) -> Range {
        let (low, high) = (least / 3.0, most * 3.0);
        if self.inverted { (-high, -low) } else { (low, high) }
    }

    /// Range of the stiffness from whichever parameter that carries force is held; `hints` are
    /// stiffnesses that parameters of the hysteresis tell, to a factor of 30.
    #[must_use]
    pub fn stiffness(&self, held: &Held, piezo: Option<f64>, hints: &[Option<f64>]) -> Range {
        let around = |value: f64, factor: f64| (value.abs() / factor, value.abs() * factor);
        let not_zero = |value: &f64| *value != 0.0;
        if let Some(value) = held.value("stiffness") {
            (value, value)
        } else if let Some(value) = piezo {
            around(value / self.gain, 3.0)
        } else if let Some(value) = hints.iter().copied().flatten().find(not_zero) {
            around(value, 30.0)
        } else if let Some(value) = held.value("damping").filter(not_zero) {
            (value * self.frequency, value * self.frequency * 1e3)
        } else if let Some(value) = held.value("mass") {
            let slowest = 3.0 * self.frequency;
            (value * slowest * slowest, value * slowest * slowest * 1e4)
        } else {
            (NOMINAL_STIFFNESS, NOMINAL_STIFFNESS)
        }
    }
}

/// RMS about the mean, and the rate of change over it, rad/s: amplitude and frequency of a sine.
fn size_and_rate(values: &[f64], dt: f64) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / index(values.len());
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    let change: f64 = values.windows(2).map(|w| (w[1] - w[0]) * (w[1] - w[0])).sum();
    (libm::sqrt(squares / index(values.len())), libm::sqrt(change / squares) / dt)
}

/// Rate of change of the rate of change, over the latter, rad/s.
fn quickness(values: &[f64], dt: f64) -> f64 {
    let first: f64 = values.windows(2).map(|w| (w[1] - w[0]) * (w[1] - w[0])).sum();
    let bend = |w: &[f64]| w[2] - 2.0 * w[1] + w[0];
    let second: f64 = values.windows(3).map(|w| bend(w) * bend(w)).sum();
    libm::sqrt(second / first) / dt
}
