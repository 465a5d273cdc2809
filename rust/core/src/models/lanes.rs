//! Plants in lanes: one stage under several voltages at once, as a search for gains simulates it.
//!
//! The steps are those of [`Plant`](super::plant::Plant), with the same bits in every lane.

use core::f64::consts::TAU;

use piezotrack_control::Number;
use piezotrack_control::creep::{Lag, advance, output};
use piezotrack_control::hysteresis::PlayState;

use super::creep::{MOST_RELAXATIONS, Relaxation, RelaxationFlow, RelaxationState};
use super::creeping::Creeping;
use super::dahl::{FrictionKernel, SmoothKernel};
use super::input::input_stage::InputStageState;
use super::plant::KernelModel;
use super::plays::prandtl_ishlinskii::{MOST_PLAYS, PrandtlIshlinskiiStage};
use super::registry::{Stage, StageState};
use crate::integrator::{
    Coupling, FeedbackState, Kernel, LumpedStage, Mechanics, Memory, TERMS, halvings,
};

/// A plant whose state may be in lanes: configuration in `&self`.
pub trait LanedPlant: Sync {
    /// State of the plant.
    type State<N: Number>: Copy;
    /// All that depends on the length of a step.
    type Flow<N: Number>;

    /// Longest step under a held voltage that is accurate, s; infinite where such steps are exact.
    fn longest(&self) -> f64;

    /// Vectors of lanes whose steps one after the other hide how long each takes, without a state
    /// that no longer fits into the registers.
    const VECTORS: usize;

    /// The state in which an experiment begins, in every lane.
    fn start<N: Number>(&self, number: N) -> Self::State<N>;

    /// Precomputes steps of `step` seconds.
    fn flow<N: Number>(&self, number: N, step: f64) -> Self::Flow<N>;

    /// One step under voltages that are linear from `from` to `to`, V.
    fn advance<N: Number>(&self, flow: &Self::Flow<N>, state: &mut Self::State<N>, from: N, to: N);

    /// Displacement, m.
    fn displacement<N: Number>(&self, state: &Self::State<N>) -> N;
}

/// An operation on any stage that has lanes.
pub trait LanedVisitor {
    /// Its result.
    type Output;

    /// Performs it.
    fn visit<P: LanedPlant>(self, plant: P) -> Self::Output;
}

impl Stage {
    /// Hands the stage in lanes to a visitor, beginning after slow visits to `voltages` in turn or,
    /// without any, in the state `start`; `None` where it has no lanes.
    pub fn in_lanes<V: LanedVisitor>(
        &self,
        voltages: &[f64],
        start: &StageState,
        visitor: V,
    ) -> Option<V::Output> {
        Some(match (self, start) {
            (Self::Dahl(one), _) if one.stage.has_friction() => {
                visitor.visit(kernelled(one.stage.lumped(FrictionKernel), one, voltages))
            }
            (Self::Dahl(one), _) => {
                let kernel = SmoothKernel::<TERMS, true>;
                visitor.visit(kernelled(one.stage.lumped(kernel), one, voltages))
            }
            (Self::BoucWen(one), _) => visitor.visit(kernelled(one.stage.lumped(), one, voltages)),
            (Self::FirstOrderDahl(one), _) => {
                visitor.visit(kernelled(one.stage.lumped(), one, voltages))
            }
            (Self::ParallelDahl(one), _) => {
                visitor.visit(kernelled(one.stage.lumped(), one, voltages))
            }
            (Self::BoucWenOscillator(one), _) => {
                visitor.visit(kernelled(one.stage.lumped(), one, voltages))
            }
            (Self::PrandtlIshlinskii(stage), StageState::PrandtlIshlinskii(state)) => {
                visitor.visit(Plays { stage, start: state, zero: stage.zero() })
            }
            (Self::MaxwellSlip(stage), StageState::MaxwellSlip(state)) => {
                let stage = &stage.as_plays();
                visitor.visit(Plays { stage, start: state, zero: stage.zero() })
            }
            _ => return None,
        })
    }
}

/// A stage that a kernel describes, with its creep.
struct Kernelled<'a, K> {
    stage: LumpedStage<K>,
    creep: &'a Relaxation,
    voltages: &'a [f64],
}

fn kernelled<'a, K: Kernel, M>(
    stage: LumpedStage<K>,
    creeping: &'a Creeping<M>,
    voltages: &'a [f64],
) -> Kernelled<'a, K> {
    Kernelled { stage, creep: creeping.relaxation(), voltages }
}

/// State of a [`Kernelled`] stage.
#[derive(Clone, Copy)]
struct KernelledState<N, M> {
    /// Displacement, m, and velocity, m/s, of the mechanics.
    x: N,
    v: N,
    memory: M,
    reached: [N; MOST_RELAXATIONS],
}

/// Steps of a [`Kernelled`] stage.
struct KernelledFlow<N, C> {
    coupling: C,
    gain: N,
    step: f64,
    lags: [Lag; MOST_RELAXATIONS],
}

impl<K: Kernel> LanedPlant for Kernelled<'_, K> {
    type State<N: Number> = KernelledState<N, Memory<K, N>>;
    type Flow<N: Number> = KernelledFlow<N, K::Coupling<N>>;

    const VECTORS: usize = 2;

    /// A quarter of the natural period, along which the hysteresis force is smooth.
    fn longest(&self) -> f64 {
        let Mechanics { mass, stiffness, .. } = self.stage.mechanics();
        0.25 * TAU * libm::sqrt(mass / stiffness)
    }

    fn start<N: Number>(&self, number: N) -> Self::State<N> {
        let LumpedStage { kernel, parameters } = &self.stage;
        let parameters = parameters.map(|value| number.like(value));
        let rest = (number.like(0.0), kernel.rest(&parameters));
        let approach = |from, &volts: &f64| kernel.approach(&parameters, from, number.like(volts));
        let (x, memory) = self.voltages.iter().fold(rest, approach);
        let reached = [x; MOST_RELAXATIONS];
        KernelledState { x, v: number.like(0.0), memory, reached }
    }

    fn flow<N: Number>(&self, number: N, step: f64) -> Self::Flow<N> {
        let LumpedStage { kernel, parameters } = &self.stage;
        let halvings = halvings(self.stage.mechanics().rate(), step);
        let parameters = parameters.map(|value| number.like(value));
        let (coupling, gain) = kernel.coupling(&parameters, step, halvings);
        let lags = self.creep.creep.map(|creep| Lag::new(creep.time, step));
        KernelledFlow { coupling, gain, step, lags }
    }

    #[inline(always)]
    fn advance<N: Number>(&self, flow: &Self::Flow<N>, state: &mut Self::State<N>, from: N, to: N) {
        let KernelledFlow { coupling, gain, step, lags } = flow;
        let step = from.like(*step);
        let start = FeedbackState { x: state.x, w: state.v * step, memory: state.memory };
        let end = coupling.step(&start, *gain * from, *gain * (to - from));
        let used = self.creep.used().len();
        advance(&lags[..used], &mut state.reached, state.x, end.x);
        (state.x, state.v, state.memory) = (end.x, end.w / step, end.memory);
    }

    #[inline(always)]
    fn displacement<N: Number>(&self, state: &Self::State<N>) -> N {
        output(self.creep.used(), state.x, &state.reached)
    }
}

/// A stage with plays at its input.
struct Plays<'a> {
    stage: &'a PrandtlIshlinskiiStage,
    start: &'a InputStageState<PlayState<f64, MOST_PLAYS>>,
    /// The operator's output at rest, m.
    zero: f64,
}

/// State of a stage with [`Plays`].
#[derive(Clone, Copy)]
struct PlaysState<N> {
    /// Voltage, and the output of each play, V.
    input: N,
    plays: [N; MOST_PLAYS],
    relaxation: RelaxationState<N>,
}

impl Plays<'_> {
    #[inline(always)]
    fn follow<N: Number>(&self, state: &mut PlaysState<N>, volts: N) -> N {
        let of = &self.stage.operator;
        state.input = volts;
        of.plays.moved(&mut state.plays, volts, (of.count, of.zones)) - volts.like(self.zero)
    }
}

/// Corners of the operator's output within a step are not located: a chord stands for it.
impl LanedPlant for Plays<'_> {
    type State<N: Number> = PlaysState<N>;
    type Flow<N: Number> = RelaxationFlow;

    const VECTORS: usize = 2;

    fn longest(&self) -> f64 {
        f64::INFINITY
    }

    fn start<N: Number>(&self, number: N) -> PlaysState<N> {
        let PlayState { input, plays, .. } = self.start.operator;
        PlaysState {
            input: number.like(input),
            plays: plays.map(|value| number.like(value)),
            relaxation: self.start.relaxation.in_lanes(number),
        }
    }

    fn flow<N: Number>(&self, _number: N, step: f64) -> RelaxationFlow {
        self.stage.relaxation.flow(step)
    }

    #[inline(always)]
    fn advance<N: Number>(&self, flow: &RelaxationFlow, state: &mut PlaysState<N>, from: N, to: N) {
        let jumped = from - state.input;
        if jumped.any_negative() || (-jumped).any_negative() {
            let output = self.follow(state, from);
            self.stage.relaxation.jump(&mut state.relaxation, output);
        }
        let output = self.follow(state, to);
        self.stage.relaxation.step(flow, &mut state.relaxation, output);
    }

    #[inline(always)]
    fn displacement<N: Number>(&self, state: &PlaysState<N>) -> N {
        state.relaxation.x
    }
}
