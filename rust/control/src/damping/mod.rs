//! Damping of a lightly damped mode by a filter of the measurement, beside a law that tracks.
//!
//! ```text
//! uFB = C (r - y) + K (y - y0)
//! ```
//!
//! C tracks, K damps; y0 is the first reading, so that K begins at 0 V, and r beside a feedforward that
//! makes the stage follow it. Each file has one K in
//! continuous time, [`damped`] what all of them share.

pub mod damped;
pub mod integral_resonant;
pub mod positive_position;
pub mod positive_velocity_position;
mod tustin;
