//! A continuous plant under a sampled controller.

use super::{Apparatus, ApparatusState, Plant, Stretch, instants, still_finite};
use crate::error::{Error, Result, not_negative, positive};
use crate::integrate::{Stop, index};

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
    /// Instants kept in each control interval, 1 or more.
    pub substeps: usize,
}

/// A controlled apparatus, `(samples - 1) substeps + 1` instants of it.
///
/// Instant `k substeps` is control sample `k`, before its command has any effect.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedLoop<S> {
    /// Time, s.
    pub time: Vec<f64>,
    /// True displacement from the sensor's zero, m.
    pub displacement: Vec<f64>,
    /// Reading of the last control sample, m.
    pub measured: Vec<f64>,
    /// Command computed at the last control sample, V.
    pub command: Vec<f64>,
    /// Voltage that the amplifier gave, V.
    pub applied: Vec<f64>,
    /// State at the last instant.
    pub last: ApparatusState<S>,
}

/// A part of each control interval: a stretch between neighbouring instants of interest.
struct Part<F> {
    stretch: Stretch<F>,
    /// Whether the newer of the two commands acts in it.
    newer: bool,
    /// Whether an instant that is kept is at its end.
    kept: bool,
}

/// A delay as whole control intervals and a fraction of one.
pub(super) struct Delay {
    pub(super) whole: usize,
    pub(super) fraction: f64,
}

impl Delay {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub(super) fn new(seconds: f64, interval: f64) -> Self {
        let intervals = seconds / interval;
        // 0.06 s are three intervals of 0.02 s, whatever the division says.
        let nearest = intervals.round();
        if (intervals - nearest).abs() < 1e-9 {
            return Self { whole: nearest as usize, fraction: 0.0 };
        }
        Self { whole: intervals as usize, fraction: intervals.fract() }
    }
}

/// Commands of one controller in their order, and when each takes effect.
pub(super) struct Commands {
    issued: Vec<f64>,
    /// What the amplifier follows before the first.
    held: f64,
    delay: Delay,
}

impl Commands {
    /// Room for `samples` commands, each of which acts `delay` after its control interval begins.
    pub(super) fn new(samples: usize, held: f64, delay: Delay) -> Self {
        Self { issued: Vec::with_capacity(samples), held, delay }
    }

    /// Takes the next command, V.
    pub(super) fn push(&mut self, volts: f64) {
        self.issued.push(volts);
    }

    /// The last command, V.
    pub(super) fn last(&self) -> f64 {
        self.issued.last().copied().unwrap_or(self.held)
    }

    /// Where in a control interval the newer command comes into effect, as a part of it.
    pub(super) fn fraction(&self) -> f64 {
        self.delay.fraction
    }

    /// Whether the newer command acts from the part `from` of a control interval on.
    pub(super) fn newer(&self, from: f64) -> bool {
        from > self.delay.fraction - SAME
    }

    /// The newer or the older of the two commands that act in control interval `k`, V.
    pub(super) fn acting(&self, k: usize, newer: bool) -> f64 {
        let back = self.delay.whole.saturating_add(usize::from(!newer));
        k.checked_sub(back).and_then(|j| self.issued.get(j)).copied().unwrap_or(self.held)
    }
}

/// Parts of a control interval nearer than this are one.
pub(super) const SAME: f64 = 1e-9;

/// Ends of the parts of a control interval, ascending to 1: the instants kept, told by `true`,
/// and `marks` beside them.
///
/// The end of the interval itself is kept as the next control sample, once read.
pub(super) fn ends(substeps: usize, marks: &[f64]) -> Vec<(f64, bool)> {
    let mut ends: Vec<(f64, bool)> =
        (1..=substeps).map(|j| (index(j) / index(substeps), j < substeps)).collect();
    for &mark in marks {
        if mark > 0.0 && ends.iter().all(|end| (end.0 - mark).abs() > SAME) {
            ends.push((mark, false));
        }
    }
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    ends
}

/// Lets a controller move an apparatus; `None` where `stop` said so meanwhile.
///
/// `controller` is called with the number of the control sample and the reading, m, and returns
/// the command, V. Before its first command has an effect, the amplifier keeps the one that it
/// had at the start. With a delay of 0 a command acts at once, and shows in the next reading.
///
/// ```
/// use piezotrack_core::integrate::NEVER;
/// use piezotrack_core::simulate::{Timing, closed_loop};
/// use piezotrack_core::stage::VirtualStage;
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let stage = VirtualStage::xu_li_2010(1);
/// let timing = Timing { interval: 0.02, samples: 100, delay: 0.0, substeps: 10 };
/// let mut volts = 0.0;
/// let integral = |_, measured: f64| {
///     volts += 0.1e6 * (20e-6 - measured);
///     volts
/// };
/// let run = closed_loop(&stage.apparatus(), stage.start(), &timing, integral, NEVER)?.unwrap();
/// assert_eq!(run.time.len(), 991);
/// assert!((run.displacement[990] - 20e-6).abs() < 0.5e-6);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Parameter`] where a number is out of its range; [`Error::Numerical`] where the
/// controller asks for a voltage that is not finite, or the motion is not finite.
pub fn closed_loop<P: Plant>(
    apparatus: &Apparatus<'_, P>,
    start: ApparatusState<P::State>,
    timing: &Timing,
    mut controller: impl FnMut(usize, f64) -> f64,
    stop: Stop<'_>,
) -> Result<Option<ClosedLoop<P::State>>> {
    apparatus.validate()?;
    let mut record = Record::new(timing, start)?;
    let delay = Delay::new(timing.delay, timing.interval);
    let mut commands = Commands::new(timing.samples, record.run.last.command, delay);
    let parts = parts(apparatus, timing, &commands)?;
    for k in 0..timing.samples {
        if stop() {
            return Ok(None);
        }
        let interval = if k == 0 { 0.0 } else { timing.interval };
        let measured = apparatus.read(&mut record.run.last, interval);
        let command = checked(k, measured, controller(k, measured))?;
        commands.push(command);
        record.control(measured, command);
        record.keep(apparatus.displacement(&record.run.last))?;
        if k + 1 == timing.samples {
            break;
        }
        for part in &parts {
            let volts = commands.acting(k, part.newer);
            apparatus.lead(&part.stretch, &mut record.run.last, volts, volts);
            if part.kept {
                record.keep(apparatus.displacement(&record.run.last))?;
            }
        }
    }
    Ok(Some(record.run))
}

/// Cuts a control interval at the instants kept and where the newer command comes into effect.
fn parts<P: Plant>(
    apparatus: &Apparatus<'_, P>,
    timing: &Timing,
    commands: &Commands,
) -> Result<Vec<Part<P::Flow>>> {
    let mut from = 0.0;
    let mut parts = Vec::new();
    for (end, kept) in ends(timing.substeps, &[commands.fraction()]) {
        let stretch = apparatus.stretch((end - from) * timing.interval)?;
        parts.push(Part { stretch, newer: commands.newer(from), kept });
        from = end;
    }
    Ok(parts)
}

/// Refuses a command at sample `k` that is not finite.
pub(super) fn checked(k: usize, measured: f64, command: f64) -> Result<f64> {
    if command.is_finite() {
        return Ok(command);
    }
    Err(Error::Numerical(format!(
        "the controller asks for {command} V at sample {k}, where the sensor reads {measured:e} m"
    )))
}

/// The run so far.
pub(super) struct Record<S> {
    pub(super) run: ClosedLoop<S>,
    /// Time between two instants, s.
    spacing: f64,
    measured: f64,
    command: f64,
}

impl<S> Record<S> {
    pub(super) fn new(timing: &Timing, start: ApparatusState<S>) -> Result<Self> {
        positive("interval", timing.interval, "s")?;
        not_negative("delay", timing.delay, "s")?;
        for (name, value) in [("samples", timing.samples), ("substeps", timing.substeps)] {
            if value == 0 {
                return Err(Error::parameter(name, 0, "1 or more"));
            }
        }
        let n = instants("samples", timing.samples.checked_mul(timing.substeps))?;
        let empty = || Vec::with_capacity(n);
        let run = ClosedLoop {
            time: empty(),
            displacement: empty(),
            measured: empty(),
            command: empty(),
            applied: empty(),
            last: start,
        };
        let spacing = timing.interval / index(timing.substeps);
        Ok(Self { run, spacing, measured: 0.0, command: 0.0 })
    }

    /// Takes what was read last and what was asked for.
    pub(super) fn control(&mut self, measured: f64, command: f64) {
        (self.measured, self.command) = (measured, command);
    }

    /// Keeps the present instant, at which the true displacement is `displacement`.
    pub(super) fn keep(&mut self, displacement: f64) -> Result<()> {
        let run = &mut self.run;
        let time = self.spacing * index(run.time.len());
        run.displacement.push(still_finite(displacement, time)?);
        run.time.push(time);
        run.measured.push(self.measured);
        run.command.push(self.command);
        run.applied.push(run.last.applied);
        Ok(())
    }
}
