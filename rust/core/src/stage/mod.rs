//! Stages: one hysteresis operator coupled with linear mechanics.

mod bouc_wen;
mod bouc_wen_oscillator;
mod dahl;
pub mod feedback;
mod first_order_dahl;
pub mod friction;
pub mod input;
pub mod kinked;
mod prandtl_ishlinskii;
mod relaxation;
mod virtual_stage;

pub use bouc_wen::{BOUC_WEN_PARAMETERS, BoucWenKernel, BoucWenMotion, BoucWenStage};
pub use bouc_wen_oscillator::{
    BOUC_WEN_OSCILLATOR_PARAMETERS, BoucWenOscillator, BoucWenOscillatorKernel,
};
pub use dahl::{DAHL_PARAMETERS, DahlStage, StageState};
pub use first_order_dahl::{
    FIRST_ORDER_DAHL_PARAMETERS, FirstOrderDahlKernel, FirstOrderDahlStage,
};
pub use prandtl_ishlinskii::{
    FeedforwardState, MOST_PLAYS, MOST_ZONES, Plays, PlaysFeedforward, PlaysInverse, PlaysMotion,
    PlaysState, PrandtlIshlinskiiStage, plays,
};
pub use relaxation::{Dynamics, MOST_RELAXATIONS, Relaxation, RelaxationFlow, RelaxationState};
pub use virtual_stage::{
    Creep, DEAD_ZONES, PLAYS, RELAXATIONS, StagePlay, VirtualSettings, VirtualStage, VirtualState,
};

use piezotrack_control::Number;

use crate::mechanics::Propagator;

/// A hysteresis coupled with linear mechanics, as one step in time sees it.
pub trait Coupling<N> {
    /// What the hysteresis remembers.
    type Memory: Copy;

    /// The state one step on, under a drive force that goes from `drive` to `drive + rise`, N.
    fn step(
        &self,
        state: &feedback::FeedbackState<N, Self::Memory>,
        drive: N,
        rise: N,
    ) -> feedback::FeedbackState<N, Self::Memory>;
}

/// Parameters of a model, SI, mass, damping and stiffness first; those it does not have are 0.
pub type Parameters<N> = [N; MOST_PARAMETERS];

/// Most parameters that a model has.
pub const MOST_PARAMETERS: usize = 9;

/// A model built from plain parameters, for one stage or for lanes of them.
pub trait Kernel<N> {
    /// Its step.
    type Coupling: Coupling<N>;

    /// What 1 V enters the step as.
    fn gain(&self, parameters: &Parameters<N>) -> N;

    /// The step for steps of `step` seconds.
    fn coupling(&self, parameters: &Parameters<N>, step: f64, halvings: u32) -> Self::Coupling;

    /// The memory before any motion.
    fn rest(&self, parameters: &Parameters<N>) -> <Self::Coupling as Coupling<N>>::Memory;

    /// Hysteresis force, N.
    fn force(
        &self,
        parameters: &Parameters<N>,
        memory: &<Self::Coupling as Coupling<N>>::Memory,
    ) -> N;
}

/// The linear part of a stage over steps of `step` seconds.
#[inline(always)]
fn linear<N: Number>(parameters: &Parameters<N>, step: f64, halvings: u32) -> Propagator<N> {
    let [mass, damping, stiffness, ..] = *parameters;
    let inverse = mass.like(1.0) / mass;
    Propagator::new(inverse, damping / mass, stiffness / mass, step, halvings)
}

/// Name, symbol and unit of one parameter of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterInfo {
    /// The name that both languages use.
    pub name: &'static str,
    /// The symbol in the literature.
    pub symbol: &'static str,
    /// SI unit, empty where there is none.
    pub unit: &'static str,
}
