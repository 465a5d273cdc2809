//! Closed-loop tracking: reference and feedforward in, motion and commands out.

use piezotrack_control::{Command, Controller, ControllerState, Feedback};

use super::apparatus::{Apparatus, ApparatusState};
use super::closed_loop::{ClosedLoop, closed_loop};
use super::timing::Timing;
use crate::error::{Error, Result};
use crate::math::{room, zeros};
use crate::models::Plant;
use crate::signal::Stop;

/// Name of the memory of the repetitive part in errors.
pub const DELAY_LINE: &str = "the delay line of the repetitive control";

/// Reference that a controller is to follow, sample by sample.
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
