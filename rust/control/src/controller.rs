//! The whole controller: feedforward, feedback and repetitive part, clipped to the limits.
//!
//! ```text
//! u = uFB + uFF + uRC,   v = clip(u),   eu = v - u
//! ```
//!
//! Xu and Li 2010, section 4, doi 10.1115/1.4001712, with the corrections described in
//! [`crate::pid`] and [`crate::repetitive`].

use crate::error::{Error, Result, check, usable};
use crate::feedback_law::Feedback;
use crate::filters::{Filter, FilterState};
use crate::limits::Limits;
use crate::repetitive::{RepetitiveState, SampledRepetitive};

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
pub struct Controller<F> {
    /// Range of the actuator.
    pub limits: Limits,
    /// The feedback law; `()` for none.
    pub feedback: F,
    /// The repetitive part.
    pub repetitive: Option<SampledRepetitive>,
    /// Filters of the measurement, one after the other.
    pub filters: [Option<Filter>; 2],
}

/// State of a [`Controller`]; `L` is the delay line of the repetitive part, `[f64; 0]` for a
/// controller without one.
#[derive(Clone, Debug, PartialEq)]
pub struct ControllerState<S, L> {
    feedback: S,
    repetitive: Option<RepetitiveState<L>>,
    filters: [FilterState; 2],
    /// Voltage to continue from at the first step, V.
    present: Option<f64>,
    /// The last command.
    last: Command,
    /// Applied voltage less the unclipped command, eu, V.
    excess: f64,
    /// Tracking error of the last sample, which the repetitive part has yet to store, m.
    unlearnt: f64,
}

/// The command of a controller at one sample, with its parts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// The voltage for the actuator, within the limits, V.
    pub volts: f64,
    /// The voltage before it was clipped, V.
    pub unclipped: f64,
    /// Its feedforward part uFF, V.
    pub feedforward: f64,
    /// Its feedback part uFB, V.
    pub feedback: f64,
    /// Its repetitive part uRC, V.
    pub repetitive: f64,
    /// The tracking error used: reference less filtered measurement, m.
    pub error: f64,
    /// Whether the voltage was clipped.
    pub saturated: bool,
    /// False where the measurement was not finite (or beyond 1e100).
    pub measurement_ok: bool,
    /// False where the reference or the feedforward was not finite (or beyond 1e100).
    pub reference_ok: bool,
}

impl<F: Feedback> Controller<F> {
    /// A controller of limits and feedback only; set the public fields for more.
    #[must_use]
    pub fn new(limits: Limits, feedback: F) -> Self {
        Self { limits, feedback, repetitive: None, filters: [None; 2] }
    }

    /// The initial state, with the feedback part at 0 V.
    ///
    /// `line` is the delay line of the repetitive part; `[]` where there is none.
    ///
    /// # Errors
    /// Names `line` where it is too short for the repetitive part.
    pub fn rest<L: AsMut<[f64]>>(&self, line: L) -> Result<ControllerState<F::State, L>> {
        let repetitive = match &self.repetitive {
            Some(part) => Some(part.rest(line)?),
            None => None,
        };
        Ok(ControllerState {
            feedback: self.feedback.rest(),
            repetitive,
            filters: [None; 2],
            present: None,
            last: Command { volts: self.limits.clip(0.0), ..Command::default() },
            excess: 0.0,
            unlearnt: 0.0,
        })
    }

    /// The initial state for a bumpless start from the voltage `present` (V) at the actuator: the
    /// feedback part starts at `present` less the other parts.
    ///
    /// # Errors
    /// Names `present` where it is outside the limits, `line` as in [`Self::rest`].
    pub fn start<L: AsMut<[f64]>>(
        &self,
        present: f64,
        line: L,
    ) -> Result<ControllerState<F::State, L>> {
        let right = (self.limits.low()..=self.limits.high()).contains(&present);
        check("present", present, "V", right, "a voltage within the limits")?;
        let mut state = self.rest(line)?;
        state.present = Some(present);
        state.last.volts = present;
        Ok(state)
    }

    /// Resets the state to that of [`Self::rest`]; the delay line is cleared and kept.
    pub fn reset<L: AsMut<[f64]>>(&self, state: &mut ControllerState<F::State, L>) {
        if let (Some(part), Some(memory)) = (&self.repetitive, &mut state.repetitive) {
            part.reset(memory);
        }
        state.feedback = self.feedback.rest();
        state.filters = [None; 2];
        state.present = None;
        state.last = Command { volts: self.limits.clip(0.0), ..Command::default() };
        state.excess = 0.0;
        state.unlearnt = 0.0;
    }

    /// One sample: `reference` and `measured` displacement in m, `feedforward` in V.
    ///
    /// Inputs that are not finite (or beyond 1e100) affect neither the actuator nor any state, and
    /// are reported by the flags of the command. Without a valid measurement or reference the
    /// feedback part holds its output, and the repetitive part continues its output without
    /// learning. Without a valid feedforward the last one is held.
    #[inline]
    pub fn step<L: AsMut<[f64]>>(
        &self,
        state: &mut ControllerState<F::State, L>,
        reference: f64,
        measured: f64,
        feedforward: f64,
    ) -> Command {
        let measurement_ok = usable(measured);
        let feedforward_ok = usable(feedforward);
        let error_ok = measurement_ok && usable(reference);
        let reference_ok = feedforward_ok && usable(reference);
        let last = state.last;
        let feedforward = if feedforward_ok { feedforward } else { last.feedforward };
        let repetitive = match (&self.repetitive, &mut state.repetitive) {
            (Some(part), Some(memory)) => part.step(memory, state.unlearnt, last.saturated),
            _ => 0.0,
        };
        let mut feedback = last.feedback;
        if let Some(present) = state.present.take() {
            feedback = present - feedforward - repetitive;
            state.feedback = self.feedback.start(feedback);
        }
        let mut error = last.error;
        state.unlearnt = 0.0;
        if error_ok {
            error = reference - self.filtered(&mut state.filters, measured);
            let volts = self.feedback.step(&mut state.feedback, error, state.excess);
            feedback = if volts.is_finite() { volts } else { feedback };
            state.unlearnt = error;
        }
        let unclipped = feedback + feedforward + repetitive;
        // The sum overflowed: hold the last voltage.
        let unclipped = if unclipped.is_finite() { unclipped } else { last.volts };
        let volts = self.limits.clip(unclipped);
        state.excess = volts - unclipped;
        state.last = Command {
            volts,
            unclipped,
            feedforward,
            feedback,
            repetitive,
            error,
            saturated: state.excess.abs() > 0.0,
            measurement_ok,
            reference_ok,
        };
        state.last
    }

    #[inline]
    fn filtered(&self, states: &mut [FilterState; 2], measured: f64) -> f64 {
        let mut value = measured;
        for (filter, state) in self.filters.iter().zip(states) {
            if let Some(filter) = filter {
                value = filter.step(state, value);
            }
        }
        value
    }
}

impl<S, L> ControllerState<S, L> {
    /// Reports the voltage (V) applied for the last command, where it differs from the clipped
    /// command because of a slew rate or of the amplifier's own limits.
    ///
    /// Antiwindup uses it; without this call, it uses the clipped command.
    ///
    /// # Errors
    /// Names `volts` where it is not finite; nothing is changed then.
    pub fn applied(&mut self, volts: f64) -> Result<()> {
        if !usable(volts) {
            let expected = "the voltage that the actuator got";
            return Err(Error { name: "volts", value: volts, unit: "V", expected });
        }
        self.excess = volts - self.last.unclipped;
        Ok(())
    }

    /// The last command.
    #[must_use]
    pub fn last(&self) -> &Command {
        &self.last
    }
}
