//! Parts of a computation on all threads.

use rayon::prelude::*;

/// What `each` makes of every part, in their order.
///
/// The function is not a type of its own: kernels would otherwise each have all that spreads work over
/// threads compiled anew.
pub(crate) fn on_all_threads<A: Sync, T: Send>(
    parts: &[A],
    each: &(dyn Fn(&A) -> T + Sync),
) -> Vec<T> {
    parts.par_iter().map(each).collect()
}
