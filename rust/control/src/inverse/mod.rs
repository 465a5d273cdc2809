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

/// The inverse of a stage, sample by sample: configuration in `&self`, memory in `State`.
pub trait Inverse {
    /// What it remembers of the reference's path.
    type State;

    /// The memory of the inverse of a stage at rest that never moved.
    fn rest(&self) -> Self::State;

    /// The drive for displacement `x` (m), velocity `v` (m/s) and acceleration `a` (m/s^2) of the
    /// reference; NaN, with the state left as it was, where there is none.
    fn step(&self, state: &mut Self::State, x: f64, v: f64, a: f64) -> f64;
}

macro_rules! inverses {
    ($($inverse:ty => $state:ty;)*) => {$(
        impl Inverse for $inverse {
            type State = $state;

            fn rest(&self) -> $state {
                self.rest()
            }

            fn step(&self, state: &mut $state, x: f64, v: f64, a: f64) -> f64 {
                self.step(state, x, v, a)
            }
        }
    )*};
}

inverses! {
    SampledDahlInverse => InverseState;
    BoucWenInverse => BoucWenInverseState;
    FirstOrderDahlInverse => FeedbackInverseState;
    OscillatorInverse => FeedbackInverseState;
}
