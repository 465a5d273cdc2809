//! Rate-independent hysteresis operators: a path goes in, a value comes out.
//!
//! Time does not enter. Along a monotone stretch of the input the step is exact, so an
//! operator is asked for the *branch* that leaves a state in one direction, and the branch
//! for the state a displacement further on.

mod bouc_wen;
mod dahl;
mod first_order_dahl;
mod play;

pub use bouc_wen::{BoucWen, BoucWenBranch, BoucWenState};
pub use dahl::{Dahl, DahlBranch, DahlState};
pub use first_order_dahl::FirstOrderDahl;
pub use play::{Play, PlayBranch, PlayState};

use crate::Number;

/// A hysteresis operator: configuration in `&self`, memory in `State`.
pub trait Operator<N: Number> {
    /// What the operator remembers of the path.
    type State: Copy;
    /// A monotone stretch that leaves a state in one direction.
    type Branch: Copy;

    /// The state before any motion.
    fn rest(&self) -> Self::State;

    /// Output of a state, and the slope of the output along the path.
    fn output(&self, state: &Self::State) -> (N, N);

    /// The branch that leaves `state` in `direction`, which is +1 or -1.
    fn branch(&self, state: &Self::State, direction: N) -> Self::Branch;

    /// The state where the input has moved on by `distance`, signed as the direction is.
    fn along(&self, branch: &Self::Branch, distance: N) -> Self::State;
}

/// An operator that leaves a reversal with another slope than it came with.
pub trait Facing<N: Number>: Operator<N> {
    /// The state about to be left by `distance` in `direction`, with the slope there.
    fn facing(&self, state: &Self::State, distance: N, direction: N) -> Self::State;
}
