//! Feedforward: the inverse of the Prandtl-Ishlinskii stage, sample by sample.
//!
//! ```text
//! h = S(p) - S(0),   p = w_0 u + sum_i w_i z_i                hysteresis and dead zones
//! d = h + sum_k c_k q_k,   tau_k q_k' = h - q_k               creep
//! x = d   or   T x' + x = d   or   x'' + 2 zeta wn x' + wn^2 x = wn^2 d
//! ```
//!
//! Kuhnen 2003, European Journal of Control 9(4), 407-418, doi 10.3166/ejc.9.407-418. The parts
//! are inverted in reverse order: the linear dynamics with the derivatives of the reference, the
//! creep by the exact inverse of its step, dead zones and play operators in closed form.

use super::{Inverse, PlayInverse};
use crate::creep::{Creep, CreepInverse, CreepState};
use crate::dynamics::Dynamics;
use crate::error::{Result, usable};
use crate::hysteresis::{Operator, Play, PlayState};

/// Inverse of a Prandtl-Ishlinskii stage for one sampling interval: displacement in, voltage out.
///
/// The operator has its weights in m/V and its dead zones in m.
///
/// ```
/// use piezotrack_control::hysteresis::Play;
/// use piezotrack_control::{Creep, Dynamics, PrandtlIshlinskiiInverse};
///
/// let play = Play {
///     linear: 1e-6,
///     thresholds: [10.0, 20.0],
///     weights: [0.2e-6, 0.1e-6],
///     corners: [],
///     bends: [],
/// };
/// let creep = [Creep { share: 0.01, time: 0.3 }];
/// let dynamics = Dynamics::First { time: 1e-3 };
/// let inverse = PrandtlIshlinskiiInverse::<2, 0, 1>::new(&play, &creep, dynamics, 1e-4)?;
/// let mut state = inverse.rest();
/// let volts = inverse.step(&mut state, 5e-6, 0.0, 0.0);
/// assert!((volts - 5.0).abs() < 1e-12); // no play has moved yet
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrandtlIshlinskiiInverse<
    const PLAYS: usize,
    const ZONES: usize,
    const RELAXATIONS: usize,
> {
    play: Play<f64, PLAYS, ZONES>,
    inverse: PlayInverse<PLAYS, ZONES>,
    creep: CreepInverse<RELAXATIONS>,
    dynamics: Dynamics,
    /// S(0), m: the operator's output at rest.
    zero: f64,
}

/// What hysteresis and creep of a stage remember, for an inverse that starts from there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrandtlIshlinskiiState<const PLAYS: usize, const RELAXATIONS: usize> {
    /// State of the play operators.
    pub plays: PlayState<f64, PLAYS>,
    /// State of the creep.
    pub creep: CreepState<RELAXATIONS>,
}

/// State of a [`PrandtlIshlinskiiInverse`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrandtlIshlinskiiInverseState<const PLAYS: usize, const RELAXATIONS: usize> {
    plays: PlayState<f64, PLAYS>,
    creep: CreepState<RELAXATIONS>,
    /// Whether the first sample has been.
    begun: bool,
}

impl<const PLAYS: usize, const ZONES: usize, const RELAXATIONS: usize>
    PrandtlIshlinskiiInverse<PLAYS, ZONES, RELAXATIONS>
{
    /// The inverse of the stage with these parts, for samples every `dt` seconds.
    ///
    /// # Errors
    /// Names the parameter that is out of its range; `creep` where there are more relaxations
    /// than `RELAXATIONS`. See [`PlayInverse::new`] for the operator.
    pub fn new(
        play: &Play<f64, PLAYS, ZONES>,
        creep: &[Creep],
        dynamics: Dynamics,
        dt: f64,
    ) -> Result<Self> {
        dynamics.validate()?;
        Ok(Self {
            play: *play,
            creep: CreepInverse::new(creep, dt)?,
            inverse: PlayInverse::new(play)?,
            dynamics,
            zero: play.output(&play.rest()).0,
        })
    }

    /// The state for a stage at rest that never moved.
    #[must_use]
    pub fn rest(&self) -> PrandtlIshlinskiiInverseState<PLAYS, RELAXATIONS> {
        let creep = CreepState::default();
        PrandtlIshlinskiiInverseState { plays: self.inverse.rest(), creep, begun: false }
    }

    /// The state for a stage that has moved before: its hysteresis and creep are taken over.
    #[must_use]
    pub fn start(
        &self,
        state: impl Into<PrandtlIshlinskiiState<PLAYS, RELAXATIONS>>,
    ) -> PrandtlIshlinskiiInverseState<PLAYS, RELAXATIONS> {
        let PrandtlIshlinskiiState { plays, creep } = state.into();
        let plays = self.inverse.memory(&self.play, &plays);
        PrandtlIshlinskiiInverseState { plays, creep, begun: false }
    }

    /// The voltage (V) for displacement `x` (m), velocity `v` (m/s) and acceleration `a` (m/s^2)
    /// of the reference. The first sample is reached in a jump, without time to creep.
    ///
    /// NaN, with the state unchanged, where an input is not finite (or beyond 1e100).
    #[inline]
    pub fn step(
        &self,
        state: &mut PrandtlIshlinskiiInverseState<PLAYS, RELAXATIONS>,
        x: f64,
        v: f64,
        a: f64,
    ) -> f64 {
        let target = self.dynamics.inverse(x, v, a);
        if !usable(target) {
            return f64::NAN;
        }
        let output = if state.begun {
            self.creep.step(&mut state.creep, target)
        } else {
            self.creep.jump(&mut state.creep, target)
        };
        state.begun = true;
        self.inverse.follow(&mut state.plays, output + self.zero)
    }
}

impl<const PLAYS: usize, const ZONES: usize, const RELAXATIONS: usize> Inverse
    for PrandtlIshlinskiiInverse<PLAYS, ZONES, RELAXATIONS>
{
    type State = PrandtlIshlinskiiInverseState<PLAYS, RELAXATIONS>;

    fn rest(&self) -> Self::State {
        self.rest()
    }

    #[inline]
    fn step(&self, state: &mut Self::State, x: f64, v: f64, a: f64) -> f64 {
        self.step(state, x, v, a)
    }
}
