//! Covariance of what was fitted, for residuals that are correlated.

mod autoregression;
mod covariance;
mod fourier;
mod linearised;
mod resampling;

pub use autoregression::Autoregression;
pub use covariance::{Covariance, covariance};
pub use linearised::Linearised;
