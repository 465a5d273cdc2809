//! A model whose hysteresis is at the input: what a stage is with its operator.

use piezotrack_control::hysteresis::Operator;
use piezotrack_control::{CreepState, InputInverse, InputInverseState, OperatorInverse, Snapshot};

use super::input_stage::{InputStage, Segmented};
use crate::design::{Gains, LoopPlant};
use crate::error::Result;
use crate::models::creep::{MOST_RELAXATIONS, Relaxation};
use crate::models::parameters::dynamics_parameters::DYNAMICS;
use crate::models::parameters::values::{ParameterInfo, ROOM, Values, extended};
use crate::models::traits::{
    Experiment, Invertible, ModelInfo, Response, StageModel, finite_state,
};

/// An operator with the name and the parameters of a model, and with an inverse.
pub trait InputModel: Segmented {
    /// The name that both languages use.
    const NAME: &'static str;

    /// Title in tables and pictures.
    const TITLE: &'static str;

    /// Parameters of the operator; those of creep and dynamics follow them.
    const PARAMETERS: &'static [ParameterInfo];

    /// Its inverse, whose state can be kept as numbers.
    type Inverse: OperatorInverse<State: Snapshot>;

    /// The operator with these parameters, which may have others beside.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    fn build(values: &Values) -> Result<Self>;

    /// The operator with its slopes along a path, whose settled loop has the gains of the stage.
    fn path(&self) -> &impl Operator<f64>;

    /// The inverse for outputs every `dt` seconds.
    ///
    /// # Errors
    /// Names the parameter, or `dt`, that is out of its range.
    fn inverse(&self, dt: f64) -> Result<Self::Inverse>;

    /// The state in which the inverse starts behind an operator in this state.
    fn start(
        &self,
        inverse: &Self::Inverse,
        state: &Self::State,
    ) -> <Self::Inverse as OperatorInverse>::State;
}

impl<O: InputModel> InputStage<O> {
    const ALL_PARAMETERS: &'static [ParameterInfo; ROOM] = &extended(O::PARAMETERS, &DYNAMICS);
}

impl<O: InputModel> StageModel for InputStage<O> {
    const INFO: ModelInfo = ModelInfo {
        name: O::NAME,
        title: O::TITLE,
        drive_unit: "V",
        parameters: Self::ALL_PARAMETERS.split_at(O::PARAMETERS.len() + DYNAMICS.len()).0,
        state: O::STATE,
        published: &[],
    };

    fn build(values: &Values) -> Result<Self> {
        Ok(Self { operator: O::build(values)?, relaxation: Relaxation::build(values)? })
    }

    /// With the creep complete.
    fn equilibrium(&self, voltages: &[f64]) -> Result<Values> {
        finite_state(self.values_of(&self.settled_at(voltages)), voltages)
    }

    fn simulate(&self, experiment: &Experiment<'_>) -> Result<Option<Response>> {
        self.follow(experiment)
    }

    /// On its settled loop between the two voltages.
    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]> {
        let gains = Gains::of(self.operator.path(), low, high, |slope| slope)?;
        gains.plants(|gain| self.relaxation.loop_plant(gain))
    }
}

impl<O: InputModel> Invertible for InputStage<O> {
    type Inverse = InputInverse<O::Inverse, MOST_RELAXATIONS>;

    fn inverse(
        &self,
        dt: f64,
        initial: Option<&Values>,
    ) -> Result<(
        Self::Inverse,
        InputInverseState<<O::Inverse as OperatorInverse>::State, MOST_RELAXATIONS>,
    )> {
        let Self { operator, relaxation } = self;
        let (inverse, zero) = (operator.inverse(dt)?, self.zero());
        let inverse =
            InputInverse::with(inverse, zero, relaxation.used(), relaxation.dynamics, dt)?;
        let state = self.state(initial)?;
        let memory = operator.start(inverse.operator(), &state.operator);
        let creep = CreepState { input: state.relaxation.input, reached: state.relaxation.creep };
        let start = inverse.start(memory, creep);
        Ok((inverse, start))
    }
}
