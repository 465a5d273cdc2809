//! Feedforward: the inverse of a stage with LuGre friction, sample by sample.
//!
//! ```text
//! uFF = (M xd'' + D xd' + K xd + F)/T
//! ```
//!
//! as Xu and Li 2010, equation (21), doi 10.1115/1.4001712, with the friction of
//! [`crate::hysteresis::LuGre`]. It acts on the displacement, so displacement and velocity of the
//! reference give it, and the inverse is explicit. Between two samples the reference is the cubic
//! through both.

use super::Inverse;
use super::feedback::not_zero;
use crate::cast::{Cast, rounded};
use crate::cubic_motion::CubicVelocity;
use crate::error::{Result, not_negative, positive};
use crate::hysteresis::LuGre;
use crate::number::Real;
use crate::unfused::Unfused;

/// Inverse of a stage with LuGre friction, for one sampling interval.
///
/// ```
/// use piezotrack_control::LuGreInverse;
/// use piezotrack_control::hysteresis::LuGre;
///
/// let friction = LuGre {
///     rest_stiffness: 1e4,
///     micro_damping: 5.0,
///     coulomb_force: 0.2,
///     static_force: 0.3,
///     stribeck_velocity: 1e-3,
/// };
/// let inverse = LuGreInverse::new([0.18, 50.0, 2.6e4], 0.0468, &friction, 2e-4)?;
/// let mut state = inverse.rest();
/// let volts = inverse.step(&mut state, 1e-6, 0.0, 0.0);
/// assert!(volts > 2.6e4 * 1e-6 / 0.0468);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LuGreInverse<T = f64> {
    mass: T,
    damping: T,
    stiffness: T,
    /// T, N/V.
    gain: T,
    friction: LuGre<Unfused<T>>,
    dt: T,
}

/// State of a [`LuGreInverse`]: the last sample of the reference and the deflection, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LuGreInverseState<T = f64> {
    x: T,
    /// x' times the sampling interval, m; `None` before the first sample.
    w: Option<T>,
    deflection: T,
}

crate::snapshot!([T: Real] LuGreInverseState<T> { x, w, deflection });

impl LuGreInverse {
    /// The inverse of the stage with this mass (kg), damping (N s/m) with that of the friction's
    /// viscous part, and stiffness (N/m), with this piezo coefficient (N/V) and this friction, for
    /// samples every `dt` seconds.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(
        [mass, damping, stiffness]: [f64; 3],
        piezo_coefficient: f64,
        friction: &LuGre<f64>,
        dt: f64,
    ) -> Result<Self> {
        let friction = LuGre {
            rest_stiffness: positive("rest_stiffness", friction.rest_stiffness, "N/m")?,
            micro_damping: not_negative("micro_damping", friction.micro_damping, "N s/m")?,
            coulomb_force: positive("coulomb_force", friction.coulomb_force, "N")?,
            static_force: positive("static_force", friction.static_force, "N")?,
            stribeck_velocity: positive("stribeck_velocity", friction.stribeck_velocity, "m/s")?,
        };
        Ok(Self {
            mass: not_negative("mass", mass, "kg")?,
            damping: not_negative("damping", damping, "N s/m")? + friction.micro_damping,
            stiffness: not_negative("stiffness", stiffness, "N/m")?,
            gain: not_zero(piezo_coefficient)?,
            friction: LuGre {
                rest_stiffness: Unfused(friction.rest_stiffness),
                micro_damping: Unfused(friction.micro_damping),
                coulomb_force: Unfused(friction.coulomb_force),
                static_force: Unfused(friction.static_force),
                stribeck_velocity: Unfused(friction.stribeck_velocity),
            },
            dt: positive("dt", dt, "s")?,
        })
    }
}

impl Cast for LuGreInverse {
    type In<T: Real> = LuGreInverse<T>;

    fn cast<T: Real>(&self) -> Result<LuGreInverse<T>> {
        let LuGre { rest_stiffness, micro_damping, coulomb_force, static_force, stribeck_velocity } =
            self.friction;
        Ok(LuGreInverse {
            mass: rounded("mass", self.mass, "kg")?,
            damping: rounded("damping", self.damping, "N s/m")?,
            stiffness: rounded("stiffness", self.stiffness, "N/m")?,
            gain: rounded("piezo_coefficient", self.gain, "N/V")?,
            friction: LuGre {
                rest_stiffness: Unfused(rounded("rest_stiffness", rest_stiffness.0, "N/m")?),
                micro_damping: Unfused(rounded("micro_damping", micro_damping.0, "N s/m")?),
                coulomb_force: Unfused(rounded("coulomb_force", coulomb_force.0, "N")?),
                static_force: Unfused(rounded("static_force", static_force.0, "N")?),
                stribeck_velocity: Unfused(rounded(
                    "stribeck_velocity",
                    stribeck_velocity.0,
                    "m/s",
                )?),
            },
            dt: rounded("dt", self.dt, "s")?,
        })
    }
}

impl<T: Real> LuGreInverse<T> {
    /// The state for a stage at rest at 0 that never moved.
    #[must_use]
    pub fn rest(&self) -> LuGreInverseState<T> {
        LuGreInverseState { x: T::ZERO, w: None, deflection: T::ZERO }
    }

    /// The drive for displacement `x` (m), velocity `v` (m/s) and acceleration `a` (m/s^2) of the
    /// reference. The first sample is taken to be reached in a slow monotone move from 0.
    ///
    /// NaN, with the state unchanged, where an input is not finite (or beyond 1e100); a controller
    /// holds its feedforward then.
    pub fn step(&self, state: &mut LuGreInverseState<T>, x: T, v: T, a: T) -> T {
        if !(x.is_usable() && v.is_usable() && a.is_usable()) {
            return T::NAN;
        }
        let (rise, w) = (x - state.x, v * self.dt);
        let deflection = Unfused(state.deflection);
        let direction = |of: T| Unfused(if of < T::ZERO { T::of(-1.0) } else { T::of(1.0) });
        let Unfused(deflection) = match state.w {
            None => {
                let side = direction(rise);
                let still = [Unfused(T::ZERO); 3];
                side * self.friction.along(side * deflection, side * Unfused(rise), still)
            }
            Some(w0) => {
                let ends = [[Unfused(state.x), Unfused(w0)], [Unfused(x), Unfused(w)]];
                let side = direction(if w0 == T::ZERO { rise } else { w0 });
                let velocity = CubicVelocity::along(side, ends[0], ends[1]);
                self.friction.through(deflection, &velocity, ends, Unfused(T::of(1.0) / self.dt))
            }
        };
        let force = self.friction.force(Unfused(deflection), Unfused(v)).0;
        let linear = self.mass * a + self.damping * v + self.stiffness * x;
        let drive = (linear + force) / self.gain;
        if !drive.is_finite() {
            return T::NAN;
        }
        *state = LuGreInverseState { x, w: Some(w), deflection };
        drive
    }
}

impl<T: Real> Inverse<T> for LuGreInverse<T> {
    type State = LuGreInverseState<T>;

    fn rest(&self) -> Self::State {
        self.rest()
    }

    #[inline]
    fn step(&self, state: &mut Self::State, x: T, v: T, a: T) -> T {
        self.step(state, x, v, a)
    }
}
