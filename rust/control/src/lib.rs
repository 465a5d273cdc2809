//! What runs at the sample rate: hysteresis operators, generic over their number type.
//!
//! Nothing here allocates, and nothing needs `std`: the same lines are compiled into a
//! laboratory's firmware, into the simulator and into the lockstep lanes of a swarm.
//! Configuration lives in `&self`, memory in a state that the caller holds.
#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

mod number;
pub mod operator;

pub use number::Number;
