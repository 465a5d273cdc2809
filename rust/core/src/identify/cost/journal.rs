//! Journal of the answers a search has computed, kept so that it can go on after an interruption.
//!
//! A search asks the simulations for costs and for normal equations; what it does between two
//! questions follows from the answers and the seed. A search that is given the answers of an
//! interrupted one again therefore goes the same way, to the bit, up to where that one ended.

use std::sync::Arc;

use super::residual_sums::Costs;
use crate::identify::records::creep_weights::MOST_CREEP_WEIGHTS;
use crate::signal::Stop;

/// Keeps the answers of simulations, in the order of the questions.
pub trait Journal: Send + Sync {
    /// The next answer of an earlier search, of so many numbers; `None` where there is none left.
    fn recall(&self, count: usize) -> Option<Vec<f64>>;

    /// Takes an answer that had to be computed.
    fn keep(&self, numbers: &[f64]);
}

/// An answer of simulations, in numbers.
pub(in crate::identify) trait Answer: Sized {
    /// Numbers of one with so many coordinates.
    fn length(coordinates: usize) -> usize;

    /// Writes it to the end of some numbers.
    fn write(&self, numbers: &mut Vec<f64>, coordinates: usize);

    /// Reads it from as many numbers as were written.
    fn read(numbers: &[f64], coordinates: usize) -> Self;
}

/// Recalls the answers to so many questions, or computes and keeps them; what was stopped is not
/// kept.
pub(in crate::identify) fn remembered<T: Answer>(
    journal: Option<&Arc<dyn Journal>>,
    (questions, coordinates): (usize, usize),
    stop: Stop<'_>,
    compute: impl FnOnce() -> Vec<T>,
) -> Vec<T> {
    let Some(journal) = journal else { return compute() };
    let each = T::length(coordinates);
    if let Some(numbers) = journal.recall(questions * each) {
        return numbers.chunks_exact(each).map(|one| T::read(one, coordinates)).collect();
    }
    let found = compute();
    if !stop() {
        let mut numbers = Vec::with_capacity(questions * each);
        for one in &found {
            one.write(&mut numbers, coordinates);
        }
        journal.keep(&numbers);
    }
    found
}

impl Answer for Costs {
    fn length(_coordinates: usize) -> usize {
        3 + MOST_CREEP_WEIGHTS
    }

    fn write(&self, numbers: &mut Vec<f64>, _coordinates: usize) {
        numbers.extend([self.rms, self.offset, self.drift]);
        numbers.extend(self.creep_weights);
    }

    fn read(numbers: &[f64], _coordinates: usize) -> Self {
        let at = |i: usize| numbers.get(i).copied().unwrap_or(f64::NAN);
        let creep_weights = core::array::from_fn(|i| at(3 + i));
        Self { rms: at(0), offset: at(1), drift: at(2), creep_weights }
    }
}
