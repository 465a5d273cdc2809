//! Plug-in repetitive controller: it learns the voltage that removes a periodic error.
//!
//! ```text
//! uRC[k] = p uRC[k-1] + (1-p) (uRC[k-N-1] + Kq e[k-N-1]),   p = exp(-Ts/Tq),  N = L/Ts
//! ```
//!
//! Xu and Li 2010, equations (26) to (28), doi 10.1115/1.4001712. The printed recursion, (29) and
//! (30), has a common factor that is not cancelled and coefficients of four digits: its pole at
//! 1.000172 grows by 4.4 % in a period. Here the delay line stores the sum `uRC + Kq e`, so that
//! one line is enough; the filter Q, the forgetting factor and a fractional delay are taps on it.
//! A second line keeps uRC alone, as what was learnt before saturation: see
//! [`SampledRepetitive::step`].

mod laned;
mod sampled;
mod saturation;

use saturation::Lengths;

pub(crate) use laned::{LanedRepetitive, Learner};
pub use sampled::{Recursion, RepetitiveState, SampledRepetitive};
pub use saturation::Outcome;

use crate::error::{Result, check, positive};

/// Taps of the cubic interpolation between two samples.
const CUBIC: usize = 4;
/// Taps on each side of the middle one in a zero-phase filter, at most.
const HALF: usize = 4;
/// Taps on the delay line, at most.
const TAPS: usize = 2 * HALF + CUBIC;
/// Longest period, in samples.
const LONGEST: f64 = 1e7;

/// The filter Q: what it passes is learnt; what it stops cannot make the learning unstable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Smoothing {
    /// First-order lag of time constant `tq`, s, as in the paper.
    ///
    /// It delays the learnt voltage by `tq`; with `compensated` the delay line is shorter by the
    /// same time.
    Lag {
        /// Time constant Tq, s.
        tq: f64,
        /// Whether the delay line makes up for the filter's lag.
        compensated: bool,
    },
    /// `((1 + cos(w Ts))/2)^order`, order 1 to 4, without phase lag: of the period before, the
    /// later samples are known too. The gain is 1/2 at 0.25 of the sampling rate for order 1, at
    /// 0.18 of it for order 2, at 0.13 for order 4.
    ZeroPhase {
        /// Order, 1 to 4.
        order: u32,
    },
    /// Q = the forgetting factor: all frequencies are learnt, which is stable only for a plant
    /// without delay.
    None,
}

impl Smoothing {
    /// Checks its numbers.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn check(&self) -> Result<()> {
        match *self {
            Self::Lag { tq, .. } => positive("tq", tq, "s").map(drop),
            Self::ZeroPhase { order } => {
                let right = (1..=4).contains(&order);
                check("order", f64::from(order), "", right, "1 to 4").map(drop)
            }
            Self::None => Ok(()),
        }
    }
}

/// Settings of a repetitive controller, in continuous time.
///
/// | field | symbol | unit | range | default |
/// | --- | --- | --- | --- | --- |
/// | `period` | L | s | two samples or more | |
/// | `smoothing` | Q, Tq | s | | |
/// | `kq` | Kq | V/um | 0 < Kq < 2 | |
/// | `forgetting_factor` | Q(1) | 1 | 0 < Q(1) <= 1 | 0.99 |
/// | `lead` | m | samples | shorter than the period | 0 |
/// | `pause` | | | | true |
///
/// `kq` is in V/um, unlike all other parameters, because the bound of equation (28),
/// 0 < Kq < 2, holds for errors in um. The bound is necessary, not sufficient.
///
/// With an integrator in the feedback the loop has a root at exactly 1: constant parts of uRC and
/// uFB that cancel each other are not observable, and they drift under saturation.
/// `forgetting_factor` below 1 and `pause` (no learning from saturated samples) prevent this.
/// With `pause`, learning also stops as a whole, and what was learnt is held, while more than a
/// quarter of a period is saturated: such a reference is beyond the reach of the stage. Where what
/// is held would itself keep the command at a limit, half of it is forgotten in each period.
///
/// ```
/// use piezotrack_control::{Outcome, Repetitive, Smoothing};
///
/// let smoothing = Smoothing::Lag { tq: 0.2, compensated: true };
/// let learner = Repetitive::new(5.0, smoothing, 1.0)?.at(0.02)?;
/// let mut state = learner.rest([0.0; Repetitive::room(250)])?;
/// let before = Outcome { error: 1e-6, excess: 0.0 };
/// let volts = learner.step(&mut state, before, 75.0);
/// assert_eq!(volts, 0.0); // there is no period to learn from yet
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repetitive {
    /// Period L of the reference, s; it need not be a whole number of samples.
    pub period: f64,
    /// The filter Q.
    pub smoothing: Smoothing,
    /// Learning gain Kq, V/um.
    pub kq: f64,
    /// Q(1), the share of a constant that is kept from period to period.
    pub forgetting_factor: f64,
    /// Number of samples by which an error is stored earlier, to compensate the delay of the
    /// plant. The voltage stored beside it is not shifted: that would change the period.
    pub lead: u32,
    /// Whether learning pauses under saturation.
    pub pause: bool,
}

impl Repetitive {
    /// A controller with the defaults of the table: `period` in s, `kq` in V/um.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(period: f64, smoothing: Smoothing, kq: f64) -> Result<Self> {
        let settings =
            Self { period, smoothing, kq, forgetting_factor: 0.99, lead: 0, pause: true };
        settings.check()?;
        Ok(settings)
    }

    /// The paper's form: Tq = 0.2 s, Kq = 1.0 V/um, no forgetting factor, no pause under
    /// saturation.
    ///
    /// Xu and Li 2010, section 4.3, with L = 5 s for 0.2 Hz and 2 s for 0.5 Hz.
    #[must_use]
    pub fn xu_li_2010(period: f64) -> Self {
        let smoothing = Smoothing::Lag { tq: 0.2, compensated: false };
        Self { period, smoothing, kq: 1.0, forgetting_factor: 1.0, lead: 0, pause: false }
    }

    /// Entries that suffice for a period of `period` samples (rounded up), for a fixed-size array.
    #[must_use]
    pub const fn room(period: usize) -> usize {
        period.saturating_add(HALF + CUBIC).saturating_mul(2)
    }

    /// Checks the numbers, as far as that can be without a sampling interval.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn check(&self) -> Result<()> {
        positive("period", self.period, "s")?;
        let right = self.kq > 0.0 && self.kq < 2.0;
        check("kq", self.kq, "V/um", right, "a gain above 0 and below 2, not included")?;
        let right = self.forgetting_factor > 0.0 && self.forgetting_factor <= 1.0;
        check("forgetting_factor", self.forgetting_factor, "", right, "a gain above 0, at most 1")?;
        self.smoothing.check()
    }

    /// The controller for a sampling interval `dt`, s.
    ///
    /// # Errors
    /// Names the parameter that is out of its range: `period` where it is under two samples or
    /// shorter than the filter needs, `lead` where the period leaves no room for it.
    pub fn at(&self, dt: f64) -> Result<SampledRepetitive> {
        self.check()?;
        positive("dt", dt, "s")?;
        let samples = self.period / dt;
        // Two samples given in decimals may miss 2 by rounding.
        let right = (2.0 - 1e-9..=LONGEST).contains(&samples);
        check("period", self.period, "s", right, "from 2 to 1e7 sampling intervals")?;

        let mut q = [0.0; HALF + 1];
        q[0] = 1.0;
        let (mut pole, mut half) = (0.0, 0);
        let mut delay = samples;
        match self.smoothing {
            Smoothing::Lag { tq, compensated } => {
                pole = libm::exp(-dt / tq);
                // The zero-order hold of the lag delays by one sample; the rest is Tq.
                delay += if compensated { 1.0 - tq / dt } else { 1.0 };
            }
            Smoothing::ZeroPhase { order } => (q, half) = binomial(order),
            Smoothing::None => {}
        }
        let shortest = samples - delay + count(half) + 1.0;
        let right = samples >= shortest;
        let expected = "longer than the sum of the filter's lag and one sample";
        check("period", self.period, "s", right, expected)?;
        let sampled = self.taps(delay, pole, &q, half).for_period(samples);
        let right = sampled.lead < sampled.nearest;
        check("lead", f64::from(self.lead), "samples", right, "less than the period allows")?;
        Ok(sampled)
    }

    /// Convolves the filter with the cubic that reads the line at a fractional delay.
    fn taps(&self, delay: f64, pole: f64, q: &[f64; HALF + 1], half: usize) -> SampledRepetitive {
        // A period given in decimals is a whole number of samples only up to rounding.
        let nearest = libm::round(delay);
        let whole = if (delay - nearest).abs() < 1e-9 * delay { nearest } else { delay };
        let mut floor = libm::floor(whole);
        let mut part = whole - floor;
        // The cubic needs one sample on each side of its interval. Beyond the newest sample
        // there is none, so that close to it the outermost interval of the cubic is used.
        let newest = count(half) + 1.0;
        let (before, reads) = if part > 0.0 {
            if floor - 1.0 < newest {
                floor += 1.0;
                part -= 1.0;
            }
            (1.0, CUBIC)
        } else {
            (0.0, 1)
        };
        let cubic = if reads == 1 { [1.0, 0.0, 0.0, 0.0] } else { lagrange(part) };
        let mut taps = [0.0; TAPS];
        let gain = self.forgetting_factor * (1.0 - pole);
        for (i, read) in cubic.iter().take(reads).enumerate() {
            for j in 0..=2 * half {
                taps[i + j] += gain * read * q[j.abs_diff(half)];
            }
        }
        let reads = reads + 2 * half;
        if let Some(used) = taps.get_mut(..reads) {
            used.reverse();
        }
        SampledRepetitive {
            lengths: Lengths { period: delay, rest: 0.0, whole: 0, entries: 0 },
            pole,
            gain: self.kq * 1e6,
            pause: self.pause,
            lead: self.lead as usize,
            nearest: samples(floor - before) - half,
            taps,
            reads,
            entries: 0,
            unread: 0,
        }
    }
}

/// Taps of `((1 + cos w)/2)^order` from the middle outwards, and their number on each side.
fn binomial(order: u32) -> ([f64; HALF + 1], usize) {
    let half = if order > 4 { HALF } else { order as usize };
    let mut q = [0.0; HALF + 1];
    q[0] = 1.0;
    for _ in 0..half {
        let old = q;
        for j in 0..=half {
            let outer = if j < half { old[j + 1] } else { 0.0 };
            let inner = if j == 0 { old[1] } else { old[j - 1] };
            q[j] = 0.5 * old[j] + 0.25 * (inner + outer);
        }
    }
    (q, half)
}

/// Weights of the samples at -1, 0, 1 and 2 for the cubic through them, evaluated at `part`.
fn lagrange(part: f64) -> [f64; CUBIC] {
    let (up, down, far) = (part + 1.0, part - 1.0, part - 2.0);
    [
        -part * down * far / 6.0,
        up * down * far / 2.0,
        -up * part * far / 2.0,
        up * part * down / 6.0,
    ]
}

/// A small index as a number.
fn count(n: usize) -> f64 {
    u32::try_from(n).map_or(f64::NAN, f64::from)
}

/// A whole number of samples; the caller has checked that it is from 0 to [`LONGEST`].
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
fn samples(value: f64) -> usize {
    value as usize
}
