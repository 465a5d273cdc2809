//! One coordinate of a search: a parameter that is held, or free between two bounds.

use crate::error::{Error, Result, shown, shown_text};

/// How a coordinate of the unit box maps to a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// Evenly in the logarithm.
    Log,
}

impl Scale {
    /// A scale by its name.
    ///
    /// # Errors
    /// [`Error::Parameter`] for any other text.
    pub fn named(parameter: &str, name: &str) -> Result<Self> {
        match name {
            "linear" => Ok(Self::Linear),
            "log" => Ok(Self::Log),
            other => {
                let argument = format!("scale of {parameter}");
                Err(Error::parameter(argument, shown_text(other), "'linear' or 'log'"))
            }
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Log => "log",
        }
    }
}

/// One parameter of the stage in a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coordinate {
    /// Follows from others.
    Tied,
    /// Held at a value.
    Fixed(f64),
    /// Searched between two bounds.
    Free {
        /// Lower bound, SI.
        low: f64,
        /// Upper bound, SI.
        high: f64,
        /// Scale of the search.
        scale: Scale,
    },
}

impl Coordinate {
    /// Free between two bounds; on a logarithmic scale where they are positive and two decades
    /// or more apart.
    ///
    /// # Errors
    /// [`Error::Parameter`] where the bounds are not finite or not in order.
    pub fn between(name: &str, low: f64, high: f64) -> Result<Self> {
        if low.is_finite() && high.is_finite() && low < high {
            let wide = low > 0.0 && high >= 100.0 * low;
            return Ok(Self::Free {
                low,
                high,
                scale: if wide { Scale::Log } else { Scale::Linear },
            });
        }
        Err(Error::parameter(
            format!("bounds of {name}"),
            format!("({}, {})", shown(low), shown(high)),
            "two finite numbers, the lower one first",
        ))
    }

    /// The parameter at a place `z` in [0, 1].
    #[must_use]
    pub fn value(&self, z: f64) -> f64 {
        match *self {
            Self::Tied => f64::NAN,
            Self::Fixed(value) => value,
            Self::Free { low, high, scale: Scale::Linear } => {
                (low + (high - low) * z).clamp(low, high)
            }
            Self::Free { low, high, scale: Scale::Log } => {
                // Not log(high / low), which can overflow where the bounds do not.
                let (from, to) = (libm::log(low), libm::log(high));
                libm::exp(from + z * (to - from)).clamp(low, high)
            }
        }
    }

    /// The place in [0, 1] of a parameter: the nearest one; 0 where it is not free.
    #[must_use]
    pub fn place(&self, value: f64) -> f64 {
        let place = match *self {
            Self::Tied | Self::Fixed(_) => 0.0,
            Self::Free { low, high, scale: Scale::Linear } => (value - low) / (high - low),
            Self::Free { low, high, scale: Scale::Log } => {
                let (from, to) = (libm::log(low), libm::log(high));
                (libm::log(value) - from) / (to - from)
            }
        };
        if place.is_nan() { 0.0 } else { place.clamp(0.0, 1.0) }
    }

    /// The coordinate with an upper bound that is no higher than this.
    #[must_use]
    pub(in crate::identify) fn limited(self, limit: f64) -> Self {
        match self {
            Self::Free { low, high, scale } => {
                Self::Free { low, high: high.min(limit).max(low), scale }
            }
            other => other,
        }
    }

    /// The coordinate with a lower bound that is no lower than this.
    #[must_use]
    pub(in crate::identify) fn raised(self, limit: f64) -> Self {
        match self {
            Self::Free { low, high, scale } => {
                Self::Free { low: low.max(limit).min(high), high, scale }
            }
            other => other,
        }
    }

    /// The coordinate on another scale.
    ///
    /// # Errors
    /// [`Error::Parameter`] where it is held, or its bounds have no logarithm.
    pub(in crate::identify) fn on(self, scale: Scale, parameter: &str) -> Result<Self> {
        let argument = format!("scale of {parameter}");
        let found = format!("'{}'", scale.name());
        match self {
            Self::Free { low, high, .. } if scale == Scale::Linear || low > 0.0 => {
                Ok(Self::Free { low, high, scale })
            }
            Self::Free { low, high, .. } => {
                let ends = format!("({}, {})", shown(low), shown(high));
                Err(Error::parameter(argument, found, format!("bounds above 0 for it, not {ends}")))
            }
            _ => Err(Error::parameter(argument, found, "none, as this parameter is not free")),
        }
    }
}
