//! Modes of several axes from sample to sample, and nonlinear functions that act on them.

mod distorted;
mod modal_system;
mod regressors;

pub use distorted::{DistortedModes, DistortedState};
pub(crate) use modal_system::check_modes;
pub use modal_system::{AxesLoop, AxesRun, ModalState, ModalSystem};
pub use regressors::{Regressor, RegressorState, Regressors};
