//! Covariance of what was fitted, for residuals that are correlated.

mod autoregression;
mod covariance;
mod fourier;
mod inverse;
mod linearised;
mod resampling;
mod restricted;
mod sieve;

pub use autoregression::Autoregression;
pub use covariance::{Covariance, covariance};
pub use linearised::Linearised;
pub(in crate::identify) use sieve::Sieve;
pub use sieve::resampled_noises;
