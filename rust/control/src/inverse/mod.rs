//! Inverses of hysteresis models for feedforward: the drive that produces a given displacement.

mod bouc_wen;
mod dahl;
mod feedback;
mod play;

pub use bouc_wen::{BoucWenInverse, BoucWenInverseState};
pub use dahl::{DahlInverse, InverseState, SampledDahlInverse};
pub use feedback::{
    FeedbackInverse, FeedbackInverseState, FirstOrderDahlInverse, OscillatorInverse,
};
pub use play::PlayInverse;
