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

pub mod controller;
pub mod creep;
mod cubic_segment;
pub mod dynamics;
mod error;
pub mod feedback_law;
pub mod filters;
pub mod hysteresis;
pub mod inverse;
pub mod limits;
mod number;
pub mod online_feedforward;
pub mod pid;
pub mod repetitive;
pub mod state_space;
pub mod unfused;

pub use controller::{Command, Controller, ControllerState};
pub use creep::{Creep, CreepState};
pub use dynamics::Dynamics;
pub use error::{Error, Result};
pub use feedback_law::Feedback;
pub use filters::{Filter, FilterState};
pub use inverse::{
    BoucWenInverse, BoucWenInverseState, DahlInverse, FeedbackInverse, FeedbackInverseState,
    FirstOrderDahlInverse, InputInverse, InputInverseState, Inverse, InverseState, OperatorInverse,
    OscillatorInverse, PlayInverse, PrandtlIshlinskiiInverse, SampledDahlInverse,
};
pub use limits::Limits;
pub use number::Number;
pub use online_feedforward::{OnlineFeedforward, OnlineFeedforwardState, ReferenceSample};
pub use pid::{Pid, PidState, SampledPid};
pub use repetitive::{Recursion, Repetitive, RepetitiveState, SampledRepetitive, Smoothing};
pub use state_space::{StateSpace, StateSpaceState};
