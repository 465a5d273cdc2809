//! Antiwindup of a repetitive controller: when to learn, and when to hold what was learnt.

use crate::number::Real;
use crate::snapshot::Snapshot;

/// Clipped samples in a period, as its part, above which learning stops as a whole.
const PART: u32 = 4;

/// Outcome of the command of the sample before: a repetitive part learns from it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome<T = f64> {
    /// Its tracking error, m.
    pub error: T,
    /// Applied voltage less the unclipped command, V; 0 where it was not saturated.
    pub excess: T,
}

/// Action of the repetitive part in a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Learning {
    /// It learns.
    On,
    /// It repeats the period before the saturation, and stores nothing.
    Held {
        /// Samples left in the held period, this one included: the age of the entry that is due.
        left: u32,
    },
    /// It stores again, and repeats until nothing that was stored before is read.
    Resuming {
        /// Samples until then.
        left: u32,
    },
}

/// Written as its kind and its number.
impl Snapshot for Learning {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        let [kind, left] = match *self {
            Self::On => [0, 0],
            Self::Held { left } => [1, left],
            Self::Resuming { left } => [2, left],
        };
        [kind, left].save(write);
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        let mut numbers = [0_u32; 2];
        numbers.load(read)?;
        *self = match numbers {
            [0, _] => Self::On,
            [1, left] => Self::Held { left },
            [2, left] => Self::Resuming { left },
            _ => return None,
        };
        Some(())
    }
}

/// Lengths of a repetitive controller that its antiwindup uses, in samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lengths<T = f64> {
    /// L/Ts.
    pub(super) period: f64,
    /// By how much that is more than a whole number.
    pub(super) rest: T,
    /// The same as a whole number.
    pub(super) whole: u32,
    /// Entries of each line.
    pub(super) entries: u32,
}

/// Counts clipped samples, and decides what the repetitive part does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Saturation<T = f64> {
    pub(super) learning: Learning,
    /// Samples since the first clipped one of the count; more than a period where none counts.
    since: u32,
    /// Clipped samples in the count.
    clipped: u32,
    /// Clipped samples in a held period whose error pointed away from the limit.
    inward: u32,
    /// Held periods with few clipped samples, one after the other.
    well: u32,
    /// Time by which the held periods are shorter than those of the reference, in samples.
    behind: T,
}

crate::snapshot!([T: Real] Saturation<T> { learning, since, clipped, inward, well, behind });

impl<T: Real> Saturation<T> {
    pub(super) const NONE: Self = Self {
        learning: Learning::On,
        since: u32::MAX,
        clipped: 0,
        inward: 0,
        well: 0,
        behind: T::ZERO,
    };

    /// Continues with the next sample where nothing was clipped and learning is on.
    #[inline]
    pub(super) fn pass(&mut self) {
        self.pass_by(1);
    }

    /// Continues with so many samples of the same kind.
    #[inline]
    pub(super) fn pass_by(&mut self, samples: u32) {
        self.since = self.since.saturating_add(samples);
    }

    /// Continues with the next sample; `clipped` is of the one before.
    ///
    /// What was learnt is held for a whole number of periods, to the nearest sample, so that it is
    /// in phase with the reference afterwards.
    #[inline]
    pub(super) fn follow(&mut self, clipped: bool, lengths: &Lengths<T>) {
        self.learning = match self.learning {
            Learning::Held { left } => return self.hold(left.saturating_sub(1), clipped, lengths),
            Learning::Resuming { left } if left > 1 => Learning::Resuming { left: left - 1 },
            Learning::Resuming { .. } | Learning::On => Learning::On,
        };
        self.pass();
        if clipped && self.since >= lengths.whole {
            (self.since, self.clipped) = (0, 0);
        }
        self.clipped = self.clipped.saturating_add(u32::from(clipped));
        if clipped && self.clipped > lengths.whole / PART {
            (self.since, self.clipped, self.inward) = (u32::MAX, 0, 0);
            self.behind = T::ZERO;
            self.learning = self.another(lengths);
        }
    }

    /// Continues in a held period. At its end, holds for another one: where too much was clipped,
    /// and once more after that, so that the feedback has settled before it learns again.
    #[inline]
    fn hold(&mut self, left: u32, clipped: bool, lengths: &Lengths<T>) {
        self.clipped = self.clipped.saturating_add(u32::from(clipped));
        self.learning = Learning::Held { left };
        if left > 0 {
            return;
        }
        self.inward = 0;
        self.well =
            if self.clipped > lengths.whole / PART { 0 } else { self.well.saturating_add(1) };
        self.clipped = 0;
        self.learning = if self.well < 2 {
            self.another(lengths)
        } else {
            self.well = 0;
            Learning::Resuming { left: lengths.entries }
        };
    }

    /// Counts a clipped sample of a held period by the sign of its error; true in the last sample
    /// of a period that was clipped by what is held and not by the reference: most of what was
    /// clipped would have been brought back by its errors, and would stay clipped for ever.
    #[inline]
    pub(super) fn is_latched(
        &mut self,
        before: Outcome<T>,
        clipped: bool,
        lengths: &Lengths<T>,
    ) -> bool {
        let Learning::Held { left } = self.learning else { return false };
        self.inward += u32::from(clipped && before.excess * before.error > T::ZERO);
        left <= 1 && self.inward > lengths.whole / PART && self.inward > self.clipped / 2
    }

    /// Another held period, of as many samples as keeps it in phase.
    fn another(&mut self, lengths: &Lengths<T>) -> Learning {
        self.behind = self.behind + lengths.rest;
        let mut left = lengths.whole;
        let (one, half) = (T::of(1.0), T::of(0.5));
        if self.behind > half && left < lengths.entries {
            (self.behind, left) = (self.behind - one, left + 1);
        } else if self.behind < -half && left > 1 {
            (self.behind, left) = (self.behind + one, left - 1);
        }
        Learning::Held { left }
    }
}
