//! Deviations summed on the way: what a bundle of lanes does with its displacement.

use piezotrack_control::Number;
use pulp::Simd;

use super::cost::{Bundle, Costs};
use crate::integrator::{FeedbackState, Sink};
use crate::math::Lanes;
use crate::models::DELAY;
use crate::signal::{Late, between, index};

/// Sums of the deviation and of its square, in lanes.
pub(super) struct Sums<'a, const K: usize, N> {
    of: &'a Bundle<'a, K>,
    sum: N,
    squares: N,
    /// Costs of the guesses that are settled before the end.
    verdicts: Vec<Option<Costs>>,
}

impl<'a, const K: usize, S: Simd> Sums<'a, K, Lanes<S, K>> {
    #[inline(always)]
    pub fn new(of: &'a Bundle<'a, K>, zero: Lanes<S, K>) -> Self {
        Self { of, sum: zero, squares: zero, verdicts: vec![None; of.guesses.len()] }
    }

    #[inline(always)]
    fn add(&mut self, k: usize, x: Lanes<S, K>) {
        let of = self.of.of;
        if k >= of.record.window.start {
            let deviation = x.like(of.record.y[k] - of.centre) - x;
            self.sum = self.sum + deviation;
            self.squares = deviation.mul_add(deviation, self.squares);
        }
    }

    /// Gives up where every guess is already beyond its limit: squares only add up, also about
    /// the mean that would suit best what has been seen.
    ///
    /// A guess's verdict is its own, whatever the other lanes hold, so it does not depend on
    /// how guesses are bundled.
    #[inline(always)]
    fn hopeless(&mut self, k: usize) -> bool {
        let Bundle { of, guesses, stop } = self.of;
        let (seen, samples) =
            ((k + 1).saturating_sub(of.record.window.start), of.record.window.len());
        if seen > 0 && seen < samples {
            let share = libm::sqrt(index(seen) / index(samples));
            let sums = self.sum.as_slice().iter().zip(self.squares.as_slice());
            for (((&sum, &squares), guess), verdict) in sums.zip(*guesses).zip(&mut self.verdicts) {
                let part = of.conclude(sum, squares, seen);
                let bound = Costs { rms: share * part.rms, ..part };
                // A hair above, so that rounding cannot abandon a guess that ends at its limit.
                if verdict.is_none() && bound.rms > guess.limit * (1.0 + 1e-9) {
                    *verdict = Some(bound);
                }
            }
        }
        stop() || self.verdicts.iter().all(Option::is_some)
    }

    /// The costs, where the lanes `ended` or were given up before.
    #[inline(always)]
    pub fn conclude(self, ended: bool) -> Vec<Costs> {
        let of = self.of.of;
        let samples = of.record.window.len();
        let lanes = self.sum.as_slice().iter().zip(self.squares.as_slice()).zip(self.verdicts);
        let costs = lanes.map(|((&sum, &squares), verdict)| match verdict {
            Some(verdict) => verdict,
            None if ended => of.conclude(sum, squares, samples),
            None => Costs::FAILED,
        });
        costs.collect()
    }
}

impl<const K: usize, S: Simd, M> Sink<Lanes<S, K>, M> for Sums<'_, K, Lanes<S, K>> {
    #[inline(always)]
    fn sample(&mut self, k: usize, state: &FeedbackState<Lanes<S, K>, M>) {
        self.add(k, state.x);
    }

    #[inline(always)]
    fn give_up(&mut self, k: usize) -> bool {
        self.hopeless(k)
    }
}

/// Sums of a displacement that is late, each lane by its own delay.
pub(super) struct Delayed<'a, const K: usize, S: Simd> {
    pub sums: Sums<'a, K, Lanes<S, K>>,
    /// Displacement and scaled velocity at the last samples, in a ring.
    past: Vec<[Lanes<S, K>; 2]>,
    /// Delay of each lane in whole samples.
    whole: Vec<usize>,
    /// What [`Late::part`] says.
    part: Lanes<S, K>,
    /// Sub-steps in a sampling interval.
    substeps: f64,
}

impl<'a, const K: usize, S: Simd> Delayed<'a, K, S> {
    #[inline(always)]
    pub fn new(sums: Sums<'a, K, Lanes<S, K>>, substeps: f64) -> Self {
        let Bundle { of, guesses, .. } = sums.of;
        let late = |lane: usize| {
            let delay = guesses.get(lane).map_or(0.0, |guess| guess.theta[DELAY]);
            Late::new(delay, of.record.drive.dt)
        };
        let whole: Vec<usize> = (0..Lanes::<S, K>::COUNT).map(|lane| late(lane).whole).collect();
        let part = sums.sum.each(|lane| late(lane).part);
        let length = whole.iter().max().unwrap_or(&0) + 2;
        // At rest before the first sample.
        let past = vec![[sums.sum; 2]; length];
        Self { sums, past, whole, part, substeps }
    }
}

impl<const K: usize, S: Simd, M> Sink<Lanes<S, K>, M> for Delayed<'_, K, S> {
    #[inline(always)]
    fn sample(&mut self, k: usize, state: &FeedbackState<Lanes<S, K>, M>) {
        let length = self.past.len();
        self.past[k % length] = [state.x, state.w * state.w.like(self.substeps)];
        let (past, whole) = (&self.past, &self.whole);
        let read = |i: usize, more: usize| {
            state
                .x
                .each(|lane| past[(k + length - whole[lane] - more) % length][i].as_slice()[lane])
        };
        let x = between(read(0, 1), read(1, 1), read(0, 0), read(1, 0), self.part);
        self.sums.add(k, x);
    }

    #[inline(always)]
    fn give_up(&mut self, k: usize) -> bool {
        self.sums.hopeless(k)
    }
}
