//! Timing of a sampled controller: delays and random sampling jitter.

use crate::error::{Error, Result, not_negative, positive, within};
use crate::math::{Draws, room};
use crate::signal::index;

/// When a controller looks and acts, and at which instants the motion is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Control interval Ts, s.
    pub interval: f64,
    /// Control samples: the first at time 0, the last at `(samples - 1) Ts`, where the run ends.
    pub samples: usize,
    /// Time from a reading to the effect of the command computed from it, s; any fraction of
    /// the interval, and more than one too.
    pub delay: f64,
    /// Mean sampling jitter, s, as on a computer without real-time scheduling: each control
    /// sample is delayed by a time drawn from an exponential distribution that ends at
    /// nine tenths of the interval; the draws follow from the seed of the sensor.
    pub jitter: f64,
    /// Instants kept in each control interval, 1 or more.
    pub substeps: usize,
}

/// Most instants kept in a control interval: each has numbers of its own for the whole run.
const MOST_SUBSTEPS: usize = 100_000;

/// Longest delay, in control intervals: beyond any run.
const LONGEST_DELAY: f64 = 1e9;

impl Timing {
    /// Checks the numbers.
    pub(crate) fn validate(&self) -> Result<()> {
        positive("interval", self.interval, "s")?;
        not_negative("delay", self.delay, "s")?;
        not_negative("jitter", self.jitter, "s")?;
        if self.delay / self.interval > LONGEST_DELAY {
            let expected = format!(
                "{:e} s at most: {LONGEST_DELAY:e} control intervals",
                LONGEST_DELAY * self.interval
            );
            return Err(Error::parameter("delay", format!("{:e} s", self.delay), expected));
        }
        if self.samples == 0 {
            return Err(Error::parameter("samples", 0, "1 or more"));
        }
        if !(1..=MOST_SUBSTEPS).contains(&self.substeps) {
            let expected = format!("1 to {MOST_SUBSTEPS}");
            return Err(Error::parameter("substeps", self.substeps, expected));
        }
        Ok(())
    }
}

/// Ticks that two axes of one computer miss, each on its own, so that one falls behind the other
/// along the path by whole samples.
///
/// In each control interval the axis behind has missed one tick more with half of the chance, and
/// the axis ahead with the other half. The computer keeps them within `most`, and the axis that is
/// served first is never behind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MissedTicks {
    /// Chance that one of the axes misses a tick in a control interval, 0 to 1.
    pub chance: f64,
    /// Most samples of the path between the axes.
    pub most: usize,
}

impl MissedTicks {
    /// Every tick comes.
    pub const NONE: Self = Self { chance: 0.0, most: 0 };

    /// Checks the numbers.
    pub(super) fn validate(&self) -> Result<()> {
        within("missed_ticks", self.chance, 0.0, 1.0).map(|_| ())
    }

    /// How many samples of the path one axis is behind at each control sample; empty where no tick
    /// is missed.
    pub(super) fn behind(&self, seed: u64, samples: usize) -> Result<Vec<usize>> {
        if self.chance == 0.0 || self.most == 0 {
            return Ok(Vec::new());
        }
        let mut course = room("the missed ticks", samples)?;
        let mut now = 0;
        for k in 0..samples {
            let drawn = Draws::tick(seed, k as u64);
            if drawn < 0.5 * self.chance {
                now = self.most.min(now + 1);
            } else if drawn < self.chance {
                now = now.saturating_sub(1);
            }
            course.push(now);
        }
        Ok(course)
    }
}

/// Parts of a control interval nearer than this are one.
pub(crate) const SAME: f64 = 1e-9;

/// A time as whole control intervals and a fraction of one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Delay {
    pub(crate) whole: usize,
    pub(crate) fraction: f64,
}

impl Delay {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub(crate) fn new(seconds: f64, interval: f64) -> Self {
        let intervals = seconds / interval;
        // 0.06 s are three intervals of 0.02 s, whatever the division says.
        let nearest = intervals.round();
        if (intervals - nearest).abs() < SAME {
            return Self { whole: nearest as usize, fraction: 0.0 };
        }
        Self { whole: intervals as usize, fraction: intervals.fract() }
    }
}

/// The samples of one axis: in each control interval one, `phase` of the interval after its
/// beginning, and as much later as chance has it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    /// Mean jitter, as a part of the interval.
    mean: f64,
    seed: u64,
    phase: f64,
}

/// Where in what is left of its interval a sample comes at the latest.
const LATEST: f64 = 0.9;

impl Clock {
    /// Samples of an axis whose sensor has this seed.
    pub(super) fn new(timing: &Timing, seed: u64) -> Self {
        Self { mean: timing.jitter / timing.interval, seed, phase: 0.0 }
    }

    /// The same, but later in each interval.
    pub(super) fn later(self, phase: f64) -> Self {
        Self { phase, ..self }
    }

    /// Jitter of the sample in control interval `k`, as a part of the interval.
    fn jitter_of(&self, k: usize) -> f64 {
        if self.mean == 0.0 {
            return 0.0;
        }
        let drawn = self.mean * Draws::jitter(self.seed, k as u64);
        drawn.min(LATEST * (1.0 - self.phase))
    }

    /// Where in control interval `k` its sample comes: 0 to below 1.
    pub(super) fn at(&self, k: usize) -> f64 {
        self.phase + self.jitter_of(k)
    }
}

/// Commands of one controller in their order, and when each takes effect.
pub(super) struct Commands {
    issued: Vec<f64>,
    /// Command that the amplifier follows before the first.
    held: f64,
    /// From the control interval that a command is for to its effect, without jitter.
    delay: Delay,
    clock: Clock,
    /// Intervals from the one that a command is for to the one in which it is computed.
    behind: usize,
}

impl Commands {
    /// Commands computed `behind` intervals after theirs, by the clock, that act `delay` after the
    /// beginning of theirs without jitter.
    pub(super) fn new(
        samples: usize,
        held: f64,
        delay: Delay,
        clock: Clock,
        behind: usize,
    ) -> Result<Self> {
        Ok(Self { issued: room("the commands", samples)?, held, delay, clock, behind })
    }

    /// Takes the next command, V.
    pub(super) fn push(&mut self, volts: f64) {
        self.issued.push(volts);
    }

    /// The last command, V.
    pub(super) fn last(&self) -> f64 {
        self.issued.last().copied().unwrap_or(self.held)
    }

    /// When command `j` takes effect.
    fn effect(&self, j: usize) -> Delay {
        let Delay { whole, fraction } = self.delay;
        let fraction = fraction + self.clock.jitter_of(j.saturating_add(self.behind));
        if fraction > 1.0 - SAME {
            return Delay { whole: j + whole + 1, fraction: (fraction - 1.0).max(0.0) };
        }
        Delay { whole: j + whole, fraction }
    }

    /// Where in control interval `k` commands take effect, as parts of it.
    ///
    /// Before the first command the interval is divided all the same, as without jitter.
    pub(super) fn effects(&self, k: usize) -> Vec<f64> {
        let whole = self.delay.whole;
        let Some(newest) = k.checked_sub(whole) else { return vec![self.delay.fraction] };
        (newest.saturating_sub(1)..=newest)
            .map(|j| self.effect(j))
            .filter(|effect| effect.whole == k)
            .map(|effect| effect.fraction)
            .collect()
    }

    /// The command that acts in control interval `k` from the part `from` of it on, V.
    pub(super) fn acting(&self, k: usize, from: f64) -> f64 {
        let newest = k.saturating_sub(self.delay.whole).saturating_add(1).min(self.issued.len());
        (newest.saturating_sub(3)..newest)
            .rev()
            .find(|&j| {
                let effect = self.effect(j);
                effect.whole < k || (effect.whole == k && from > effect.fraction - SAME)
            })
            .map_or(self.held, |j| self.issued[j])
    }
}

/// Most samples in a control interval: that of x, that of y for the record, that of y's controller.
pub(super) const SAMPLES: usize = 3;

/// Event at the end of a part of a control interval.
#[derive(Clone, Copy, Debug)]
pub(super) struct Event {
    /// Where it is, as a part of the interval.
    pub(super) end: f64,
    /// Whether an instant that is kept is there; that at the end of the interval is kept as the
    /// next control sample.
    pub(super) kept: bool,
    /// Which of the samples come there.
    pub(super) samples: [bool; SAMPLES],
}

/// Cuts a control interval at the instants kept, where commands take effect, and where samples come
/// after its beginning; ascending to 1.
pub(super) fn events(substeps: usize, effects: &[f64], samples: [f64; SAMPLES]) -> Vec<Event> {
    let mut events: Vec<Event> = (1..=substeps)
        .map(|j| Event {
            end: index(j) / index(substeps),
            kept: j < substeps,
            samples: [false; SAMPLES],
        })
        .collect();
    for &mark in effects.iter().chain(&samples) {
        if mark > 0.0 && events.iter().all(|event| (event.end - mark).abs() > SAME) {
            events.push(Event { end: mark, kept: false, samples: [false; SAMPLES] });
        }
    }
    events.sort_by(|a, b| a.end.total_cmp(&b.end));
    for (which, sample) in samples.into_iter().enumerate() {
        // Once in an interval, however near its neighbours are.
        if let Some(event) =
            events.iter_mut().find(|event| sample > 0.0 && (event.end - sample).abs() <= SAME)
        {
            event.samples[which] = true;
        }
    }
    events
}
