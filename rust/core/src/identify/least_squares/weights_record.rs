//! A record as least squares take it.

use crate::error::{Error, Result, shown};
use crate::identify::parameters::delay::Delay;
use crate::identify::parameters::drift::DriftKind;
use crate::identify::records::history::History;
use crate::models::Measures;
use crate::signal::{Drive, Hold, index, range};

/// Share of its range by which a drive jumps from one sample to the next.
const JUMP: f64 = 0.1;

/// A record: the displacement under a drive, judged from sample `start` on, and what is asked of
/// it alone.
#[derive(Clone, Copy, Debug)]
pub struct WeightsRecord<'a> {
    /// Drive, V.
    pub drive: Drive<'a>,
    /// Displacement, m.
    pub y: &'a [f64],
    /// First sample that counts; those before are warm-up.
    pub start: usize,
    /// Motion before the record; `None` chooses.
    pub history: Option<History>,
    /// Whether the sensor shows something where the stage is at rest.
    pub offset: bool,
    /// Whether what it shows drifts.
    pub drift: DriftKind,
    /// Delay of the reading.
    pub delay: WeightsDelay,
    /// How much a sample counts beside those of other records.
    pub weight: f64,
    /// Samples whose displacement does not count, one entry for each; none where empty.
    pub left_out: &'a [bool],
}

/// Delay of a reading in a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WeightsDelay {
    /// Known, s; 0 for none.
    Known(f64),
    /// To be found between two bounds, s.
    Fitted(f64, f64),
}

impl<'a> WeightsRecord<'a> {
    /// A record that begins as it shows, with an offset, without drift or delay.
    #[must_use]
    pub fn of(drive: Drive<'a>, y: &'a [f64], start: usize) -> Self {
        let delay = WeightsDelay::Known(0.0);
        Self {
            drive,
            y,
            start,
            history: None,
            offset: true,
            drift: DriftKind::None,
            delay,
            weight: 1.0,
            left_out: &[],
        }
    }

    /// The same with a delay of its reading.
    ///
    /// # Errors
    /// Names `delay` where it is out of its range.
    pub fn delayed(self, delay: Delay) -> Result<Self> {
        let length = self.drive.dt * index(self.drive.u.len());
        let ends = delay.ends(length, || self.measures().longest_delay())?;
        let delay = match delay {
            Delay::Fixed(value) => WeightsDelay::Known(value),
            Delay::Between(low, high) if low > high => {
                let found = format!("({}, {}) s", shown(low), shown(high));
                return Err(Error::parameter("delay", found, "the lower bound first"));
            }
            _ if ends.0 < ends.1 => WeightsDelay::Fitted(ends.0, ends.1),
            _ => WeightsDelay::Known(ends.0),
        };
        Ok(Self { delay, ..self })
    }

    /// Measures of the samples that count.
    pub(super) fn measures(&self) -> Measures {
        Measures::of(&self.drive, self.y, self.start..self.y.len())
    }

    /// Seconds within which the drive comes to a sample: none where it is held and jumps.
    pub(super) fn step(&self, k: usize) -> f64 {
        if k > 0 && self.drive.hold.until(k) == Hold::First { self.drive.dt } else { f64::INFINITY }
    }

    /// Whether the drive at a sample is another one than before.
    pub(super) fn changes(&self, k: usize) -> bool {
        k > 0 && self.drive.u[k].to_bits() != self.drive.u[k - 1].to_bits()
    }

    /// How many times the drive has changed up to each sample; of one that is not held, as if it
    /// changed at each.
    pub(super) fn levels(&self) -> Vec<usize> {
        let held = self.drive.hold == Hold::Zero;
        let mut level = 0;
        let mut count = |k: usize| {
            level += usize::from(k > 0 && (!held || self.changes(k)));
            level
        };
        (0..self.drive.u.len()).map(&mut count).collect()
    }

    /// Whether the drive jumps from one sample to the next.
    pub(super) fn jumps(&self) -> bool {
        let u = &self.drive.u[self.start..];
        let (low, high) = range(u);
        u.windows(2).any(|pair| (pair[1] - pair[0]).abs() > JUMP * (high - low))
    }

    /// Whether the displacement at a sample counts.
    pub(super) fn counts(&self, k: usize) -> bool {
        !self.left_out.get(k).is_some_and(|left_out| *left_out)
    }

    /// Samples of the window.
    pub(super) fn samples(&self) -> usize {
        self.y.len().saturating_sub(self.start)
    }

    /// Seconds that count.
    pub(super) fn length(&self) -> f64 {
        self.drive.dt * index(self.samples())
    }
}
