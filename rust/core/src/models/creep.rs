//! Creep and linear dynamics of first or second order behind a hysteresis at the input.
//!
//! ```text
//! d = h + sum_j c_j q_j,   tau_j q_j' = h - q_j           creep
//! x = d                                                   no dynamics
//! T x' + x = d                                            first order
//! x'' + 2 zeta wn x' + wn^2 x = wn^2 d                    second order
//! x = sum_k g_k x_k                                       modes in parallel, each of second order
//! ```
//!
//! Relaxations whose time constants are a decade apart, with about equal shares, make a creep
//! that grows nearly with the logarithm of time, as that of piezoceramics does. Every step is
//! exact for an `h` that is linear over the step, of any length,
//! but for dynamics behind creep, for which the creep is taken as linear over the step too.

pub use piezotrack_control::{Creep, Dynamics, MOST_MODES, Mode, Modes};

use piezotrack_control::Number;
use piezotrack_control::creep::{Lag, advance, output};

use crate::error::{Error, Result, not_negative, positive};
use crate::integrator::{Mechanics, Propagator, halvings};

/// Most relaxations of the creep.
pub const MOST_RELAXATIONS: usize = 8;

/// Room for the modes beside the main one.
pub(super) const FURTHER: usize = MOST_MODES - 1;

/// Damping ratio below which the largest gain is not followed.
const LEAST_DAMPING: f64 = 0.01;

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

/// Memory of creep and dynamics, of one stage or of lanes of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelaxationState<N = f64> {
    /// Input h, m.
    pub input: N,
    /// State q of each relaxation, m.
    pub creep: [N; MOST_RELAXATIONS],
    /// Displacement, m.
    pub x: N,
    /// Velocity, m/s; 0 where there is no mode.
    pub v: N,
    /// Displacement of each mode beside the main one, m.
    pub mode_x: [N; FURTHER],
    /// Velocity of each of them, m/s.
    pub mode_v: [N; FURTHER],
}

impl RelaxationState {
    /// The same state in every lane of a number like `number`.
    #[must_use]
    pub fn in_lanes<N: Number>(&self, number: N) -> RelaxationState<N> {
        let each = |value: f64| number.like(value);
        RelaxationState {
            input: each(self.input),
            creep: self.creep.map(each),
            x: each(self.x),
            v: each(self.v),
            mode_x: self.mode_x.map(each),
            mode_v: self.mode_v.map(each),
        }
    }
}

/// Steps of one length.
#[derive(Clone, Copy, Debug)]
pub struct RelaxationFlow {
    creep: [Lag; MOST_RELAXATIONS],
    dynamics: DynamicsFlow,
    step: f64,
}

#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "one for each length of a step, and no allocation")]
enum DynamicsFlow {
    None,
    First(Lag),
    Second(ModeFlow),
    /// The main mode with its weight, then the modes beside it without.
    Modes(ModeFlow, [ModeFlow; FURTHER]),
}

/// Steps of one mode.
#[derive(Clone, Copy, Debug)]
struct ModeFlow {
    propagator: Propagator<f64>,
    /// Of a mode of mass 1, times its share.
    stiffness: f64,
}

impl ModeFlow {
    /// Of a mode that follows a share of the static displacement.
    fn new(frequency: f64, damping_ratio: f64, share: f64, step: f64) -> Self {
        // Mass 1: only ratios matter, and the force is wn^2 d.
        let natural = core::f64::consts::TAU * frequency;
        let damping = 2.0 * damping_ratio * natural;
        let modes = Mechanics { mass: 1.0, damping, stiffness: natural * natural };
        let halvings = halvings(modes.rate().max(damping), step);
        let propagator = Propagator::new(1.0, damping, modes.stiffness, step, halvings);
        Self { propagator, stiffness: share * modes.stiffness }
    }

    /// Takes displacement and velocity through a step of `step` seconds in which the static
    /// displacement rises by `rise` from `before`.
    #[inline(always)]
    fn step<N: Number>(&self, step: f64, x: &mut N, v: &mut N, before: N, rise: N) {
        let Self { propagator: p, stiffness } = self;
        let number = |value: f64| before.like(value);
        let by = |one: f64, other: f64| (number(one), number(other));
        let state = (*x, *v * number(step));
        let load = (number(*stiffness) * before, number(*stiffness) * rise);
        *x = after(state, by(p.position.x, p.velocity.x), load, by(p.constant.x, p.ramp.x));
        let w = after(state, by(p.position.w, p.velocity.w), load, by(p.constant.w, p.ramp.w));
        *v = w / number(step);
    }
}

/// Value after a step: displacement and velocity, force and ramp, each times its factor.
///
/// No closure: those of lanes are not compiled for their instruction set unless they are inlined.
#[inline(always)]
fn after<N: Number>(state: (N, N), of_state: (N, N), load: (N, N), of_load: (N, N)) -> N {
    let held = of_load.0.mul_add(load.0, of_load.1 * load.1);
    of_state.0.mul_add(state.0, of_state.1.mul_add(state.1, held))
}

/// Steps of the dynamics of one length, s.
fn dynamics_flow(dynamics: Dynamics, step: f64) -> DynamicsFlow {
    match dynamics {
        Dynamics::None => DynamicsFlow::None,
        Dynamics::First { time } => DynamicsFlow::First(Lag::new(time, step)),
        Dynamics::Second { frequency, damping_ratio } => {
            DynamicsFlow::Second(ModeFlow::new(frequency, damping_ratio, 1.0, step))
        }
        Dynamics::Modes(modes) => {
            let flow =
                |mode: &Mode, share| ModeFlow::new(mode.frequency, mode.damping_ratio, share, step);
            let all = modes.all();
            let main = flow(&all[0], all[0].weight);
            DynamicsFlow::Modes(main, core::array::from_fn(|k| flow(&all[k + 1], 1.0)))
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

    /// Whether the displacement depends on the input before, and not only on that now.
    #[must_use]
    #[inline(always)]
    pub fn remembers(&self) -> bool {
        self.count > 0 || !matches!(self.dynamics, Dynamics::None)
    }

    /// Largest displacement that an input below 1 in size can make: the integral of the size of
    /// the impulse response. A mode with less damping than `LEAST_DAMPING` counts as one with it.
    #[must_use]
    pub fn largest_gain(&self) -> f64 {
        let mode = |damping_ratio: f64| {
            // Its step response overshoots by `beyond`, and each half wave by so much less.
            let damping = damping_ratio.max(LEAST_DAMPING);
            if damping >= 1.0 {
                return 1.0;
            }
            let half_wave = core::f64::consts::PI * damping / libm::sqrt(1.0 - damping * damping);
            let beyond = libm::exp(-half_wave);
            (1.0 + beyond) / (1.0 - beyond)
        };
        let dynamics = match self.dynamics {
            Dynamics::None | Dynamics::First { .. } => 1.0,
            Dynamics::Second { damping_ratio, .. } => mode(damping_ratio),
            Dynamics::Modes(modes) => {
                modes.used().iter().map(|one| one.weight.abs() * mode(one.damping_ratio)).sum()
            }
        };
        dynamics * self.used().iter().fold(1.0, |sum, creep| sum + creep.share)
    }

    /// Input of the dynamics, d, m.
    #[must_use]
    #[inline(always)]
    pub fn target<N: Number>(&self, state: &RelaxationState<N>) -> N {
        output(self.used(), state.input, &state.creep)
    }

    /// The input jumps to `input`, m.
    #[inline(always)]
    pub fn jump<N: Number>(&self, state: &mut RelaxationState<N>, input: N) {
        state.input = input;
        if matches!(self.dynamics, Dynamics::None) {
            state.x = self.target(state);
        }
    }

    /// One step in which the input is linear and ends at `input`, m.
    #[inline(always)]
    pub fn step<N: Number>(&self, flow: &RelaxationFlow, state: &mut RelaxationState<N>, input: N) {
        let before = self.target(state);
        let used = self.used().len();
        advance(&flow.creep[..used], &mut state.creep, state.input, input);
        state.input = input;
        let target = self.target(state);
        match &flow.dynamics {
            DynamicsFlow::None => state.x = target,
            DynamicsFlow::First(lag) => state.x = lag.step(state.x, target, target - before),
            DynamicsFlow::Second(mode) => {
                mode.step(flow.step, &mut state.x, &mut state.v, before, target - before);
            }
            DynamicsFlow::Modes(main, further) => {
                let rise = target - before;
                let (x, v) = self.beside(state);
                let (mut x, mut v) = (state.x - x, state.v - v);
                main.step(flow.step, &mut x, &mut v, before, rise);
                let places = state.mode_x.iter_mut().zip(&mut state.mode_v);
                for ((place, speed), mode) in places.zip(further) {
                    mode.step(flow.step, place, speed, before, rise);
                }
                let beside = self.beside(state);
                (state.x, state.v) = (x + beside.0, v + beside.1);
            }
        }
    }

    /// Displacement and velocity that the modes beside the main one add.
    #[inline(always)]
    fn beside<N: Number>(&self, state: &RelaxationState<N>) -> (N, N) {
        let zero = state.x.like(0.0);
        let (mut x, mut v) = (zero, zero);
        let states = state.mode_x.iter().zip(&state.mode_v);
        for (mode, (place, speed)) in self.dynamics.further().iter().zip(states) {
            let weight = zero.like(mode.weight);
            (x, v) = (x + weight * *place, v + weight * *speed);
        }
        (x, v)
    }

    /// The state in equilibrium with an input that has long been `input`, m.
    #[must_use]
    pub fn settled(&self, input: f64) -> RelaxationState {
        let mut state = RelaxationState { input, ..RelaxationState::default() };
        state.creep[..self.used().len()].fill(input);
        state.x = self.target(&state);
        state.mode_x[..self.dynamics.further().len()].fill(state.x);
        state
    }
}
