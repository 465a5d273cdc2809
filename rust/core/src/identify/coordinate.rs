//! One coordinate of a search: a parameter that is held, or free between two bounds.

use crate::error::{Error, Result, shown};

/// How a coordinate of the unit box maps to a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// Evenly in the logarithm.
    Log,
}

/// One parameter of the stage in a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coordinate {
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
}
