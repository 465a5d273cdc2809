//! What runs at the sample rate: hysteresis operators, generic over their number type, and the
//! parts of a controller.
//!
//! Nothing here allocates, and nothing needs `std`: the same lines are compiled into a
//! laboratory's firmware, into the simulator and into the lockstep lanes of a swarm.
//! Configuration lives in `&self`, memory in a state that the caller holds. A part is described
//! in continuous time and SI units (`Pid`, `Repetitive`, `DahlInverse`); `at(dt)` gives its
//! coefficients for a sampling interval.
#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

pub mod bouc_wen_inverse;
pub mod controller;
mod error;
pub mod feedback;
pub mod feedback_inverse;
pub mod filters;
pub mod inverse;
pub mod limits;
mod number;
pub mod operator;
mod path;
pub mod pid;
pub mod plain;
pub mod repetitive;
pub mod state_space;

pub use bouc_wen_inverse::{BoucWenInverse, BoucWenInverseState};
pub use controller::{Command, Controller, ControllerState};
pub use error::{Error, Result};
pub use feedback::Feedback;
pub use feedback_inverse::{FeedbackInverseState, FirstOrderDahlInverse, OscillatorInverse};
pub use filters::{Filter, FilterState};
pub use inverse::{DahlInverse, InverseState, SampledDahlInverse};
pub use limits::Limits;
pub use number::Number;
pub use pid::{Pid, PidState, SampledPid};
pub use repetitive::{Recursion, Repetitive, RepetitiveState, SampledRepetitive, Smoothing};
pub use state_space::{StateSpace, StateSpaceState};
