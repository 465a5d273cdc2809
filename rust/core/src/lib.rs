//! Stage models, their integrator and the particle swarm that identifies them.
//!
//! All quantities are SI: metres, volts, seconds, newtons, kilograms. The crate knows nothing
//! of Python, prints nothing, and returns an [`Error`] where an argument cannot be used.
//!
//! The modules are layers. Each uses those before it in this list, and none after it: [`error`],
//! [`math`], [`signal`], [`integrator`], [`design`], [`parts`], [`models`], [`simulate`],
//! [`identify`], [`tune`].
#![forbid(unsafe_code)]

pub mod design;
pub mod error;
pub mod identify;
pub mod integrator;
pub mod math;
pub mod models;
pub mod parts;
pub mod signal;
pub mod simulate;
pub mod tune;

pub use error::{Error, Result};
