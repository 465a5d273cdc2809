//! Closed-loop tracking: reference and feedforward in, motion and commands out.

use piezotrack_control::hysteresis::{BoucWen, BoucWenState, Dahl, DahlState};
use piezotrack_control::unfused::Unfused;
use piezotrack_control::{
    Command, Controller, ControllerState, Feedback, FeedbackSample, HysteresisObserved,
    HysteresisObservedState, Observed, ObservedState, PidState, SampledPid, SampledSlidingMode,
    ScheduledPid, ScheduledPidState, SlidingModeState, Snapshot, StateSpace, StateSpaceState,
};

use super::apparatus::{Apparatus, ApparatusState};
use super::closed_loop::{ClosedLoop, closed_loop};
use super::timing::Timing;
use crate::design::LinearFeedback;
use crate::error::{Error, Result};
use crate::math::{room, zeros};
use crate::models::Plant;
use crate::signal::Stop;

/// Most states of a feedback law in state space.
pub const MOST_STATES: usize = 16;

/// What an error calls the memory of the repetitive part.
pub const DELAY_LINE: &str = "the delay line of the repetitive control";

/// The feedback laws that a controller can be given.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "one in a controller, and no allocation in it")]
pub enum Law {
    /// None: feedforward without feedback.
    None,
    /// Incremental PID.
    Pid(SampledPid),
    /// PID whose gains follow amplitude and rate of the reference.
    Scheduled(ScheduledPid),
    /// Discrete state space.
    StateSpace(StateSpace<MOST_STATES>),
    /// Sliding mode with a boundary layer.
    SlidingMode(SampledSlidingMode),
    /// Disturbance observer around a PID.
    ObservedPid(Observed<SampledPid>),
    /// Sliding mode with perturbation estimation.
    ObservedSlidingMode(Observed<SampledSlidingMode>),
    /// Observer of a Dahl hysteresis around a PID.
    DahlObserver(HysteresisObserved<Dahl<Unfused>, SampledPid>),
    /// Observer of a Bouc-Wen hysteresis around a PID.
    BoucWenObserver(HysteresisObserved<BoucWen<Unfused>, SampledPid>),
}

/// Memory of a [`Law`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LawState {
    /// Nothing to remember.
    None,
    /// Of a PID controller.
    Pid(PidState),
    /// Of a PID controller with scheduled gains.
    Scheduled(ScheduledPidState),
    /// Of a controller in state space.
    StateSpace(StateSpaceState<MOST_STATES>),
    /// Of sliding mode control.
    SlidingMode(SlidingModeState),
    /// Of a PID controller with a disturbance observer.
    ObservedPid(ObservedState<PidState>),
    /// Of sliding mode control with perturbation estimation.
    ObservedSlidingMode(ObservedState<SlidingModeState>),
    /// Of a PID controller with an observer of a Dahl hysteresis.
    DahlObserver(HysteresisObservedState<DahlState<Unfused>, PidState>),
    /// Of a PID controller with an observer of a Bouc-Wen hysteresis.
    BoucWenObserver(HysteresisObservedState<BoucWenState<Unfused>, PidState>),
}

impl Snapshot for LawState {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        match self {
            Self::None => {}
            Self::Pid(state) => state.save(write),
            Self::Scheduled(state) => state.save(write),
            Self::StateSpace(state) => state.save(write),
            Self::SlidingMode(state) => state.save(write),
            Self::ObservedPid(state) => state.save(write),
            Self::ObservedSlidingMode(state) => state.save(write),
            Self::DahlObserver(state) => state.save(write),
            Self::BoucWenObserver(state) => state.save(write),
        }
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        match self {
            Self::None => Some(()),
            Self::Pid(state) => state.load(read),
            Self::Scheduled(state) => state.load(read),
            Self::StateSpace(state) => state.load(read),
            Self::SlidingMode(state) => state.load(read),
            Self::ObservedPid(state) => state.load(read),
            Self::ObservedSlidingMode(state) => state.load(read),
            Self::DahlObserver(state) => state.load(read),
            Self::BoucWenObserver(state) => state.load(read),
        }
    }
}

impl Feedback for Law {
    type State = LawState;

    fn rest(&self) -> LawState {
        match self {
            Self::None => LawState::None,
            Self::Pid(law) => LawState::Pid(law.rest()),
            Self::Scheduled(law) => LawState::Scheduled(law.rest()),
            Self::StateSpace(law) => LawState::StateSpace(law.rest()),
            Self::SlidingMode(law) => LawState::SlidingMode(law.rest()),
            Self::ObservedPid(law) => LawState::ObservedPid(law.rest()),
            Self::ObservedSlidingMode(law) => LawState::ObservedSlidingMode(law.rest()),
            Self::DahlObserver(law) => LawState::DahlObserver(law.rest()),
            Self::BoucWenObserver(law) => LawState::BoucWenObserver(law.rest()),
        }
    }

    fn start(&self, volts: f64) -> LawState {
        match self {
            Self::None => LawState::None,
            Self::Pid(law) => LawState::Pid(law.start(volts)),
            Self::Scheduled(law) => LawState::Scheduled(law.start(volts)),
            Self::StateSpace(law) => LawState::StateSpace(law.start(volts)),
            Self::SlidingMode(law) => LawState::SlidingMode(law.start(volts)),
            Self::ObservedPid(law) => LawState::ObservedPid(law.start(volts)),
            Self::ObservedSlidingMode(law) => LawState::ObservedSlidingMode(law.start(volts)),
            Self::DahlObserver(law) => LawState::DahlObserver(law.start(volts)),
            Self::BoucWenObserver(law) => LawState::BoucWenObserver(law.start(volts)),
        }
    }

    fn holds(&self) -> bool {
        !matches!(self, Self::None)
    }

    fn adopt(&self, before: &Self, state: &mut LawState) -> bool {
        match (self, before, state) {
            (Self::Pid(law), Self::Pid(before), LawState::Pid(state)) => law.adopt(before, state),
            (Self::Scheduled(law), Self::Scheduled(before), LawState::Scheduled(state)) => {
                law.adopt(before, state)
            }
            (Self::StateSpace(law), Self::StateSpace(before), LawState::StateSpace(state)) => {
                law.adopt(before, state)
            }
            (Self::SlidingMode(law), Self::SlidingMode(before), LawState::SlidingMode(state)) => {
                law.adopt(before, state)
            }
            (Self::ObservedPid(law), Self::ObservedPid(before), LawState::ObservedPid(state)) => {
                law.adopt(before, state)
            }
            (
                Self::ObservedSlidingMode(law),
                Self::ObservedSlidingMode(before),
                LawState::ObservedSlidingMode(state),
            ) => law.adopt(before, state),
            (
                Self::DahlObserver(law),
                Self::DahlObserver(before),
                LawState::DahlObserver(state),
            ) => law.adopt(before, state),
            (
                Self::BoucWenObserver(law),
                Self::BoucWenObserver(before),
                LawState::BoucWenObserver(state),
            ) => law.adopt(before, state),
            (Self::None, Self::None, _) => true,
            _ => false,
        }
    }

    fn step(&self, state: &mut LawState, sample: &FeedbackSample) -> f64 {
        match (self, state) {
            (Self::Pid(law), LawState::Pid(state)) => law.step(state, sample),
            (Self::Scheduled(law), LawState::Scheduled(state)) => law.step(state, sample),
            (Self::StateSpace(law), LawState::StateSpace(state)) => law.step(state, sample),
            (Self::SlidingMode(law), LawState::SlidingMode(state)) => law.step(state, sample),
            (Self::ObservedPid(law), LawState::ObservedPid(state)) => law.step(state, sample),
            (Self::ObservedSlidingMode(law), LawState::ObservedSlidingMode(state)) => {
                law.step(state, sample)
            }
            (Self::DahlObserver(law), LawState::DahlObserver(state)) => law.step(state, sample),
            (Self::BoucWenObserver(law), LawState::BoucWenObserver(state)) => {
                law.step(state, sample)
            }
            _ => 0.0,
        }
    }
}

impl LinearFeedback for Law {
    fn transfer_function(&self) -> [Vec<f64>; 2] {
        match self {
            Self::None => ().transfer_function(),
            Self::Pid(law) => law.transfer_function(),
            Self::Scheduled(law) => law.first().transfer_function(),
            Self::StateSpace(law) => law.transfer_function(),
            Self::SlidingMode(law) => law.transfer_function(),
            Self::ObservedPid(law) => law.transfer_function(),
            Self::ObservedSlidingMode(law) => law.transfer_function(),
            Self::DahlObserver(law) => law.transfer_function(),
            Self::BoucWenObserver(law) => law.transfer_function(),
        }
    }

    fn named_gain(&self) -> Option<f64> {
        match self {
            Self::Pid(law) => law.named_gain(),
            Self::Scheduled(law) => law.first().named_gain(),
            _ => None,
        }
    }
}

/// What a controller is to follow, sample by sample.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceSamples<'a> {
    /// Reference, m.
    pub reference: &'a [f64],
    /// Feedforward, V.
    pub feedforward: &'a [f64],
}

/// A controlled motion and the commands behind it.
#[derive(Clone, Debug)]
pub struct TrackingRun<S> {
    /// The motion, with the instants between the control samples.
    pub motion: ClosedLoop<S>,
    /// The command at each control sample.
    pub commands: Vec<Command>,
}

/// Simulates a controller on an apparatus; `None` where `stop` said so meanwhile.
///
/// # Errors
/// [`Error::Shape`] where reference and feedforward differ in length; otherwise as [`closed_loop`].
pub fn track<P: Plant, F: Feedback>(
    apparatus: &Apparatus<'_, P>,
    start: ApparatusState<P::State>,
    timing: &Timing,
    controller: &Controller<F>,
    samples: ReferenceSamples<'_>,
    stop: Stop<'_>,
) -> Result<Option<TrackingRun<P::State>>> {
    let mut run = ControllerRun::new(controller, samples)?;
    let timing = Timing { samples: samples.reference.len(), ..*timing };
    let command = |k, measured| run.command(k, measured);
    let motion = closed_loop(apparatus, start, &timing, command, stop)?;
    Ok(motion.map(|motion| TrackingRun { motion, commands: run.commands }))
}

/// A running controller with its reference and feedforward.
pub(super) struct ControllerRun<'a, F: Feedback> {
    controller: &'a Controller<F>,
    input: ReferenceSamples<'a>,
    state: ControllerState<F::State, Vec<f64>>,
    /// By how many samples the reference is late at each sample; where empty, by none.
    behind: Vec<usize>,
    /// The commands so far.
    pub(super) commands: Vec<Command>,
}

impl<'a, F: Feedback> ControllerRun<'a, F> {
    pub(super) fn new(controller: &'a Controller<F>, input: ReferenceSamples<'a>) -> Result<Self> {
        let samples = input.reference.len();
        if input.feedforward.len() != samples {
            return Err(Error::Shape {
                name: "feedforward".into(),
                found: format!("{} samples", input.feedforward.len()),
                expected: format!("{samples}, as many as the reference"),
            });
        }
        let length = controller.repetitive.map_or(0, |part| part.length());
        let state = controller.rest(zeros(DELAY_LINE, length)?)?;
        let commands = room("the commands", samples)?;
        Ok(Self { controller, input, state, behind: Vec::new(), commands })
    }

    /// The same, with a reference that is late by so many samples.
    pub(super) fn late(self, behind: Vec<usize>) -> Self {
        Self { behind, ..self }
    }

    /// The command at sample `k`, V.
    pub(super) fn command(&mut self, k: usize, measured: f64) -> f64 {
        let at = k.saturating_sub(self.behind.get(k).copied().unwrap_or(0));
        let (reference, feedforward) = (self.input.reference[at], self.input.feedforward[at]);
        let command = self.controller.step(&mut self.state, reference, measured, feedforward);
        self.commands.push(command);
        command.volts
    }
}
