//! Parameters that are searched: coordinates, bounds, ties, constraints, priors; delay and drift.

pub mod bounds;
pub(super) mod candidate;
pub(super) mod constraint;
pub(super) mod coordinate;
pub(super) mod delay;
pub(super) mod drift;
pub(super) mod prior;
pub(super) mod relations;
pub(super) mod tie;
