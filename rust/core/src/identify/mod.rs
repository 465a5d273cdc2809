//! Identification: which parameters are searched, what a guess costs, and the swarm.

pub mod bounds;
mod cost;
mod deviation;
mod identification;
mod line;
mod local;
mod model;
mod nnls;
mod plays;
mod problem;
mod ringing;
mod search;
mod spectrum;
mod step;
mod stepping;
mod swarm;
mod turns;

pub use cost::{Costs, Evaluator, Guess};
pub use identification::{Identification, identify};
pub use local::{Local, Polished, Sensitivity};
pub use model::{Facts, Model};
pub use nnls::{Rows, nnls};
pub use plays::{DynamicsKind, PlaysFit, PlaysRecord, PlaysSettings, identify_plays};
pub use problem::{
    Coordinate, DELAY, Delay, NOMINAL_STIFFNESS, Problem, Record, Scale, Spec, Theta,
};
pub use search::{Monitor, Outcome, Plan, Progress, StopReason, search};
pub use step::{Conventional, StepReadings, StepResponse, read_step, separate};
pub use swarm::{Boundary, Swarm, SwarmSettings, Topology, Update};
pub use turns::turns;
