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
struct Delay {
    whole: usize,
    fraction: f64,
}

impl Delay {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    fn new(seconds: f64, interval: f64) -> Self {
        let intervals = seconds / interval;
        // 0.06 s are three intervals of 0.02 s, whatever the division says.
        let nearest = intervals.round();
        if (intervals - nearest).abs() < 1e-9 {
            return Self { whole: nearest as usize, fraction: 0.0 };
        }
        Self { whole: intervals as usize, fraction: intervals.fract() }
    }
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
    let parts = parts(apparatus, timing, delay.fraction)?;
    let held = record.run.last.command;
    let mut commands = Vec::with_capacity(timing.samples);
    for k in 0..timing.samples {
        if stop() {
            return Ok(None);
        }
        let interval = if k == 0 { 0.0 } else { timing.interval };
        let measured = apparatus.read(&mut record.run.last, interval);
        let command = controller(k, measured);
        record.control(k, measured, command)?;
        record.keep(apparatus)?;
        commands.push(command);
        if k + 1 == timing.samples {
            break;
        }
        let issued = |back: usize| {
            k.checked_sub(back).and_then(|j| commands.get(j)).copied().unwrap_or(held)
        };
        let (older, newer) = (issued(delay.whole.saturating_add(1)), issued(delay.whole));
        for part in &parts {
            let volts = if part.newer { newer } else { older };
            apparatus.lead(&part.stretch, &mut record.run.last, volts, volts);
            if part.kept {
                record.keep(apparatus)?;
            }
        }
    }
    Ok(Some(record.run))
}

/// Cuts a control interval at the instants kept and where the newer command comes into effect.
fn parts<P: Plant>(
    apparatus: &Apparatus<'_, P>,
    timing: &Timing,
    fraction: f64,
) -> Result<Vec<Part<P::Flow>>> {
    let n = timing.substeps;
    let mut ends: Vec<(f64, bool)> = (1..=n).map(|j| (index(j) / index(n), true)).collect();
    let apart = |end: &(f64, bool)| (end.0 - fraction).abs() > 1e-9;
    if fraction > 0.0 && ends.iter().all(apart) {
        ends.push((fraction, false));
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    let mut from = 0.0;
    let mut parts = Vec::with_capacity(ends.len());
    for (end, kept) in ends {
        let stretch = apparatus.stretch((end - from) * timing.interval)?;
        // The end of the interval itself is kept as the next control sample, once read.
        let kept = kept && end < 1.0;
        parts.push(Part { stretch, newer: from > fraction - 1e-9, kept });
        from = end;
    }
    Ok(parts)
}

/// The run so far.
struct Record<S> {
    run: ClosedLoop<S>,
    /// Time between two instants, s.
    spacing: f64,
    measured: f64,
    command: f64,
}

impl<S> Record<S> {
    fn new(timing: &Timing, start: ApparatusState<S>) -> Result<Self> {
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

    /// Takes what the controller read and asked for at sample `k`.
    fn control(&mut self, k: usize, measured: f64, command: f64) -> Result<()> {
        if !command.is_finite() {
            return Err(Error::Numerical(format!(
                "the controller asks for {command} V at sample {k}, where the sensor reads \
                 {measured:e} m"
            )));
        }
        (self.measured, self.command) = (measured, command);
        Ok(())
    }

    /// Keeps the present instant.
    fn keep<P: Plant<State = S>>(&mut self, apparatus: &Apparatus<'_, P>) -> Result<()> {
        let run = &mut self.run;
        let time = self.spacing * index(run.time.len());
        run.displacement.push(still_finite(apparatus.displacement(&run.last), time)?);
        run.time.push(time);
        run.measured.push(self.measured);
        run.command.push(self.command);
        run.applied.push(run.last.applied);
        Ok(())
    }
}
