//! A plant in continuous time: voltage in, displacement out.

use crate::integrator::{Coupling, FeedbackState, Instant, Kernel, LumpedStage, Memory, halvings};

/// A stage from its terminals to its displacement: configuration in `&self`, memory in `State`.
pub trait Plant {
    /// State of the stage.
    type State: Clone;
    /// All that depends on the length of a step.
    type Flow;

    /// The state before any voltage.
    fn rest(&self) -> Self::State;

    /// Precomputes steps of `step` seconds.
    fn flow(&self, step: f64) -> Self::Flow;

    /// One step under a voltage that is linear from `from` to `to`, V.
    fn advance(&self, flow: &Self::Flow, state: &mut Self::State, from: f64, to: f64);

    /// Displacement, m.
    fn displacement(&self, state: &Self::State) -> f64;
}

/// A plant that can begin in equilibrium.
pub trait Settling: Plant {
    /// The state in equilibrium after a slow visit to each voltage in turn, from rest.
    fn settled(&self, voltages: &[f64]) -> Self::State;
}

/// A model that one kernel describes, whatever its parameters.
pub trait KernelModel: Copy {
    /// The kernel.
    type Kernel: Kernel;

    /// The kernel with the stage's parameters.
    fn lumped(&self) -> LumpedStage<Self::Kernel>;

    /// State of the hysteresis within a stage's state, whose numbers are in the order of the model's
    /// state.
    fn memory(&self, state: &[f64]) -> Memory<Self::Kernel, f64>;

    /// The state of the hysteresis as numbers, in the order of the model's state after displacement and
    /// velocity.
    fn state(&self, memory: &Memory<Self::Kernel, f64>) -> Vec<f64>;
}

/// Steps of a stage that a kernel describes.
#[derive(Clone, Copy, Debug)]
pub struct KernelFlow<C> {
    coupling: C,
    gain: f64,
    step: f64,
}

/// With the operator at the input, steps under a held voltage are exact, however long they are.
impl<M: KernelModel> Plant for M {
    type State = Instant<Memory<M::Kernel, f64>>;
    type Flow = KernelFlow<<M::Kernel as Kernel>::Coupling<f64>>;

    fn rest(&self) -> Self::State {
        self.lumped().rest()
    }

    fn flow(&self, step: f64) -> Self::Flow {
        let stage = self.lumped();
        let halvings = halvings(stage.mechanics().rate(), step);
        let (coupling, gain) = stage.kernel.coupling(&stage.parameters, step, halvings);
        KernelFlow { coupling, gain, step }
    }

    #[inline(always)]
    fn advance(&self, flow: &Self::Flow, state: &mut Self::State, from: f64, to: f64) {
        let KernelFlow { coupling, gain, step } = flow;
        let start = FeedbackState { x: state.x, w: state.v * step, memory: state.memory };
        let end = coupling.step(&start, gain * from, gain * (to - from));
        *state = Instant { x: end.x, v: end.w / step, memory: end.memory };
    }

    fn displacement(&self, state: &Self::State) -> f64 {
        state.x
    }
}

impl<M: KernelModel> Settling for M {
    fn settled(&self, voltages: &[f64]) -> Self::State {
        self.lumped().equilibrium(voltages)
    }
}
