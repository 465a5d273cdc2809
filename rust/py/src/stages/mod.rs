//! Models, stages, their inverses, and virtual stages on one axis, two and several.

pub mod distorted;
pub mod distortion;
pub mod inverse;
pub mod modal_fit;
pub mod modal_system;
pub mod models;
pub mod regressors;
pub mod stage;
pub mod virtual_stage;
pub mod xy;
