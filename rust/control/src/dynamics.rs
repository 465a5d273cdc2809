//! Linear dynamics between the hysteresis and the displacement.
//!
//! ```text
//! x = d                                       none
//! T x' + x = d                                first order
//! x'' + 2 zeta wn x' + wn^2 x = wn^2 d        second order
//! x = sum_k g_k x_k,  sum_k g_k = 1            modes in parallel, each of second order
//! ```
//!
//! Here are their parameters and their inverse, which needs the derivatives of the reference only.
//! The forward steps are in the simulation (piezotrack-core).

use core::f64::consts::TAU;

use crate::cast::{Cast, rounded};
use crate::error::{Error, Result, check, not_negative, positive};
use crate::number::Real;

/// Most modes in parallel.
pub const MOST_MODES: usize = 4;

/// One of several modes in parallel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// Its share of the static displacement, g.
    pub weight: f64,
    /// Undamped natural frequency wn/(2 pi), Hz.
    pub frequency: f64,
    /// Damping ratio zeta.
    pub damping_ratio: f64,
}

/// Modes in parallel, whose weights add up to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modes {
    modes: [Mode; MOST_MODES],
    count: usize,
}

impl Modes {
    /// The main mode, and `further` ones beside it; the main mode has what their weights leave.
    ///
    /// # Errors
    /// Names the parameter that is out of its range; `mode_weights` where there are more than
    /// 3 further modes.
    pub fn new(frequency: f64, damping_ratio: f64, further: &[Mode]) -> Result<Self> {
        if further.len() >= MOST_MODES {
            let value = u32::try_from(further.len()).map_or(f64::INFINITY, f64::from);
            let expected = "3 at most";
            return Err(Error { name: "mode_weights", value, unit: "entries", expected });
        }
        positive("frequency", frequency, "Hz")?;
        not_negative("damping_ratio", damping_ratio, "")?;
        let mut weight = 1.0;
        let unused = Mode { weight: 0.0, frequency: 1.0, damping_ratio: 1.0 };
        let mut modes = [unused; MOST_MODES];
        for (slot, mode) in modes.iter_mut().skip(1).zip(further) {
            let right = mode.weight.abs() < 1.0;
            check("mode_weights", mode.weight, "", right, "between -1 and 1")?;
            positive("mode_frequencies", mode.frequency, "Hz")?;
            not_negative("mode_damping_ratios", mode.damping_ratio, "")?;
            weight -= mode.weight;
            *slot = *mode;
        }
        modes[0] = Mode { weight, frequency, damping_ratio };
        Ok(Self { modes, count: 1 + further.len() })
    }

    /// The modes, the main one first; those that are not used weigh 0.
    #[must_use]
    pub fn all(&self) -> &[Mode; MOST_MODES] {
        &self.modes
    }

    /// The modes in use, the main one first.
    #[must_use]
    #[inline(always)]
    pub fn used(&self) -> &[Mode] {
        self.modes.get(..self.count).unwrap_or(&self.modes)
    }

    /// The modes beside the main one.
    #[must_use]
    #[inline(always)]
    pub fn further(&self) -> &[Mode] {
        self.used().get(1..).unwrap_or_default()
    }
}

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
    /// Several modes in parallel.
    Modes(Modes),
}

impl Dynamics {
    /// A mode, with `further` ones in parallel.
    ///
    /// # Errors
    /// Those of [`Modes::new`].
    pub fn modes(frequency: f64, damping_ratio: f64, further: &[Mode]) -> Result<Self> {
        let modes = Modes::new(frequency, damping_ratio, further)?;
        let alone = further.is_empty();
        Ok(if alone { Self::Second { frequency, damping_ratio } } else { Self::Modes(modes) })
    }

    /// The modes beside the main one.
    #[must_use]
    #[inline(always)]
    pub fn further(&self) -> &[Mode] {
        if let Self::Modes(modes) = self { modes.further() } else { &[] }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn validate(&self) -> Result<()> {
        match *self {
            // Several modes have been checked when they were put together.
            Self::None | Self::Modes(_) => Ok(()),
            Self::First { time } => positive("time_constant", time, "s").map(drop),
            Self::Second { frequency, damping_ratio } => {
                positive("frequency", frequency, "Hz")?;
                not_negative("damping_ratio", damping_ratio, "").map(drop)
            }
        }
    }

    /// The input d (m) for displacement `x` (m), velocity `v` (m/s) and acceleration `a` (m/s^2).
    ///
    /// NaN for several modes, whose inverse has a memory: [`crate::inverse::ModesInverse`].
    #[must_use]
    #[inline]
    pub fn inverse(&self, x: f64, v: f64, a: f64) -> f64 {
        Derivatives::of(self).inverse(x, v, a)
    }
}

/// The inverse of dynamics that needs the derivatives of the reference only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Derivatives<T = f64> {
    /// That of none.
    None,
    /// T, s.
    First { time: T },
    /// 2 zeta, and wn in rad/s.
    Second { twice: T, natural: T },
    /// There is none of several modes.
    Modes,
}

impl Derivatives {
    #[inline]
    pub(crate) fn of(dynamics: &Dynamics) -> Self {
        match *dynamics {
            Dynamics::None => Self::None,
            Dynamics::First { time } => Self::First { time },
            Dynamics::Second { frequency, damping_ratio } => {
                Self::Second { twice: 2.0 * damping_ratio, natural: TAU * frequency }
            }
            Dynamics::Modes(_) => Self::Modes,
        }
    }
}

impl Cast for Derivatives {
    type In<T: Real> = Derivatives<T>;

    fn cast<T: Real>(&self) -> Result<Derivatives<T>> {
        Ok(match *self {
            Self::None => Derivatives::None,
            Self::First { time } => {
                Derivatives::First { time: rounded("time_constant", time, "s")? }
            }
            Self::Second { twice, natural } => Derivatives::Second {
                twice: rounded("damping_ratio", twice, "")?,
                natural: rounded("frequency", natural, "rad/s")?,
            },
            Self::Modes => Derivatives::Modes,
        })
    }
}

impl<T: Real> Derivatives<T> {
    /// The input, as [`Dynamics::inverse`].
    #[inline]
    pub(crate) fn inverse(&self, x: T, v: T, a: T) -> T {
        match *self {
            Self::None => x,
            Self::First { time } => x + time * v,
            Self::Second { twice, natural } => x + (twice * v + a / natural) / natural,
            Self::Modes => T::NAN,
        }
    }
}
