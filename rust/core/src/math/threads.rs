//! Parts of a computation on all threads.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

/// Results of `each` for every part, in their order.
///
/// What spreads the work over threads is compiled once, not for every type of parts and results.
pub(crate) fn on_all_threads<A: Sync, T: Send>(
    parts: &[A],
    each: &(dyn Fn(&A) -> T + Sync),
) -> Vec<T> {
    let slots: Vec<Mutex<Option<T>>> = parts.iter().map(|_| Mutex::new(None)).collect();
    spread(parts.len(), &|i| {
        let found = each(&parts[i]);
        *slots[i].lock().unwrap_or_else(PoisonError::into_inner) = Some(found);
    });
    let found =
        slots.into_iter().map(|slot| slot.into_inner().unwrap_or_else(PoisonError::into_inner));
    found.flatten().collect()
}

/// Calls `job` with every number below `count`.
fn spread(count: usize, job: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(job);
}
