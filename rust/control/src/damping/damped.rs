//! A law with a damping filter of the measurement beside it.
//!
//! ```text
//! uFB[k] = uC[k] + K (y - y0)[k]
//! uFB[k] = uC[k] + K (y - r)[k]     beside a feedforward that makes the stage follow r
//! ```
//!
//! The law inside has the antiwindup, for the whole command; the filter's memory is of readings
//! only, and does not wind up. Counted from the first reading, the filter makes no step where the
//! law starts, and is kept out of the voltage at which it starts. Such a feedforward is for the stage
//! without K, which is to be 0 V where the stage follows; r is outside of the loop, whose roots and
//! margins are those of the other form.

use crate::cast::Cast;
use crate::error::Result;
use crate::feedback_law::{Feedback, FeedbackSample};
use crate::filters::{Filter, FilterState};
use crate::number::Real;

/// A law with a damping filter, for one sampling interval; see
/// [`crate::IntegralResonantControl::around`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damped<F, T = f64> {
    inner: F,
    filter: Filter<T>,
}

/// State of a [`Damped`] law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DampedState<S, T = f64> {
    inner: S,
    filter: FilterState<T>,
    /// y0, m; `None` before the first reading, and where r takes its place.
    origin: Option<T>,
    /// The last output, V.
    volts: T,
}

crate::snapshot!(
    [S: crate::Snapshot, T: Real] DampedState<S, T> { inner, filter, origin, volts }
);

impl<F: Cast> Cast for Damped<F> {
    type In<T: Real> = Damped<F::In<T>, T>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        Ok(Damped { inner: self.inner.cast()?, filter: self.filter.cast()? })
    }
}

impl<F, T> Damped<F, T> {
    pub(super) fn new(inner: F, filter: Filter<T>) -> Self {
        Self { inner, filter }
    }

    /// The law inside.
    #[must_use]
    pub fn inner(&self) -> &F {
        &self.inner
    }

    /// K: from the filtered measurement (m) to volts.
    #[must_use]
    pub fn filter(&self) -> &Filter<T> {
        &self.filter
    }
}

impl<S, T: Real> DampedState<S, T> {
    fn new(inner: S, volts: T) -> Self {
        Self { inner, filter: Some([T::ZERO; 2]), origin: None, volts }
    }
}

impl<F: Feedback<T>, T: Real> Feedback<T> for Damped<F, T> {
    type State = DampedState<F::State, T>;

    fn rest(&self) -> Self::State {
        DampedState::new(self.inner.rest(), T::ZERO)
    }

    fn start(&self, volts: T) -> Self::State {
        DampedState::new(self.inner.start(volts), volts)
    }

    /// Where the filter is the same and the law inside can.
    fn adopt(&self, before: &Self, state: &mut Self::State) -> bool {
        self.filter == before.filter && self.inner.adopt(&before.inner, &mut state.inner)
    }

    #[inline]
    fn step(&self, state: &mut Self::State, sample: &FeedbackSample<T>) -> T {
        let moved = if sample.follows {
            -sample.error
        } else {
            sample.measured - *state.origin.get_or_insert(sample.measured)
        };
        let damping = self.filter.step(&mut state.filter, moved);
        let volts = self.inner.step(&mut state.inner, sample) + damping;
        if volts.is_finite() {
            state.volts = volts;
        } else {
            // Overflow: hold the output, and count from the next reading.
            (state.filter, state.origin) = (Some([T::ZERO; 2]), None);
        }
        state.volts
    }
}
