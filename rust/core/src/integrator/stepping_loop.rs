//! Time stepping of a stage under a sampled drive, scalar or vectorised.

use std::ops::Range;

use piezotrack_control::Number;

use super::traits::{Coupling, FeedbackState};
use crate::signal::{Drive, index};

/// Order of the coupling of hysteresis and linear part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// One evaluation of the operator per step: for slow drives, whose steps are short anyway.
    Second,
    /// Predictor and corrector, with reversals located.
    Fourth,
}

/// Order and number of the steps in a sampling interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stepping {
    /// Order of the coupling.
    pub order: Order,
    /// Steps in each sampling interval.
    pub substeps: usize,
}

/// Receives the states of a stage at the samples.
pub trait Observer<N, M> {
    /// Takes the state at sample `k`.
    fn sample(&mut self, k: usize, state: &FeedbackState<N, M>);

    /// Whether to give up, asked from time to time, after sample `k`.
    fn give_up(&mut self, k: usize) -> bool;
}

/// A stage with all that depends only on its parameters precomputed.
#[derive(Clone, Copy, Debug)]
pub struct SteppingLoop<N, C> {
    /// One sub-step.
    pub coupling: C,
    /// Force for 1 V, N.
    pub gain: N,
}

/// Terms of the operator's series with a step of fourth order.
pub const TERMS: usize = 6;

/// Terms of the operator's series with a step of second order.
pub const FEW_TERMS: usize = 3;

/// Sub-steps between two questions whether to give up: tens of microseconds.
const BLOCK: usize = 1024;

impl<N: Number, C: Coupling<N>> SteppingLoop<N, C> {
    /// Steps the stage along the drive; `None` where the observer gave up.
    #[inline(always)]
    pub fn run(
        &self,
        drive: &Drive<'_>,
        substeps: usize,
        start: FeedbackState<N, C::Memory>,
        observer: &mut impl Observer<N, C::Memory>,
    ) -> Option<FeedbackState<N, C::Memory>> {
        let mut state = start;
        observer.sample(0, &state);
        let block = (BLOCK / substeps).max(1);
        let mut from = 1;
        while from < drive.u.len() {
            let to = (from + block).min(drive.u.len());
            let reached = if const { C::SHORT } && substeps == 1 {
                self.whole(drive, from..to, state, observer)
            } else {
                self.parts(drive, substeps, from..to, state, observer)
            };
            state = reached;
            if observer.give_up(to - 1) {
                return None;
            }
            from = to;
        }
        Some(state)
    }

    /// One step from sample to sample. Written apart for short steps: most searches spend their
    /// time here.
    #[inline(always)]
    fn whole(
        &self,
        drive: &Drive<'_>,
        samples: Range<usize>,
        mut state: FeedbackState<N, C::Memory>,
        observer: &mut impl Observer<N, C::Memory>,
    ) -> FeedbackState<N, C::Memory> {
        for k in samples {
            let (u, change) = drive.interval(k - 1);
            state = self.step(&state, u, change);
            observer.sample(k, &state);
        }
        state
    }

    /// Several steps from sample to sample.
    #[inline(always)]
    fn parts(
        &self,
        drive: &Drive<'_>,
        substeps: usize,
        samples: Range<usize>,
        mut state: FeedbackState<N, C::Memory>,
        observer: &mut impl Observer<N, C::Memory>,
    ) -> FeedbackState<N, C::Memory> {
        let part = 1.0 / index(substeps);
        for k in samples {
            let (u, change) = drive.interval(k - 1);
            let change = change * part;
            for j in 0..substeps {
                state = self.step(&state, index(j).mul_add(change, u), change);
            }
            observer.sample(k, &state);
        }
        state
    }

    /// One sub-step under a drive that goes from `u` to `u + change`, V.
    #[inline(always)]
    fn step(
        &self,
        state: &FeedbackState<N, C::Memory>,
        u: f64,
        change: f64,
    ) -> FeedbackState<N, C::Memory> {
        let force = self.gain * self.gain.like(u);
        let rise = self.gain * self.gain.like(change);
        self.coupling.step(state, force, rise)
    }
}
