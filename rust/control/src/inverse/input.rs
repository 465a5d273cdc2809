//! Feedforward: the inverse of a stage with its hysteresis at the input, sample by sample.
//!
//! ```text
//! h = H(u)                                                    hysteresis, 0 at rest
//! d = h + sum_k c_k q_k,   tau_k q_k' = h - q_k               creep
//! x = d   or   T x' + x = d   or   x'' + 2 zeta wn x' + wn^2 x = wn^2 d
//! or   x = sum_k g_k x_k, each x_k a mode as above
//! ```
//!
//! The parts are inverted in reverse order: the linear dynamics with the derivatives of the
//! reference (of several modes with a filter), the creep by the exact inverse of its step, the hysteresis by its own inverse. With
//! play operators this is Kuhnen 2003, European Journal of Control 9(4), 407-418, doi
//! 10.3166/ejc.9.407-418.

use super::{Inverse, ModesInverse, ModesInverseState, PlayInverse};
use crate::cast::{Cast, rounded};
use crate::creep::{Creep, CreepInverse, CreepState};
use crate::dynamics::{Derivatives, Dynamics};
use crate::error::Result;
use crate::hysteresis::{Operator, Play, PlayState};
use crate::number::Real;

/// Inverse of a hysteresis operator: output in, input out.
pub trait OperatorInverse<T = f64>: Copy {
    /// Its state, which depends on the path.
    type State: Copy;

    /// The state for an operator that never moved.
    fn rest(&self) -> Self::State;

    /// Takes the output of the operator to `output` and returns its input; NaN, with the state
    /// unchanged, where there is none.
    fn follow(&self, state: &mut Self::State, output: T) -> T;
}

impl<const PLAYS: usize, const ZONES: usize, T: Real> OperatorInverse<T>
    for PlayInverse<PLAYS, ZONES, T>
{
    type State = PlayState<T, PLAYS>;

    fn rest(&self) -> Self::State {
        PlayInverse::rest(self)
    }

    #[inline]
    fn follow(&self, state: &mut Self::State, output: T) -> T {
        PlayInverse::follow(self, state, output)
    }
}

/// Inverse of a stage with the operator at the input: displacement in, voltage out.
///
/// ```
/// use piezotrack_control::hysteresis::Play;
/// use piezotrack_control::{Creep, Dynamics, PrandtlIshlinskiiInverse};
///
/// let play = Play {
///     linear: 1e-6,
///     thresholds: [10.0, 20.0],
///     weights: [0.2e-6, 0.1e-6],
///     dead_zone_thresholds: [],
///     dead_zone_weights: [],
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
pub struct InputInverse<I, const RELAXATIONS: usize, T = f64> {
    inverse: I,
    creep: CreepInverse<RELAXATIONS, T>,
    dynamics: Derivatives<T>,
    /// Of the dynamics, where they are several modes.
    modes: Option<ModesInverse<T>>,
    /// H(0) before the zero is taken off, m: the operator's output at rest.
    zero: T,
}

/// Inverse of a Prandtl-Ishlinskii stage, whose operator has its weights in m/V and its dead
/// zones in m.
pub type PrandtlIshlinskiiInverse<
    const PLAYS: usize,
    const ZONES: usize,
    const RELAXATIONS: usize,
    T = f64,
> = InputInverse<PlayInverse<PLAYS, ZONES, T>, RELAXATIONS, T>;

/// State of an [`InputInverse`]; `S` is the state of the operator's inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputInverseState<S, const RELAXATIONS: usize, T = f64> {
    operator: S,
    creep: CreepState<RELAXATIONS, T>,
    modes: ModesInverseState<T>,
    /// Whether the first sample has been.
    begun: bool,
}

crate::snapshot!(
    [S: crate::Snapshot, const RELAXATIONS: usize, T: Real]
    InputInverseState<S, RELAXATIONS, T> { operator, creep, modes, begun }
);

impl<const PLAYS: usize, const ZONES: usize, const RELAXATIONS: usize>
    PrandtlIshlinskiiInverse<PLAYS, ZONES, RELAXATIONS>
{
    /// The inverse of the stage with these parts, for samples every `dt` seconds.
    ///
    /// # Errors
    /// Those of [`PlayInverse::new`] and [`InputInverse::with`].
    pub fn new(
        play: &Play<f64, PLAYS, ZONES>,
        creep: &[Creep],
        dynamics: Dynamics,
        dt: f64,
    ) -> Result<Self> {
        let zero = play.output(&play.rest()).0;
        Self::with(PlayInverse::new(play)?, zero, creep, dynamics, dt)
    }
}

impl<I: OperatorInverse, const RELAXATIONS: usize> InputInverse<I, RELAXATIONS> {
    /// The inverse of the stage with these parts, for samples every `dt` seconds; the operator
    /// puts out `zero` (m) at rest, which the stage does not show.
    ///
    /// # Errors
    /// Names the parameter that is out of its range; `creep` where there are more relaxations
    /// than `RELAXATIONS`; `mode_weights` where several modes have no stable inverse.
    pub fn with(
        inverse: I,
        zero: f64,
        creep: &[Creep],
        dynamics: Dynamics,
        dt: f64,
    ) -> Result<Self> {
        dynamics.validate()?;
        let creep = CreepInverse::new(creep, dt)?;
        let modes = match dynamics {
            Dynamics::Modes(modes) => Some(ModesInverse::new(&modes, dt)?),
            _ => None,
        };
        Ok(Self { inverse, creep, dynamics: Derivatives::of(&dynamics), modes, zero })
    }
}

impl<I: Cast, const RELAXATIONS: usize> Cast for InputInverse<I, RELAXATIONS> {
    type In<T: Real> = InputInverse<I::In<T>, RELAXATIONS, T>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        Ok(InputInverse {
            inverse: self.inverse.cast()?,
            creep: self.creep.cast()?,
            dynamics: self.dynamics.cast()?,
            modes: self.modes.as_ref().map(ModesInverse::cast).transpose()?,
            zero: rounded("zero", self.zero, "m")?,
        })
    }
}

impl<I: OperatorInverse<T>, const RELAXATIONS: usize, T: Real> InputInverse<I, RELAXATIONS, T> {
    /// The inverse of the operator.
    #[must_use]
    pub fn operator(&self) -> &I {
        &self.inverse
    }

    /// The state for a stage at rest that never moved.
    #[must_use]
    pub fn rest(&self) -> InputInverseState<I::State, RELAXATIONS, T> {
        self.start(self.inverse.rest(), CreepState::default())
    }

    /// The state for a stage that has moved before: what hysteresis and creep remember.
    #[must_use]
    pub fn start(
        &self,
        operator: I::State,
        creep: CreepState<RELAXATIONS, T>,
    ) -> InputInverseState<I::State, RELAXATIONS, T> {
        InputInverseState { operator, creep, modes: ModesInverseState::default(), begun: false }
    }

    /// The voltage (V) for displacement `x` (m), velocity `v` (m/s) and acceleration `a` (m/s^2)
    /// of the reference. The first sample is reached in a jump, without time to creep, and with all
    /// modes at one displacement and velocity.
    ///
    /// NaN, with the state unchanged, where an input is not finite (or beyond 1e100) or the
    /// operator puts out nothing of that size.
    #[inline]
    pub fn step(
        &self,
        state: &mut InputInverseState<I::State, RELAXATIONS, T>,
        x: T,
        v: T,
        a: T,
    ) -> T {
        let mut modes = state.modes;
        let target = match &self.modes {
            None => self.dynamics.inverse(x, v, a),
            Some(inverse) => {
                if state.begun {
                    inverse.step(&mut modes, x, v, a);
                } else {
                    modes = inverse.begin(x, v, a);
                }
                inverse.output(&modes)
            }
        };
        if !target.is_usable() {
            return T::NAN;
        }
        let mut creep = state.creep;
        let output = if state.begun {
            self.creep.step(&mut creep, target)
        } else {
            self.creep.jump(&mut creep, target)
        };
        let input = self.inverse.follow(&mut state.operator, output + self.zero);
        if !input.is_nan() {
            (state.creep, state.modes, state.begun) = (creep, modes, true);
        }
        input
    }
}

impl<I: OperatorInverse<T>, const RELAXATIONS: usize, T: Real> Inverse<T>
    for InputInverse<I, RELAXATIONS, T>
{
    type State = InputInverseState<I::State, RELAXATIONS, T>;

    fn rest(&self) -> Self::State {
        self.rest()
    }

    #[inline]
    fn step(&self, state: &mut Self::State, x: T, v: T, a: T) -> T {
        self.step(state, x, v, a)
    }
}
