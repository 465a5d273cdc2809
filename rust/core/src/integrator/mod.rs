//! Time integration of a hysteresis operator coupled with linear mechanics.

mod accuracy;
pub(crate) mod equilibrium;
mod feedback_coupling;
mod friction_coupling;
mod input_coupling;
mod lugre_coupling;
mod nonsmooth_coupling;
mod propagator;
mod simulate;
mod stepping_loop;
mod traits;

pub use accuracy::steps_for;
pub use feedback_coupling::FeedbackCoupling;
pub use friction_coupling::{FrictionCoupling, FrictionMemory, FrictionParameters};
pub use input_coupling::{InputCoupling, InputMemory};
pub use lugre_coupling::{LuGreCoupling, LuGreMemory};
pub use nonsmooth_coupling::NonsmoothCoupling;
pub use propagator::{Column, Mechanics, Propagator, halvings};
pub use simulate::{Instant, LumpedStage, Motion};
pub use stepping_loop::{FEW_TERMS, Observer, Order, Stepping, SteppingLoop, Substeps, TERMS};
pub use traits::{Coupling, FeedbackState, Kernel, MOST_PARAMETERS, Memory, Parameters};

pub(crate) use accuracy::{MOST_SUBSTEPS, agrees, first_substeps, out_of_reach};
pub(crate) use simulate::columns;
pub(crate) use traits::linear;
