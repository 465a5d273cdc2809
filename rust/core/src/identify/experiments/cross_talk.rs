//! Cross-talk between two axes, from logs in which one of them is driven.

use crate::error::{Error, Result};
use crate::signal::contour_error::check;
use crate::signal::{index, without_drift};

/// Share of one axis in the reading of the other, and its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossTalk {
    /// Least squares of `other = share * driven + drift`, the drift a cubic in time.
    pub share: f64,
    /// Standard deviation of `share`, with the residuals' correlation from sample to sample.
    pub sd: f64,
    /// Root of the mean square of the residuals, m.
    pub residual: f64,
}

/// Cross-talk from the displacements of the axis that is driven and of the one that is not, m.
///
/// The axis that is held still creeps, for which a cubic in time is fitted along. Residuals that
/// are correlated as a first-order process of correlation r count as n (1 - r) / (1 + r)
/// independent ones: Bartlett 1935, doi 10.2307/2342284, for a drive that is slow beside them.
///
/// ```
/// use piezotrack_core::identify::cross_talk;
///
/// let driven: Vec<f64> = (0..100).map(|k| f64::from(k % 20)).collect();
/// let other: Vec<f64> = driven.iter().map(|d| 5.0 + 0.015 * d).collect();
/// assert!((cross_talk(&driven, &other)?.share - 0.015).abs() < 1e-12);
/// # Ok::<(), piezotrack_core::Error>(())
/// ```
///
/// # Errors
/// [`Error::Shape`] where there are less than 10 samples or the records differ in length;
/// [`Error::Data`] where a sample is not finite, or the driven axis does not move.
pub fn cross_talk(driven: &[f64], other: &[f64]) -> Result<CrossTalk> {
    check(["driven", "other"], driven, other, 10)?;
    let n = index(driven.len());
    let total: f64 = driven.iter().map(|d| (d - driven[0]) * (d - driven[0])).sum();
    let ((driven, _), (other, _)) = (without_drift(driven), without_drift(other));
    let pairs = || driven.iter().zip(&other);
    let square: f64 = pairs().map(|(d, _)| d * d).sum();
    if total <= 0.0 || square <= 1e-20 * total {
        return Err(Error::Data(
            "the axis that is driven does not move, or as drift does: drive it up and down".into(),
        ));
    }
    let share = pairs().map(|(d, o)| d * o).sum::<f64>() / square;
    let left: Vec<f64> = pairs().map(|(d, o)| o - share * d).collect();
    let power: f64 = left.iter().map(|r| r * r).sum();
    let next: f64 = left.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let correlation = if power > 0.0 { (next / power).clamp(0.0, 1.0 - 1.0 / n) } else { 0.0 };
    let inflation = (1.0 + correlation) / (1.0 - correlation);
    let sd = (power / (n - 5.0) / square * inflation).sqrt();
    Ok(CrossTalk { share, sd, residual: (power / n).sqrt() })
}
