//! Intervals of the values of a search by descents: profiles of the cost, and refits of resampled
//! noise.

pub mod chain;
pub mod profile;
pub mod refits;
