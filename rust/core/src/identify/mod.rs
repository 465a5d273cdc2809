//! Identification: which parameters are searched, what a guess costs, and the swarm.

pub mod bounds;
mod cost;
mod deviation;
mod identification;
mod local;
mod model;
mod problem;
mod search;
mod stepping;
mod swarm;

pub use cost::{Costs, Evaluator, Guess};
pub use identification::{Identification, identify};
pub use local::{Local, Polished, Sensitivity};
pub use model::{Facts, Model};
pub use problem::{
    Coordinate, DELAY, Delay, NOMINAL_STIFFNESS, Problem, Record, Scale, Spec, Theta,
};
pub use search::{Monitor, Outcome, Plan, Progress, StopReason, search};
pub use swarm::{Boundary, Swarm, SwarmSettings, Topology, Update};
