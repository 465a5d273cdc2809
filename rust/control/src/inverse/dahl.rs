//! Feedforward: the inverse of the Dahl stage, sample by sample.
//!
//! ```text
//! uFF = (M xd'' + D xd' + K xd + Fh(xd))/T,   Fh = b1 q1 + sgn(xd') b0 q2
//! dq1/dx = q2,   dq2/dx = up - a2 q1 - sgn(x') a1 q2
//! ```
//!
//! Xu and Li 2010, equations (21), (7) and (8), doi 10.1115/1.4001712. The force depends on the
//! path of the reference only, so the inverse is explicit. Where the reference reverses between
//! two samples, its path is taken to be the cubic through displacement and velocity at both
//! samples, and the operator follows it from turning point to turning point.

use super::Inverse;
use crate::cast::{Cast, rounded};
use crate::cubic_segment::{is_straight, legs};
use crate::error::{Result, check, finite, not_negative, positive};
use crate::hysteresis::{Dahl, DahlState, Operator};
use crate::number::Real;
use crate::unfused::Unfused;

/// Parameters of the inverse of a Dahl stage.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `mass`, `damping`, `stiffness` | M, D, K | kg, N s/m, N/m | >= 0 |
/// | `piezo_coefficient` | T | N/V | not 0 |
/// | `a1`, `a2` | a1, a2 | 1/m, 1/m^2 | >= 0 |
/// | `b1`, `b0` | b1, b0 | N/m^2, N/m | any |
/// | `up` | up | 1 | any |
///
/// ```
/// use piezotrack_control::DahlInverse;
///
/// let inverse = DahlInverse::xu_li_2010().at(2e-4)?;
/// let mut state = inverse.rest();
/// assert_eq!(inverse.step(&mut state, 0.0, 0.0, 0.0), 0.0);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DahlInverse {
    mass: f64,
    damping: f64,
    stiffness: f64,
    piezo_coefficient: f64,
    a1: f64,
    a2: f64,
    b1: f64,
    b0: f64,
    up: f64,
}

impl DahlInverse {
    /// The inverse of the stage with these parameters, in SI units.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    #[expect(clippy::too_many_arguments, reason = "the stage's nine numbers, in their order")]
    pub fn new(
        mass: f64,
        damping: f64,
        stiffness: f64,
        piezo_coefficient: f64,
        a1: f64,
        a2: f64,
        b1: f64,
        b0: f64,
        up: f64,
    ) -> Result<Self> {
        finite("piezo_coefficient", piezo_coefficient, "N/V")?;
        let right = piezo_coefficient.abs() > 0.0;
        check("piezo_coefficient", piezo_coefficient, "N/V", right, "a value other than 0")?;
        Ok(Self {
            mass: not_negative("mass", mass, "kg")?,
            damping: not_negative("damping", damping, "N s/m")?,
            stiffness: not_negative("stiffness", stiffness, "N/m")?,
            piezo_coefficient,
            a1: not_negative("a1", a1, "1/m")?,
            a2: not_negative("a2", a2, "1/m^2")?,
            b1: finite("b1", b1, "N/m^2")?,
            b0: finite("b0", b0, "N/m")?,
            up: finite("up", up, "")?,
        })
    }

    /// The inverse of Table 1 of Xu and Li 2010.
    #[must_use]
    pub fn xu_li_2010() -> Self {
        Self {
            mass: 0.1828,
            damping: 2597.3,
            stiffness: 26065.0,
            piezo_coefficient: 0.0468,
            a1: 121.9874,
            a2: 1.1773e6,
            b1: 1.8485e6,
            b0: 0.0,
            up: 30.0,
        }
    }

    /// The inverse for samples that come every `dt` seconds.
    ///
    /// # Errors
    /// Names `dt` where it is not above 0.
    pub fn at(&self, dt: f64) -> Result<SampledDahlInverse> {
        positive("dt", dt, "s")?;
        let t = self.piezo_coefficient;
        let root = libm::sqrt(self.a2);
        Ok(SampledDahlInverse {
            inertia: self.mass / t,
            damping: self.damping / t,
            stiffness: self.stiffness / t,
            level: self.b1 / t,
            friction: self.b0 / t,
            operator: Dahl { a1: Unfused(self.a1), a2: Unfused(self.a2), gain: Unfused(self.up) },
            piece: PIECE / if root > self.a1 { root } else { self.a1 },
            dt,
        })
    }
}

/// Terms of the operator's power series. Four terms keep a step short. They omit 3e-11 of the
/// slope in each [`PIECE`], which adds up to about a picometre with the published stage.
const TERMS: usize = 4;
/// Longest move in one piece, times the larger of sqrt(a2) and a1: 4.6 um with the published a2.
const PIECE: f64 = 0.005;
/// Most pieces that a move between two samples is split into; it bounds the time of a step.
const MOST_PIECES: f64 = 2000.0;

/// The inverse for one sampling interval; see [`DahlInverse::at`].
#[derive(Clone, Copy, Debug)]
pub struct SampledDahlInverse<T = f64> {
    /// M/T, V s^2/m.
    inertia: T,
    /// D/T, V s/m.
    damping: T,
    /// K/T, V/m.
    stiffness: T,
    /// b1/T, V for one unit of q1.
    level: T,
    /// b0/T, V for one unit of q2.
    friction: T,
    /// Its gain is up without b1, so that its output is q1 and q2.
    operator: Dahl<Unfused<T>, TERMS>,
    /// Longest move in one piece, m; infinite where the operator is a parabola.
    piece: T,
    dt: T,
}

/// State of a [`SampledDahlInverse`]: the last sample of the reference and the operator's state.
#[derive(Clone, Copy, Debug)]
pub struct InverseState<T = f64> {
    x: T,
    /// x' times the sampling interval, m; `None` before the first sample.
    w: Option<T>,
    memory: DahlState<Unfused<T>>,
}

crate::snapshot!([T: Real] InverseState<T> { x, w, memory });

impl Cast for SampledDahlInverse {
    type In<T: Real> = SampledDahlInverse<T>;

    fn cast<T: Real>(&self) -> Result<SampledDahlInverse<T>> {
        Ok(SampledDahlInverse {
            inertia: rounded("mass", self.inertia, "V s^2/m")?,
            damping: rounded("damping", self.damping, "V s/m")?,
            stiffness: rounded("stiffness", self.stiffness, "V/m")?,
            level: rounded("b1", self.level, "V")?,
            friction: rounded("b0", self.friction, "V")?,
            operator: self.operator.cast()?,
            piece: rounded("a2", self.piece, "m")?,
            dt: rounded("dt", self.dt, "s")?,
        })
    }
}

impl<T: Real> SampledDahlInverse<T> {
    /// The state for a stage at rest at 0 that never moved.
    #[must_use]
    pub fn rest(&self) -> InverseState<T> {
        InverseState { x: T::ZERO, w: None, memory: self.operator.rest() }
    }

    /// M/T, D/T, K/T, b1/T, b0/T, a1, a2, up, and the longest move in one piece (m).
    #[must_use]
    pub fn coefficients(&self) -> [T; 9] {
        let Dahl { a1, a2, gain } = self.operator;
        [
            self.inertia,
            self.damping,
            self.stiffness,
            self.level,
            self.friction,
            a1.0,
            a2.0,
            gain.0,
            self.piece,
        ]
    }

    /// The voltage for displacement `x` (m), velocity `v` (m/s) and acceleration `a` (m/s^2) of
    /// the reference. The first sample is taken to be reached in a monotone move from 0.
    ///
    /// NaN, with the state unchanged, where an input is not finite (or beyond 1e100), or `x` is
    /// more than 2000 pieces (9 mm with the published a2) away from the last one; a controller
    /// holds its feedforward then.
    #[inline]
    pub fn step(&self, state: &mut InverseState<T>, x: T, v: T, a: T) -> T {
        if !(x.is_usable() && v.is_usable() && a.is_usable()) {
            return T::NAN;
        }
        let rise = x - state.x;
        let w = v * self.dt;
        let memory = match state.w {
            Some(w0) if !is_straight(w0, rise, w) => self.travel_turning(state.memory, w0, rise, w),
            _ => self.travel(state.memory, rise),
        };
        let Some(memory) = memory else { return T::NAN };
        let one = T::of(1.0);
        let sign = if v > T::ZERO {
            one
        } else if v < T::ZERO {
            -one
        } else {
            T::ZERO
        };
        let linear = self.inertia * a + self.damping * v + self.stiffness * x;
        let hysteresis = self.level * memory.force.0 + sign * self.friction * memory.slope.0;
        let volts = linear + hysteresis;
        if !volts.is_finite() {
            return T::NAN;
        }
        *state = InverseState { x, w: Some(w), memory };
        volts
    }

    /// The operator's state after a monotone move; `None` where the move is too long.
    #[inline]
    fn travel(
        &self,
        mut memory: DahlState<Unfused<T>>,
        distance: T,
    ) -> Option<DahlState<Unfused<T>>> {
        let length = distance.abs();
        let direction = Unfused(if distance < T::ZERO { T::of(-1.0) } else { T::of(1.0) });
        if length > self.piece {
            if length > T::of(MOST_PIECES) * self.piece {
                return None;
            }
            let mut left = length;
            while left > self.piece {
                let branch = self.operator.branch(&memory, direction);
                memory = self.operator.along(&branch, direction * Unfused(self.piece));
                left = left - self.piece;
            }
            let branch = self.operator.branch(&memory, direction);
            return Some(self.operator.along(&branch, direction * Unfused(left)));
        }
        let branch = self.operator.branch(&memory, direction);
        Some(self.operator.along(&branch, Unfused(distance)))
    }

    /// The operator's state after the cubic with velocities `w0` and `w1` that rises by `rise`.
    #[cold]
    fn travel_turning(
        &self,
        mut memory: DahlState<Unfused<T>>,
        w0: T,
        rise: T,
        w1: T,
    ) -> Option<DahlState<Unfused<T>>> {
        for leg in legs(w0, rise, w1) {
            memory = self.travel(memory, leg)?;
        }
        Some(memory)
    }
}

impl<T: Real> Inverse<T> for SampledDahlInverse<T> {
    type State = InverseState<T>;

    fn rest(&self) -> Self::State {
        self.rest()
    }

    #[inline]
    fn step(&self, state: &mut Self::State, x: T, v: T, a: T) -> T {
        self.step(state, x, v, a)
    }
}
