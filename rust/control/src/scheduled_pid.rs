//! PID gains scheduled by amplitude and rate of the reference.
//!
//! Xu and Li 2010, conclusion, doi 10.1115/1.4001712, name it as future work. Between two turning
//! points of the reference the gains are constant; at each turning point amplitude and rate are
//! those of the half wave that ends there, and the gains are interpolated linearly in the
//! logarithms of both. The state is that of a [`crate::Pid`], output and two errors, which no gain
//! multiplies: the transfer is bumpless (Rugh and Shamma 2000, doi 10.1016/S0005-1098(00)00058-3,
//! on gain scheduling).

use crate::cast::{Cast, all_rounded, rounded};
use crate::error::{Result, check, positive};
use crate::feedback_law::{Feedback, FeedbackSample};
use crate::number::Real;
use crate::pid::{Pid, PidState, SampledPid};

/// Most amplitudes, and most rates, of a schedule.
pub const MOST_GRADES: usize = 4;

/// Share of the last swing by which the reference turns back before it counts as a turn.
const TURNED: f64 = 0.02;

/// Gains on a grid of amplitudes and rates.
///
/// ```
/// use piezotrack_control::{Feedback, FeedbackSample, Pid, ScheduledPid};
///
/// let (slow, fast) = (Pid::new(0.2e6, 0.02, 0.0, None)?, Pid::new(0.1e6, 0.02, 0.0, None)?);
/// let dt = 1e-3;
/// let schedule = ScheduledPid::new(&[10e-6], &[1.0, 10.0], &[slow, fast], (10e-6, 1.0), dt)?;
/// let mut state = schedule.rest();
/// let volts = schedule.step(&mut state, &FeedbackSample::new(1e-6));
/// assert!((volts - 0.2 * dt / 0.02).abs() < 1e-12);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledPid<T = f64> {
    amplitudes: Axis<T>,
    rates: Axis<T>,
    /// For each amplitude the gains at each rate.
    gains: [[SampledPid<T>; MOST_GRADES]; MOST_GRADES],
    /// Those until the first half wave has ended.
    first: SampledPid<T>,
    dt: T,
}

/// Logarithms of the values along an axis, in rising order.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Axis<T> {
    logarithms: [T; MOST_GRADES],
    count: usize,
}

impl Axis<f64> {
    fn new(name: &'static str, values: &[f64], unit: &'static str) -> Result<Self> {
        let count = values.len();
        let room = u32::try_from(count).map_or(f64::INFINITY, f64::from);
        let right = (1..=MOST_GRADES).contains(&count);
        check(name, room, "entries", right, "1 to 4 entries")?;
        let mut logarithms = [0.0; MOST_GRADES];
        let mut before = 0.0;
        for (slot, value) in logarithms.iter_mut().zip(values) {
            positive(name, *value, unit)?;
            check(name, *value, unit, *value > before, "values in rising order")?;
            (*slot, before) = (libm::log(*value), *value);
        }
        Ok(Self { logarithms, count })
    }

    fn cast<T: Real>(&self) -> Result<Axis<T>> {
        let logarithms = all_rounded("gains", &self.logarithms, "")?;
        Ok(Axis { logarithms, count: self.count })
    }
}

impl<T: Real> Axis<T> {
    /// The entry below a value, and how far the value is towards the next.
    fn place(&self, value: T) -> (usize, T) {
        let logarithm = value.ln();
        let mut below = 0;
        for i in 1..self.count.saturating_sub(1) {
            if logarithm > self.logarithms[i] {
                below = i;
            }
        }
        if self.count < 2 {
            return (0, T::ZERO);
        }
        let (low, high) = (self.logarithms[below], self.logarithms[below + 1]);
        let share = (logarithm - low) / (high - low);
        (below, if share > T::ZERO { share.smaller(T::of(1.0)) } else { T::ZERO })
    }
}

impl ScheduledPid {
    /// `gains` has for each of the `amplitudes` (m, half of peak to peak) the gains at each of the
    /// `rates` (Hz). Until the first half wave has ended the gains are those at `first`, an
    /// amplitude and a rate. For samples every `dt` seconds.
    ///
    /// # Errors
    /// Names what is out of its range, or the gains where they are not as many.
    pub fn new(
        amplitudes: &[f64],
        rates: &[f64],
        gains: &[Pid],
        first: (f64, f64),
        dt: f64,
    ) -> Result<Self> {
        let (along, across) =
            (Axis::new("amplitudes", amplitudes, "m")?, Axis::new("rates", rates, "Hz")?);
        let count = u32::try_from(gains.len()).map_or(f64::INFINITY, f64::from);
        let right = gains.len() == amplitudes.len() * rates.len();
        check("gains", count, "entries", right, "one for each amplitude and rate")?;
        positive("first amplitude", first.0, "m")?;
        positive("first rate", first.1, "Hz")?;
        let begin = gains.first().map_or_else(|| Pid::xu_li_2010().at(dt), |one| one.at(dt))?;
        let mut table = [[begin; MOST_GRADES]; MOST_GRADES];
        for (row, gains) in table.iter_mut().zip(gains.chunks(rates.len().max(1))) {
            for (slot, pid) in row.iter_mut().zip(gains) {
                *slot = pid.at(dt)?;
            }
        }
        let mut out = Self { amplitudes: along, rates: across, gains: table, first: begin, dt };
        out.first = out.at(first.0, first.1);
        Ok(out)
    }
}

impl Cast for ScheduledPid {
    type In<T: Real> = ScheduledPid<T>;

    fn cast<T: Real>(&self) -> Result<ScheduledPid<T>> {
        let first = self.first.cast()?;
        let mut gains = [[first; MOST_GRADES]; MOST_GRADES];
        for (row, own) in gains.iter_mut().zip(&self.gains) {
            for (slot, own) in row.iter_mut().zip(own) {
                *slot = own.cast()?;
            }
        }
        let (amplitudes, rates) = (self.amplitudes.cast()?, self.rates.cast()?);
        Ok(ScheduledPid { amplitudes, rates, gains, first, dt: rounded("dt", self.dt, "s")? })
    }
}

impl<T: Real> ScheduledPid<T> {
    /// The gains at an amplitude (m) and a rate (Hz); at the nearest end of the grid outside of it.
    #[must_use]
    pub fn at(&self, amplitude: T, rate: T) -> SampledPid<T> {
        let (i, along) = self.amplitudes.place(amplitude);
        let (j, across) = self.rates.place(rate);
        let (next, beside) = ((i + 1).min(MOST_GRADES - 1), (j + 1).min(MOST_GRADES - 1));
        let low = self.gains[i][j].towards(&self.gains[i][beside], across);
        let high = self.gains[next][j].towards(&self.gains[next][beside], across);
        low.towards(&high, along)
    }

    /// The gains until the first half wave has ended.
    #[must_use]
    pub fn first(&self) -> SampledPid<T> {
        self.first
    }
}

/// State of a [`ScheduledPid`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledPidState<T = f64> {
    pid: PidState<T>,
    gains: SampledPid<T>,
    /// Last turning point and the furthest reference since, m.
    turn: T,
    furthest: T,
    /// Samples from one to the other, and since then.
    half_wave: u32,
    since: u32,
    /// Turning points so far.
    turns: u32,
    begun: bool,
}

crate::snapshot!(
    [T: Real]
    ScheduledPidState<T> { pid, gains, turn, furthest, half_wave, since, turns, begun }
);

impl<T: Real> ScheduledPidState<T> {
    fn new(pid: PidState<T>, gains: SampledPid<T>) -> Self {
        let (turn, furthest) = (T::ZERO, T::ZERO);
        Self { pid, gains, turn, furthest, half_wave: 0, since: 0, turns: 0, begun: false }
    }

    /// Follows the reference; true where it has turned.
    #[inline]
    fn turned(&mut self, reference: T) -> bool {
        if !self.begun {
            (self.turn, self.furthest, self.begun) = (reference, reference, true);
        }
        self.since = self.since.saturating_add(1);
        let swing = self.furthest - self.turn;
        if (reference - self.furthest) * swing >= T::ZERO {
            self.half_wave = self.half_wave.saturating_add(self.since);
            (self.furthest, self.since) = (reference, 0);
            return false;
        }
        (self.furthest - reference).abs() > T::of(TURNED) * swing.abs()
    }
}

impl<T: Real> Feedback<T> for ScheduledPid<T> {
    type State = ScheduledPidState<T>;

    fn rest(&self) -> ScheduledPidState<T> {
        ScheduledPidState::new(self.first.rest(), self.first)
    }

    fn start(&self, volts: T) -> ScheduledPidState<T> {
        ScheduledPidState::new(self.first.start(volts), self.first)
    }

    /// Always: the gains are those of the new schedule from the next turning point on.
    fn adopt(&self, _before: &Self, _state: &mut ScheduledPidState<T>) -> bool {
        true
    }

    #[inline]
    fn step(&self, state: &mut ScheduledPidState<T>, sample: &FeedbackSample<T>) -> T {
        if state.turned(sample.reference) {
            // The first half wave is cut off where the motion begins.
            if state.turns > 0 && state.half_wave > 0 {
                let amplitude = T::of(0.5) * (state.furthest - state.turn).abs();
                let rate = T::of(0.5) / (T::count(state.half_wave) * self.dt);
                state.gains = self.at(amplitude, rate);
            }
            state.turns = state.turns.saturating_add(1);
            state.turn = state.furthest;
            state.furthest = sample.reference;
            (state.half_wave, state.since) = (state.since, 0);
        }
        state.gains.step(&mut state.pid, sample)
    }
}
