//! A continuous plant under a sampled controller.

use super::apparatus::{Apparatus, ApparatusState, Stretch, instants, still_finite};
use super::open_loop::BLOCK;
use super::timing::{Clock, Commands, Delay, Event, Timing, events};
use crate::error::{Error, Result};
use crate::math::room;
use crate::models::Plant;
use crate::signal::{Stop, index};

/// A controlled apparatus, `(samples - 1) substeps + 1` instants of it.
///
/// Instant `k substeps` is control sample `k`, before its command has any effect; with jitter its
/// reading and command, which come a little later, stand beside it all the same.
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

/// A part of a control interval: a stretch between neighbouring events.
struct Part<F> {
    stretch: Stretch<F>,
    /// Where it begins, as a part of the interval.
    from: f64,
    /// Event at its end.
    event: Event,
}

/// Lets a controller move an apparatus; `None` where `stop` said so meanwhile.
///
/// `controller` is called with the number of the control sample and the reading, m, and returns
/// the command, V. Before its first command has an effect, the amplifier keeps the one that it
/// had at the start. With a delay of 0 a command acts at once, and shows in the next reading. The
/// delay of the sensor adds to that of the timing.
///
/// ```
/// use piezotrack_core::signal::NEVER;
/// use piezotrack_core::simulate::{Timing, VirtualStage, closed_loop};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let stage = VirtualStage::xu_li_2010(1);
/// let timing = Timing { interval: 0.02, samples: 100, delay: 0.0, jitter: 0.0, substeps: 10 };
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
    // A delayed reading and a delayed voltage have the same effect.
    let timing = &Timing { delay: timing.delay + apparatus.sensor.delay, ..*timing };
    let mut record = Record::new(timing, start)?;
    let clock = Clock::new(timing, apparatus.sensor.seed);
    let delay = Delay::new(timing.delay, timing.interval);
    let held = record.run.last.command;
    let mut commands = Commands::new(timing.samples, held, delay, clock, 0)?;
    let mut parts = Vec::new();
    let mut sample =
        |record: &mut Record<P::State>, commands: &mut Commands, k: usize| -> Result<()> {
            let since = record.since(clock.at(k));
            let measured = apparatus.read(&mut record.run.last, since);
            let command = checked(k, measured, controller(k, measured))?;
            commands.push(command);
            record.control(k, measured, command);
            Ok(())
        };
    for k in 0..timing.samples {
        if stop() {
            return Ok(None);
        }
        if parts.is_empty() || timing.jitter > 0.0 {
            parts = cut(apparatus, timing, &commands.effects(k), clock.at(k))?;
        }
        let prompt = clock.at(k) == 0.0;
        if prompt {
            sample(&mut record, &mut commands, k)?;
        }
        record.keep(apparatus.displacement(&record.run.last))?;
        let last = k + 1 == timing.samples;
        if last && prompt {
            break;
        }
        for (i, Part { stretch, from, event }) in parts.iter().enumerate() {
            let volts = commands.acting(k, *from);
            let moved = apparatus.drive(stretch, &mut record.run.last, [volts; 2], stop);
            if !moved || ((i + 1) % BLOCK == 0 && stop()) {
                return Ok(None);
            }
            if event.kept && !last {
                record.keep(apparatus.displacement(&record.run.last))?;
            }
            if event.samples[0] {
                sample(&mut record, &mut commands, k)?;
                if last {
                    break;
                }
            }
        }
        record.next_interval();
    }
    Ok(Some(record.run))
}

/// Cuts a control interval into parts.
fn cut<P: Plant>(
    apparatus: &Apparatus<'_, P>,
    timing: &Timing,
    effects: &[f64],
    sample: f64,
) -> Result<Vec<Part<P::Flow>>> {
    let mut from = 0.0;
    let events = events(timing.substeps, effects, [sample, 0.0, 0.0]);
    let mut parts = room("the parts of a control interval", events.len())?;
    for event in events {
        let stretch = apparatus.stretch((event.end - from) * timing.interval)?;
        parts.push(Part { stretch, from, event });
        from = event.end;
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
    timing: Timing,
    /// When the sensor was read last, from the beginning of the control interval, as a part of it.
    read: f64,
    measured: f64,
    command: f64,
}

impl<S> Record<S> {
    pub(super) fn new(timing: &Timing, start: ApparatusState<S>) -> Result<Self> {
        timing.validate()?;
        let n = instants("samples", timing.samples.checked_mul(timing.substeps))?;
        let empty = || room("the motion in the loop", n);
        let run = ClosedLoop {
            time: empty()?,
            displacement: empty()?,
            measured: empty()?,
            command: empty()?,
            applied: empty()?,
            last: start,
        };
        Ok(Self { run, timing: *timing, read: 0.0, measured: 0.0, command: 0.0 })
    }

    /// The sensor is read now, at this part of the control interval: seconds since it was last.
    pub(super) fn since(&mut self, now: f64) -> f64 {
        let since = (now - self.read) * self.timing.interval;
        self.read = now;
        since
    }

    /// The next control interval begins.
    pub(super) fn next_interval(&mut self) {
        self.read -= 1.0;
    }

    /// Takes what was read and asked for at control sample `k`, and puts it beside the instant of
    /// that sample, should that be kept already.
    pub(super) fn control(&mut self, k: usize, measured: f64, command: f64) {
        (self.measured, self.command) = (measured, command);
        let place = k * self.timing.substeps;
        if place < self.run.time.len() {
            self.run.measured[place] = measured;
            self.run.command[place] = command;
        }
    }

    /// Keeps the present instant, at which the true displacement is `displacement`.
    pub(super) fn keep(&mut self, displacement: f64) -> Result<()> {
        let run = &mut self.run;
        let spacing = self.timing.interval / index(self.timing.substeps);
        let time = spacing * index(run.time.len());
        run.displacement.push(still_finite(displacement, time)?);
        run.time.push(time);
        run.measured.push(self.measured);
        run.command.push(self.command);
        run.applied.push(run.last.applied);
        Ok(())
    }
}
