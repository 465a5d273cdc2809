//! Trials that do not depend on each other, on all threads.

use crate::identify::least_squares::solving::fit::Fit;
use crate::math::on_all_threads;

/// A way to a fit; `None` where it was stopped.
pub(super) type Trial<'t, 'a> = &'t (dyn Fn() -> Option<Fit<'a>> + Sync);

/// The fits of some trials, in their order.
pub(super) fn side_by_side<'a, const N: usize>(trials: [Trial<'_, 'a>; N]) -> Option<[Fit<'a>; N]> {
    settled_all(&trials)?.try_into().ok()
}

/// The fits of one trial with each of some values, in their order.
pub(super) fn with_each<'a, V: Sync>(
    values: &[V],
    trial: impl Fn(&V) -> Option<Fit<'a>> + Sync,
) -> Option<Vec<Fit<'a>>> {
    let ways: Vec<_> = values.iter().map(|value| || trial(value)).collect();
    let trials: Vec<Trial<'_, 'a>> = ways.iter().map(|way| way as Trial<'_, 'a>).collect();
    settled_all(&trials)
}

/// The fits of trials that do not depend on each other, in their order.
pub(super) fn settled_all<'a>(trials: &[Trial<'_, 'a>]) -> Option<Vec<Fit<'a>>> {
    on_all_threads(trials, &|trial| trial()).into_iter().collect()
}
