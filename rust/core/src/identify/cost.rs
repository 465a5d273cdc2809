//! What a guess costs: the RMS deviation of the simulated from the measured displacement.
//!
//! ```text
//! f = sqrt(mean((x_i - xhat_i)^2))
//! ```
//!
//! Xu and Li 2010, equation (16), doi 10.1115/1.4001712. Where an offset is fitted, its best
//! value for each guess is the mean of the deviation, so it costs the swarm no dimension.
//! Particles run in lockstep lanes, and no trajectory is stored.

use piezotrack_control::hysteresis::{Dahl, DahlState, Operator};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::problem::Problem;
use super::record::Record;
use super::residual_sums::{Costs, Delayed, Guess, Residuals, Sums};
use super::step_size;
use crate::integrator::{
    Coupling, FEW_TERMS, FeedbackState, Friction, FrictionParameters, Kernel, MOST_PARAMETERS,
    March, Mechanics, Order, Propagator, Smooth, Stepping, TERMS, halvings,
};
use crate::math::Lanes;
use crate::models::{BoucWenKernel, BoucWenOscillatorKernel, FirstOrderDahlKernel, Model, Theta};
use crate::signal::{Stop, index};

/// Vectors that go through the step together, to hide each other's latency.
const VECTORS: usize = 3;

/// Computes costs of guesses for one problem, with the stepping fixed.
pub struct Evaluator<'a> {
    residuals: Residuals<'a>,
    problem: &'a Problem,
    arch: Arch,
    /// How finely a sampling interval is stepped through.
    pub stepping: Stepping,
    halvings: u32,
}

impl<'a> Evaluator<'a> {
    /// Fixes the stepping from the bounds, the sampling rate and the drive.
    #[must_use]
    pub fn new(record: &'a Record<'a>, problem: &'a Problem, stop: Stop<'_>) -> Self {
        let stepping = step_size::choose(record, problem, stop);
        let rate = step_size::corners(problem).iter().fold(0.0, |most: f64, theta| {
            let mechanics = Mechanics { mass: theta[0], damping: theta[1], stiffness: theta[2] };
            most.max(mechanics.rate())
        });
        let window = &record.y[record.window.clone()];
        let centre =
            if problem.offset { window.iter().sum::<f64>() / index(window.len()) } else { 0.0 };
        let halvings = halvings(rate, record.drive.dt / index(stepping.substeps));
        let residuals = Residuals { record, offset: problem.offset, centre };
        Self { residuals, problem, arch: Arch::new(), stepping, halvings }
    }

    /// Runs on another instruction set: the costs have the same bits.
    #[must_use]
    pub fn on(mut self, arch: Arch) -> Self {
        self.arch = arch;
        self
    }

    /// Length of a sub-step, s.
    fn step(&self) -> f64 {
        self.residuals.record.drive.dt / index(self.stepping.substeps)
    }

    /// Costs of guesses, in their order, computed on the threads of the present pool.
    ///
    /// Those that were not finished when `stop` said so are infinite.
    #[must_use]
    pub fn costs(&self, guesses: &[Guess], stop: Stop<'_>) -> Vec<Costs> {
        let width = self.arch.dispatch(Width);
        // Every thread gets vectors to fill before any gets a second one.
        let vectors = guesses.len().div_ceil(width);
        let each = vectors.div_ceil(rayon::current_num_threads()).clamp(1, self.most());
        let size = guesses.len().div_ceil(vectors.div_ceil(each).max(1)).max(1);
        guesses.par_chunks(size).flat_map_iter(|chunk| self.bundle(chunk, width, stop)).collect()
    }

    /// Most vectors in a bundle: a step with friction fills the registers with one, as do most.
    fn most(&self) -> usize {
        if self.problem.has_friction() || self.problem.model != Model::Dahl { 1 } else { VECTORS }
    }

    /// Costs of as many guesses as one bundle of lanes takes.
    fn bundle(&self, guesses: &[Guess], width: usize, stop: Stop<'_>) -> Vec<Costs> {
        if guesses.len() <= width {
            self.arch.dispatch(Bundle::<1> { of: self, guesses, stop })
        } else {
            self.arch.dispatch(Bundle::<VECTORS> { of: self, guesses, stop })
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
        if self.of.problem.has_friction() {
            return self.with_friction(simd);
        }
        // One vector at most, so that these steps are not compiled for several as well.
        if K == 1 {
            let model = self.of.problem.model;
            let exponent = self.guesses.first().map_or(1.0, |guess| model.exponent(&guess.theta));
            match model {
                Model::Dahl => {}
                Model::BoucWen => return self.kernel(simd, &BoucWenKernel { exponent }),
                Model::FirstOrderDahl => {
                    return self.kernel(simd, &FirstOrderDahlKernel { exponent });
                }
                Model::BoucWenOscillator => {
                    return self.kernel(simd, &BoucWenOscillatorKernel { exponent });
                }
            }
        }
        match self.of.stepping.order {
            Order::Second => self.smooth::<S, FEW_TERMS, false>(simd),
            Order::Fourth => self.smooth::<S, TERMS, true>(simd),
        }
    }
}

impl<const K: usize> Bundle<'_, K> {
    /// A value for each lane; lanes without a guess of their own repeat the last.
    #[inline(always)]
    fn lanes<S: Simd>(&self, simd: S, value: impl Fn(&Theta) -> f64) -> Lanes<S, K> {
        Lanes::gather(simd, |lane| {
            let guess = self.guesses.get(lane).or(self.guesses.last());
            guess.map_or(f64::NAN, |guess| value(&guess.theta))
        })
    }

    #[inline(always)]
    fn smooth<S: Simd, const T: usize, const FOURTH: bool>(self, simd: S) -> Vec<Costs> {
        let linear = Propagator::new(
            self.lanes(simd, |theta| 1.0 / theta[0]),
            self.lanes(simd, |theta| theta[1] / theta[0]),
            self.lanes(simd, |theta| theta[2] / theta[0]),
            self.of.step(),
            self.of.halvings,
        );
        let operator = Dahl::<_, T> {
            a1: self.lanes(simd, |theta| theta[4]),
            a2: self.lanes(simd, |theta| theta[5]),
            gain: self.lanes(simd, |theta| theta[6] * theta[8]),
        };
        let zero = Lanes::splat(simd, 0.0);
        let start = FeedbackState { x: zero, w: zero, memory: operator.rest() };
        let gain = self.lanes(simd, |theta| theta[3]);
        self.march(Smooth::<_, _, FOURTH> { linear, operator }, start, gain)
    }

    /// Any model that is built from plain parameters.
    #[inline(always)]
    fn kernel<S: Simd>(self, simd: S, kernel: &impl Kernel<Lanes<S, K>>) -> Vec<Costs> {
        let zero = Lanes::splat(simd, 0.0);
        let mut parameters = [zero; MOST_PARAMETERS];
        for (i, parameter) in parameters.iter_mut().enumerate() {
            *parameter = self.lanes(simd, |theta| theta[i]);
        }
        let coupling = kernel.coupling(&parameters, self.of.step(), self.of.halvings);
        let start = FeedbackState { x: zero, w: zero, memory: kernel.rest(&parameters) };
        let gain = kernel.gain(&parameters);
        self.march(coupling, start, gain)
    }

    #[inline(always)]
    fn with_friction<S: Simd>(self, simd: S) -> Vec<Costs> {
        let parameters = FrictionParameters {
            mechanics: [0, 1, 2].map(|i| self.lanes(simd, |theta| theta[i])),
            operator: [4, 5, 8].map(|i| self.lanes(simd, |theta| theta[i])),
            b1: self.lanes(simd, |theta| theta[6]),
            b0: self.lanes(simd, |theta| theta[7]),
        };
        let coupling = Friction::new(parameters, self.of.step(), self.of.halvings);
        let zero = Lanes::splat(simd, 0.0);
        let start = coupling.start(zero, zero, DahlState { force: zero, slope: zero });
        let gain = self.lanes(simd, |theta| theta[3]);
        self.march(coupling, start, gain)
    }

    /// Leads the lanes along the drive and concludes.
    #[inline(always)]
    fn march<S: Simd, C: Coupling<Lanes<S, K>>>(
        self,
        coupling: C,
        start: FeedbackState<Lanes<S, K>, C::Memory>,
        gain: Lanes<S, K>,
    ) -> Vec<Costs> {
        let Self { of, guesses, stop } = self;
        let (drive, substeps) = (&of.residuals.record.drive, of.stepping.substeps);
        let march = March { coupling, gain };
        let mut sums = Sums::new(&of.residuals, guesses, stop, start.x);
        let ended = if of.problem.has_delay() {
            let mut late = Delayed::new(sums, index(substeps));
            let end = march.run(drive, substeps, start, &mut late);
            sums = late.sums;
            end.is_some()
        } else {
            march.run(drive, substeps, start, &mut sums).is_some()
        };
        sums.conclude(ended)
    }
}
