//! Searches for the parameters of a stage.

mod descents;
mod distortion;
mod modes;
mod relations;
mod several_records;
mod step;
mod swarm;
