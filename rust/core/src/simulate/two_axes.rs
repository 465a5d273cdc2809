//! Two apparatuses in one time: an XY stage under two sampled controllers.
//!
//! ```text
//! x = dx + c_xy dy,   y = c_yx dx + dy
//! ```
//!
//! with dx and dy what each axis makes of its own voltage, from its sensor's zero. Both loops see
//! x and y, so cross-talk couples them, and everything is computed in the order of its events.

use piezotrack_control::{Command, Controller, Feedback};

use super::closed_loop::{Commands, Delay, Record, SAME, checked, ends};
use super::open_loop::{BLOCK, checked as checked_drive, since};
use super::tracking::{Leader, Tracked};
use super::{Apparatus, ApparatusState, ClosedLoop, Course, OpenLoop, Plant, Stretch, Timing};
use crate::error::{Error, Result, finite, not_negative};
use crate::integrate::{Drive, Stop, index};

/// Two axes on one platform, under one computer.
///
/// In each control interval the computer takes the next point of the path, and reads, computes
/// and writes x; `lag` seconds later it does so for y, with the same point of the path.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `cross_talk` | c_xy, c_yx | m/m | product below 1 |
/// | `lag` | | s | >= 0 |
#[derive(Clone, Copy, Debug)]
pub struct TwoAxes<'a, X, Y> {
    /// The axis that is served first.
    pub x: Apparatus<'a, X>,
    /// The axis that is served second.
    pub y: Apparatus<'a, Y>,
    /// What of y shows in x, and what of x shows in y.
    pub cross_talk: [f64; 2],
    /// Time from the sampling of x to that of y, s; it may be more than an interval.
    pub lag: f64,
}

/// Memory of both axes.
pub type TwoStates<X, Y> = (ApparatusState<X>, ApparatusState<Y>);

/// Controlled motion of both axes.
pub type TwoMotions<X, Y> = (ClosedLoop<<X as Plant>::State>, ClosedLoop<<Y as Plant>::State>);

/// Controlled motion of both axes, with the commands behind it.
pub type TwoTracked<X, Y> = (Tracked<<X as Plant>::State>, Tracked<<Y as Plant>::State>);

/// Driven motion of both axes.
pub type TwoLogs<X, Y> = (OpenLoop<<X as Plant>::State>, OpenLoop<<Y as Plant>::State>);

impl<X: Plant, Y: Plant> TwoAxes<'_, X, Y> {
    /// Checks apparatuses, cross-talk and lag.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the number that is out of its range.
    pub fn validate(&self) -> Result<()> {
        self.x.validate()?;
        self.y.validate()?;
        let [xy, yx] = self.cross_talk;
        finite("cross_talk[0]", xy, "")?;
        finite("cross_talk[1]", yx, "")?;
        if xy * yx >= 1.0 {
            let expected = "two shares whose product is below 1, or the axes are one";
            return Err(Error::parameter("cross_talk", format!("({xy}, {yx})"), expected));
        }
        not_negative("lag", self.lag, "s").map(|_| ())
    }

    /// What cross-talk adds to each axis, m.
    #[inline]
    fn added(&self, x: &ApparatusState<X::State>, y: &ApparatusState<Y::State>) -> [f64; 2] {
        let [xy, yx] = self.cross_talk;
        [xy * self.y.displacement(y), yx * self.x.displacement(x)]
    }

    /// True displacement of the platform from the sensors' zeros, m.
    #[must_use]
    pub fn displacement(
        &self,
        x: &ApparatusState<X::State>,
        y: &ApparatusState<Y::State>,
    ) -> [f64; 2] {
        let [to_x, to_y] = self.added(x, y);
        [self.x.displacement(x) + to_x, self.y.displacement(y) + to_y]
    }

    /// Reads both sensors, each so many seconds after its last reading, m.
    fn read(
        &self,
        x: &mut ApparatusState<X::State>,
        y: &mut ApparatusState<Y::State>,
        [since_x, since_y]: [f64; 2],
    ) -> [f64; 2] {
        let [to_x, to_y] = self.added(x, y);
        [self.x.read_beside(x, to_x, since_x), self.y.read_beside(y, to_y, since_y)]
    }

    /// Cuts a control interval at all that happens in it.
    fn parts(&self, run: &Pair<X::State, Y::State>) -> Result<Vec<Part<X::Flow, Y::Flow>>> {
        let Timing { interval, substeps, .. } = run.timing;
        let marks = [run.commands[0].fraction(), run.lag.fraction, run.commands[1].fraction()];
        let mut parts = Vec::new();
        let mut from = 0.0;
        let mut waits = run.lag.fraction > 0.0;
        for (end, kept) in ends(substeps, &marks) {
            // Once in an interval, however near its neighbours are.
            let samples_y = waits && (end - run.lag.fraction).abs() <= SAME;
            waits &= !samples_y;
            let duration = (end - from) * interval;
            parts.push(Part {
                x: self.x.stretch(duration)?,
                y: self.y.stretch(duration)?,
                newer: [run.commands[0].newer(from), run.commands[1].newer(from)],
                kept,
                samples_y,
            });
            from = end;
        }
        Ok(parts)
    }
}

/// A part of each control interval: a stretch between neighbouring events.
struct Part<X, Y> {
    x: Stretch<X>,
    y: Stretch<Y>,
    /// Whether the newer of the two commands of each axis acts in it.
    newer: [bool; 2],
    /// Whether an instant that is kept is at its end.
    kept: bool,
    /// Whether y is read and its command computed at its end.
    samples_y: bool,
}

/// The run of both axes so far.
struct Pair<X, Y> {
    timing: Timing,
    lag: Delay,
    x: Record<X>,
    y: Record<Y>,
    commands: [Commands; 2],
}

impl<X, Y> Pair<X, Y> {
    fn new(timing: &Timing, lag: f64, start: TwoStates<X, Y>) -> Result<Self> {
        let (x, y) = (Record::new(timing, start.0)?, Record::new(timing, start.1)?);
        let Timing { interval, samples, delay, .. } = *timing;
        let commands = [
            Commands::new(samples, x.run.last.command, Delay::new(delay, interval)),
            Commands::new(samples, y.run.last.command, Delay::new(lag + delay, interval)),
        ];
        let lag = Delay::new(lag, interval);
        Ok(Self { timing: *timing, lag, x, y, commands })
    }

    /// Reads both sensors at the beginning of control interval `k`, for the record and for x.
    fn read<P, Q>(&mut self, axes: &TwoAxes<'_, P, Q>, k: usize) -> [f64; 2]
    where
        P: Plant<State = X>,
        Q: Plant<State = Y>,
    {
        let Timing { interval, .. } = self.timing;
        let since_x = if k == 0 { 0.0 } else { interval };
        // Between two such readings y's controller has read it, `lag` after the first.
        let sampled_between = self.lag.fraction > 0.0 && k > self.lag.whole;
        let since_y = if sampled_between { (1.0 - self.lag.fraction) * interval } else { since_x };
        axes.read(&mut self.x.run.last, &mut self.y.run.last, [since_x, since_y])
    }

    /// Reads y alone, `lag` into control interval `k`.
    fn read_late<P, Q>(&mut self, axes: &TwoAxes<'_, P, Q>) -> f64
    where
        P: Plant<State = X>,
        Q: Plant<State = Y>,
    {
        let since = self.lag.fraction * self.timing.interval;
        let [_, to_y] = axes.added(&self.x.run.last, &self.y.run.last);
        axes.y.read_beside(&mut self.y.run.last, to_y, since)
    }

    /// Keeps the present instant of both axes.
    fn keep<P, Q>(&mut self, axes: &TwoAxes<'_, P, Q>) -> Result<()>
    where
        P: Plant<State = X>,
        Q: Plant<State = Y>,
    {
        let [x, y] = axes.displacement(&self.x.run.last, &self.y.run.last);
        self.x.keep(x)?;
        self.y.keep(y)
    }
}

/// Lets two controllers move two axes; `None` where `stop` said so meanwhile.
///
/// Each controller is called as in [`super::closed_loop`]; that of y at `lag` after that of x,
/// with a reading of its own. `timing.delay` counts from each axis's own sampling. The record is of
/// the instants of x: both `measured` are read at once there, whatever the lag, as a recorder
/// beside the controllers would. Of two axes without cross-talk and lag each has the bits of
/// [`super::closed_loop`].
///
/// # Errors
/// Those of [`super::closed_loop`], for both axes.
pub fn closed_loops<X: Plant, Y: Plant>(
    axes: &TwoAxes<'_, X, Y>,
    start: TwoStates<X::State, Y::State>,
    timing: &Timing,
    mut x: impl FnMut(usize, f64) -> f64,
    mut y: impl FnMut(usize, f64) -> f64,
    stop: Stop<'_>,
) -> Result<Option<TwoMotions<X, Y>>> {
    axes.validate()?;
    let mut run = Pair::new(timing, axes.lag, start)?;
    let parts = axes.parts(&run)?;
    let mut serve_y = |run: &mut Pair<X::State, Y::State>, k: usize, measured: f64| -> Result<()> {
        // Before the lag has passed there is nothing to follow.
        let Some(sample) = k.checked_sub(run.lag.whole) else { return Ok(()) };
        run.commands[1].push(checked(sample, measured, y(sample, measured))?);
        Ok(())
    };
    for k in 0..timing.samples {
        if stop() {
            return Ok(None);
        }
        let [read_x, read_y] = run.read(axes, k);
        run.commands[0].push(checked(k, read_x, x(k, read_x))?);
        if run.lag.fraction == 0.0 {
            serve_y(&mut run, k, read_y)?;
        }
        run.x.control(read_x, run.commands[0].last());
        run.y.control(read_y, run.commands[1].last());
        run.keep(axes)?;
        if k + 1 == timing.samples {
            break;
        }
        for part in &parts {
            let [volts_x, volts_y] =
                [0, 1].map(|axis| run.commands[axis].acting(k, part.newer[axis]));
            axes.x.lead(&part.x, &mut run.x.run.last, volts_x, volts_x);
            axes.y.lead(&part.y, &mut run.y.run.last, volts_y, volts_y);
            if part.kept {
                run.keep(axes)?;
            }
            if part.samples_y && k >= run.lag.whole {
                let measured = run.read_late(axes);
                serve_y(&mut run, k, measured)?;
            }
        }
    }
    Ok(Some((run.x.run, run.y.run)))
}

/// Leads two axes along two courses; `None` where `stop` said so meanwhile.
///
/// The command of y beside an instant is the last one computed by then: before `lag` has passed,
/// the voltage that is there, with no parts.
///
/// # Errors
/// [`Error::Shape`] where the courses differ in length; otherwise as [`super::track`].
pub fn track_both<X: Plant, Y: Plant, F: Feedback, G: Feedback>(
    axes: &TwoAxes<'_, X, Y>,
    start: TwoStates<X::State, Y::State>,
    timing: &Timing,
    controllers: (&Controller<F>, &Controller<G>),
    courses: [Course<'_>; 2],
    stop: Stop<'_>,
) -> Result<Option<TwoTracked<X, Y>>> {
    let samples = courses[0].reference.len();
    if courses[1].reference.len() != samples {
        return Err(Error::Shape {
            name: "reference of y".into(),
            found: format!("{} samples", courses[1].reference.len()),
            expected: format!("{samples}, as many as that of x"),
        });
    }
    let (mut x, mut y) =
        (Leader::new(controllers.0, courses[0])?, Leader::new(controllers.1, courses[1])?);
    let timing = Timing { samples, ..*timing };
    let waiting = Command { volts: start.1.command, ..Command::default() };
    let (lead_x, lead_y) = (|k, read| x.lead(k, read), |k, read| y.lead(k, read));
    let run = closed_loops(axes, start, &timing, lead_x, lead_y, stop)?;
    let late = samples - y.commands.len();
    y.commands.splice(..0, core::iter::repeat_n(waiting, late));
    Ok(run.map(|(motion_x, motion_y)| {
        (
            Tracked { motion: motion_x, commands: x.commands },
            Tracked { motion: motion_y, commands: y.commands },
        )
    }))
}

/// Drives both axes, for logs; `None` where `stop` said so meanwhile.
///
/// Both sensors are read at once, at the samples of the drives.
///
/// ```
/// use piezotrack_core::integrate::{Drive, Hold, NEVER};
/// use piezotrack_core::simulate::{TwoAxes, open_loops};
/// use piezotrack_core::stage::VirtualStage;
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let (x, y) = (VirtualStage::xu_li_2010(1), VirtualStage::xu_li_2010_y(1));
/// let axes =
///     TwoAxes { x: x.apparatus(), y: y.apparatus(), cross_talk: [0.015, 0.010], lag: 0.0 };
/// let (up, held) = ([75.0; 1500], [0.0; 1500]);
/// let drives = [Drive::new(&up, 2e-4, Hold::Zero)?, Drive::new(&held, 2e-4, Hold::Zero)?];
/// let run = open_loops(&axes, (x.start(), y.start()), [&drives[0], &drives[1]], NEVER)?;
/// let (along_x, along_y) = run.unwrap();
/// assert!((along_x.displacement[1499] - 117.76e-6).abs() < 0.2e-6);
/// assert!((along_y.displacement[1499] - 1.18e-6).abs() < 0.2e-6);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Shape`] where the drives differ in length, [`Error::Parameter`] where they differ in
/// interval; otherwise as [`super::open_loop`].
pub fn open_loops<X: Plant, Y: Plant>(
    axes: &TwoAxes<'_, X, Y>,
    start: TwoStates<X::State, Y::State>,
    drives: [&Drive<'_>; 2],
    stop: Stop<'_>,
) -> Result<Option<TwoLogs<X, Y>>> {
    axes.validate()?;
    let [to_x, to_y] = drives;
    let n = checked_drive(to_x)?;
    if checked_drive(to_y)? != n {
        return Err(Error::Shape {
            name: "uy".into(),
            found: format!("{} samples", to_y.u.len()),
            expected: format!("{n}, as many as ux"),
        });
    }
    if (to_x.dt - to_y.dt).abs() > 0.0 {
        let expected = format!("{} s, as that of ux", to_x.dt);
        return Err(Error::parameter("interval of uy", format!("{} s", to_y.dt), expected));
    }
    let (stretch_x, stretch_y) = (axes.x.stretch(to_x.dt)?, axes.y.stretch(to_y.dt)?);
    let (mut x, mut y) = (OpenLoop::from_start(n, start.0), OpenLoop::from_start(n, start.1));
    for k in 0..n {
        x.drive(&axes.x, &stretch_x, to_x, k);
        y.drive(&axes.y, &stretch_y, to_y, k);
        if k % BLOCK == 0 && stop() {
            return Ok(None);
        }
        let passed = since(to_x, k);
        let [read_x, read_y] = axes.read(&mut x.last, &mut y.last, [passed, passed]);
        let [true_x, true_y] = axes.displacement(&x.last, &y.last);
        let time = to_x.dt * index(k);
        x.keep(true_x, read_x, time)?;
        y.keep(true_y, read_y, time)?;
    }
    Ok(Some((x, y)))
}
