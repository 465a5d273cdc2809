//! Deviations summed on the way: what a bundle of lanes does with its displacement.

use piezotrack_control::Number;
use pulp::Simd;

use super::record::Record;
use crate::integrator::{FeedbackState, Sink};
use crate::math::Lanes;
use crate::models::{DELAY, Theta};
use crate::signal::{Late, Stop, between, index};

/// Parameters to simulate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guess {
    /// The parameters, SI.
    pub theta: Theta,
    /// The cost, m, beyond which nobody asks how bad the guess is; infinite for none.
    pub limit: f64,
}

/// Cost and offset of a guess.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// RMS deviation, m; infinite where the simulation blew up. Where the guess was abandoned,
    /// a lower bound that lies above its limit.
    pub rms: f64,
    /// Offset added to the simulated displacement, m.
    pub offset: f64,
}

impl Costs {
    /// What a guess costs that could not be simulated.
    pub(super) const FAILED: Self = Self { rms: f64::INFINITY, offset: 0.0 };
}

/// The residual that is summed: measured less simulated displacement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Residuals<'a> {
    pub record: &'a Record<'a>,
    /// Whether an offset is fitted.
    pub offset: bool,
    /// Subtracted from the measured displacement, m, to keep the sums small.
    pub centre: f64,
}

impl Residuals<'_> {
    /// Cost and offset from the sums of the deviation and of its square.
    fn conclude(&self, sum: f64, squares: f64, samples: usize) -> Costs {
        let (mean, mean_square) = (sum / index(samples), squares / index(samples));
        let (variance, offset) = if self.offset {
            (mean_square - mean * mean, mean + self.centre)
        } else {
            (mean_square, 0.0)
        };
        if variance.is_finite() && mean.is_finite() {
            Costs { rms: libm::sqrt(variance.max(0.0)), offset }
        } else {
            Costs::FAILED
        }
    }
}

/// Sums of the deviation and of its square, in lanes.
pub(super) struct Sums<'a, N> {
    of: &'a Residuals<'a>,
    guesses: &'a [Guess],
    stop: Stop<'a>,
    sum: N,
    squares: N,
    /// Costs of the guesses that are settled before the end.
    verdicts: Vec<Option<Costs>>,
}

impl<'a, const K: usize, S: Simd> Sums<'a, Lanes<S, K>> {
    #[inline(always)]
    pub fn new(
        of: &'a Residuals<'a>,
        guesses: &'a [Guess],
        stop: Stop<'a>,
        zero: Lanes<S, K>,
    ) -> Self {
        Self { of, guesses, stop, sum: zero, squares: zero, verdicts: vec![None; guesses.len()] }
    }

    #[inline(always)]
    fn add(&mut self, k: usize, x: Lanes<S, K>) {
        let of = self.of;
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
        let Self { of, guesses, stop, .. } = *self;
        let (seen, samples) =
            ((k + 1).saturating_sub(of.record.window.start), of.record.window.len());
        if seen > 0 && seen < samples {
            let share = libm::sqrt(index(seen) / index(samples));
            let sums = self.sum.as_slice().iter().zip(self.squares.as_slice());
            for (((&sum, &squares), guess), verdict) in sums.zip(guesses).zip(&mut self.verdicts) {
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
        let of = self.of;
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

impl<const K: usize, S: Simd, M> Sink<Lanes<S, K>, M> for Sums<'_, Lanes<S, K>> {
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
    pub sums: Sums<'a, Lanes<S, K>>,
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
    pub fn new(sums: Sums<'a, Lanes<S, K>>, substeps: f64) -> Self {
        let (of, guesses) = (sums.of, sums.guesses);
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
