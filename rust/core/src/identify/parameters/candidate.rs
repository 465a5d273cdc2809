//! A point of the search: the parameters of a stage, the delay and the drift of its sensor, and where it
//! came from.

use crate::identify::records::creep_weights::CreepWeights;
use crate::integrator::{MOST_PARAMETERS, Parameters};

/// Places of a [`Theta`]: the parameters of a model, and what [`ITS_OWN`] has.
pub const PLACES: usize = MOST_PARAMETERS + ITS_OWN.len();

/// Place of the delay in a [`Theta`].
pub const DELAY: usize = MOST_PARAMETERS;

/// Place of the voltage that the stage came from, in a [`Theta`].
pub const BEFORE: usize = MOST_PARAMETERS + 1;

/// Place of the drift's time constant in a [`Theta`].
pub const DRIFT_TIME: usize = MOST_PARAMETERS + 2;

/// Places that each record has of its own, with their names.
pub const ITS_OWN: [(usize, &str); 3] =
    [(DELAY, "delay"), (BEFORE, "voltage_before"), (DRIFT_TIME, "drift_time")];

/// Scalar parameters in the order of the model, 0 for those that it does not have, and after them
/// the delay, s, the voltage that the stage came from, V, and the time constant of the drift, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Theta(pub [f64; PLACES]);

impl Theta {
    /// The parameters of the stage.
    #[must_use]
    pub fn parameters(&self) -> Parameters<f64> {
        core::array::from_fn(|i| self.0[i])
    }

    /// Delay between drive and displacement, s.
    #[must_use]
    pub fn delay(&self) -> f64 {
        self.0[DELAY]
    }

    /// Voltage that the stage came from, V: of a history that is fitted.
    #[must_use]
    pub fn before(&self) -> f64 {
        self.0[BEFORE]
    }

    /// Time constant of the drift, s; `None` for no drift.
    #[must_use]
    pub fn drift_time(&self) -> Option<f64> {
        Some(self.0[DRIFT_TIME]).filter(|&time| time > 0.0)
    }
}

/// A place of the unit box to simulate.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Coordinates of all that is free.
    pub place: Vec<f64>,
    /// The cost, m, beyond which nobody asks how bad the place is; infinite for none.
    pub limit: f64,
}

/// Parameters to simulate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The parameters, SI.
    pub theta: Theta,
    /// The cost, m, beyond which nobody asks how bad the candidate is; infinite for none.
    pub limit: f64,
    /// Weights of the creep; those that suit the record best where none are given.
    pub creep_weights: Option<CreepWeights>,
}

impl Candidate {
    /// Parameters that are simulated to the end however bad, with the weights that suit best.
    #[must_use]
    pub fn of(theta: Theta) -> Self {
        Self { theta, limit: f64::INFINITY, creep_weights: None }
    }
}
