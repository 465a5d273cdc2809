//! Antiwindup of a repetitive controller: when to learn, and when to hold what was learnt.

use crate::snapshot::Snapshot;

/// Share of a period above which clipped samples stop learning as a whole, as 1/4.
const QUARTER: f64 = 4.0;

/// What the repetitive part does in a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Learning {
    /// It learns.
    On,
    /// It repeats the period before the saturation, and stores nothing.
    Held {
        /// Samples since the beginning of the held period.
        phase: f64,
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
        let (kind, number) = match *self {
            Self::On => (0.0, 0.0),
            Self::Held { phase } => (1.0, phase),
            Self::Resuming { left } => (2.0, f64::from(left)),
        };
        (write(kind), write(number));
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        let (kind, number) = (read()?, read()?);
        let mut left = 0_u32;
        *self = match kind {
            0.0 => Self::On,
            1.0 => Self::Held { phase: number },
            2.0 => {
                left.load(&mut || Some(number))?;
                Self::Resuming { left }
            }
            _ => return None,
        };
        Some(())
    }
}

/// Counts clipped samples, and decides what the repetitive part does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Saturation {
    pub(super) learning: Learning,
    /// Samples until the count ends; 0 while nothing is clipped.
    pub(super) left: f64,
    /// Clipped samples in the count.
    pub(super) clipped: f64,
    /// Held periods with few clipped samples, one after the other.
    pub(super) well: u32,
}

crate::snapshot!(Saturation { learning, left, clipped, well });

impl Saturation {
    pub(super) const NONE: Self = Self { learning: Learning::On, left: 0.0, clipped: 0.0, well: 0 };

    /// Continues with the next sample; `clipped` is of the one before. `period` and `entries` are
    /// those of the controller, in samples.
    ///
    /// What was learnt is held for a whole number of periods, to the nearest sample, so that it is
    /// in phase with the reference afterwards.
    #[inline]
    pub(super) fn follow(&mut self, clipped: bool, period: f64, entries: u32) {
        if !clipped && self.left <= 0.0 && self.learning == Learning::On {
            return;
        }
        let mut held = match self.learning {
            Learning::Held { phase } => return self.hold(phase + 1.0, clipped, period, entries),
            Learning::Resuming { left } if left > 1 => Learning::Resuming { left: left - 1 },
            Learning::Resuming { .. } | Learning::On => Learning::On,
        };
        if clipped && self.left <= 0.0 {
            (self.left, self.clipped) = (period, 0.0);
        }
        self.left -= 1.0;
        if clipped {
            self.clipped += 1.0;
            if QUARTER * self.clipped > period {
                held = Learning::Held { phase: 0.0 };
                (self.left, self.clipped) = (0.0, 0.0);
            }
        }
        self.learning = held;
    }

    /// Continues at `phase` of a held period. At its end, holds for another one: where too much was
    /// clipped, and once more after that, so that the feedback has settled before it learns again.
    fn hold(&mut self, phase: f64, clipped: bool, period: f64, entries: u32) {
        self.clipped += f64::from(u8::from(clipped));
        self.learning = Learning::Held { phase };
        if phase < period - 0.5 {
            return;
        }
        self.well = if QUARTER * self.clipped > period { 0 } else { self.well + 1 };
        self.clipped = 0.0;
        self.learning = if self.well < 2 {
            Learning::Held { phase: phase - period }
        } else {
            self.well = 0;
            Learning::Resuming { left: entries }
        };
    }
}
