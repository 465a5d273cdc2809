//! What an experiment moves: a voltage goes in, a displacement comes out.

use piezotrack_control::hysteresis::{Dahl, DahlState};

use super::dahl::{DahlStage, StageState};
use crate::integrator::{
    Alone, Coupling, FeedbackState, Friction, Instant, Kernel, Memory, Propagator, Smooth, TERMS,
    halvings,
};

/// A stage from its terminals to its displacement: configuration in `&self`, memory in `State`.
pub trait Plant {
    /// What the stage remembers.
    type State: Clone;
    /// All that the length of a step decides.
    type Flow;

    /// The state before any voltage.
    fn rest(&self) -> Self::State;

    /// Works out steps of `step` seconds.
    fn flow(&self, step: f64) -> Self::Flow;

    /// One step under a voltage that goes straight from `from` to `to`, V.
    fn advance(&self, flow: &Self::Flow, state: &mut Self::State, from: f64, to: f64);

    /// Displacement, m.
    fn displacement(&self, state: &Self::State) -> f64;
}

/// Steps of a [`DahlStage`].
#[derive(Clone, Copy, Debug)]
pub struct DahlFlow {
    coupling: DahlCoupling,
    step: f64,
}

#[derive(Clone, Copy, Debug)]
enum DahlCoupling {
    /// b0 = 0.
    Smooth(Smooth<f64, Dahl<f64, TERMS>, true>),
    /// Any other: reversals, sticking and breaking away are located inside the step.
    Friction(Friction<f64>),
}

impl Plant for DahlStage {
    type State = StageState;
    type Flow = DahlFlow;

    fn rest(&self) -> StageState {
        StageState::default()
    }

    fn flow(&self, step: f64) -> DahlFlow {
        let m = &self.mechanics;
        let halvings = halvings(m.rate(), step);
        let coupling = if self.has_friction() {
            DahlCoupling::Friction(Friction::new(self.friction(), step, halvings))
        } else {
            let (inverse, d, k) = (1.0 / m.mass, m.damping / m.mass, m.stiffness / m.mass);
            let linear = Propagator::new(inverse, d, k, step, halvings);
            DahlCoupling::Smooth(Smooth { linear, operator: self.operator() })
        };
        DahlFlow { coupling, step }
    }

    #[inline(always)]
    fn advance(&self, flow: &DahlFlow, state: &mut StageState, from: f64, to: f64) {
        let DahlFlow { coupling, step } = flow;
        let gain = self.piezo_coefficient;
        let (drive, rise) = (gain * from, gain * (to - from));
        let (x, w) = (state.x, state.v * step);
        *state = match coupling {
            DahlCoupling::Smooth(smooth) => {
                let start = FeedbackState { x, w, memory: self.memory(state) };
                let end = smooth.step(&start, drive, rise);
                let (q1, q2) = self.states(&end.memory);
                StageState { x: end.x, v: end.w / step, q1, q2 }
            }
            DahlCoupling::Friction(friction) => {
                let memory = DahlState { force: state.q1, slope: state.q2 };
                let end = friction.step(&friction.start(x, w, memory), drive, rise);
                let DahlState { force: q1, slope: q2 } = end.memory.operator;
                StageState { x: end.x, v: end.w / step, q1, q2 }
            }
        };
    }

    fn displacement(&self, state: &StageState) -> f64 {
        state.x
    }
}

/// Steps of a stage of any kind that a kernel describes.
#[derive(Clone, Copy, Debug)]
pub struct KernelFlow<C> {
    coupling: C,
    step: f64,
}

/// With the operator at the input, steps under a held voltage are exact, however long they are.
impl<K: Kernel<f64> + Copy> Plant for Alone<'_, K> {
    type State = Instant<Memory<K>>;
    type Flow = KernelFlow<K::Coupling>;

    fn rest(&self) -> Self::State {
        Alone::rest(self)
    }

    fn flow(&self, step: f64) -> Self::Flow {
        let halvings = halvings(self.mechanics().rate(), step);
        KernelFlow { coupling: self.kernel.coupling(self.parameters, step, halvings), step }
    }

    #[inline(always)]
    fn advance(&self, flow: &Self::Flow, state: &mut Self::State, from: f64, to: f64) {
        let KernelFlow { coupling, step } = flow;
        let gain = self.kernel.gain(self.parameters);
        let start = FeedbackState { x: state.x, w: state.v * step, memory: state.memory };
        let end = coupling.step(&start, gain * from, gain * (to - from));
        *state = Instant { x: end.x, v: end.w / step, memory: end.memory };
    }

    fn displacement(&self, state: &Self::State) -> f64 {
        state.x
    }
}
