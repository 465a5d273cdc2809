//! One axis of a stage: a model, or a virtual stage.

use super::virtual_stage::{VirtualStage, VirtualState};
use super::{Apparatus, ApparatusState};
use crate::models::{Plant, RelaxationFlow, Settling, Stage, StageFlow, StageState};

/// A model, or a virtual stage.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "two in an experiment")]
pub enum Axis {
    /// A model, with nothing around it.
    Model {
        /// The stage.
        stage: Stage,
        /// Longest step of the simulation, s.
        step: f64,
    },
    /// A virtual stage, with its amplifier and its sensor.
    Virtual(VirtualStage),
}

/// State of an [`Axis`].
#[derive(Clone, Debug)]
pub enum AxisState {
    /// Of a model.
    Model(StageState),
    /// Of a virtual stage.
    Virtual(VirtualState),
}

/// Steps of an [`Axis`].
#[expect(missing_debug_implementations, reason = "numbers of a step")]
pub enum AxisFlow {
    /// Of a model.
    Model(StageFlow),
    /// Of a virtual stage.
    Virtual(RelaxationFlow),
}

impl Axis {
    /// The axis between its amplifier and its sensor.
    #[must_use]
    pub fn apparatus(&self) -> Apparatus<'_, Self> {
        match self {
            Self::Model { step, .. } => Apparatus::ideal(self, *step),
            Self::Virtual(stage) => {
                let Apparatus { amplifier, sensor, step, .. } = stage.apparatus();
                Apparatus { plant: self, amplifier, sensor, step }
            }
        }
    }

    /// Where an experiment starts with a stage that visited voltages slowly, in turn, and rests
    /// at the last; a virtual stage has a start of its own.
    #[must_use]
    pub fn start_after(&self, voltages: &[f64]) -> ApparatusState<AxisState> {
        let start = self.start();
        match (self, voltages.last()) {
            (Self::Model { stage, .. }, Some(&volts)) => {
                let plant = AxisState::Model(stage.settled(voltages));
                ApparatusState { plant, command: volts, applied: volts, ..start }
            }
            _ => start,
        }
    }

    /// Where an experiment starts.
    #[must_use]
    pub fn start(&self) -> ApparatusState<AxisState> {
        match self {
            Self::Model { .. } => self.apparatus().rest(),
            Self::Virtual(stage) => {
                let ApparatusState { plant, command, applied, sensor } = stage.start();
                ApparatusState { plant: AxisState::Virtual(plant), command, applied, sensor }
            }
        }
    }
}

impl Plant for Axis {
    type State = AxisState;
    type Flow = AxisFlow;

    fn rest(&self) -> AxisState {
        match self {
            Self::Model { stage, .. } => AxisState::Model(stage.rest()),
            Self::Virtual(stage) => AxisState::Virtual(stage.rest()),
        }
    }

    fn flow(&self, step: f64) -> AxisFlow {
        match self {
            Self::Model { stage, .. } => AxisFlow::Model(stage.flow(step)),
            Self::Virtual(stage) => AxisFlow::Virtual(stage.flow(step)),
        }
    }

    #[inline(always)]
    fn advance(&self, flow: &AxisFlow, state: &mut AxisState, from: f64, to: f64) {
        match (self, flow, state) {
            (Self::Model { stage, .. }, AxisFlow::Model(flow), AxisState::Model(state)) => {
                stage.advance(flow, state, from, to);
            }
            (Self::Virtual(stage), AxisFlow::Virtual(flow), AxisState::Virtual(state)) => {
                stage.advance(flow, state, from, to);
            }
            // Flow and state are always those of the axis itself.
            _ => {}
        }
    }

    #[inline(always)]
    fn displacement(&self, state: &AxisState) -> f64 {
        match (self, state) {
            (Self::Model { stage, .. }, AxisState::Model(state)) => stage.displacement(state),
            (Self::Virtual(stage), AxisState::Virtual(state)) => stage.displacement(state),
            _ => f64::NAN,
        }
    }
}
