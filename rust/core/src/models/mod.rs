//! Models of a stage: one file each, the traits that it implements, and the list of models.

mod any_inverse;
mod creep;
mod creeping;
pub mod dahl;
mod feedback;
mod input;
mod lanes;
mod nodes;
mod parameters;
mod plant;
mod plays;
mod registry;
mod relays;
mod traits;

pub use any_inverse::{AnyInverse, AnyInverseState};
pub use creep::{
    Creep, Dynamics, MOST_MODES, MOST_RELAXATIONS, Mode, Modes, Relaxation, RelaxationFlow,
    RelaxationState,
};
pub(crate) use creeping::relaxed;
pub use creeping::{Creeping, CreepingFlow, CreepingState};
pub use dahl::{DahlStage, DahlStageState};
pub use feedback::bouc_wen_oscillator::{BoucWenOscillator, BoucWenOscillatorKernel};
pub use feedback::first_order_dahl::{FirstOrderDahlKernel, FirstOrderDahlStage};
pub use feedback::lugre::{LuGreKernel, LuGreStage};
pub use feedback::parallel_dahl::{ParallelDahlKernel, ParallelDahlStage};
pub use input::asymmetric_bouc_wen::{AsymmetricBoucWenHysteresis, AsymmetricBoucWenStage};
pub use input::bouc_wen::{BoucWenHysteresis, BoucWenStage};
pub use input::input_kernel::{InputHysteresis, InputKernel};
pub use input::input_model::InputModel;
pub use input::input_stage::{
    InputOperator, InputStage, InputStageFlow, InputStageState, Remembering, Segmented,
};
pub use input::superposition::{
    AnySuperposition, FittedWeights, Nodes, Rest, Shape, Signals, SignalsOf, Superposition,
};
pub use lanes::{LanedPlant, LanedVisitor};
pub(crate) use nodes::check_nodes;
pub use parameters::search_ranges::{
    HIGHEST_MODE, Measures, ModeShown, NOMINAL_STIFFNESS, Range, Ranges,
};
pub use parameters::values::{Held, ParameterInfo, Values, position};
pub use plant::{KernelFlow, KernelModel, Plant, Settling};
pub use plays::asymmetric_prandtl_ishlinskii::{
    AsymmetricPlays, AsymmetricPrandtlIshlinskiiStage, asymmetric_plays,
};
pub use plays::generalised_prandtl_ishlinskii::{
    GeneralisedPlays, GeneralisedPlaysInverse, GeneralisedPlaysInverseState, GeneralisedPlaysState,
    GeneralisedPrandtlIshlinskiiStage,
};
pub use plays::maxwell_slip::{MaxwellSlip, MaxwellSlipStage};
pub use plays::polynomial_prandtl_ishlinskii::{
    PolynomialPlays, PolynomialPlaysInverse, PolynomialPlaysInverseState, PolynomialPlaysState,
    PolynomialPrandtlIshlinskiiStage,
};
pub use plays::prandtl_ishlinskii::{
    MOST_PLAYS, MOST_ZONES, PlayHysteresis, Plays, PrandtlIshlinskiiStage,
};
pub use plays::rate_dependent_prandtl_ishlinskii::{
    DilatedPlays, DilatedPlaysInverse, DilatedPlaysInverseState, DilatedPlaysState,
    RateDependentPrandtlIshlinskiiStage,
};
pub use plays::tanh_envelope::TanhEnvelope;
pub use registry::{FoundBy, Model, Stage, StageFlow, StageInverse, StageInverseState, StageState};
pub use relays::duhem::DuhemStage;
pub use relays::duhem_operator::{
    DuhemInverse, DuhemInverseState, DuhemOperator, DuhemParameters, DuhemState,
};
pub use relays::everett::{Everett, MOST_LEVELS};
pub use relays::preisach::PreisachStage;
pub use relays::preisach_operator::{
    PreisachInverse, PreisachInverseState, PreisachOperator, PreisachState,
};
pub use relays::reversals::{MOST_REVERSALS, Reversals};
pub use traits::{
    Experiment, Invertible, KernelVisitor, LumpedModel, Method, ModelInfo, Response, Searchable,
    StageModel,
};
