//! Stages: one hysteresis operator coupled with linear mechanics.

mod dahl;
pub mod feedback;
pub mod friction;
mod prandtl_ishlinskii;
mod relaxation;
mod virtual_stage;

pub use dahl::{DAHL_PARAMETERS, DahlStage, StageState};
pub use prandtl_ishlinskii::{
    FeedforwardState, MOST_PLAYS, MOST_ZONES, Plays, PlaysFeedforward, PlaysInverse, PlaysMotion,
    PlaysState, PrandtlIshlinskiiStage, plays,
};
pub use relaxation::{Dynamics, MOST_RELAXATIONS, Relaxation, RelaxationFlow, RelaxationState};
pub use virtual_stage::{
    Creep, DEAD_ZONES, PLAYS, RELAXATIONS, StagePlay, VirtualFlow, VirtualSettings, VirtualStage,
    VirtualState,
};

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
