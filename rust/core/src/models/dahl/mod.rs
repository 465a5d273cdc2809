//! The Dahl stage: second-order Dahl hysteresis in feedback on linear mechanics.
//!
//! ```text
//! M x'' + D x' + K x = T u - Fh,   Fh = b1 q1 + sgn(x') b0 q2
//! q1' = q2 x',   q2' = (up - a2 q1 - sgn(x') a1 q2) x'
//! ```
//!
//! Xu and Li 2010, equations (2), (7), (8) and Table 1, doi 10.1115/1.4001712.

mod kernels;
mod model;
mod runge_kutta;
mod stage;
mod virgin_branch;

pub use kernels::{DahlFlow, FrictionKernel, SmoothKernel};
pub use stage::{DahlStage, DahlStageState};
pub use virgin_branch::{extremes, linearised};
