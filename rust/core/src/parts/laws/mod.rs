//! The feedback laws: a file for each, and their list in [`law`].

mod disturbance_observer;
mod hysteresis_observer;
mod integral_resonant;
pub(super) mod law;
mod lead_lag;
mod perturbation_estimator;
mod pid;
mod positive_position;
mod positive_velocity_position;
mod scheduled_pid;
mod sliding_mode;
pub(super) mod state_space;
