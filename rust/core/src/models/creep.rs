//! Creep and linear dynamics of first or second order behind a hysteresis at the input.
//!
//! ```text
//! d = h + sum_j c_j q_j,   tau_j q_j' = h - q_j           creep
//! x = d                                                   no dynamics
//! T x' + x = d                                            first order
//! x'' + 2 zeta wn x' + wn^2 x = wn^2 d                    second order
//! ```
//!
//! Relaxations whose time constants are a decade apart, with about equal shares, make a creep
//! that grows nearly with the logarithm of time, as that of piezoceramics does. Every step is
//! exact for an `h` that is linear over the step.

pub use piezotrack_control::{Creep, Dynamics};

use piezotrack_control::creep::{Lag, advance, output};

use crate::error::{Error, Result, not_negative, positive};
use crate::integrator::{Mechanics, Propagator, halvings};

/// Most relaxations of the creep.
pub const MOST_RELAXATIONS: usize = 8;

/// Creep and dynamics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relaxation {
    /// Relaxations of the creep: the first `count` of them.
    pub creep: [Creep; MOST_RELAXATIONS],
    /// Number of relaxations.
    pub count: usize,
    /// Linear dynamics behind them.
    pub dynamics: Dynamics,
}

/// Memory of creep and dynamics.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelaxationState {
    /// Input h, m.
    pub input: f64,
    /// State q of each relaxation, m.
    pub creep: [f64; MOST_RELAXATIONS],
    /// Displacement, m.
    pub x: f64,
    /// Velocity, m/s; 0 where there is no mode.
    pub v: f64,
}

/// Steps of one length.
#[derive(Clone, Copy, Debug)]
pub struct RelaxationFlow {
    creep: [Lag; MOST_RELAXATIONS],
    dynamics: DynamicsFlow,
    step: f64,
}

#[derive(Clone, Copy, Debug)]
enum DynamicsFlow {
    None,
    First(Lag),
    Second(Propagator<f64>),
}

/// Steps of the dynamics of one length, s.
fn dynamics_flow(dynamics: Dynamics, step: f64) -> DynamicsFlow {
    match dynamics {
        Dynamics::None => DynamicsFlow::None,
        Dynamics::First { time } => DynamicsFlow::First(Lag::new(time, step)),
        Dynamics::Second { frequency, damping_ratio } => {
            // Mass 1: only ratios matter, and the force is wn^2 d.
            let natural = core::f64::consts::TAU * frequency;
            let damping = 2.0 * damping_ratio * natural;
            let modes = Mechanics { mass: 1.0, damping, stiffness: natural * natural };
            let halvings = halvings(modes.rate().max(damping), step);
            DynamicsFlow::Second(Propagator::new(1.0, damping, modes.stiffness, step, halvings))
        }
    }
}

impl Relaxation {
    /// From shares of the creep with their time constants, s.
    ///
    /// # Errors
    /// [`Error`] where they are not as many, too many, or out of their range.
    pub fn new(shares: &[f64], times: &[f64], dynamics: Dynamics) -> Result<Self> {
        if shares.len() != times.len() || shares.len() > MOST_RELAXATIONS {
            return Err(Error::Shape {
                name: "creep_weights".into(),
                found: format!("{} entries", shares.len()),
                expected: format!(
                    "as many as creep_times, which has {}, and {MOST_RELAXATIONS} at most",
                    times.len()
                ),
            });
        }
        let mut creep = [Creep { share: 0.0, time: 1.0 }; MOST_RELAXATIONS];
        for (j, slot) in creep.iter_mut().take(shares.len()).enumerate() {
            slot.share = not_negative(&format!("creep_weights[{j}]"), shares[j], "")?;
            slot.time = positive(&format!("creep_times[{j}]"), times[j], "s")?;
        }
        dynamics.validate()?;
        Ok(Self { creep, count: shares.len(), dynamics })
    }

    /// Works out steps of `step` seconds.
    #[must_use]
    pub fn flow(&self, step: f64) -> RelaxationFlow {
        let creep = self.creep.map(|creep| Lag::new(creep.time, step));
        RelaxationFlow { creep, dynamics: dynamics_flow(self.dynamics, step), step }
    }

    /// The relaxations in use.
    #[must_use]
    #[inline(always)]
    pub fn used(&self) -> &[Creep] {
        self.creep.get(..self.count).unwrap_or(&self.creep)
    }

    /// Input of the dynamics, d, m.
    #[must_use]
    pub fn target(&self, state: &RelaxationState) -> f64 {
        output(self.used(), state.input, &state.creep)
    }

    /// The input jumps to `input`, m.
    pub fn jump(&self, state: &mut RelaxationState, input: f64) {
        state.input = input;
        if self.dynamics == Dynamics::None {
            state.x = self.target(state);
        }
    }

    /// One step in which the input is linear and ends at `input`, m.
    #[inline(always)]
    pub fn step(&self, flow: &RelaxationFlow, state: &mut RelaxationState, input: f64) {
        let before = self.target(state);
        let used = self.used().len();
        advance(&flow.creep[..used], &mut state.creep, state.input, input);
        state.input = input;
        let target = self.target(state);
        match &flow.dynamics {
            DynamicsFlow::None => state.x = target,
            DynamicsFlow::First(lag) => state.x = lag.step(state.x, target, target - before),
            DynamicsFlow::Second(p) => {
                let stiffness = match self.dynamics {
                    Dynamics::Second { frequency, .. } => {
                        let natural = core::f64::consts::TAU * frequency;
                        natural * natural
                    }
                    _ => 0.0,
                };
                let (force, ramp) = (stiffness * before, stiffness * (target - before));
                let (x, w) = (state.x, state.v * flow.step);
                let end = |position: f64, velocity: f64, constant: f64, slope: f64| {
                    position.mul_add(x, velocity.mul_add(w, constant.mul_add(force, slope * ramp)))
                };
                state.x = end(p.position.x, p.velocity.x, p.constant.x, p.ramp.x);
                state.v = end(p.position.w, p.velocity.w, p.constant.w, p.ramp.w) / flow.step;
            }
        }
    }
}
