//! Time stepping of a stage under a sampled drive, scalar or vectorised.

use std::ops::Range;

use piezotrack_control::Number;

use super::traits::{Coupling, FeedbackState, Kernel, Parameters};
use crate::signal::{Drive, index};

/// Order of the coupling of hysteresis and linear part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// One evaluation of the operator per step: for slow drives, whose steps are short anyway.
    Second,
    /// Predictor and corrector, with reversals located.
    Fourth,
}

/// Steps in each sampling interval.
///
/// An operator at the input is smooth between reversals, but a straight line over many volts asks
/// for far more steps than the rest of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Substeps {
    /// In an interval.
    pub usual: usize,
    /// In an interval in which the drive jumps.
    pub at_jumps: usize,
    /// Change of the drive over an interval beyond which it jumps, V.
    pub jump: f64,
}

impl Substeps {
    /// As many in every interval.
    #[must_use]
    pub const fn even(count: usize) -> Self {
        Self { usual: count, at_jumps: count, jump: f64::INFINITY }
    }

    /// Twice as many.
    #[must_use]
    pub const fn doubled(self) -> Self {
        Self { usual: 2 * self.usual, at_jumps: 2 * self.at_jumps, jump: self.jump }
    }

    /// Whether the drive jumps to sample `k`.
    fn jumps_to(&self, drive: &Drive<'_>, k: usize) -> bool {
        drive.interval(k - 1).1.abs() > self.jump
    }

    /// The end of the samples from `from` on, before `end`, to all of which the drive jumps, or to
    /// none.
    fn alike(&self, drive: &Drive<'_>, from: usize, end: usize) -> usize {
        if self.jump.is_infinite() {
            return end;
        }
        let first = self.jumps_to(drive, from);
        (from + 1..end).find(|&k| self.jumps_to(drive, k) != first).unwrap_or(end)
    }
}

/// Order and number of the steps in a sampling interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stepping {
    /// Order of the coupling.
    pub order: Order,
    /// Steps in each sampling interval.
    pub substeps: Substeps,
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
    /// One sub-step, and one where the drive jumps.
    couplings: [C; 2],
    /// Force for 1 V, N.
    gain: N,
    substeps: Substeps,
}

/// Terms of the operator's series with a step of fourth order.
pub const TERMS: usize = 6;

/// Terms of the operator's series with a step of second order.
pub const FEW_TERMS: usize = 3;

/// Sub-steps between two questions whether to give up: tens of microseconds.
const BLOCK: usize = 1024;

impl<N: Number, C: Coupling<N>> SteppingLoop<N, C> {
    /// The steps of a kernel in sampling intervals of `dt` seconds.
    #[inline(always)]
    pub fn new<K: Kernel<Coupling<N> = C>>(
        kernel: &K,
        parameters: &Parameters<N>,
        dt: f64,
        substeps: Substeps,
        halvings: u32,
    ) -> Self {
        // Written out: a closure would not be compiled for the vectors of its caller.
        let (usual, gain) = kernel.coupling(parameters, dt / index(substeps.usual), halvings);
        let mut at_jumps = usual;
        if substeps.at_jumps != substeps.usual {
            at_jumps = kernel.coupling(parameters, dt / index(substeps.at_jumps), halvings).0;
        }
        Self { couplings: [usual, at_jumps], gain, substeps }
    }

    /// Steps the stage along the drive; `None` where the observer gave up.
    ///
    /// Velocities are scaled by the usual step.
    #[inline(always)]
    pub fn run(
        &self,
        drive: &Drive<'_>,
        start: FeedbackState<N, C::Memory>,
        observer: &mut impl Observer<N, C::Memory>,
    ) -> Option<FeedbackState<N, C::Memory>> {
        let Substeps { usual, at_jumps, .. } = self.substeps;
        let mut state = start;
        observer.sample(0, &state);
        let mut from = 1;
        while from < drive.u.len() {
            let jumps = self.substeps.jumps_to(drive, from);
            // By value: what is chosen by reference stays in memory.
            let [usually, at_jump] = self.couplings;
            let (coupling, count) = if jumps { (at_jump, at_jumps) } else { (usually, usual) };
            let block = from + (BLOCK / count).max(1);
            let to = self.substeps.alike(drive, from, block.min(drive.u.len()));
            let reached = if const { C::SHORT } && count == 1 && usual == 1 {
                self.whole(&coupling, drive, from..to, state, observer)
            } else {
                self.parts(&coupling, drive, count, from..to, state, observer)
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
        coupling: &C,
        drive: &Drive<'_>,
        samples: Range<usize>,
        mut state: FeedbackState<N, C::Memory>,
        observer: &mut impl Observer<N, C::Memory>,
    ) -> FeedbackState<N, C::Memory> {
        for k in samples {
            let (u, change) = drive.interval(k - 1);
            state = self.step(coupling, &state, u, change);
            observer.sample(k, &state);
        }
        state
    }

    /// Several steps from sample to sample.
    #[inline(always)]
    fn parts(
        &self,
        coupling: &C,
        drive: &Drive<'_>,
        count: usize,
        samples: Range<usize>,
        mut state: FeedbackState<N, C::Memory>,
        observer: &mut impl Observer<N, C::Memory>,
    ) -> FeedbackState<N, C::Memory> {
        let part = 1.0 / index(count);
        let scale = index(self.substeps.usual) * part;
        let (down, up) = (self.gain.like(scale), self.gain.like(1.0 / scale));
        for k in samples {
            let (u, change) = drive.interval(k - 1);
            let change = change * part;
            state.w = state.w * down;
            for j in 0..count {
                state = self.step(coupling, &state, index(j).mul_add(change, u), change);
            }
            state.w = state.w * up;
            observer.sample(k, &state);
        }
        state
    }

    /// One sub-step under a drive that goes from `u` to `u + change`, V.
    #[inline(always)]
    fn step(
        &self,
        coupling: &C,
        state: &FeedbackState<N, C::Memory>,
        u: f64,
        change: f64,
    ) -> FeedbackState<N, C::Memory> {
        let force = self.gain * self.gain.like(u);
        let rise = self.gain * self.gain.like(change);
        coupling.step(state, force, rise)
    }
}
