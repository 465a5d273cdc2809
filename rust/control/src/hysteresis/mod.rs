//! Rate-independent hysteresis operators: a path goes in, a value comes out.
//!
//! The output depends on the path of the input, not on its speed. Along a monotone section of
//! the path the output has a closed form (or a fast converging one). An operator therefore gives
//! the *branch* that leaves a state in one direction, and the branch gives the state at a
//! distance along it.

mod asymmetric_bouc_wen;
mod asymmetric_play;
mod bouc_wen;
mod dahl;
mod decay;
mod first_order_dahl;
mod lugre;
mod parallel_dahl;
mod play;
mod power_series;
mod series;

pub use asymmetric_bouc_wen::AsymmetricBoucWen;
pub use asymmetric_play::{AsymmetricPlay, AsymmetricPlayState, Bend, PlayFamily};
pub use bouc_wen::{BoucWen, BoucWenBranch, BoucWenState};
pub use dahl::{Dahl, DahlBranch, DahlState};
pub use first_order_dahl::FirstOrderDahl;
pub use lugre::LuGre;
pub use parallel_dahl::{FRICTION_ELEMENTS, ParallelDahl, ParallelDahlBranch, ParallelDahlState};
pub use play::{Play, PlayBranch, PlayState};

use crate::Number;

/// A hysteresis operator: configuration in `&self`, memory in `State`.
pub trait Operator<N: Number>: Copy {
    /// State of the operator, which depends on the path.
    type State: Copy;
    /// A monotone section of the path that leaves a state in one direction.
    type Branch: Copy;

    /// The initial state, before any motion.
    fn rest(&self) -> Self::State;

    /// Output of a state, and the slope of the output along the path.
    fn output(&self, state: &Self::State) -> (N, N);

    /// The branch that leaves `state` in `direction`, which is +1 or -1.
    fn branch(&self, state: &Self::State, direction: N) -> Self::Branch;

    /// The state after the input has moved by `distance`, which has the sign of the direction.
    fn along(&self, branch: &Self::Branch, distance: N) -> Self::State;
}

/// An operator whose slope jumps at a reversal.
pub trait NonsmoothOperator<N: Number>: Operator<N> {
    /// The same state with the slope of the branch that leaves it by `distance` in `direction`.
    fn leaving(&self, state: &Self::State, distance: N, direction: N) -> Self::State;
}
