//! Identification of models, and the experiments and searches beside it.

pub mod checkpoint;
mod checkpoint_content;
pub mod covariance;
pub mod descents;
pub mod identification;
pub mod least_squares;
pub mod local_fit;
pub mod objective;
pub mod problem;
pub mod step;
pub mod swarm;
