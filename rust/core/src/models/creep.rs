//! What follows a hysteresis at the input: creep, then linear dynamics of first or second order.
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
//! exact for an `h` that goes straight from its start to its end.

use crate::error::{Error, Result, not_negative, positive};
use crate::integrator::{Mechanics, Propagator, halvings};

/// Most relaxations of the creep.
pub const MOST_RELAXATIONS: usize = 8;

/// One relaxation of the creep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Creep {
    /// Displacement that it adds in the end, as a share of the immediate one.
    pub share: f64,
    /// Time constant, s.
    pub time: f64,
}

/// Linear dynamics between the hysteresis and the displacement, with a static gain of 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Dynamics {
    /// None: the displacement follows at once.
    None,
    /// A first-order lag.
    First {
        /// Time constant T, s.
        time: f64,
    },
    /// A mode.
    Second {
        /// Undamped frequency wn / (2 pi), Hz.
        frequency: f64,
        /// Damping ratio zeta.
        damping_ratio: f64,
    },
}

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
    /// What comes in, h, m.
    pub input: f64,
    /// What each relaxation has reached, q, m.
    pub creep: [f64; MOST_RELAXATIONS],
    /// Displacement, m.
    pub x: f64,
    /// Velocity, m/s; 0 where there is no mode.
    pub v: f64,
}

/// Steps of one length.
#[derive(Clone, Copy, Debug)]
pub struct RelaxationFlow {
    /// exp(-step / tau), and tau / step.
    creep: [(f64, f64); MOST_RELAXATIONS],
    dynamics: DynamicsFlow,
    step: f64,
}

#[derive(Clone, Copy, Debug)]
enum DynamicsFlow {
    None,
    First(f64, f64),
    Second(Propagator<f64>),
}

/// exp(-step / time), and time / step.
fn lag(time: f64, step: f64) -> (f64, f64) {
    (libm::exp(-step / time), time / step)
}

/// A first-order lag at the end of a step in which its input rises by `rise` to `end`.
fn lagged(reached: f64, end: f64, rise: f64, (decay, lag): (f64, f64)) -> f64 {
    // Behind a ramp it settles to trail; the rest of the gap decays.
    let trail = rise * lag;
    end - ((end - rise - reached - trail) * decay + trail)
}

impl Dynamics {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the number that is out of its range.
    pub fn validate(&self) -> Result<()> {
        match *self {
            Self::None => Ok(()),
            Self::First { time } => positive("time_constant", time, "s").map(|_| ()),
            Self::Second { frequency, damping_ratio } => {
                positive("frequency", frequency, "Hz")?;
                not_negative("damping_ratio", damping_ratio, "").map(|_| ())
            }
        }
    }

    /// The input that leads to displacement `x`, m, with velocity `v` and acceleration `a`.
    #[must_use]
    pub fn inverse(&self, x: f64, v: f64, a: f64) -> f64 {
        match *self {
            Self::None => x,
            Self::First { time } => x + time * v,
            Self::Second { frequency, damping_ratio } => {
                let natural = core::f64::consts::TAU * frequency;
                x + (2.0 * damping_ratio * v + a / natural) / natural
            }
        }
    }

    fn flow(&self, step: f64) -> DynamicsFlow {
        match *self {
            Self::None => DynamicsFlow::None,
            Self::First { time } => {
                let (decay, lag) = lag(time, step);
                DynamicsFlow::First(decay, lag)
            }
            Self::Second { frequency, damping_ratio } => {
                // Mass 1: only ratios matter, and the force is wn^2 d.
                let natural = core::f64::consts::TAU * frequency;
                let damping = 2.0 * damping_ratio * natural;
                let modes = Mechanics { mass: 1.0, damping, stiffness: natural * natural };
                let halvings = halvings(modes.rate().max(damping), step);
                DynamicsFlow::Second(Propagator::new(1.0, damping, modes.stiffness, step, halvings))
            }
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
                name: "creep_shares".into(),
                found: format!("{} entries", shares.len()),
                expected: format!(
                    "as many as creep_times, which has {}, and {MOST_RELAXATIONS} at most",
                    times.len()
                ),
            });
        }
        let mut creep = [Creep { share: 0.0, time: 1.0 }; MOST_RELAXATIONS];
        for (j, slot) in creep.iter_mut().take(shares.len()).enumerate() {
            slot.share = not_negative(&format!("creep_shares[{j}]"), shares[j], "")?;
            slot.time = positive(&format!("creep_times[{j}]"), times[j], "s")?;
        }
        dynamics.validate()?;
        Ok(Self { creep, count: shares.len(), dynamics })
    }

    /// Works out steps of `step` seconds.
    #[must_use]
    pub fn flow(&self, step: f64) -> RelaxationFlow {
        let creep = self.creep.map(|creep| lag(creep.time, step));
        RelaxationFlow { creep, dynamics: self.dynamics.flow(step), step }
    }

    /// Displacement that the dynamics are drawn to, d, m.
    #[must_use]
    pub fn target(&self, state: &RelaxationState) -> f64 {
        let crept = self.creep.iter().zip(&state.creep).take(self.count);
        crept.fold(state.input, |sum, (creep, reached)| sum + creep.share * reached)
    }

    /// What comes in jumps to `input`, m.
    pub fn jump(&self, state: &mut RelaxationState, input: f64) {
        state.input = input;
        if self.dynamics == Dynamics::None {
            state.x = self.target(state);
        }
    }

    /// One step in which what comes in goes straight to `input`, m.
    #[inline(always)]
    pub fn step(&self, flow: &RelaxationFlow, state: &mut RelaxationState, input: f64) {
        let before = self.target(state);
        let rise = input - state.input;
        for (reached, lag) in state.creep.iter_mut().zip(&flow.creep).take(self.count) {
            *reached = lagged(*reached, input, rise, *lag);
        }
        state.input = input;
        let target = self.target(state);
        match &flow.dynamics {
            DynamicsFlow::None => state.x = target,
            DynamicsFlow::First(decay, lag) => {
                state.x = lagged(state.x, target, target - before, (*decay, *lag));
            }
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

    /// What has to come in at the end of the next step for the creep to reach `target`, m.
    ///
    /// The exact inverse of [`Relaxation::step`] without dynamics.
    #[inline]
    pub fn inverse_step(
        &self,
        flow: &RelaxationFlow,
        state: &mut RelaxationState,
        target: f64,
    ) -> f64 {
        let (mut fixed, mut gain) = (0.0, 1.0);
        for j in 0..self.count {
            let (share, lag, reached) = (self.creep[j].share, flow.creep[j], state.creep[j]);
            // The end of the step is linear in what comes in: at 0, and its slope.
            fixed += share * lagged(reached, 0.0, -state.input, lag);
            gain += share * lagged(0.0, 1.0, 1.0, lag);
        }
        let input = (target - fixed) / gain;
        let rise = input - state.input;
        for (reached, lag) in state.creep.iter_mut().zip(&flow.creep).take(self.count) {
            *reached = lagged(*reached, input, rise, *lag);
        }
        state.input = input;
        input
    }

    /// What has to come in at once, without time for the creep, for `target`, m.
    pub fn inverse_jump(&self, state: &mut RelaxationState, target: f64) -> f64 {
        state.input = 0.0;
        let input = target - self.target(state);
        state.input = input;
        input
    }
}
