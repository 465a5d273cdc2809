//! Identification: which parameters are searched, what a guess costs, and the swarm.

pub mod bounds;
mod cost;
mod cross_talk;
mod deviation;
mod drift;
mod identification;
mod line;
mod local;
mod model;
mod nnls;
mod noise;
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
pub use cross_talk::{CrossTalk, cross_talk};
pub use identification::{Identification, identify};
pub use local::{Local, Polished, Sensitivity};
pub use model::{Facts, Model};
pub use nnls::{Rows, nnls};
pub use noise::{Noise, noise_at_rest};
pub use plays::{DynamicsKind, PlaysFit, PlaysRecord, PlaysSettings, identify_plays};
pub use problem::{
    Coordinate, DELAY, Delay, NOMINAL_STIFFNESS, Problem, Record, Scale, Spec, Theta,
};
pub use search::{Monitor, Outcome, Plan, Progress, StopReason, search};
pub use step::{Conventional, StepReadings, StepResponse, read_step, separate};
pub use swarm::{Boundary, Swarm, SwarmSettings, Topology, Update};
pub use turns::turns;
