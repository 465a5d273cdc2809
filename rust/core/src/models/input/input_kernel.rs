//! The kernel of lumped stages with their hysteresis at the input: `m x'' + b x' + k x = k (d u - h)`.

use core::f64::consts::TAU;

use piezotrack_control::Number;
use piezotrack_control::hysteresis::{BoucWenState, NonsmoothOperator, Operator};

use crate::design::{Gains, LoopPlant};
use crate::error::Result;
use crate::integrator::{
    InputCoupling, InputMemory, Kernel, Mechanics, Parameters, equilibrium, linear,
};

/// The operator of such stages, V to m, from their parameters: m, b, k, d and those of the hysteresis.
pub trait InputHysteresis: Copy + Send + Sync {
    /// The operator.
    type Operator<N: Number>: NonsmoothOperator<N, State = BoucWenState<N>>;

    /// The operator with these parameters.
    fn operator<N: Number>(&self, parameters: &Parameters<N>) -> Self::Operator<N>;
}

/// Lumped stages with one hysteresis at the input.
#[derive(Clone, Copy, Debug)]
pub struct InputKernel<H>(
    /// Makes the operator; the same in all lanes.
    pub H,
);

impl<H: InputHysteresis> Kernel for InputKernel<H> {
    type Coupling<N: Number> = InputCoupling<N, H::Operator<N>>;

    /// The drive enters in volts.
    #[inline(always)]
    fn coupling<N: Number>(
        &self,
        parameters: &Parameters<N>,
        step: f64,
        halvings: u32,
    ) -> (Self::Coupling<N>, N) {
        let [_, _, stiffness, gain, ..] = *parameters;
        let linear = linear(parameters, step, halvings);
        let operator = self.0.operator(parameters);
        (InputCoupling { linear, operator, stiffness, gain }, gain.like(1.0))
    }

    #[inline(always)]
    fn rest<N: Number>(&self, parameters: &Parameters<N>) -> InputMemory<N, BoucWenState<N>> {
        let zero = parameters[0].like(0.0);
        InputMemory { operator: self.0.operator(parameters).rest(), input: zero, rise: zero }
    }

    #[inline(always)]
    fn approach<N: Number>(
        &self,
        parameters: &Parameters<N>,
        from: (N, InputMemory<N, BoucWenState<N>>),
        volts: N,
    ) -> (N, InputMemory<N, BoucWenState<N>>) {
        equilibrium::input(&self.0.operator(parameters), parameters[3], &from.1, volts)
    }

    /// k h, what the hysteresis takes off the drive's force.
    #[inline(always)]
    fn force(
        &self,
        parameters: &Parameters<f64>,
        memory: &InputMemory<f64, BoucWenState<f64>>,
    ) -> f64 {
        parameters[2] * memory.operator.value
    }
}

/// Such a stage on its settled loop between the two voltages: `d - dh/du`.
pub(in crate::models) fn plants_with_input<O: Operator<f64>>(
    operator: &O,
    mechanics: &Mechanics,
    piezo: f64,
    low: f64,
    high: f64,
) -> Result<[LoopPlant; 3]> {
    let gains = Gains::of(operator, low, high, |slope| piezo - slope)?;
    let Mechanics { mass, damping, stiffness } = *mechanics;
    let natural = libm::sqrt(stiffness / mass);
    let ratio = 0.5 * damping / (mass * natural);
    gains.plants(|gain| LoopPlant::mode(gain, natural / TAU, ratio))
}
