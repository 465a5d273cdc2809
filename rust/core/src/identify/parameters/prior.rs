//! Priors: what is known of parameters besides the record, each as a value and a width.
//!
//! With deviations that are independent and normal, of a variance that is not known and takes its
//! most likely value, minus the logarithm of the posterior is
//!
//! ```text
//! N ln f + Q/2,   Q = sum ((theta - mean) / width)^2
//! ```
//!
//! with the RMS deviation f of N samples; integrating the variance out with the usual prior
//! 1/variance gives the same (Gelman et al. 2013, Bayesian Data Analysis, section 3.2). What is
//! minimised is f exp(Q / 2N), which has the unit of a cost and falls where the posterior rises.

use super::candidate::Theta;
use crate::error::{Error, Result, shown};
use crate::models::ParameterInfo;
use crate::signal::index;

/// Widths on either side of the value that are searched where no bounds are given.
const REACH: f64 = 8.0;

/// Share of the value down to which is searched where 0 is out of range.
const LEAST: f64 = 1e-3;

/// Largest exponent of the factor: beyond it the factor rises by a straight line, as the search has
/// to find its way from wherever it starts without an overflow.
const MOST_EXPONENT: f64 = 300.0;

/// Prior knowledge of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Place of the parameter.
    pub parameter: usize,
    /// Its value, SI.
    pub mean: f64,
    /// Standard deviation of that, SI.
    pub width: f64,
}

impl Prior {
    /// Checks value and width.
    ///
    /// # Errors
    /// [`Error::Parameter`] where they are not finite, or the width is not above 0.
    pub fn new(info: &ParameterInfo, parameter: usize, mean: f64, width: f64) -> Result<Self> {
        let prior = Self { parameter, mean, width };
        // Neither may its square overflow or vanish.
        let usable = mean.is_finite() && (1e-150..1e150).contains(&width);
        if usable { Ok(prior) } else { Err(prior.refuse(info, "a finite value, a width above 0")) }
    }

    /// The values that are searched where no bounds are given: eight widths on either side, or up
    /// to near 0 where what is beyond is not `valid`.
    #[must_use]
    pub fn range(&self, valid: impl Fn(f64) -> bool) -> (f64, f64) {
        let Self { mean, width, .. } = *self;
        let (low, high) = (mean - REACH * width, mean + REACH * width);
        let low = if low <= 0.0 && mean > 0.0 && !valid(low) { LEAST * mean } else { low };
        let high = if high >= 0.0 && mean < 0.0 && !valid(high) { LEAST * mean } else { high };
        (low, high)
    }

    /// An error of it.
    #[must_use]
    pub fn refuse(&self, info: &ParameterInfo, expected: impl Into<String>) -> Error {
        let value = format!("{} +- {} {}", shown(self.mean), shown(self.width), info.unit);
        Error::parameter(format!("prior of {}", info.name), value.trim_end(), expected)
    }
}

/// Factor on the cost of a candidate: 1 without priors.
#[must_use]
pub fn factor(priors: &[Prior], theta: &Theta, samples: usize) -> f64 {
    let square = |prior: &Prior| {
        let distance = (theta.0[prior.parameter] - prior.mean) / prior.width;
        distance * distance
    };
    let exponent = 0.5 * priors.iter().map(square).sum::<f64>() / index(samples);
    if exponent.is_nan() {
        // The candidate has no value of its own, and fails without this.
        return 1.0;
    }
    let beyond = (exponent - MOST_EXPONENT).max(0.0);
    libm::exp(exponent.min(MOST_EXPONENT)) * (1.0 + beyond)
}
