//! Numbers, arrays, displacements and states between Python and the core.

pub mod arrays;
pub mod displacements;
pub mod numbers;
pub mod snapshots;
