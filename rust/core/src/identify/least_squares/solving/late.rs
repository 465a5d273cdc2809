//! A reading that comes late.

use crate::signal::FractionalDelay;

/// A reading that comes late, on straight lines between samples; before the first sample the stage
/// is where it starts.
#[derive(Clone, Copy, Debug)]
pub(in crate::identify::least_squares) struct Late(FractionalDelay);

impl Late {
    pub fn new(delay: f64, dt: f64) -> Self {
        Self(FractionalDelay::new(delay, dt))
    }

    /// Whether readings are in time.
    pub fn is_none(self) -> bool {
        self.0.whole == 0 && self.0.part >= 1.0
    }

    /// Reading at sample `k` of values at samples.
    pub fn of(self, k: usize, at: impl Fn(usize) -> f64) -> f64 {
        let (before, after) = self.between(k);
        self.mixed(at(before), at(after))
    }

    /// Reading between two values.
    pub fn mixed(self, before: f64, after: f64) -> f64 {
        self.0.part.mul_add(after - before, before)
    }

    /// The samples between which it is read at sample `k`.
    pub fn between(self, k: usize) -> (usize, usize) {
        (k.saturating_sub(self.0.whole + 1), k.saturating_sub(self.0.whole))
    }
}
