//! Models of a stage, one file each, and the registry of those that can be identified.

mod bouc_wen;
mod bouc_wen_oscillator;
mod creep;
mod dahl;
mod dahl_runge_kutta;
pub mod dahl_simulate;
mod first_order_dahl;
mod plant;
mod prandtl_ishlinskii;
mod registry;

pub use bouc_wen::{BOUC_WEN_PARAMETERS, BoucWenKernel, BoucWenMotion, BoucWenStage};
pub use bouc_wen_oscillator::{
    BOUC_WEN_OSCILLATOR_PARAMETERS, BoucWenOscillator, BoucWenOscillatorKernel,
};
pub use creep::{Creep, Dynamics, MOST_RELAXATIONS, Relaxation, RelaxationFlow, RelaxationState};
pub use dahl::{DAHL_PARAMETERS, DahlStage, StageState, Trajectory};
pub use first_order_dahl::{
    FIRST_ORDER_DAHL_PARAMETERS, FirstOrderDahlKernel, FirstOrderDahlStage,
};
pub use plant::{DahlFlow, KernelFlow, Plant};
pub use prandtl_ishlinskii::{
    FeedforwardState, MOST_PLAYS, MOST_ZONES, Plays, PlaysFeedforward, PlaysInverse, PlaysMotion,
    PlaysState, PrandtlIshlinskiiStage, plays,
};
pub use registry::{DELAY, Facts, Model, Theta};
