//! Stage models, their integrator and the particle swarm that identifies them.
//!
//! All quantities are SI: metres, volts, seconds, newtons, kilograms. The crate knows nothing
//! of Python, prints nothing, and returns an [`Error`] where an argument cannot be used.
#![forbid(unsafe_code)]

pub mod alone;
mod classical;
pub mod contour;
mod delay;
pub mod design;
pub mod error;
pub mod identify;
pub mod integrate;
pub mod lanes;
pub mod march;
pub mod mechanics;
pub mod metrics;
mod random;
pub mod simulate;
pub mod stage;

pub use error::{Error, Result};
