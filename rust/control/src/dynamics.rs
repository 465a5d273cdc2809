//! Linear dynamics between the hysteresis and the displacement.
//!
//! ```text
//! x = d                                       none
//! T x' + x = d                                first order
//! x'' + 2 zeta wn x' + wn^2 x = wn^2 d        second order
//! ```
//!
//! Here are their parameters and their inverse, which needs the derivatives of the reference only.
//! The forward steps are in the simulation (piezotrack-core).

use core::f64::consts::TAU;

use crate::error::{Result, not_negative, positive};

/// Linear dynamics between the hysteresis and the displacement, with a static gain of 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Dynamics {
    /// None: x = d.
    None,
    /// A first-order lag.
    First {
        /// Time constant T, s.
        time: f64,
    },
    /// A resonant mode.
    Second {
        /// Undamped natural frequency wn/(2 pi), Hz.
        frequency: f64,
        /// Damping ratio zeta.
        damping_ratio: f64,
    },
}

impl Dynamics {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn validate(&self) -> Result<()> {
        match *self {
            Self::None => Ok(()),
            Self::First { time } => positive("time_constant", time, "s").map(drop),
            Self::Second { frequency, damping_ratio } => {
                positive("frequency", frequency, "Hz")?;
                not_negative("damping_ratio", damping_ratio, "").map(drop)
            }
        }
    }

    /// The input d (m) for displacement `x` (m), velocity `v` (m/s) and acceleration `a` (m/s^2).
    #[must_use]
    #[inline]
    pub fn inverse(&self, x: f64, v: f64, a: f64) -> f64 {
        match *self {
            Self::None => x,
            Self::First { time } => x + time * v,
            Self::Second { frequency, damping_ratio } => {
                let natural = TAU * frequency;
                x + (2.0 * damping_ratio * v + a / natural) / natural
            }
        }
    }
}
