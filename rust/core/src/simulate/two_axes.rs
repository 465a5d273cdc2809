//! Two apparatuses in one time: an XY stage under two sampled controllers.
//!
//! ```text
//! x = dx + c_xy dy,   y = c_yx dx + dy
//! ```
//!
//! with dx and dy what each axis makes of its own voltage, from its sensor's zero. Both loops see
//! x and y, so cross-talk couples them, and everything is computed in the order of its events.

use piezotrack_control::{Command, Controller, Feedback};

use super::apparatus::{Apparatus, ApparatusState, Stretch};
use super::closed_loop::{ClosedLoop, Record, checked};
use super::open_loop::{BLOCK, OpenLoop, Route, checked as checked_drive, since};
use super::sensor::Sensor;
use super::sensor_delay::Looks;
use super::timing::{Clock, Commands, Delay, Event, MissedTicks, SAMPLES, Timing, events};
use super::tracking::{ControllerRun, ReferenceSamples, TrackingRun};
use crate::error::{Error, Result, finite, not_negative};
use crate::math::room;
use crate::models::Plant;
use crate::signal::{Drive, Stop, index};

/// Two axes on one platform, under one computer.
///
/// In each control interval the computer takes the next point of the path, and reads, computes
/// and writes x; `lag` seconds later it does so for y, with the same point of the path.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `cross_talk` | `c_xy`, `c_yx` | m/m | product below 1 |
/// | `lag` | | s | >= 0 |
/// | `missed.chance`, `missed.most` | | | 0 to 1, >= 0 |
///
/// Where ticks are missed, y's controller takes a point of the path that is up to `missed.most`
/// samples old: drawn from the seed of y's sensor, and seen by [`track_both`] only.
#[derive(Clone, Copy, Debug)]
pub struct TwoAxes<'a, X, Y> {
    /// The axis that is served first.
    pub x: Apparatus<'a, X>,
    /// The axis that is served second.
    pub y: Apparatus<'a, Y>,
    /// Share of y that shows in x, and share of x that shows in y.
    pub cross_talk: [f64; 2],
    /// Time from the sampling of x to that of y, s; it may be more than an interval.
    pub lag: f64,
    /// Ticks that one axis misses and the other does not.
    pub missed: MissedTicks,
}

/// Memory of both axes.
pub type TwoStates<X, Y> = (ApparatusState<X>, ApparatusState<Y>);

/// Controlled motion of both axes.
pub type TwoMotions<X, Y> = (ClosedLoop<<X as Plant>::State>, ClosedLoop<<Y as Plant>::State>);

/// Controlled motion of both axes, with the commands behind it.
pub type TwoTracked<X, Y> = (TrackingRun<<X as Plant>::State>, TrackingRun<<Y as Plant>::State>);

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
        not_negative("lag", self.lag, "s")?;
        self.missed.validate()
    }

    /// Displacement that cross-talk adds to each axis, m.
    #[inline]
    fn added(&self, x: &ApparatusState<X::State>, y: &ApparatusState<Y::State>) -> [f64; 2] {
        let [xy, yx] = self.cross_talk;
        // An offset is of the reading only.
        let moved_x = self.x.displacement(x) - self.x.sensor.offset;
        let moved_y = self.y.displacement(y) - self.y.sensor.offset;
        [xy * moved_y, yx * moved_x]
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

    /// Displacement that each sensor sees, before its zero, m.
    fn seen(&self, x: &ApparatusState<X::State>, y: &ApparatusState<Y::State>) -> [f64; 2] {
        let [to_x, to_y] = self.added(x, y);
        let (own_x, own_y) =
            (self.x.plant.displacement(&x.plant), self.y.plant.displacement(&y.plant));
        [own_x + to_x, own_y + to_y]
    }

    /// Cuts control interval `k` at all that happens in it.
    fn cut(&self, run: &Pair<X::State, Y::State>, k: usize) -> Result<Parts<X::Flow, Y::Flow>> {
        let effects: Vec<f64> = run.commands.iter().flat_map(|one| one.effects(k)).collect();
        let samples = run.clocks.map(|clock| clock.at(k));
        let mut from = 0.0;
        let events = events(run.timing.substeps, &effects, samples);
        let mut parts = room("the parts of a control interval", events.len())?;
        for event in events {
            let duration = (event.end - from) * run.timing.interval;
            let (x, y) = (self.x.stretch(duration)?, self.y.stretch(duration)?);
            parts.push(Part { x, y, from, event });
            from = event.end;
        }
        Ok(parts)
    }
}

type Parts<X, Y> = Vec<Part<X, Y>>;

/// A part of a control interval: a stretch between neighbouring events.
struct Part<X, Y> {
    x: Stretch<X>,
    y: Stretch<Y>,
    /// Where it begins, as a part of the interval.
    from: f64,
    /// Event at its end.
    event: Event,
}

/// The run of both axes so far.
struct Pair<X, Y> {
    timing: Timing,
    lag: Delay,
    /// When x is read, y for the record, and y for its controller.
    clocks: [Clock; 3],
    x: Record<X>,
    y: Record<Y>,
    commands: [Commands; 2],
}

impl<X, Y> Pair<X, Y> {
    fn new(
        timing: &Timing,
        lag: f64,
        sensors: [Sensor; 2],
        start: TwoStates<X, Y>,
    ) -> Result<Self> {
        let (x, y) = (Record::new(timing, start.0)?, Record::new(timing, start.1)?);
        let Timing { interval, samples, delay, .. } = *timing;
        let whole = Delay::new(lag, interval);
        let [clock_x, clock_y] = sensors.map(|sensor| Clock::new(timing, sensor.seed));
        let late_y = clock_y.later(whole.fraction);
        let held = [x.run.last.command, y.run.last.command];
        let [of_x, of_y] = sensors.map(|sensor| sensor.delay);
        let acts = [delay + of_x, lag + delay + of_y];
        for delay in acts {
            Timing { delay, ..*timing }.validate()?;
        }
        let acts = acts.map(|delay| Delay::new(delay, interval));
        let commands = [
            Commands::new(samples, held[0], acts[0], clock_x, 0)?,
            Commands::new(samples, held[1], acts[1], late_y, whole.whole)?,
        ];
        let clocks = [clock_x, clock_y, late_y];
        Ok(Self { timing: *timing, lag: whole, clocks, x, y, commands })
    }

    /// Reads x at the part `now` of the present control interval.
    fn read_x<P, Q>(&mut self, axes: &TwoAxes<'_, P, Q>, now: f64) -> f64
    where
        P: Plant<State = X>,
        Q: Plant<State = Y>,
    {
        let since = self.x.since(now);
        let [to_x, _] = axes.added(&self.x.run.last, &self.y.run.last);
        axes.x.read_beside(&mut self.x.run.last, to_x, since)
    }

    /// Reads y likewise.
    fn read_y<P, Q>(&mut self, axes: &TwoAxes<'_, P, Q>, now: f64) -> f64
    where
        P: Plant<State = X>,
        Q: Plant<State = Y>,
    {
        let since = self.y.since(now);
        let [_, to_y] = axes.added(&self.x.run.last, &self.y.run.last);
        axes.y.read_beside(&mut self.y.run.last, to_y, since)
    }

    /// Takes the samples of control interval `k` that come now.
    fn serve<P, Q>(
        &mut self,
        axes: &TwoAxes<'_, P, Q>,
        k: usize,
        come: [bool; SAMPLES],
        (x, y): (&mut impl FnMut(usize, f64) -> f64, &mut impl FnMut(usize, f64) -> f64),
    ) -> Result<()>
    where
        P: Plant<State = X>,
        Q: Plant<State = Y>,
    {
        let [now_x, now_y, now_late] = self.clocks.map(|clock| clock.at(k));
        if come[0] {
            let measured = self.read_x(axes, now_x);
            self.commands[0].push(checked(k, measured, x(k, measured))?);
            self.x.control(k, measured, self.commands[0].last());
        }
        // For the record and, where it is the same, for the controller.
        let measured = come[1].then(|| self.read_y(axes, now_y));
        // Before the lag has passed there is nothing to follow.
        if let Some(sample) = k.checked_sub(self.lag.whole).filter(|_| come[2]) {
            let seen = measured.unwrap_or_else(|| self.read_y(axes, now_late));
            self.commands[1].push(checked(sample, seen, y(sample, seen))?);
        }
        if let Some(measured) = measured {
            self.y.control(k, measured, self.commands[1].last());
        }
        Ok(())
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
/// with a reading of its own. `timing.delay` counts from each axis's own sampling, and the delay of
/// its sensor adds to it. The record is of
/// the instants of x: both `measured` are read at once there, whatever the lag, as a recorder
/// beside the controllers would; with jitter each has its own random delay. Of two axes
/// without cross-talk, lag and jitter each has the bits of [`super::closed_loop`].
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
    let mut run = Pair::new(timing, axes.lag, [axes.x.sensor, axes.y.sensor], start)?;
    let mut parts = Vec::new();
    for k in 0..timing.samples {
        if stop() {
            return Ok(None);
        }
        if parts.is_empty() || timing.jitter > 0.0 {
            parts = axes.cut(&run, k)?;
        }
        // The last interval ends with its samples; y's controller is not served any more in it.
        let last = k + 1 == timing.samples;
        let mut due = run.clocks.map(|clock| clock.at(k)).map(|at| at > 0.0);
        run.serve(axes, k, due.map(|late| !late), (&mut x, &mut y))?;
        run.keep(axes)?;
        for (i, part) in parts.iter().enumerate() {
            due[2] &= !last || run.lag.fraction == 0.0;
            if last && due == [false; SAMPLES] {
                break;
            }
            let [volts_x, volts_y] = [0, 1].map(|axis| run.commands[axis].acting(k, part.from));
            let moved = axes.x.drive(&part.x, &mut run.x.run.last, [volts_x; 2], stop)
                && axes.y.drive(&part.y, &mut run.y.run.last, [volts_y; 2], stop);
            if !moved || ((i + 1) % BLOCK == 0 && stop()) {
                return Ok(None);
            }
            if part.event.kept && !last {
                run.keep(axes)?;
            }
            let mut come = part.event.samples;
            for (come, due) in come.iter_mut().zip(&mut due) {
                *come &= *due;
                *due &= !*come;
            }
            run.serve(axes, k, come, (&mut x, &mut y))?;
        }
        run.x.next_interval();
        run.y.next_interval();
    }
    Ok(Some((run.x.run, run.y.run)))
}

/// Simulates closed-loop tracking of two axes; `None` where `stop` said so meanwhile.
///
/// The command of y beside an instant is the last one computed by then: before `lag` has passed,
/// the voltage that is there, with no parts.
///
/// # Errors
/// [`Error::Shape`] where the references differ in length; otherwise as [`super::track`].
pub fn track_both<X: Plant, Y: Plant, F: Feedback, G: Feedback>(
    axes: &TwoAxes<'_, X, Y>,
    start: TwoStates<X::State, Y::State>,
    timing: &Timing,
    controllers: (&Controller<F>, &Controller<G>),
    inputs: [ReferenceSamples<'_>; 2],
    stop: Stop<'_>,
) -> Result<Option<TwoTracked<X, Y>>> {
    let samples = inputs[0].reference.len();
    if inputs[1].reference.len() != samples {
        return Err(Error::Shape {
            name: "reference of y".into(),
            found: format!("{} samples", inputs[1].reference.len()),
            expected: format!("{samples}, as many as that of x"),
        });
    }
    axes.validate()?;
    let behind = axes.missed.behind(axes.y.sensor.seed, samples)?;
    let (mut x, mut y) = (
        ControllerRun::new(controllers.0, inputs[0])?,
        ControllerRun::new(controllers.1, inputs[1])?.late(behind),
    );
    let timing = Timing { samples, ..*timing };
    let waiting = Command { volts: start.1.command, ..Command::default() };
    let (command_x, command_y) = (|k, read| x.command(k, read), |k, read| y.command(k, read));
    let run = closed_loops(axes, start, &timing, command_x, command_y, stop)?;
    let late = samples - y.commands.len();
    y.commands.splice(..0, core::iter::repeat_n(waiting, late));
    Ok(run.map(|(motion_x, motion_y)| {
        (
            TrackingRun { motion: motion_x, commands: x.commands },
            TrackingRun { motion: motion_y, commands: y.commands },
        )
    }))
}

/// Drives both axes, for logs; `None` where `stop` said so meanwhile.
///
/// Both sensors are read at once, at the samples of the drives.
///
/// ```
/// use piezotrack_core::signal::{Drive, Hold, NEVER};
/// use piezotrack_core::simulate::{MissedTicks, TwoAxes, VirtualStage, open_loops};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let (x, y) = (VirtualStage::xu_li_2010(1), VirtualStage::xu_li_2010_y(1));
/// let (cross_talk, missed) = ([0.015, 0.010], MissedTicks::NONE);
/// let axes =
///     TwoAxes { x: x.apparatus(), y: y.apparatus(), cross_talk, lag: 0.0, missed };
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
    let mut looks = Looks::new([axes.x.sensor.delay, axes.y.sensor.delay], to_x.dt, n)?;
    let (route_x, route_y) =
        (Route::new(&axes.x, &looks, to_x.dt)?, Route::new(&axes.y, &looks, to_y.dt)?);
    let (mut x, mut y) = (OpenLoop::from_start(n, start.0)?, OpenLoop::from_start(n, start.1)?);
    for (axis, seen) in axes.seen(&x.last, &y.last).into_iter().enumerate() {
        looks.see(axis, seen);
    }
    for k in 0..n {
        for part in 0..route_x.parts(k) {
            let moved = x.drive(&axes.x, &route_x, to_x, (k, part), stop)
                && y.drive(&axes.y, &route_y, to_y, (k, part), stop);
            if !moved {
                return Ok(None);
            }
            for (axis, seen) in axes.seen(&x.last, &y.last).into_iter().enumerate() {
                if looks.is_due(axis, part) {
                    looks.see(axis, seen);
                }
            }
        }
        if k % BLOCK == 0 && stop() {
            return Ok(None);
        }
        let passed = since(to_x, k);
        let read_x = axes.x.read_seen(&mut x.last, looks.read_at(0, k), passed);
        let read_y = axes.y.read_seen(&mut y.last, looks.read_at(1, k), passed);
        let [true_x, true_y] = axes.displacement(&x.last, &y.last);
        let time = to_x.dt * index(k);
        x.keep(true_x, read_x, time)?;
        y.keep(true_y, read_y, time)?;
    }
    Ok(Some((x, y)))
}
