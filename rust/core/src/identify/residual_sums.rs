//! Sums over the residuals, accumulated during the simulation of a bundle of lanes.

use piezotrack_control::Number;
use pulp::Simd;

use super::candidate::Candidate;
use super::record::Record;
use crate::integrator::{FeedbackState, Observer};
use crate::math::Lanes;
use crate::signal::{FractionalDelay, Stop, between, index};

/// Cost and offset of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// RMS deviation, m; infinite where the simulation blew up. Where the candidate was
    /// abandoned, a lower bound that lies above its limit.
    pub rms: f64,
    /// Offset added to the simulated displacement, m.
    pub offset: f64,
}

impl Costs {
    /// What a candidate costs that could not be simulated.
    pub(super) const FAILED: Self = Self { rms: f64::INFINITY, offset: 0.0 };
}

/// A record whose deviations are summed.
#[derive(Clone, Copy)]
pub(super) struct Residuals<'a> {
    /// The record.
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

/// How the displacement of a bundle is read at a sample.
pub(super) trait Reading<N> {
    /// Takes the state at sample `k` and gives the displacement that is read there.
    fn read(&mut self, k: usize, x: N, w: N) -> N;
}

/// Without delay.
pub(super) struct Direct;

impl<N> Reading<N> for Direct {
    #[inline(always)]
    fn read(&mut self, _k: usize, x: N, _w: N) -> N {
        x
    }
}

/// With a delay, or without.
impl<N, R: Reading<N>> Reading<N> for Option<R> {
    #[inline(always)]
    fn read(&mut self, k: usize, x: N, w: N) -> N {
        match self {
            None => x,
            Some(delayed) => delayed.read(k, x, w),
        }
    }
}

/// Sums of the deviation and of its square, in lanes.
pub(super) struct ResidualSums<'a, const V: usize, S: Simd, R> {
    of: &'a Residuals<'a>,
    candidates: &'a [Candidate],
    stop: Stop<'a>,
    sum: Lanes<S, V>,
    squares: Lanes<S, V>,
    reading: R,
    /// Costs of the candidates that are settled before the end.
    verdicts: Vec<Option<Costs>>,
}

impl<'a, const V: usize, S: Simd, R> ResidualSums<'a, V, S, R> {
    /// Sums that are 0.
    #[inline(always)]
    pub fn new(
        of: &'a Residuals<'a>,
        candidates: &'a [Candidate],
        stop: Stop<'a>,
        zero: Lanes<S, V>,
        reading: R,
    ) -> Self {
        let verdicts = vec![None; candidates.len()];
        Self { of, candidates, stop, sum: zero, squares: zero, reading, verdicts }
    }

    /// Gives up where every candidate is already beyond its limit: squares only add up, also
    /// about the mean that would suit best what has been seen.
    ///
    /// A candidate's verdict is its own, whatever the other lanes hold, so it does not depend on
    /// how candidates are bundled.
    fn hopeless(&mut self, k: usize) -> bool {
        let Self { of, candidates, stop, .. } = *self;
        let (seen, samples) =
            ((k + 1).saturating_sub(of.record.window.start), of.record.window.len());
        if seen > 0 && seen < samples {
            let share = libm::sqrt(index(seen) / index(samples));
            let sums = self.sum.as_slice().iter().zip(self.squares.as_slice());
            let each = sums.zip(candidates).zip(&mut self.verdicts);
            for (((&sum, &squares), candidate), verdict) in each {
                let part = of.conclude(sum, squares, seen);
                let bound = Costs { rms: share * part.rms, ..part };
                // A hair above, so that rounding cannot abandon one that ends at its limit.
                if verdict.is_none() && bound.rms > candidate.limit * (1.0 + 1e-9) {
                    *verdict = Some(bound);
                }
            }
        }
        stop() || self.verdicts.iter().all(Option::is_some)
    }

    /// The costs, where the lanes `ended` or were given up before.
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

impl<const V: usize, S: Simd, M, R: Reading<Lanes<S, V>>> Observer<Lanes<S, V>, M>
    for ResidualSums<'_, V, S, R>
{
    #[inline(always)]
    fn sample(&mut self, k: usize, state: &FeedbackState<Lanes<S, V>, M>) {
        let x = self.reading.read(k, state.x, state.w);
        let record = self.of.record;
        if k >= record.window.start {
            let deviation = x.like(record.y[k] - self.of.centre) - x;
            self.sum = self.sum + deviation;
            self.squares = deviation.mul_add(deviation, self.squares);
        }
    }

    fn give_up(&mut self, k: usize) -> bool {
        self.hopeless(k)
    }
}

/// The last samples of a displacement that is read with a delay, each lane with its own.
pub(super) struct Delayed<const V: usize, S: Simd> {
    /// Displacement and scaled velocity at the last samples, in a ring.
    past: Vec<[Lanes<S, V>; 2]>,
    /// Delay of each lane in whole samples.
    whole: Vec<usize>,
    /// What [`FractionalDelay::part`] says.
    part: Lanes<S, V>,
    /// Sub-steps in a sampling interval.
    substeps: f64,
}

impl<const V: usize, S: Simd> Delayed<V, S> {
    pub fn new(candidates: &[Candidate], dt: f64, start: Lanes<S, V>, substeps: f64) -> Self {
        let zero = start.like(0.0);
        let late = |lane: usize| {
            let delay = candidates.get(lane).map_or(0.0, |candidate| candidate.theta.delay());
            FractionalDelay::new(delay, dt)
        };
        let whole: Vec<usize> = (0..Lanes::<S, V>::COUNT).map(|lane| late(lane).whole).collect();
        let part = zero.each(|lane| late(lane).part);
        let length = whole.iter().max().unwrap_or(&0) + 2;
        // At rest before the first sample.
        Self { past: vec![[start, zero]; length], whole, part, substeps }
    }
}

impl<const V: usize, S: Simd> Reading<Lanes<S, V>> for Delayed<V, S> {
    #[inline(always)]
    fn read(&mut self, k: usize, x: Lanes<S, V>, w: Lanes<S, V>) -> Lanes<S, V> {
        let length = self.past.len();
        self.past[k % length] = [x, w * w.like(self.substeps)];
        let (past, whole) = (&self.past, &self.whole);
        let read = |i: usize, more: usize| {
            x.each(|lane| past[(k + length - whole[lane] - more) % length][i].as_slice()[lane])
        };
        between(read(0, 1), read(1, 1), read(0, 0), read(1, 0), self.part)
    }
}
