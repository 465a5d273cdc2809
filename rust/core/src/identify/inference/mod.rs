//! Covariance of what was fitted, for residuals that are correlated.

mod autoregression;
mod covariance;
mod fourier;
mod resampling;

pub use covariance::{Covariance, Linearised, covariance};
