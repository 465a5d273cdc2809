//! A law with a damping filter of the measurement beside it.
//!
//! ```text
//! uFB[k] = uC[k] + K (y - y0)[k]
//! ```
//!
//! The law inside has the antiwindup, for the whole command; the filter's memory is of readings
//! only, and does not wind up. Counted from the first reading, the filter makes no step where the
//! law starts, and is kept out of the voltage at which it starts.

use crate::feedback_law::{Feedback, FeedbackSample};
use crate::filters::{Filter, FilterState};

/// A law with a damping filter, for one sampling interval; see
/// [`crate::IntegralResonantControl::around`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damped<F> {
    inner: F,
    filter: Filter,
}

/// State of a [`Damped`] law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DampedState<S> {
    inner: S,
    filter: FilterState,
    /// y0, m; `None` before the first reading.
    origin: Option<f64>,
    /// The last output, V.
    volts: f64,
}

crate::snapshot!([S: crate::Snapshot] DampedState<S> { inner, filter, origin, volts });

impl<F> Damped<F> {
    pub(super) fn new(inner: F, filter: Filter) -> Self {
        Self { inner, filter }
    }

    /// The law inside.
    #[must_use]
    pub fn inner(&self) -> &F {
        &self.inner
    }

    /// K: from the filtered measurement (m) to volts.
    #[must_use]
    pub fn filter(&self) -> &Filter {
        &self.filter
    }
}

impl<S> DampedState<S> {
    fn new(inner: S, volts: f64) -> Self {
        Self { inner, filter: Some([0.0; 2]), origin: None, volts }
    }
}

impl<F: Feedback> Feedback for Damped<F> {
    type State = DampedState<F::State>;

    fn rest(&self) -> Self::State {
        DampedState::new(self.inner.rest(), 0.0)
    }

    fn start(&self, volts: f64) -> Self::State {
        DampedState::new(self.inner.start(volts), volts)
    }

    /// Where the filter is the same and the law inside can.
    fn adopt(&self, before: &Self, state: &mut Self::State) -> bool {
        self.filter == before.filter && self.inner.adopt(&before.inner, &mut state.inner)
    }

    #[inline]
    fn step(&self, state: &mut Self::State, sample: &FeedbackSample) -> f64 {
        let origin = *state.origin.get_or_insert(sample.measured);
        let damping = self.filter.step(&mut state.filter, sample.measured - origin);
        let volts = self.inner.step(&mut state.inner, sample) + damping;
        if volts.is_finite() {
            state.volts = volts;
        } else {
            // Overflow: hold the output, and count from the next reading.
            (state.filter, state.origin) = (Some([0.0; 2]), None);
        }
        state.volts
    }
}
