//! Models, stages, their inverses, and virtual stages on one axis and two.

pub mod inverse;
pub mod models;
pub mod stage;
pub mod virtual_stage;
pub mod xy;
