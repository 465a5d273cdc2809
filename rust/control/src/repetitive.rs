//! Plug-in repetitive controller: it learns the voltage that removes a periodic error.
//!
//! ```text
//! uRC[k] = p uRC[k-1] + (1-p) (uRC[k-N-1] + Kq e[k-N-1]),   p = exp(-Ts/Tq),  N = L/Ts
//! ```
//!
//! Xu and Li 2010, equations (26) to (28), doi 10.1115/1.4001712. The printed recursion, (29) and
//! (30), has a common factor that is not cancelled and coefficients of four digits: its pole at
//! 1.000172 grows by 4.4 % in a period. Here the delay line stores the sum `uRC + Kq e`, so that
//! one line is enough; the filter Q, the leak and a fractional delay are taps on it.

use crate::error::{Error, Result, check, positive};

/// Taps of the cubic interpolation between two samples.
const CUBIC: usize = 4;
/// Taps on each side of the middle one in a zero-phase filter, at most.
const HALF: usize = 4;
/// Taps on the delay line, at most.
const TAPS: usize = 2 * HALF + CUBIC;
/// Longest period, in samples.
const LONGEST: f64 = 1e9;

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
    /// Q = leak: all frequencies are learnt, which is stable only for a plant without delay.
    None,
}

/// Settings of a repetitive controller, in continuous time.
///
/// | field | symbol | unit | range | default |
/// | --- | --- | --- | --- | --- |
/// | `period` | L | s | two samples or more | |
/// | `smoothing` | Q, Tq | s | | |
/// | `kq` | Kq | V/um | 0 < Kq < 2 | |
/// | `leak` | Q(1) | 1 | 0 < Q(1) <= 1 | 0.99 |
/// | `lead` | m | samples | shorter than the period | 0 |
/// | `pause` | | | | true |
///
/// `kq` is in V/um, unlike all other parameters, because the bound of equation (28),
/// 0 < Kq < 2, holds for errors in um. The bound is necessary, not sufficient.
///
/// With an integrator in the feedback the loop has a root at exactly 1: constant parts of uRC and
/// uFB that cancel each other are not observable, and they drift under saturation. `leak` below 1
/// and `pause` (no learning from saturated samples) prevent this.
///
/// ```
/// use piezotrack_control::{Repetitive, Smoothing};
///
/// let smoothing = Smoothing::Lag { tq: 0.2, compensated: true };
/// let learner = Repetitive::new(5.0, smoothing, 1.0)?.at(0.02)?;
/// let mut state = learner.rest([0.0; 256])?;
/// let volts = learner.step(&mut state, 1e-6, false);
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
    pub leak: f64,
    /// Number of samples by which an error is stored earlier, to compensate the delay of the
    /// plant. The voltage stored beside it is not shifted: that would change the period.
    pub lead: u32,
    /// Whether the error of a saturated sample is stored as 0.
    pub pause: bool,
}

impl Repetitive {
    /// A controller with the defaults of the table: `period` in s, `kq` in V/um.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(period: f64, smoothing: Smoothing, kq: f64) -> Result<Self> {
        let settings = Self { period, smoothing, kq, leak: 0.99, lead: 0, pause: true };
        settings.check()?;
        Ok(settings)
    }

    /// The paper's form: Tq = 0.2 s, Kq = 1.0 V/um, no leak, no pause under saturation.
    ///
    /// Xu and Li 2010, section 4.3, with L = 5 s for 0.2 Hz and 2 s for 0.5 Hz.
    #[must_use]
    pub fn xu_li_2010(period: f64) -> Self {
        let smoothing = Smoothing::Lag { tq: 0.2, compensated: false };
        Self { period, smoothing, kq: 1.0, leak: 1.0, lead: 0, pause: false }
    }

    /// Entries that suffice for a period of `period` samples (rounded up), for a fixed-size array.
    #[must_use]
    pub const fn room(period: usize) -> usize {
        period.saturating_add(HALF + CUBIC)
    }

    fn check(&self) -> Result<()> {
        positive("period", self.period, "s")?;
        let right = self.kq > 0.0 && self.kq < 2.0;
        check("kq", self.kq, "V/um", right, "a gain above 0 and below 2, not included")?;
        let right = self.leak > 0.0 && self.leak <= 1.0;
        check("leak", self.leak, "", right, "a gain above 0, at most 1")?;
        match self.smoothing {
            Smoothing::Lag { tq, .. } => positive("tq", tq, "s").map(drop),
            Smoothing::ZeroPhase { order } => {
                let right = (1..=4).contains(&order);
                check("order", f64::from(order), "", right, "1 to 4").map(drop)
            }
            Smoothing::None => Ok(()),
        }
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
        check("period", self.period, "s", right, "from 2 to 1e9 sampling intervals")?;

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
        let expected = "longer than the filter's lag and one sample together";
        check("period", self.period, "s", right, expected)?;
        let sampled = SampledRepetitive { period: samples, ..self.taps(delay, pole, &q, half) };
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
        let gain = self.leak * (1.0 - pole);
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
            period: delay,
            pole,
            gain: self.kq * 1e6,
            pause: self.pause,
            lead: self.lead as usize,
            nearest: samples(floor - before) - half,
            taps,
            reads,
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

/// Coefficients of a repetitive controller for one sampling interval; see [`Repetitive::at`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledRepetitive {
    /// L/Ts.
    period: f64,
    /// p, 0 for a filter without memory.
    pole: f64,
    /// Kq, V/m.
    gain: f64,
    pause: bool,
    /// Number of entries by which an error is stored earlier.
    lead: usize,
    /// Delay of the first tap, in samples, 1 or more.
    nearest: usize,
    /// Weights of the samples, the oldest first; 0 where not in use.
    taps: [f64; TAPS],
    /// Number of taps in use.
    reads: usize,
}

/// Coefficients of a repetitive controller: see [`SampledRepetitive::recursion`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recursion<'a> {
    /// Period of the reference, in samples.
    pub period: f64,
    /// Pole p of the filter, 0 for a filter without memory.
    pub pole: f64,
    /// Learning gain Kq, V/m.
    pub gain: f64,
    /// Number of samples by which errors are stored earlier than voltages.
    pub lead: usize,
    /// Delay of the first tap, in samples, more than `lead`.
    pub nearest: usize,
    /// Weights of the samples, the oldest first; the last one has the delay `nearest`.
    pub taps: &'a [f64],
}

/// Sum of products in two independent sums, which the processor can compute in parallel.
#[inline]
fn weighted(entries: &[f64], taps: &[f64]) -> f64 {
    let (mut even, mut odd) = (0.0, 0.0);
    let mut pairs = entries.iter().zip(taps);
    while let Some((entry, tap)) = pairs.next() {
        even += entry * tap;
        if let Some((entry, tap)) = pairs.next() {
            odd += entry * tap;
        }
    }
    even + odd
}

/// State of a repetitive controller, with a delay line provided by the caller: `&mut [f64]`,
/// `[f64; N]` or `Vec<f64>`.
#[derive(Clone, Debug, PartialEq)]
pub struct RepetitiveState<L> {
    line: L,
    /// Index of the next entry to be written.
    next: usize,
    /// The last output, V.
    volts: f64,
}

impl SampledRepetitive {
    /// Least number of entries of the delay line.
    #[must_use]
    pub fn length(&self) -> usize {
        self.nearest + self.reads - 1
    }

    /// Coefficients of the recursion, for a stability analysis:
    /// `uRC[k] = pole uRC[k-1] + sum of tap (uRC[k-n] + gain e[k-n+lead])`, n the delay of a tap.
    #[must_use]
    pub fn recursion(&self) -> Recursion<'_> {
        Recursion {
            period: self.period,
            pole: self.pole,
            gain: self.gain,
            lead: self.lead,
            nearest: self.nearest,
            taps: self.taps.get(..self.reads).unwrap_or_default(),
        }
    }

    /// The state before any learning. `line` is filled with zeros.
    ///
    /// # Errors
    /// Names `line` where it is shorter than [`Self::length`].
    pub fn rest<L: AsMut<[f64]>>(&self, mut line: L) -> Result<RepetitiveState<L>> {
        let entries = line.as_mut();
        if entries.len() < self.length() {
            let value = count(entries.len());
            let expected = "at least as many as the controller's length()";
            return Err(Error { name: "line", value, unit: "entries", expected });
        }
        entries.fill(0.0);
        Ok(RepetitiveState { line, next: 0, volts: 0.0 })
    }

    /// The voltage for this sample, from the tracking error (m) of the sample *before*.
    ///
    /// An error affects the voltage of the next sample at the earliest, so it is passed one sample
    /// later, when it is also known whether that command was clipped (`saturated`). At the first
    /// sample there is no error yet: pass 0.
    #[inline]
    pub fn step<L: AsMut<[f64]>>(
        &self,
        state: &mut RepetitiveState<L>,
        error: f64,
        saturated: bool,
    ) -> f64 {
        let error = if (saturated && self.pause) || !error.is_finite() { 0.0 } else { error };
        let line = state.line.as_mut();
        let length = self.length();
        let Some(line) = line.get_mut(..length) else { return 0.0 };
        if let Some(entry) = line.get_mut(state.next) {
            *entry = state.volts;
        }
        let back = if state.next >= self.lead { state.next } else { state.next + length };
        if let Some(entry) = line.get_mut(back - self.lead) {
            *entry += self.gain * error;
        }
        state.next = if state.next + 1 < length { state.next + 1 } else { 0 };
        // The oldest entry is the one to be written next.
        let (newer, older) = line.split_at(state.next);
        let (first, rest) = self.taps.split_at(self.reads.min(older.len()).min(TAPS));
        let mut learnt = weighted(older, first);
        if first.len() < self.reads {
            learnt += weighted(newer, rest);
        }
        let volts = self.pole * state.volts + learnt;
        // Overflow: start again from 0 V.
        state.volts = if volts.is_finite() { volts } else { 0.0 };
        state.volts
    }

    /// Clears everything learnt.
    pub fn reset<L: AsMut<[f64]>>(&self, state: &mut RepetitiveState<L>) {
        state.line.as_mut().fill(0.0);
        state.next = 0;
        state.volts = 0.0;
    }
}
