//! Kernels of the Dahl stage: smooth, of second or fourth order, or with dry friction.

use piezotrack_control::Number;
use piezotrack_control::hysteresis::{Dahl, DahlState, Operator};

use super::stage::{DahlStage, DahlStageState};
use crate::integrator::{
    Coupling, FeedbackCoupling, FeedbackState, FrictionCoupling, FrictionMemory,
    FrictionParameters, Kernel, Parameters, TERMS, equilibrium, halvings, linear,
};
use crate::models::plant::{Plant, Settling};

/// Without dry friction: `T` terms of the operator's series, to second or fourth order.
#[derive(Clone, Copy, Debug)]
pub struct SmoothKernel<const T: usize, const FOURTH: bool>;

#[inline(always)]
fn operator<N: Number, const T: usize>(parameters: &Parameters<N>) -> Dahl<N, T> {
    let [_, _, _, _, a1, a2, b1, _, up, ..] = *parameters;
    Dahl { a1, a2, gain: b1 * up }
}

impl<const T: usize, const FOURTH: bool> Kernel for SmoothKernel<T, FOURTH> {
    const VECTORS: usize = 3;

    type Coupling<N: Number> = FeedbackCoupling<N, Dahl<N, T>, FOURTH>;

    #[inline(always)]
    fn coupling<N: Number>(
        &self,
        parameters: &Parameters<N>,
        step: f64,
        halvings: u32,
    ) -> (Self::Coupling<N>, N) {
        let linear = linear(parameters, step, halvings);
        (FeedbackCoupling { linear, operator: operator(parameters) }, parameters[3])
    }

    #[inline(always)]
    fn rest<N: Number>(&self, parameters: &Parameters<N>) -> DahlState<N> {
        operator::<N, T>(parameters).rest()
    }

    #[inline(always)]
    fn approach<N: Number>(
        &self,
        parameters: &Parameters<N>,
        from: (N, DahlState<N>),
        volts: N,
    ) -> (N, DahlState<N>) {
        let [_, _, stiffness, piezo, ..] = *parameters;
        equilibrium::feedback(&operator::<N, T>(parameters), stiffness, from, piezo * volts)
    }

    #[inline(always)]
    fn force(&self, _parameters: &Parameters<f64>, memory: &DahlState<f64>) -> f64 {
        memory.force
    }
}

/// With dry friction: reversals, sticking and breaking away are located inside the step.
#[derive(Clone, Copy, Debug)]
pub struct FrictionKernel;

#[inline(always)]
fn friction<N: Number>(parameters: &Parameters<N>) -> FrictionParameters<N> {
    let [mass, damping, stiffness, _, a1, a2, b1, b0, up, ..] = *parameters;
    let (mechanics, operator) = ([mass, damping, stiffness], [a1, a2, up]);
    FrictionParameters { mechanics, operator, b1, b0 }
}

impl Kernel for FrictionKernel {
    type Coupling<N: Number> = FrictionCoupling<N>;

    #[inline(always)]
    fn coupling<N: Number>(
        &self,
        parameters: &Parameters<N>,
        step: f64,
        halvings: u32,
    ) -> (FrictionCoupling<N>, N) {
        (FrictionCoupling::new(friction(parameters), step, halvings), parameters[3])
    }

    #[inline(always)]
    fn rest<N: Number>(&self, parameters: &Parameters<N>) -> FrictionMemory<N> {
        let zero = parameters[0].like(0.0);
        friction(parameters).memory(zero, DahlState { force: zero, slope: zero })
    }

    #[inline(always)]
    fn approach<N: Number>(
        &self,
        parameters: &Parameters<N>,
        from: (N, FrictionMemory<N>),
        volts: N,
    ) -> (N, FrictionMemory<N>) {
        friction(parameters).approach(from, parameters[3] * volts)
    }

    #[inline(always)]
    fn force(&self, _parameters: &Parameters<f64>, memory: &FrictionMemory<f64>) -> f64 {
        memory.force
    }

    fn unique(&self, memory: &FrictionMemory<f64>) -> bool {
        memory.doubt <= 0.0
    }
}

/// Steps of a [`DahlStage`] in an experiment.
#[derive(Clone, Copy, Debug)]
pub struct DahlFlow {
    coupling: DahlCoupling,
    step: f64,
}

#[derive(Clone, Copy, Debug)]
enum DahlCoupling {
    /// b0 = 0.
    Smooth(FeedbackCoupling<f64, Dahl<f64, TERMS>, true>),
    /// Any other.
    FrictionCoupling(FrictionCoupling<f64>),
}

impl Plant for DahlStage {
    type State = DahlStageState;
    type Flow = DahlFlow;

    fn rest(&self) -> DahlStageState {
        DahlStageState::default()
    }

    fn flow(&self, step: f64) -> DahlFlow {
        let halvings = halvings(self.mechanics.rate(), step);
        let parameters = self.lumped(FrictionKernel).parameters;
        let coupling = if self.has_friction() {
            DahlCoupling::FrictionCoupling(FrictionKernel.coupling(&parameters, step, halvings).0)
        } else {
            let kernel = SmoothKernel::<TERMS, true>;
            DahlCoupling::Smooth(kernel.coupling(&parameters, step, halvings).0)
        };
        DahlFlow { coupling, step }
    }

    #[inline(always)]
    fn advance(&self, flow: &DahlFlow, state: &mut DahlStageState, from: f64, to: f64) {
        let DahlFlow { coupling, step } = flow;
        let gain = self.piezo_coefficient;
        let (drive, rise) = (gain * from, gain * (to - from));
        let (x, w) = (state.x, state.v * step);
        *state = match coupling {
            DahlCoupling::Smooth(smooth) => {
                let start = FeedbackState { x, w, memory: self.memory(state) };
                let end = smooth.step(&start, drive, rise);
                let (q1, q2) = self.states(&end.memory);
                DahlStageState { x: end.x, v: end.w / step, q1, q2 }
            }
            DahlCoupling::FrictionCoupling(friction) => {
                let memory = DahlState { force: state.q1, slope: state.q2 };
                let end = friction.step(&friction.start(x, w, memory), drive, rise);
                let DahlState { force: q1, slope: q2 } = end.memory.operator;
                DahlStageState { x: end.x, v: end.w / step, q1, q2 }
            }
        };
    }

    fn displacement(&self, state: &DahlStageState) -> f64 {
        state.x
    }
}

impl Settling for DahlStage {
    fn settled(&self, voltages: &[f64]) -> DahlStageState {
        let (x, (q1, q2)) = if self.b1 == 0.0 || self.has_friction() {
            let end = self.lumped(FrictionKernel).equilibrium(voltages);
            (end.x, (end.memory.operator.force, end.memory.operator.slope))
        } else {
            let end = self.lumped(SmoothKernel::<TERMS, true>).equilibrium(voltages);
            (end.x, self.states(&end.memory))
        };
        DahlStageState { x, v: 0.0, q1, q2 }
    }
}
