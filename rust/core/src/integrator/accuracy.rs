//! Choice of the number of sub-steps that reaches a requested accuracy.

use super::propagator::Mechanics;
use crate::error::Error;
use crate::signal::{index, largest_difference};

/// Most sub-steps in one sampling interval that are tried.
pub(crate) const MOST_SUBSTEPS: usize = 1 << 17;

/// Factor by which a difference surely falls with twice the steps: 16 by the order, less where the
/// steps pass kinks of the hysteresis.
const SURE: f64 = 10.0;

/// Whether the `difference` of two simulations shows that the finer is accurate.
///
/// Two can agree by chance. So the difference `before`, of the two that were coarser, has to
/// promise the same; where there was none (infinity), this one has to be that much smaller.
pub(crate) fn agrees(before: f64, difference: f64, accuracy: f64) -> bool {
    let promised = if before.is_finite() { before / SURE } else { SURE * difference };
    difference.max(promised) <= accuracy
}

/// Where the search for sub-steps begins: a radian of the oscillation in each.
///
/// Coarser steps could agree with each other by chance, both blind to the oscillation.
pub(crate) fn first_substeps(mechanics: &Mechanics, dt: f64) -> usize {
    let radians = mechanics.oscillation() * dt;
    let mut substeps = 1;
    while index(substeps) < radians && substeps < MOST_SUBSTEPS / 2 {
        substeps *= 2;
    }
    substeps
}

/// Fewest sub-steps, by powers of two from `first` on, from which twice as many differ by at
/// most `accuracy`, and the displacement with them.
///
/// `None` where `run` gives none and where more than `most` would be needed.
#[must_use]
pub fn steps_for(
    first: usize,
    accuracy: f64,
    most: usize,
    run: impl Fn(usize) -> Option<Vec<f64>>,
) -> Option<(usize, Vec<f64>)> {
    let mut substeps = first;
    let mut coarse = run(substeps)?;
    while substeps <= most {
        let fine = run(2 * substeps)?;
        if largest_difference(&coarse, &fine) <= accuracy {
            return Some((substeps, fine));
        }
        substeps *= 2;
        coarse = fine;
    }
    None
}

/// The error of a simulation whose accuracy cannot be reached.
pub(crate) fn out_of_reach(accuracy: f64, substeps: usize, difference: f64) -> Error {
    Error::Numerical(format!(
        "accuracy {accuracy} m is out of reach: {substeps} sub-steps a sample differ from a \
         coarser simulation by {difference:.3e} m; ask for less with accuracy=, or check that \
         parameters and drive are in SI units"
    ))
}
