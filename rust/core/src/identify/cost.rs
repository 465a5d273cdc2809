//! What a guess costs: the RMS deviation of the simulated from the measured displacement.
//!
//! ```text
//! f = sqrt(mean((x_i - xhat_i)^2))
//! ```
//!
//! Xu and Li 2010, equation (16), doi 10.1115/1.4001712. Where an offset is fitted, its best
//! value for each guess is the mean of the deviation, so it costs the swarm no dimension.
//! Particles run in lockstep lanes and no trajectory is stored.

use piezotrack_control::Number;
use piezotrack_control::operator::{Dahl, Operator};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::problem::{Problem, Record, Theta, range};
use crate::integrate::{Drive, March, Stop, index, steps_for};
use crate::lanes::Lanes;
use crate::mechanics::{Mechanics, Propagator, halvings};
use crate::stage::DahlStage;
use crate::stage::feedback::FeedbackState;

/// Vectors that go through the step together: they hide each other's latency.
const VECTORS: usize = 2;

/// Accuracy that a search asks of its simulations, m.
const ACCURACY: f64 = 2e-10;

/// Most sub-steps that a search takes in one sampling interval.
const MOST: usize = 256;

/// Cost and offset of a guess.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// RMS deviation, m; infinite where the simulation blew up.
    pub rms: f64,
    /// Offset added to the simulated displacement, m.
    pub offset: f64,
}

/// Computes costs of guesses for one problem, with the sub-steps fixed.
pub struct Evaluator<'a> {
    record: &'a Record<'a>,
    problem: &'a Problem,
    arch: Arch,
    /// Steps of the integrator in each sampling interval.
    pub substeps: usize,
    halvings: u32,
    /// Subtracted from the measured displacement, m, to keep the sums small.
    centre: f64,
}

impl<'a> Evaluator<'a> {
    /// Fixes the sub-steps from the bounds, the sampling rate and the drive.
    ///
    /// The stages at the corners and in the middle of the box are simulated with more and more
    /// sub-steps, until none of them moves by more than 0.2 nm.
    #[must_use]
    pub fn new(record: &'a Record<'a>, problem: &'a Problem, stop: Stop<'_>) -> Self {
        let substeps = substeps(record, problem, stop);
        let step = record.drive.dt / index(substeps);
        let rate = corners(problem).iter().fold(0.0, |most: f64, theta| {
            let mechanics = Mechanics {
                mass: theta[0],
                damping: theta[1],
                stiffness: theta[2],
            };
            most.max(mechanics.rate())
        });
        let window = &record.y[record.window.clone()];
        let centre = if problem.offset {
            window.iter().sum::<f64>() / index(window.len())
        } else {
            0.0
        };
        let halvings = halvings(rate, step);
        Self {
            record,
            problem,
            arch: Arch::new(),
            substeps,
            halvings,
            centre,
        }
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
    pub fn costs(&self, thetas: &[Theta], stop: Stop<'_>) -> Vec<Costs> {
        let width = self.arch.dispatch(Width);
        let share = thetas.len().div_ceil(rayon::current_num_threads()).max(1);
        let size = share.div_ceil(width).max(1) * width;
        let size = size.min(width * VECTORS);
        thetas
            .par_chunks(size)
            .flat_map_iter(|chunk| self.bundle(chunk, width, stop))
            .collect()
    }

    /// Costs of as many guesses as one bundle of lanes takes.
    fn bundle(&self, thetas: &[Theta], width: usize, stop: Stop<'_>) -> Vec<Costs> {
        if thetas.len() > width {
            self.arch.dispatch(Bundle::<VECTORS> {
                of: self,
                thetas,
                stop,
            })
        } else {
            self.arch.dispatch(Bundle::<1> {
                of: self,
                thetas,
                stop,
            })
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
    thetas: &'a [Theta],
    stop: Stop<'a>,
}

impl<const K: usize> WithSimd for Bundle<'_, K> {
    type Output = Vec<Costs>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Costs> {
        let Self { of, thetas, stop } = self;
        let Record { drive, y, window } = of.record;
        // Lanes without a guess of their own repeat the last.
        let lanes = |value: &dyn Fn(&Theta) -> f64| {
            Lanes::<S, K>::gather(simd, |lane| {
                thetas.get(lane).or(thetas.last()).map_or(f64::NAN, value)
            })
        };
        let step = drive.dt / index(of.substeps);
        let linear = Propagator::new(
            lanes(&|theta| 1.0 / theta[0]),
            lanes(&|theta| theta[1] / theta[0]),
            lanes(&|theta| theta[2] / theta[0]),
            step,
            of.halvings,
        );
        let operator = Dahl {
            a1: lanes(&|theta| theta[4]),
            a2: lanes(&|theta| theta[5]),
            gain: lanes(&|theta| theta[6] * theta[8]),
        };
        let gain = lanes(&|theta| theta[3]);
        let zero = lanes(&|_| 0.0);
        let (mut sum, mut squares) = (zero, zero);
        let start = FeedbackState {
            x: zero,
            w: zero,
            memory: operator.rest(),
        };
        let march = March {
            linear,
            operator,
            gain,
        };
        march.run(drive, of.substeps, start, stop, |k, state| {
            if k >= window.start {
                let deviation = zero.like(y[k] - of.centre) - state.x;
                sum = sum + deviation;
                squares = deviation.mul_add(deviation, squares);
            }
        });
        if stop() {
            return vec![
                Costs {
                    rms: f64::INFINITY,
                    offset: 0.0
                };
                thetas.len()
            ];
        }
        let count = index(window.len());
        let lanes = sum
            .as_slice()
            .iter()
            .zip(squares.as_slice())
            .take(thetas.len());
        lanes
            .map(|(&sum, &squares)| of.conclude(sum / count, squares / count))
            .collect()
    }
}

impl Evaluator<'_> {
    /// Cost and offset from the mean and the mean square of the deviation.
    fn conclude(&self, mean: f64, mean_square: f64) -> Costs {
        let (variance, offset) = if self.problem.offset {
            (mean_square - mean * mean, mean + self.centre)
        } else {
            (mean_square, 0.0)
        };
        let rms = libm::sqrt(variance.max(0.0));
        if variance.is_finite() && mean.is_finite() {
            Costs { rms, offset }
        } else {
            Costs {
                rms: f64::INFINITY,
                offset: 0.0,
            }
        }
    }
}

/// The corners of the box of free parameters, and its middle.
fn corners(problem: &Problem) -> Vec<Theta> {
    let count = problem.free().count();
    let mut places: Vec<Vec<f64>> = (0..1_usize << count)
        .map(|bits| {
            (0..count)
                .map(|d| f64::from(u8::from(bits >> d & 1 == 1)))
                .collect()
        })
        .collect();
    places.push(vec![0.5; count]);
    places.iter().map(|place| problem.theta(place)).collect()
}

/// Sub-steps with which the stages at the corners and in the middle are accurate, a power of 2.
///
/// A stage that goes more than twice the measured stroke is left out, and so is one that no
/// sub-steps make accurate: such a guess costs more than any stage worth finding, however
/// exactly it is computed.
fn substeps(record: &Record<'_>, problem: &Problem, stop: Stop<'_>) -> usize {
    let excerpts = excerpts(&record.drive);
    let most = 2.0 * record.stroke();
    let thetas = corners(problem);
    let needed = thetas.par_iter().filter_map(|theta| {
        let stage = DahlStage::from_theta(theta).ok()?;
        let needs = excerpts.iter().filter_map(|drive| {
            let (substeps, x) = steps_for(&stage, drive, ACCURACY, MOST, stop)?;
            let (low, high) = range(&x);
            (high - low <= most).then_some(substeps)
        });
        needs.max()
    });
    needed.max().unwrap_or(1)
}

/// Parts of a long drive that ask most of the integrator: its beginning, and its steepest part.
fn excerpts<'a>(drive: &Drive<'a>) -> Vec<Drive<'a>> {
    const LENGTH: usize = 8192;
    if drive.u.len() <= 2 * LENGTH {
        return vec![*drive];
    }
    let steepest = drive
        .u
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .enumerate()
        .fold(
            (0, 0.0),
            |most, now| if now.1 > most.1 { now } else { most },
        )
        .0;
    let start = steepest
        .saturating_sub(LENGTH / 2)
        .min(drive.u.len() - LENGTH);
    [0, start]
        .map(|from| Drive {
            u: &drive.u[from..from + LENGTH],
            ..*drive
        })
        .to_vec()
}
