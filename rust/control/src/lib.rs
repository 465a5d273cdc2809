//! Everything that runs at the sample rate: hysteresis operators, inverses and online feedforward,
//! and the parts of a controller.
//!
//! Nothing here allocates or needs `std`, so that firmware, the simulation and the vectorised
//! particle swarm run the same code. Configuration is in `&self`; the state of each part is a
//! value that the caller keeps and passes to `step`. Parts are described in continuous time and
//! in SI units (`Pid`, `Repetitive`, `DahlInverse`); `at(dt)` computes their coefficients for a
//! sampling interval.
//!
//! One sample of a controller with feedforward:
//!
//! ```
//! use piezotrack_control::{
//!     Controller, DahlInverse, Limits, OnlineFeedforward, Pid, ReferenceSample,
//! };
//!
//! // Once, at the start: parameters are checked and coefficients computed.
//! let dt = 0.02;
//! let inverse = DahlInverse::xu_li_2010().at(dt)?;
//! let feedforward = OnlineFeedforward::new(inverse, dt, 0.0, 0.0)?;
//! let controller = Controller::new(Limits::new(0.0, 75.0)?, Pid::xu_li_2010().at(dt)?);
//! let mut feedforward_state = feedforward.rest();
//! let mut controller_state = controller.rest([])?; // no repetitive part, no delay line
//!
//! // In every sampling interval: the reference now and one sample ahead, and the measurement.
//! let (reference, next, measured) = (1.0e-6, 1.2e-6, 0.9e-6);
//! let sample = ReferenceSample { preview: Some(next), ..ReferenceSample::new(reference) };
//! let volts = feedforward.step(&mut feedforward_state, &sample);
//! let command = controller.step(&mut controller_state, reference, measured, volts);
//! assert!(command.reference_ok && command.measurement_ok && !command.saturated);
//! assert!(command.volts > 0.0 && command.volts < 75.0);
//! # Ok::<(), piezotrack_control::Error>(())
//! ```
//!
//! `examples/firmware_step.rs` has a whole axis with a repetitive part.
//!
//! # Single precision
//!
//! Settings and checks are in `f64`. What is made for a sampling interval is generic over the type
//! of a step, [`Real`], which is `f64` where nothing else is said; [`Cast::cast`] rounds its
//! coefficients to `f32`, and no step has an operation in `f64` then:
//!
//! ```
//! use piezotrack_control::{
//!     Cast, Controller, DahlInverse, Limits, OnlineFeedforward, Pid, ReferenceSample,
//! };
//!
//! let dt = 0.02;
//! let inverse = DahlInverse::xu_li_2010().at(dt)?;
//! let feedforward = OnlineFeedforward::new(inverse, dt, 0.0, 0.0)?.cast::<f32>()?;
//! let pid = Pid::xu_li_2010().at(dt)?;
//! let controller = Controller::new(Limits::new(0.0, 75.0)?, pid).cast::<f32>()?;
//! let mut feedforward_state = feedforward.rest();
//! let mut controller_state = controller.rest([])?;
//!
//! let (reference, measured): (f32, f32) = (1.0e-6, 0.9e-6);
//! let sample = ReferenceSample::new(reference);
//! let volts = feedforward.step(&mut feedforward_state, &sample);
//! let command = controller.step(&mut controller_state, reference, measured, volts);
//! assert!(command.volts > 0.0 && command.volts < 75.0);
//! # Ok::<(), piezotrack_control::Error>(())
//! ```
#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

// The example of the page on crates.io runs among the tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod back_calculation;
pub mod cast;
pub mod controller;
pub mod creep;
pub mod cubic_motion;
mod cubic_segment;
pub mod damping;
pub mod disturbance_observer;
pub mod dynamics;
mod error;
pub mod feedback_law;
pub mod filters;
pub mod hysteresis;
pub mod hysteresis_observer;
pub mod inverse;
pub mod iterative_learning;
pub mod lead_lag;
pub mod limits;
pub mod lockstep;
pub mod measurement;
mod number;
pub mod online_feedforward;
pub mod pid;
pub mod repetitive;
pub mod root;
pub mod scheduled_pid;
pub mod sliding_mode;
pub mod snapshot;
pub mod state_space;
pub mod unfused;

pub use cast::Cast;
pub use controller::{Command, Controller, ControllerState};
pub use creep::{Creep, CreepState};
pub use damping::damped::{Damped, DampedState};
pub use damping::integral_resonant::IntegralResonantControl;
pub use damping::positive_position::PositivePositionFeedback;
pub use damping::positive_velocity_position::PositiveVelocityPositionFeedback;
pub use disturbance_observer::{DisturbanceObserver, Observed, ObservedState};
pub use dynamics::{Dynamics, MOST_MODES, Mode, Modes};
pub use error::{Error, Result};
pub use feedback_law::{Feedback, FeedbackSample};
pub use filters::{Filter, FilterState};
pub use hysteresis_observer::{
    HysteresisObserved, HysteresisObservedState, HysteresisObserver, Observable, ObservedOperator,
};
pub use inverse::{
    AsymmetricBoucWenInverse, AsymmetricPlayInverse, AsymmetricPlayInverseState, BoucWenInverse,
    BoucWenInverseState, CreepingInverse, CreepingInverseState, DahlInverse, FeedbackInverse,
    FeedbackInverseState, FirstOrderDahlInverse, InputInverse, InputInverseState, Inverse,
    InverseState, LuGreInverse, LuGreInverseState, ModesInverse, ModesInverseState,
    OperatorInverse, OscillatorInverse, ParallelDahlInverse, PlayInverse, PrandtlIshlinskiiInverse,
    SampledDahlInverse,
};
pub use iterative_learning::IterativeLearning;
pub use lead_lag::LeadLag;
pub use limits::Limits;
pub use lockstep::{LanedCommand, Lockstep, step_each};
pub use measurement::{Refused, Span};
pub use number::{Number, Real};
pub use online_feedforward::{OnlineFeedforward, OnlineFeedforwardState, ReferenceSample};
pub use pid::{Pid, PidState, SampledPid};

pub use repetitive::{
    Outcome, Recursion, Repetitive, RepetitiveState, SampledRepetitive, Smoothing,
};
pub use scheduled_pid::{MOST_GRADES, ScheduledPid, ScheduledPidState};
pub use sliding_mode::{SampledSlidingMode, SlidingMode, SlidingModeState};
pub use snapshot::Snapshot;
pub use state_space::{StateSpace, StateSpaceState};
