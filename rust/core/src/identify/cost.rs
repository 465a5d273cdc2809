//! What a guess costs: the RMS deviation of the simulated from the measured displacement.
//!
//! ```text
//! f = sqrt(mean((x_i - xhat_i)^2))
//! ```
//!
//! Xu and Li 2010, equation (16), doi 10.1115/1.4001712. Where an offset is fitted, its best
//! value for each guess is the mean of the deviation, so it costs the swarm no dimension.
//! Particles run in lockstep lanes, and no trajectory is stored.

use piezotrack_control::Number;
use piezotrack_control::operator::{Dahl, DahlState, Operator};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::problem::{Problem, Record, Theta};
use super::stepping;
use crate::integrate::{Stop, index};
use crate::lanes::Lanes;
use crate::march::{FEW_TERMS, March, Order, Sink, Stepping, TERMS};
use crate::mechanics::{Mechanics, Propagator, halvings};
use crate::stage::feedback::FeedbackState;

/// Vectors that go through the step together, to hide each other's latency.
const VECTORS: usize = 3;

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
    const FAILED: Self = Self { rms: f64::INFINITY, offset: 0.0 };
}

/// Computes costs of guesses for one problem, with the stepping fixed.
pub struct Evaluator<'a> {
    record: &'a Record<'a>,
    problem: &'a Problem,
    arch: Arch,
    /// How finely a sampling interval is stepped through.
    pub stepping: Stepping,
    halvings: u32,
    /// Subtracted from the measured displacement, m, to keep the sums small.
    centre: f64,
}

impl<'a> Evaluator<'a> {
    /// Fixes the stepping from the bounds, the sampling rate and the drive.
    #[must_use]
    pub fn new(record: &'a Record<'a>, problem: &'a Problem, stop: Stop<'_>) -> Self {
        let stepping = stepping::choose(record, problem, stop);
        let step = record.drive.dt / index(stepping.substeps);
        let rate = stepping::corners(problem).iter().fold(0.0, |most: f64, theta| {
            let mechanics = Mechanics { mass: theta[0], damping: theta[1], stiffness: theta[2] };
            most.max(mechanics.rate())
        });
        let window = &record.y[record.window.clone()];
        let centre =
            if problem.offset { window.iter().sum::<f64>() / index(window.len()) } else { 0.0 };
        let halvings = halvings(rate, step);
        Self { record, problem, arch: Arch::new(), stepping, halvings, centre }
    }

    /// Runs on another instruction set: the costs have the same bits.
    #[must_use]
    pub fn on(mut self, arch: Arch) -> Self {
        self.arch = arch;
        self
    }

    /// Costs of guesses, in their order, computed on the threads of the present pool.
    ///
    /// Those that were not finished when `stop` said so are infinite.
    #[must_use]
    pub fn costs(&self, guesses: &[Guess], stop: Stop<'_>) -> Vec<Costs> {
        let width = self.arch.dispatch(Width);
        // Every thread gets vectors to fill before any gets a second one.
        let vectors = guesses.len().div_ceil(width);
        let each = vectors.div_ceil(rayon::current_num_threads()).clamp(1, VECTORS);
        let size = guesses.len().div_ceil(vectors.div_ceil(each).max(1)).max(1);
        guesses.par_chunks(size).flat_map_iter(|chunk| self.bundle(chunk, width, stop)).collect()
    }

    /// Costs of as many guesses as one bundle of lanes takes.
    fn bundle(&self, guesses: &[Guess], width: usize, stop: Stop<'_>) -> Vec<Costs> {
        if guesses.len() <= width {
            self.arch.dispatch(Bundle::<1> { of: self, guesses, stop })
        } else {
            self.arch.dispatch(Bundle::<VECTORS> { of: self, guesses, stop })
        }
    }

    /// Cost and offset from the sums of the deviation and of its square.
    fn conclude(&self, sum: f64, squares: f64, samples: usize) -> Costs {
        let (mean, mean_square) = (sum / index(samples), squares / index(samples));
        let (variance, offset) = if self.problem.offset {
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

/// Asks an instruction set for its lanes.
struct Width;

impl WithSimd for Width {
    type Output = usize;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> usize {
        S::F64_LANES
    }
}

/// Guesses in one bundle of lanes.
struct Bundle<'a, const K: usize> {
    of: &'a Evaluator<'a>,
    guesses: &'a [Guess],
    stop: Stop<'a>,
}

impl<const K: usize> WithSimd for Bundle<'_, K> {
    type Output = Vec<Costs>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Costs> {
        match self.of.stepping.order {
            Order::Second => self.run::<S, FEW_TERMS, false>(simd),
            Order::Fourth => self.run::<S, TERMS, true>(simd),
        }
    }
}

impl<const K: usize> Bundle<'_, K> {
    #[inline(always)]
    fn run<S: Simd, const T: usize, const FOURTH: bool>(self, simd: S) -> Vec<Costs> {
        let Self { of, guesses, .. } = self;
        // Lanes without a guess of their own repeat the last.
        let lanes = |value: &dyn Fn(&Theta) -> f64| {
            Lanes::<S, K>::gather(simd, |lane| {
                guesses.get(lane).or(guesses.last()).map_or(f64::NAN, |guess| value(&guess.theta))
            })
        };
        let linear = Propagator::new(
            lanes(&|theta| 1.0 / theta[0]),
            lanes(&|theta| theta[1] / theta[0]),
            lanes(&|theta| theta[2] / theta[0]),
            of.record.drive.dt / index(of.stepping.substeps),
            of.halvings,
        );
        let operator = Dahl::<_, T> {
            a1: lanes(&|theta| theta[4]),
            a2: lanes(&|theta| theta[5]),
            gain: lanes(&|theta| theta[6] * theta[8]),
        };
        let gain = lanes(&|theta| theta[3]);
        let zero = lanes(&|_| 0.0);
        let start = FeedbackState { x: zero, w: zero, memory: operator.rest() };
        let verdicts = vec![None; guesses.len()];
        let mut sums = Sums { of: &self, sum: zero, squares: zero, verdicts };
        let march = March { linear, operator, gain };
        let end = march.run::<FOURTH>(&of.record.drive, of.stepping.substeps, start, &mut sums);
        let ended = end.is_some();
        let samples = of.record.window.len();
        let lanes = sums.sum.as_slice().iter().zip(sums.squares.as_slice()).zip(sums.verdicts);
        lanes
            .map(|((&sum, &squares), verdict)| match verdict {
                Some(verdict) => verdict,
                None if ended => of.conclude(sum, squares, samples),
                None => Costs::FAILED,
            })
            .collect()
    }
}

/// Sums of the deviation and of its square, in lanes.
struct Sums<'a, const K: usize, N> {
    of: &'a Bundle<'a, K>,
    sum: N,
    squares: N,
    /// Costs of the guesses that are settled before the end.
    verdicts: Vec<Option<Costs>>,
}

impl<const K: usize, S: Simd> Sink<Lanes<S, K>, DahlState<Lanes<S, K>>>
    for Sums<'_, K, Lanes<S, K>>
{
    #[inline(always)]
    fn sample(&mut self, k: usize, state: &FeedbackState<Lanes<S, K>, DahlState<Lanes<S, K>>>) {
        let Evaluator { record, centre, .. } = self.of.of;
        if k >= record.window.start {
            let deviation = state.x.like(record.y[k] - centre) - state.x;
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
    fn give_up(&mut self, k: usize) -> bool {
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
}
