//! Models of a stage: one file each, the traits that it implements, and the list of models.

mod any_inverse;
mod asymmetric_bouc_wen;
mod asymmetric_prandtl_ishlinskii;
mod bouc_wen;
mod bouc_wen_oscillator;
mod creep;
mod creeping;
mod cubic_curve;
pub mod dahl;
mod duhem;
mod duhem_operator;
mod dynamics_parameters;
mod everett;
mod first_order_dahl;
mod generalised_prandtl_ishlinskii;
mod input_kernel;
mod input_stage;
mod lanes;
mod lugre;
mod maxwell_slip;
mod mechanics_parameters;
mod parallel_dahl;
mod places;
mod plant;
mod polynomial_prandtl_ishlinskii;
mod prandtl_ishlinskii;
mod preisach;
mod preisach_operator;
mod rate_dependent_prandtl_ishlinskii;
mod registry;
mod reversals;
mod search_ranges;
mod superposition;
mod tanh_envelope;
mod traits;
mod values;

pub use any_inverse::{AnyInverse, AnyInverseState};
pub use asymmetric_bouc_wen::{AsymmetricBoucWenHysteresis, AsymmetricBoucWenStage};
pub use asymmetric_prandtl_ishlinskii::{
    AsymmetricPlays, AsymmetricPrandtlIshlinskiiStage, asymmetric_plays,
};
pub use bouc_wen::{BoucWenHysteresis, BoucWenStage};
pub use bouc_wen_oscillator::{BoucWenOscillator, BoucWenOscillatorKernel};
pub use creep::{
    Creep, Dynamics, MOST_MODES, MOST_RELAXATIONS, Mode, Modes, Relaxation, RelaxationFlow,
    RelaxationState,
};
pub(crate) use creeping::relaxed;
pub use creeping::{Creeping, CreepingFlow, CreepingState};
pub use dahl::{DahlStage, DahlStageState};
pub use duhem::DuhemStage;
pub use duhem_operator::{
    DuhemInverse, DuhemInverseState, DuhemOperator, DuhemParameters, DuhemState,
};
pub use everett::{Everett, MOST_LEVELS};
pub use first_order_dahl::{FirstOrderDahlKernel, FirstOrderDahlStage};
pub use generalised_prandtl_ishlinskii::{
    GeneralisedPlays, GeneralisedPlaysInverse, GeneralisedPlaysInverseState, GeneralisedPlaysState,
    GeneralisedPrandtlIshlinskiiStage,
};
pub use input_kernel::{InputHysteresis, InputKernel};
pub use input_stage::{
    InputOperator, InputStage, InputStageFlow, InputStageState, Remembering, Segmented,
};
pub use lanes::{LanedPlant, LanedVisitor};
pub use lugre::{LuGreKernel, LuGreStage};
pub use maxwell_slip::{MaxwellSlip, MaxwellSlipStage};
pub use parallel_dahl::{ParallelDahlKernel, ParallelDahlStage};
pub(crate) use places::check_places;
pub use plant::{KernelFlow, KernelModel, Plant, Settling};
pub use polynomial_prandtl_ishlinskii::{
    PolynomialPlays, PolynomialPlaysInverse, PolynomialPlaysInverseState, PolynomialPlaysState,
    PolynomialPrandtlIshlinskiiStage,
};
pub use prandtl_ishlinskii::{
    MOST_PLAYS, MOST_ZONES, PlayHysteresis, Plays, PrandtlIshlinskiiStage,
};
pub use preisach::PreisachStage;
pub use preisach_operator::{
    PreisachInverse, PreisachInverseState, PreisachOperator, PreisachState,
};
pub use rate_dependent_prandtl_ishlinskii::{
    DilatedPlays, DilatedPlaysInverse, DilatedPlaysInverseState, DilatedPlaysState,
    RateDependentPrandtlIshlinskiiStage,
};
pub use registry::{FoundBy, Model, Stage, StageFlow, StageInverse, StageInverseState, StageState};
pub use reversals::{MOST_REVERSALS, Reversals};
pub use search_ranges::{Measures, ModeShown, NOMINAL_STIFFNESS, Range, Ranges};
pub use superposition::{
    AnySuperposition, FittedWeights, Places, Rest, Shape, Signals, SignalsOf, Superposition,
};
pub use tanh_envelope::TanhEnvelope;
pub use traits::{
    Experiment, Invertible, KernelVisitor, Method, ModelInfo, Response, Searchable, StageModel,
};
pub use values::{Held, ParameterInfo, Values, position};
