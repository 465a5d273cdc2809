//! The recursion of a repetitive controller for one sampling interval, and its delay line.

use super::saturation::{Learning, Lengths, Outcome, Saturation};
use super::{TAPS, count, samples};
use crate::cast::{Cast, all_rounded, rounded};
use crate::error::{Error, Result};
use crate::number::{Number, Real};
use crate::snapshot::Snapshot;

/// Coefficients of a repetitive controller for one sampling interval; see [`crate::Repetitive::at`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledRepetitive<T = f64> {
    /// L/Ts and others.
    pub(super) lengths: Lengths<T>,
    /// p, 0 for a filter without memory.
    pub(super) pole: T,
    /// Kq, V/m.
    pub(super) gain: T,
    pub(super) pause: bool,
    /// Number of entries by which an error is stored earlier.
    pub(super) lead: usize,
    /// Delay of the first tap, in samples, 1 or more.
    pub(super) nearest: usize,
    /// Weights of the samples, the oldest first; 0 where not in use.
    pub(super) taps: [T; TAPS],
    /// Number of taps in use.
    pub(super) reads: usize,
    /// Entries of each of the two lines.
    pub(super) entries: usize,
    /// Oldest entries that no tap reads.
    pub(super) unread: usize,
}

/// Coefficients of a repetitive controller and the lengths of its memory: see
/// [`SampledRepetitive::recursion`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recursion<'a, T = f64> {
    /// Period of the reference, in samples.
    pub period: f64,
    /// Pole p of the filter, 0 for a filter without memory.
    pub pole: T,
    /// Learning gain Kq, V/m.
    pub gain: T,
    /// Number of samples by which errors are stored earlier than voltages.
    pub lead: usize,
    /// Delay of the first tap, in samples, more than `lead`.
    pub nearest: usize,
    /// Weights of the samples, the oldest first; the last one has the delay `nearest`.
    pub taps: &'a [T],
    /// Entries of each of the two lines of the memory.
    pub entries: usize,
    /// Oldest entries of a line that no tap reads.
    pub unread: usize,
    /// The period as a whole number of samples.
    pub whole: u32,
    /// Whether learning pauses under saturation.
    pub pause: bool,
}

/// Sum of products, from `zero` on, in two independent sums, which the processor can compute in parallel.
#[inline(always)]
fn weighted<N: Number>(entries: &[N], taps: &[N], zero: N) -> N {
    let (mut even, mut odd) = (zero, zero);
    let mut pairs = entries.iter().zip(taps);
    while let Some((entry, tap)) = pairs.next() {
        even = even + *entry * *tap;
        if let Some((entry, tap)) = pairs.next() {
            odd = odd + *entry * *tap;
        }
    }
    even + odd
}

/// State of a repetitive controller, with a delay line provided by the caller: `&mut [T]`,
/// `[T; N]` or `Vec<T>`.
#[derive(Clone, Debug, PartialEq)]
pub struct RepetitiveState<L, T = f64> {
    /// First what is learnt, uRC + Kq e, then what was put out, uRC: a ring of each.
    pub(super) line: L,
    /// Index of the next entry to be written.
    pub(super) next: usize,
    /// The last output, V.
    pub(super) volts: T,
    pub(super) saturation: Saturation<T>,
}

/// The line is written with its length, and read into one of the same length.
impl<T: Real, L: AsRef<[T]> + AsMut<[T]>> Snapshot for RepetitiveState<L, T> {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        let line = self.line.as_ref();
        length(line).save(write);
        for entry in line {
            entry.save(write);
        }
        length(line.get(..self.next).unwrap_or_default()).save(write);
        self.volts.save(write);
        self.saturation.save(write);
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        let line = self.line.as_mut();
        let (mut entries, mut next) = (0_u32, 0_u32);
        entries.load(read)?;
        if entries != length(line) {
            return None;
        }
        line.iter_mut().try_for_each(|entry| entry.load(read))?;
        next.load(read)?;
        self.volts.load(read)?;
        self.next = (next < (entries / 2).max(1)).then_some(next as usize)?;
        self.saturation.load(read)
    }
}

/// A state without a repetitive part must have been one when it was saved too.
impl<T: Real, L: AsRef<[T]> + AsMut<[T]>> Snapshot for Option<RepetitiveState<L, T>> {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        self.is_some().save(write);
        if let Some(memory) = self {
            memory.save(write);
        }
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        let mut repeats = false;
        repeats.load(read)?;
        if repeats != self.is_some() {
            return None;
        }
        self.iter_mut().try_for_each(|memory| memory.load(read))
    }
}

/// Number of entries, of which a line has fewer than 2^32.
fn length<T>(line: &[T]) -> u32 {
    u32::try_from(line.len()).unwrap_or(u32::MAX)
}

impl SampledRepetitive {
    /// The same coefficients for a reference of `period` samples, with the lines' length.
    pub(super) fn for_period(self, period: f64) -> Self {
        let reach = self.nearest + self.reads - 1;
        let entries = reach.max(samples(libm::ceil(period - 1e-9)));
        let count = |n| u32::try_from(n).unwrap_or(u32::MAX);
        let whole = count(samples(libm::round(period)).clamp(1, entries));
        let rest = period - f64::from(whole);
        let lengths = Lengths { period, rest, whole, entries: count(entries) };
        Self { lengths, entries, unread: entries - reach, ..self }
    }
}

impl Cast for SampledRepetitive {
    type In<T: Real> = SampledRepetitive<T>;

    fn cast<T: Real>(&self) -> Result<SampledRepetitive<T>> {
        let Lengths { period, rest, whole, entries } = self.lengths;
        Ok(SampledRepetitive {
            lengths: Lengths { period, rest: rounded("period", rest, "samples")?, whole, entries },
            pole: rounded("tq", self.pole, "")?,
            gain: rounded("kq", self.gain, "V/m")?,
            pause: self.pause,
            lead: self.lead,
            nearest: self.nearest,
            taps: all_rounded("forgetting_factor", &self.taps, "")?,
            reads: self.reads,
            entries: self.entries,
            unread: self.unread,
        })
    }
}

impl<T: Real> SampledRepetitive<T> {
    /// Least number of entries of the delay line.
    #[must_use]
    pub fn length(&self) -> usize {
        self.entries.saturating_mul(2)
    }

    /// Whether the other one writes and reads its lines at the same places.
    pub(crate) fn is_shaped_like(&self, other: &Self) -> bool {
        let shape = |one: &Self| (one.entries, one.unread, one.reads, one.lead, one.pause);
        shape(self) == shape(other) && self.lengths == other.lengths
    }

    /// Period in samples and entries of a line: what a controller must share to use the memory of
    /// this one.
    pub(crate) fn memory(&self) -> (f64, usize) {
        (self.lengths.period, self.entries)
    }

    /// Coefficients of the recursion, for a stability analysis or a controller in another language:
    /// `uRC[k] = pole uRC[k-1] + sum of tap (uRC[k-n] + gain e[k-n+lead])`, n the delay of a tap.
    #[must_use]
    pub fn recursion(&self) -> Recursion<'_, T> {
        Recursion {
            period: self.lengths.period,
            pole: self.pole,
            gain: self.gain,
            lead: self.lead,
            nearest: self.nearest,
            taps: self.taps.get(..self.reads).unwrap_or_default(),
            entries: self.entries,
            unread: self.unread,
            whole: self.lengths.whole,
            pause: self.pause,
        }
    }

    /// The state before any learning. `line` is filled with zeros.
    ///
    /// # Errors
    /// Names `line` where it is shorter than [`Self::length`].
    pub fn rest<L: AsMut<[T]>>(&self, mut line: L) -> Result<RepetitiveState<L, T>> {
        let entries = line.as_mut();
        if entries.len() < self.length() {
            let value = count(entries.len());
            let expected = "at least as many as the controller's length()";
            return Err(Error { name: "line", value, unit: "entries", expected });
        }
        entries.fill(T::ZERO);
        Ok(RepetitiveState { line, next: 0, volts: T::ZERO, saturation: Saturation::NONE })
    }

    /// The voltage for this sample, from what came of the sample *before*; within `most` (V) of 0.
    ///
    /// An error affects the voltage of the next sample at the earliest, so it is passed one sample
    /// later, when it is also known whether that command was clipped. At the first sample there is
    /// no error yet: pass `Outcome::default()`.
    ///
    /// With `pause`, a saturated sample learns no error and keeps no more voltage than pushes the
    /// command to the limit. Where more than a quarter of a period is saturated, the period before
    /// the saturation is repeated unchanged until it ends. Where the repeated voltage itself is
    /// what saturates, as the errors then tell, half of it is forgotten with each period.
    #[inline]
    pub fn step<L: AsMut<[T]>>(
        &self,
        state: &mut RepetitiveState<L, T>,
        before: Outcome<T>,
        most: T,
    ) -> T {
        let clipped = self.pause && before.excess.abs() > T::ZERO;
        if clipped || state.saturation.learning != Learning::On {
            return self.step_saturated(state, before, clipped, most);
        }
        state.saturation.pass();
        let RepetitiveState { line, next, volts, .. } = state;
        let Some(lines) = line.as_mut().get_mut(..2 * self.entries) else { return T::ZERO };
        let error = if before.error.is_finite() { before.error } else { T::ZERO };
        self.store(lines, next, [*volts, *volts], self.gain * error);
        *volts = bounded(self.pole * *volts + self.filtered(lines, *next), most);
        *volts
    }

    /// A sample while command or memory are affected by saturation.
    #[inline]
    fn step_saturated<L: AsMut<[T]>>(
        &self,
        state: &mut RepetitiveState<L, T>,
        before: Outcome<T>,
        clipped: bool,
        most: T,
    ) -> T {
        let RepetitiveState { line, next, volts, saturation } = state;
        let Some(lines) = line.as_mut().get_mut(..2 * self.entries) else { return T::ZERO };
        let was_held = matches!(saturation.learning, Learning::Held { .. });
        if saturation.is_latched(before, clipped, &self.lengths) {
            for entry in lines.iter_mut() {
                *entry = *entry * T::of(0.5);
            }
        }
        saturation.follow(clipped, &self.lengths);
        if !was_held {
            let (sum, learns) = if clipped {
                // As much of uRC as takes the command to the limit.
                let used = *volts + before.excess;
                let (least, most) = (volts.smaller(T::ZERO), volts.larger(T::ZERO));
                (used.larger(least).smaller(most), T::ZERO)
            } else {
                (*volts, if before.error.is_finite() { self.gain * before.error } else { T::ZERO })
            };
            self.store(lines, next, [sum, *volts], learns);
        }
        let given = lines.get(self.entries..).unwrap_or_default();
        let out = match saturation.learning {
            Learning::On => self.pole * *volts + self.filtered(lines, *next),
            Learning::Held { left } => repeated(given, *next, left),
            Learning::Resuming { .. } => repeated(given, *next, self.lengths.whole),
        };
        *volts = bounded(out, most);
        *volts
    }

    /// Clears everything learnt.
    pub fn reset<L: AsMut<[T]>>(&self, state: &mut RepetitiveState<L, T>) {
        state.line.as_mut().fill(T::ZERO);
        state.next = 0;
        state.volts = T::ZERO;
        state.saturation = Saturation::NONE;
    }
}

/// Of one controller, or of lanes of them.
impl<N: Number> SampledRepetitive<N> {
    /// Writes an entry of both lines, what is learnt (less the error's part) and what was put out,
    /// and adds `learns` where its error belongs.
    #[inline(always)]
    pub(super) fn store(&self, lines: &mut [N], next: &mut usize, entry: [N; 2], learns: N) {
        let entries = self.entries;
        if let Some(given) = lines.get_mut(entries + *next) {
            *given = entry[1];
        }
        if let Some(sum) = lines.get_mut(*next) {
            *sum = entry[0];
        }
        let back = if *next >= self.lead { *next } else { *next + entries };
        if let Some(sum) = lines.get_mut(back - self.lead) {
            *sum = *sum + learns;
        }
        *next = if *next + 1 < entries { *next + 1 } else { 0 };
    }

    /// The filter Q of what is learnt, without its memory; the entry at `next` is the oldest.
    #[inline(always)]
    pub(super) fn filtered(&self, lines: &[N], next: usize) -> N {
        let zero = self.pole.like(0.0);
        let Some(learnt) = lines.get(..self.entries) else { return zero };
        let first = next + self.unread;
        let first = if first < self.entries { first } else { first - self.entries };
        let (newer, older) = learnt.split_at(first.min(learnt.len()));
        let (taps, rest) = self.taps.split_at(self.reads.min(older.len()).min(TAPS));
        let sum = weighted(older, taps, zero);
        if taps.len() < self.reads { sum + weighted(newer, rest, zero) } else { sum }
    }
}

/// A voltage within `most` of 0; 0 V where it is not a number.
#[inline]
fn bounded<T: Real>(volts: T, most: T) -> T {
    if volts.abs() <= most {
        return volts;
    }
    if volts.is_nan() { T::ZERO } else { volts.larger(-most).smaller(most) }
}

/// The entry of a ring that was written `age` samples ago; `next` is the oldest.
#[inline]
fn repeated<T: Real>(ring: &[T], next: usize, age: u32) -> T {
    let age = age as usize;
    let place = if next >= age { next - age } else { (next + ring.len()).wrapping_sub(age) };
    ring.get(place).copied().unwrap_or(T::ZERO)
}
