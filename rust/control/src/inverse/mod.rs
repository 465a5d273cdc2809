//! Inverses of stage models for feedforward: the drive that produces a given displacement.
//!
//! Every inverse implements [`Inverse`]: displacement, velocity and acceleration of the reference
//! go in, one sample at a time, and the drive comes out. [`crate::OnlineFeedforward`] estimates
//! the derivatives where they are not known and compensates offset and delay.

mod asymmetric_play;
mod bouc_wen;
mod creeping;
mod dahl;
mod drive;
mod feedback;
mod input;
mod lugre;
mod modes;
mod neural_network;
mod play;

pub use asymmetric_play::{AsymmetricPlayInverse, AsymmetricPlayInverseState};
pub use bouc_wen::{AsymmetricBoucWenInverse, BoucWenInverse, BoucWenInverseState};
pub use creeping::{CreepingInverse, CreepingInverseState};
pub use dahl::{DahlInverse, InverseState, SampledDahlInverse};
pub use drive::after_drive;
pub use feedback::{
    FeedbackInverse, FeedbackInverseState, FirstOrderDahlInverse, OscillatorInverse,
    ParallelDahlInverse,
};
pub use input::{InputInverse, InputInverseState, OperatorInverse, PrandtlIshlinskiiInverse};
pub use lugre::{LuGreInverse, LuGreInverseState};
pub use modes::{ModesInverse, ModesInverseState};
pub use neural_network::{
    MOST_NETWORK_PLAYS, MOST_UNITS, NetworkNumbers, NeuralNetworkInverse, NeuralNetworkState,
};
pub use play::PlayInverse;

/// Inverse of a stage model in the real type `T`: configuration in `&self`, memory in `State`.
///
/// A choice of models at run time is an enum of inverses with an enum of their states; where the
/// two do not belong together, `step` returns NaN:
///
/// ```
/// use piezotrack_control::{BoucWenInverse, DahlInverse, Inverse, SampledDahlInverse};
///
/// enum AnyInverse {
///     Dahl(SampledDahlInverse),
///     BoucWen(BoucWenInverse),
/// }
///
/// #[derive(Clone, Copy)]
/// enum AnyState {
///     Dahl(<SampledDahlInverse as Inverse>::State),
///     BoucWen(<BoucWenInverse as Inverse>::State),
/// }
///
/// impl Inverse for AnyInverse {
///     type State = AnyState;
///
///     fn rest(&self) -> AnyState {
///         match self {
///             Self::Dahl(inverse) => AnyState::Dahl(inverse.rest()),
///             Self::BoucWen(inverse) => AnyState::BoucWen(inverse.rest()),
///         }
///     }
///
///     fn step(&self, state: &mut AnyState, x: f64, v: f64, a: f64) -> f64 {
///         match (self, state) {
///             (Self::Dahl(inverse), AnyState::Dahl(state)) => inverse.step(state, x, v, a),
///             (Self::BoucWen(inverse), AnyState::BoucWen(state)) => inverse.step(state, x, v, a),
///             _ => f64::NAN,
///         }
///     }
/// }
///
/// let any = AnyInverse::Dahl(DahlInverse::xu_li_2010().at(2e-4)?);
/// let mut state = any.rest();
/// assert_eq!(any.step(&mut state, 0.0, 0.0, 0.0), 0.0);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
pub trait Inverse<T = f64> {
    /// State of the inverse, which depends on the path of the reference.
    type State: Copy;

    /// The state for a stage at rest that never moved.
    fn rest(&self) -> Self::State;

    /// The drive (V for a piezo stage) for displacement `x` (m), velocity `v` (m/s) and
    /// acceleration `a` (m/s^2) of the reference at the next sample.
    ///
    /// NaN, with the state unchanged, where there is no such drive or an input is not finite.
    fn step(&self, state: &mut Self::State, x: T, v: T, a: T) -> T;
}
