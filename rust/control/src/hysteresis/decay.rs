//! The exponential decay along a path, of any length, in lanes.

use super::series::{GROWTH, growth, polynomial};
use crate::Number;

/// Longest path for which the series is summed as it is.
const SHORT: f64 = 0.5;
/// Paths are cut off here: e^-40 is left.
const LONGEST: f64 = 40.0;
/// A longer path is halved so often before the series is summed.
const HALVINGS: usize = 5;
/// Terms of that series: what they leave out, times the share of the way that is left, is below
/// 2e-16 for all paths.
const FEW_TERMS: usize = 10;

/// e^-path - 1 for a path from 0 up.
#[inline(always)]
pub(super) fn decay<N: Number>(path: N) -> N {
    let long = path.like(SHORT) - path;
    let part = -long.where_negative(path.like(SHORT), path);
    let short = part * polynomial(part, &GROWTH);
    if !long.any_negative() {
        return short;
    }
    // Each lane takes its own way, whatever the others.
    long.where_negative(long_decay(path), short)
}

/// The same where the series would need many terms.
#[inline(always)]
fn long_decay<N: Number>(path: N) -> N {
    let longest = path.like(LONGEST);
    let path = (path - longest).where_negative(path, longest);
    let part = path * path.like(-1.0 / f64::from(1 << HALVINGS));
    let mut change = part * growth::<_, FEW_TERMS>(part);
    for _ in 0..HALVINGS {
        change = change.mul_add(change, change + change);
    }
    change
}
