//! The whole controller: feedforward, feedback and repetitive part, clipped to the limits.
//!
//! ```text
//! u = uFB + uFF + uRC,   v = clip(u),   eu = v - u
//! ```
//!
//! Xu and Li 2010, section 4, doi 10.1115/1.4001712, with the corrections described in
//! [`crate::pid`] and [`crate::repetitive`].

use crate::cast::Cast;
use crate::error::{Error, Result, check};
use crate::feedback_law::{Feedback, FeedbackSample};
use crate::filters::{Filter, FilterState};
use crate::limits::Limits;
use crate::measurement::{Readings, Refused, Span};
use crate::number::Real;
use crate::repetitive::{Outcome, RepetitiveState, SampledRepetitive};
use crate::snapshot::Snapshot;

/// A controller for one sampling interval: limits, feedback, repetitive part and filters.
///
/// Gains may be changed between two steps with the state kept; the transfer is bumpless.
///
/// ```
/// use piezotrack_control::{Controller, Limits, Pid};
///
/// let pid = Pid::new(0.120e6, 0.009, 0.044, None)?.at(0.02)?;
/// let controller = Controller::new(Limits::new(0.0, 75.0)?, pid);
/// let mut state = controller.rest([])?;
/// let command = controller.step(&mut state, 1e-6, 0.0, 0.5);
/// assert!((command.volts - (0.5 + 0.120 * 0.02 / 0.009)).abs() < 1e-12);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Controller<F, T = f64> {
    /// Range of the actuator.
    pub limits: Limits<T>,
    /// Displacements that the stage can have: what is beyond is no measurement.
    pub span: Span<T>,
    /// The feedback law; `()` for none.
    pub feedback: F,
    /// The repetitive part.
    pub repetitive: Option<SampledRepetitive<T>>,
    /// Filters of the measurement, one after the other.
    pub filters: [Option<Filter<T>>; 2],
    /// Whether the feedforward makes the stage follow the reference, as an inverse does: a law that
    /// damps acts on what is left then, the deviation from the reference. False by default.
    pub follows: bool,
}

/// State of a [`Controller`]; `L` is the delay line of the repetitive part, `[T; 0]` for a
/// controller without one.
#[derive(Clone, Debug, PartialEq)]
pub struct ControllerState<S, L, T = f64> {
    pub(crate) feedback: S,
    pub(crate) repetitive: Option<RepetitiveState<L, T>>,
    pub(crate) filters: [FilterState<T>; 2],
    /// Voltage to continue from at the next step, V.
    present: Option<T>,
    /// Whether there was a step since the start.
    stepped: bool,
    /// The last command.
    pub(crate) last: Command<T>,
    /// Applied voltage less the unclipped command, eu, V.
    pub(crate) excess: T,
    /// Whether that is from a voltage that was reported.
    reported: bool,
    /// Whether the next sample is the first after a start or a reported voltage.
    pub(crate) apart: bool,
    /// Tracking error of the last sample, which the repetitive part has yet to store, m.
    pub(crate) unlearnt: T,
    pub(crate) readings: Readings<T>,
}

crate::snapshot!(
    [S: Snapshot, T: Real, L: AsRef<[T]> + AsMut<[T]>]
    ControllerState<S, L, T> {
        feedback,
        repetitive,
        filters,
        present,
        stepped,
        last,
        excess,
        reported,
        apart,
        unlearnt,
        readings,
    }
);

/// Share of the limits' range by which a reported voltage may differ from the command without
/// counting as saturated: accuracy of its reading.
const READING: f64 = 0.01;

/// The command of a controller at one sample, with its parts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command<T = f64> {
    /// The voltage for the actuator, within the limits, V.
    pub volts: T,
    /// The voltage before it was clipped, V.
    pub unclipped: T,
    /// Its feedforward part uFF, V.
    pub feedforward: T,
    /// Its feedback part uFB, V.
    pub feedback: T,
    /// Its repetitive part uRC, V.
    pub repetitive: T,
    /// The tracking error used: reference less filtered measurement, m.
    pub error: T,
    /// Whether the voltage was clipped.
    pub saturated: bool,
    /// False where the measurement was not finite, outside the span, or a jump too far.
    pub measurement_ok: bool,
    /// False where the reference was not finite or far outside the span, or the feedforward was not
    /// finite.
    pub reference_ok: bool,
}

crate::snapshot!(
    [T: Real]
    Command<T> {
        volts,
        unclipped,
        feedforward,
        feedback,
        repetitive,
        error,
        saturated,
        measurement_ok,
        reference_ok
    }
);

/// Limits, span, law, repetitive part and filters, each in the other type.
impl<F: Cast> Cast for Controller<F> {
    type In<T: Real> = Controller<F::In<T>, T>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        let mut filters = [None; 2];
        for (slot, filter) in filters.iter_mut().zip(&self.filters) {
            *slot = filter.as_ref().map(Filter::cast).transpose()?;
        }
        Ok(Controller {
            limits: self.limits.cast()?,
            span: self.span.cast()?,
            feedback: self.feedback.cast()?,
            repetitive: self.repetitive.as_ref().map(SampledRepetitive::cast).transpose()?,
            filters,
            follows: self.follows,
        })
    }
}

impl<F: Feedback<T>, T: Real> Controller<F, T> {
    /// A controller of limits and feedback only; set the public fields for more.
    #[must_use]
    pub fn new(limits: Limits<T>, feedback: F) -> Self {
        let (span, filters) = (Span::default(), [None; 2]);
        Self { limits, span, feedback, repetitive: None, filters, follows: false }
    }

    /// The initial state, with the feedback part at 0 V.
    ///
    /// `line` is the delay line of the repetitive part; `[]` where there is none.
    ///
    /// # Errors
    /// Names `line` where it is too short for the repetitive part.
    pub fn rest<L: AsMut<[T]>>(&self, line: L) -> Result<ControllerState<F::State, L, T>> {
        let repetitive = match &self.repetitive {
            Some(part) => Some(part.rest(line)?),
            None => None,
        };
        Ok(ControllerState {
            feedback: self.feedback.rest(),
            repetitive,
            filters: [None; 2],
            present: None,
            stepped: false,
            last: Command { volts: self.limits.clip(T::ZERO), ..Command::default() },
            excess: T::ZERO,
            reported: false,
            apart: true,
            unlearnt: T::ZERO,
            readings: Readings::NONE,
        })
    }

    /// The initial state for a bumpless start from the voltage `present` (V) at the actuator: the
    /// feedback part starts at `present` less the other parts. An integrator works that off; a law
    /// without one keeps it as a constant part of its output.
    ///
    /// # Errors
    /// Names `present` where it is outside the limits, `line` as in [`Self::rest`].
    pub fn start<L: AsMut<[T]>>(
        &self,
        present: T,
        line: L,
    ) -> Result<ControllerState<F::State, L, T>> {
        let right = (self.limits.low()..=self.limits.high()).contains(&present);
        check("present", present.into(), "V", right, "a voltage within the limits")?;
        let mut state = self.rest(line)?;
        state.present = Some(present);
        state.last.volts = present;
        Ok(state)
    }

    /// Forgets errors, readings and everything learnt, and goes on from the voltage that is there,
    /// without a bump, as after [`Self::start`]; before the first step as after [`Self::rest`].
    ///
    /// Without feedback there is nothing that could hold the voltage: it is the feedforward then.
    /// A law without an integrator holds it as a constant part of its output.
    pub fn reset<L: AsMut<[T]>>(&self, state: &mut ControllerState<F::State, L, T>) {
        if let (Some(part), Some(memory)) = (&self.repetitive, &mut state.repetitive) {
            part.reset(memory);
        }
        let present = self.limits.clip(state.voltage());
        if state.stepped {
            state.present = Some(present);
        }
        state.feedback = self.feedback.rest();
        state.filters = [None; 2];
        state.last = Command { volts: present, ..Command::default() };
        state.stepped = false;
        (state.excess, state.reported, state.apart) = (T::ZERO, false, true);
        state.unlearnt = T::ZERO;
        state.readings = Readings::NONE;
    }

    /// Goes on with the settings of `next` in place of these, without a bump; the limits and the
    /// span are those of `next` at once.
    ///
    /// Where only the gains of a [`crate::Pid`] change, its state is kept. Otherwise the feedback
    /// starts anew from the voltage that is there, as in [`Self::start`], and changed filters start
    /// from the next measurement. What was learnt is kept.
    ///
    /// # Errors
    /// Names `repetitive` where the two have not the same period and lines; nothing is changed.
    pub fn retune<L: AsMut<[T]>>(
        &self,
        next: &Self,
        state: &mut ControllerState<F::State, L, T>,
    ) -> Result<()> {
        let mine = self.repetitive.as_ref().map(SampledRepetitive::memory);
        let others = next.repetitive.as_ref().map(SampledRepetitive::memory);
        if mine != others {
            let value = others.map_or(0.0, |(period, _)| period);
            let expected = "a repetitive part of the same period, with lines as long";
            return Err(Error { name: "repetitive", value, unit: "samples", expected });
        }
        let kept = next.feedback.adopt(&self.feedback, &mut state.feedback);
        for ((filter, other), memory) in
            self.filters.iter().zip(&next.filters).zip(&mut state.filters)
        {
            if filter != other {
                *memory = None;
            }
        }
        let same = self.filters == next.filters
            && self.repetitive == next.repetitive
            && self.follows == next.follows;
        if state.stepped && !(kept && same) {
            state.present = Some(next.limits.clip(state.voltage()));
            state.apart = true;
        }
        Ok(())
    }

    /// One sample: `reference` and `measured` displacement in m, `feedforward` in V.
    ///
    /// Inputs that are not finite affect neither the actuator nor any state, and are reported by
    /// the flags of the command; so do measurements outside the span (or jumps that it excludes)
    /// and references that are outside it by more than its width. Without a valid measurement or reference the feedback part
    /// holds its output, and the repetitive part continues its output without learning. Without a
    /// valid feedforward the last one is held; of one far outside the limits, as much is used as
    /// reaches from one limit beyond the other by the range between them.
    #[inline]
    pub fn step<L: AsMut<[T]>>(
        &self,
        state: &mut ControllerState<F::State, L, T>,
        reference: T,
        measured: T,
        feedforward: T,
    ) -> Command<T> {
        self.advance(state, reference, measured, feedforward);
        // Here, so that what the caller does not use of it is not copied.
        state.last
    }

    /// Computes the last command of the state.
    fn advance<L: AsMut<[T]>>(
        &self,
        state: &mut ControllerState<F::State, L, T>,
        reference: T,
        measured: T,
        feedforward: T,
    ) {
        let measurement_ok = self.span.accepts(&mut state.readings, measured);
        let reference_fits = self.span.may_ask_for(reference);
        let (low, high) = (self.limits.low(), self.limits.high());
        let (mut feedforward_ok, mut used) = (true, feedforward);
        if !(feedforward >= low - (high - low) && feedforward <= high + (high - low)) {
            (feedforward_ok, used) = self.far_feedforward(feedforward, state.last.feedforward);
        }
        let applied = state.voltage();
        let (mut present, mut learns) = (None, state.excess);
        if state.apart {
            (present, learns) = self.first(state);
        }
        let last = state.last;
        let repetitive = match (&self.repetitive, &mut state.repetitive) {
            (Some(part), Some(memory)) => {
                let before = Outcome { error: state.unlearnt, excess: learns };
                part.step(memory, before, high - low)
            }
            _ => T::ZERO,
        };
        let mut feedback = last.feedback;
        if let Some(present) = present {
            feedback = present - used - repetitive;
            state.feedback = self.feedback.start(feedback);
            state.excess = T::ZERO;
        }
        let mut error = last.error;
        state.unlearnt = T::ZERO;
        if measurement_ok && reference_fits {
            let measured = self.filtered(&mut state.filters, measured);
            error = reference - measured;
            let (excess, feedforward, follows) = (state.excess, used + repetitive, self.follows);
            let sample = FeedbackSample {
                error,
                reference,
                measured,
                excess,
                applied,
                feedforward,
                follows,
            };
            let volts = self.feedback.step(&mut state.feedback, &sample);
            feedback = if volts.is_finite() { volts } else { feedback };
            state.unlearnt = error;
        }
        let unclipped = feedback + used + repetitive;
        // The sum overflowed: hold the last voltage.
        let unclipped = if unclipped.is_finite() { unclipped } else { last.volts };
        let volts = self.limits.clip(unclipped);
        state.excess = volts - unclipped;
        state.last = Command {
            volts,
            unclipped,
            feedforward: used,
            feedback,
            repetitive,
            error,
            saturated: state.excess.abs() > T::ZERO,
            measurement_ok,
            reference_ok: reference_fits && feedforward_ok,
        };
    }

    /// Whether a feedforward far outside the limits is valid, and what is used in its place.
    #[inline]
    fn far_feedforward(&self, feedforward: T, last: T) -> (bool, T) {
        if feedforward.is_usable() { (true, self.near(feedforward)) } else { (false, last) }
    }

    /// At the first sample after a start or a reported voltage: the voltage to start the feedback
    /// from, if any, and the excess that the repetitive part is told.
    #[inline]
    fn first<L>(&self, state: &mut ControllerState<F::State, L, T>) -> (Option<T>, T) {
        let range = self.limits.high() - self.limits.low();
        let accurate = state.reported && state.excess.abs() <= T::of(READING) * range;
        let excess = if accurate { T::ZERO } else { state.excess };
        (state.stepped, state.reported, state.apart) = (true, false, false);
        (state.present.take().filter(|_| self.feedback.holds()), excess)
    }

    /// Reports the voltage (V) applied for the last command, where it differs from the clipped
    /// command because of a slew rate or of the amplifier's own limits.
    ///
    /// Antiwindup uses it; without this call, it uses the clipped command. Where it differs from
    /// the command by more than 1 % of the limits' range, the sample counts as saturated for the
    /// repetitive part. A voltage outside the limits by more than the range between them is no
    /// reading, and is ignored; so is one before the first command.
    ///
    /// # Errors
    /// Names `volts` where it is not finite; nothing is changed then.
    pub fn applied<L>(&self, state: &mut ControllerState<F::State, L, T>, volts: T) -> Result<()> {
        if !volts.is_finite() {
            let expected = "the voltage that the actuator got";
            return Err(Error { name: "volts", value: volts.into(), unit: "V", expected });
        }
        let range = self.limits.high() - self.limits.low();
        let near = volts >= self.limits.low() - range && volts <= self.limits.high() + range;
        if state.stepped && near {
            state.excess = volts - state.last.unclipped;
            (state.reported, state.apart) = (true, true);
        }
        Ok(())
    }

    /// How much of the last feedforward reached the stage, V: for [`crate::OnlineFeedforward`],
    /// whose inverse otherwise remembers what the stage never got.
    ///
    /// It is within the limits and, where the command was clipped or [`Self::applied`] reported a
    /// saturated amplifier, not beyond the voltage that was applied, which may have been outside of
    /// the limits. `None` where that is all of it.
    #[must_use]
    pub fn reached<L>(&self, state: &ControllerState<F::State, L, T>) -> Option<T> {
        let (asked, excess) = (state.last.feedforward, state.excess);
        let mut reached = self.limits.clip(asked);
        if excess.abs() > T::of(READING) * (self.limits.high() - self.limits.low()) {
            // Not from the excess, which of a huge command has lost the voltage to rounding.
            let volts = if state.reported { self.near(state.voltage()) } else { state.last.volts };
            reached = if excess < T::ZERO { reached.smaller(volts) } else { reached.larger(volts) };
        }
        ((reached - asked).abs() > T::ZERO).then_some(reached)
    }

    /// A voltage, outside the limits by the range between them at most.
    fn near(&self, volts: T) -> T {
        let (low, high) = (self.limits.low(), self.limits.high());
        volts.larger(low - (high - low)).smaller(high + (high - low))
    }

    #[inline]
    fn filtered(&self, states: &mut [FilterState<T>; 2], measured: T) -> T {
        let mut value = measured;
        for (filter, state) in self.filters.iter().zip(states) {
            if let Some(filter) = filter {
                value = filter.step(state, value);
            }
        }
        value
    }
}

impl<S, L, T: Real> ControllerState<S, L, T> {
    /// The last command.
    #[must_use]
    pub fn last(&self) -> &Command<T> {
        &self.last
    }

    /// Number of readings that were no measurements since the start.
    #[must_use]
    pub fn refused(&self) -> Refused {
        self.readings.refused
    }

    /// The last valid measurement, m, if there was one.
    #[must_use]
    pub fn measured(&self) -> Option<T> {
        self.readings.last()
    }

    /// The voltage at the actuator: the last command, or what was reported as applied, V.
    fn voltage(&self) -> T {
        if self.stepped { self.last.unclipped + self.excess } else { self.last.volts }
    }
}
