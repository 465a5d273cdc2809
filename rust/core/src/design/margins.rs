//! Margins of the sampled loop and its frequency response.

use core::f64::consts::{PI, TAU};

use piezotrack_control::Filter;

use super::argument_principle::{Peak, Place};
use super::linear_feedback::LinearFeedback;
use super::plant::LoopPlant;
use super::sampled_loop::SampledLoop;
use crate::error::{Error, Result};
use crate::math::C;

/// Lowest angle at which margins are evaluated, rad.
const SLOWEST: f64 = 1e-9;

/// Distances of a loop from instability; meaningful for a stable loop only.
///
/// On the unit circle, `z = exp(i w Ts)`, with L the open loop and S = 1/(1 + L); see Franklin,
/// Powell and Workman, Digital Control of Dynamic Systems, 3rd edition, section 7.4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Whether the loop is stable.
    pub stable: bool,
    /// Factor by which the loop gain may rise until instability, infinite where there is none;
    /// of an unstable loop, the factor, below 1, that would make it stable. `None` where no gain
    /// would.
    pub gain: Option<f64>,
    /// Where the phase is -180 degrees at that gain, Hz.
    pub gain_frequency: Option<f64>,
    /// Angle between L and -1 where |L| = 1, rad, the smallest; `None` where |L| is never 1.
    pub phase: Option<f64>,
    /// Where that is, Hz.
    pub phase_frequency: Option<f64>,
    /// Delay that turns L to -1 where |L| = 1, s, the shortest.
    ///
    /// It takes a delay for a factor `exp(-i w delay)`, right for whole samples.
    pub delay: Option<f64>,
    /// The highest frequency at which |L| = 1, Hz.
    pub crossover: Option<f64>,
    /// Ms, the largest |S|: 1/Ms is the distance of L from -1.
    pub sensitivity: f64,
    /// Where |S| is largest, Hz.
    pub sensitivity_frequency: f64,
}

/// The loop at some frequencies, for plots: `[real, imaginary]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Frequencies, Hz.
    pub frequency: Vec<f64>,
    /// Open loop L; infinite at a pole.
    pub open: Vec<[f64; 2]>,
    /// Sensitivity S = 1/(1 + L), from reference to error.
    pub sensitivity: Vec<[f64; 2]>,
    /// From the reference to the filtered displacement: T = L/(1 + L), but for a law that damps by
    /// the displacement alone, of which T = G F C/(1 + L), C the part that tracks.
    pub complementary: Vec<[f64; 2]>,
    /// |Q (1 - z^lead Kq G F/(1 + G F C))|, what a period leaves of what the last one knew; 0
    /// without a repetitive part.
    pub learning: Vec<f64>,
}

/// The margins of a plant with a feedback law and filters of the measurement, every `dt` s.
///
/// # Errors
/// As [`SampledLoop::new`].
///
/// ```
/// use piezotrack_control::Pid;
/// use piezotrack_core::design::{LoopPlant, margins};
///
/// let pid = Pid::xu_li_2010().at(0.02).expect("published");
/// let margins = margins(&LoopPlant::fixed_gain(1.0e-6)?, &pid, &[], 0.02)?;
/// assert!((margins.gain.unwrap_or(0.0) - 1.28).abs() < 0.001);
/// # Ok::<(), piezotrack_core::Error>(())
/// ```
pub fn margins(
    plant: &LoopPlant,
    feedback: &impl LinearFeedback,
    filters: &[Filter],
    dt: f64,
) -> Result<Margins> {
    Ok(SampledLoop::new(plant, feedback, filters, None, dt)?.margins())
}

impl SampledLoop {
    /// The margins of this loop, its repetitive part included.
    #[must_use]
    pub fn margins(&self) -> Margins {
        let mut out = Margins {
            stable: self.is_stable(),
            gain: None,
            gain_frequency: None,
            phase: None,
            phase_frequency: None,
            delay: None,
            crossover: None,
            sensitivity: 0.0,
            sensitivity_frequency: 0.0,
        };
        if let Some(range) = self.stable_gains() {
            out.gain = Some(range.high);
            let crossings = self.phase_crossings();
            let at = crossings.iter().find(|(_, open)| (open.re * range.high + 1.0).abs() < 1e-9);
            out.gain_frequency = at.map(|(theta, _)| self.hertz(*theta));
        }
        let turn = |place: &Place| place.turn_open().norm().max(place.turn_closed().norm()) * 4.0;
        let sensitivity = |place: &Place| place.parts.a.value.norm() / place.closed().value.norm();
        let mut peak = Peak::default();
        self.sweep(1.0, SLOWEST, turn, |left, right| {
            self.crossover(&mut out, left, right);
            peak.take(left.theta, right.theta, sensitivity(right));
        });
        let peak = peak.refine(|theta| sensitivity(&self.place(1.0, theta)));
        out.sensitivity = peak.height;
        out.sensitivity_frequency = self.hertz(peak.theta);
        out
    }

    /// Where |L| passes 1 between two places, if it does.
    fn crossover(&self, out: &mut Margins, left: &Place, right: &Place) {
        let size = |place: &Place| place.parts.b.value.norm() - place.parts.a.value.norm();
        if (size(left) > 0.0) != (size(right) > 0.0) {
            let place = self.between(left, right, size);
            let angle = (-place.open()).arg();
            let hertz = self.hertz(place.theta);
            if out.phase.is_none_or(|least| angle.abs() < least) {
                out.phase = Some(angle.abs());
                out.phase_frequency = Some(hertz);
            }
            let delay = (if angle < 0.0 { angle + TAU } else { angle }) / (TAU * hertz);
            out.delay = Some(out.delay.map_or(delay, |least| least.min(delay)));
            out.crossover = Some(hertz);
        }
    }

    /// Open loop, sensitivities and learning at frequencies in Hz, up to half the sampling rate.
    ///
    /// # Errors
    /// Names `frequency` where one is below 0 or above half the sampling rate.
    pub fn response(&self, frequency: &[f64]) -> Result<Response> {
        let mut out = Response {
            frequency: frequency.to_vec(),
            open: Vec::with_capacity(frequency.len()),
            sensitivity: Vec::with_capacity(frequency.len()),
            complementary: Vec::with_capacity(frequency.len()),
            learning: Vec::with_capacity(frequency.len()),
        };
        let pair = |value: C| [value.re, value.im];
        for &hertz in frequency {
            let theta = TAU * hertz * self.dt();
            if !(0.0..=PI * (1.0 + 1e-12)).contains(&theta) {
                let expected = "from 0 to half the sampling rate";
                return Err(Error::parameter("frequency", format!("{hertz} Hz"), expected));
            }
            let place = self.place(1.0, theta);
            let closed = place.closed().value;
            out.open.push(pair(place.open()));
            out.sensitivity.push(pair(place.parts.a.value / closed));
            out.complementary.push(pair(self.complementary(place.delta)));
            out.learning.push(self.learning_gain(place.delta).norm());
        }
        Ok(out)
    }

    /// An angle on the circle as a frequency, Hz.
    pub(crate) fn hertz(&self, theta: f64) -> f64 {
        theta / (TAU * self.dt())
    }
}
