//! Cost of a candidate: the RMS deviation of the simulated from the measured displacement.
//!
//! ```text
//! f = sqrt(mean((x_i - xhat_i)^2))
//! ```
//!
//! Xu and Li 2010, equation (16), doi 10.1115/1.4001712. Where an offset is fitted, its best
//! value for each candidate is the mean of the deviation, so the swarm does not search it; nor does
//! it search the size of a drift, or the weights of the creep.
//! Particles run in lockstep lanes, and no trajectory is stored.

use piezotrack_control::Number;
use pulp::{Arch, Simd, WithSimd};

use super::creep_sums::{CreepCost, CreepSums};
use super::motion::motion;
use super::residual_sums::{Costs, Delayed, Direct, ResidualSums, Residuals, Simulated, add_creep};
use super::step_size;
use crate::identify::parameters::candidate::{BEFORE, Candidate, Theta};
use crate::identify::problem::Problem;
use crate::identify::records::creep_weights::CreepWeights;
use crate::identify::records::history::voltages_before;
use crate::identify::records::record::Record;
use crate::integrator::{
    FeedbackState, Kernel, MOST_PARAMETERS, Mechanics, Stepping, SteppingLoop, halvings,
};
use crate::math::{Lanes, dispatch_vectors, on_all_threads, width};
use crate::models::{Held, KernelVisitor, relaxed};
use crate::signal::{Stop, delayed, index};

/// Computes costs of candidates for one problem, with the stepping fixed.
pub struct Evaluator<'a> {
    residuals: Residuals<'a>,
    problem: &'a Problem,
    held: Held,
    arch: Arch,
    /// How finely a sampling interval is stepped through.
    pub stepping: Stepping,
    halvings: u32,
    /// Voltages visited before the record, in turn; the first of a fitted history is a candidate's.
    visited: Vec<f64>,
}

impl<'a> Evaluator<'a> {
    /// Fixes the stepping from the bounds, the sampling rate and the drive.
    #[must_use]
    pub fn new(record: &'a Record<'a>, problem: &'a Problem, stop: Stop<'_>) -> Self {
        Self::stepped(record, problem, step_size::choose(record, problem, stop))
    }

    /// With a stepping that was chosen before.
    #[must_use]
    pub fn stepped(record: &'a Record<'a>, problem: &'a Problem, stepping: Stepping) -> Self {
        let rate = step_size::corners(problem).iter().fold(0.0, |most: f64, theta| {
            let [mass, damping, stiffness, ..] = theta.parameters();
            most.max(Mechanics { mass, damping, stiffness }.rate())
        });
        let window = &record.y[record.window.clone()];
        let centre =
            if problem.offset { window.iter().sum::<f64>() / index(window.len()) } else { 0.0 };
        let halvings = halvings(rate, record.drive.dt / index(stepping.substeps.usual));
        let (held, arch) = (problem.held(), Arch::new());
        let creep_times = &problem.creep_times;
        let (offset, drifts) = (problem.offset, problem.has_drift());
        let residuals = Residuals { record, offset, centre, creep_times, drifts };
        let visited = voltages_before(&record.drive, problem.history, f64::NAN);
        Self { residuals, problem, held, arch, stepping, halvings, visited }
    }

    /// The record.
    #[must_use]
    pub fn record(&self) -> &'a Record<'a> {
        self.residuals.record
    }

    /// Search problem of the record.
    #[must_use]
    pub fn problem(&self) -> &'a Problem {
        self.problem
    }

    /// Runs on another instruction set: the costs have the same bits.
    #[must_use]
    pub fn on(mut self, arch: Arch) -> Self {
        self.arch = arch;
        self
    }

    /// The same record and stepping for a problem with other parameters held.
    pub(in crate::identify) fn of<'b>(&self, problem: &'b Problem) -> Evaluator<'b>
    where
        'a: 'b,
    {
        let Self { residuals, arch, stepping, halvings, ref visited, .. } = *self;
        let visited = visited.clone();
        Evaluator { residuals, problem, held: problem.held(), arch, stepping, halvings, visited }
    }

    /// Displacement as it is read in the window, with these weights of the creep but without offset
    /// and drift, stepped as a cost is; `None` where it is not finite.
    pub(in crate::identify) fn reading(
        &self,
        theta: &Theta,
        creep_weights: &CreepWeights,
        stop: Stop<'_>,
    ) -> Option<Vec<f64>> {
        let Residuals { record, creep_times, .. } = self.residuals;
        let dt = record.drive.dt;
        let Problem { model, history, .. } = *self.problem;
        let [x, v] = motion(model, history, theta, &record.drive, self.stepping, stop)?;
        let read = |x: &[f64], v: &[f64]| -> Option<Vec<f64>> {
            let read = delayed(x, v, dt, theta.delay()).ok()?;
            Some(read[record.window.clone()].to_vec())
        };
        let mut total = read(&x, &v)?;
        let outputs: Option<Vec<Vec<f64>>> = creep_times
            .iter()
            .map(|&time| relaxed(time, dt, None, [&x, &v]))
            .map(|[q, slopes]| read(&q, &slopes))
            .collect();
        add_creep(&mut total, &outputs?, creep_weights);
        Some(total)
    }

    /// Costs of candidates, in their order, computed on the threads of the present pool; where
    /// there are priors, with their factors.
    ///
    /// Those that were not finished when `stop` said so are infinite.
    #[must_use]
    pub fn costs(&self, candidates: &[Candidate], stop: Stop<'_>) -> Vec<Costs> {
        let relations = &self.problem.relations;
        if relations.priors.is_empty() {
            return self.deviations(candidates, stop);
        }
        let factors: Vec<f64> = candidates.iter().map(|one| relations.factor(&one.theta)).collect();
        let scaled = candidates.iter().zip(&factors);
        let scaled: Vec<Candidate> =
            scaled.map(|(one, factor)| Candidate { limit: one.limit / factor, ..*one }).collect();
        let mut costs = self.deviations(&scaled, stop);
        for (one, factor) in costs.iter_mut().zip(&factors) {
            one.rms *= factor;
        }
        costs
    }

    /// RMS deviations of candidates, without the factors of priors.
    pub(in crate::identify) fn deviations(
        &self,
        candidates: &[Candidate],
        stop: Stop<'_>,
    ) -> Vec<Costs> {
        self.simulated(candidates, 0, stop).into_iter().map(|one| one.costs).collect()
    }

    /// Candidates simulated, and what is read of them every `stride` samples of the window, or
    /// never; nothing is read where a simulation did not stay finite, or was not finished when
    /// `stop` said so.
    pub(in crate::identify) fn simulated(
        &self,
        candidates: &[Candidate],
        stride: usize,
        stop: Stop<'_>,
    ) -> Vec<Simulated> {
        let all = All { of: self, candidates, stride, stop };
        let found = self.problem.model.kernel(&self.held, self.stepping.order, all);
        found.unwrap_or_else(|| candidates.iter().map(|_| Simulated::FAILED).collect())
    }

    /// Cost and offset with these weights of the creep, from sums over the whole window.
    pub(in crate::identify) fn costs_with(
        &self,
        sums: &CreepSums,
        creep_weights: CreepWeights,
    ) -> Costs {
        self.residuals.costs(sums, Some(creep_weights), self.record().samples(), false)
    }

    /// Cost, and weights of the creep, from sums over the whole window.
    pub(in crate::identify) fn creep_cost(&self, sums: &CreepSums) -> CreepCost {
        sums.cost(self.record().samples(), self.problem.offset)
    }
}

/// Candidates to be spread over threads and lanes.
struct All<'a> {
    of: &'a Evaluator<'a>,
    candidates: &'a [Candidate],
    stride: usize,
    stop: Stop<'a>,
}

impl<'a> KernelVisitor for All<'a> {
    type Output = Vec<Simulated>;

    fn visit<K: Kernel>(self, kernel: K) -> Vec<Simulated> {
        let Self { of, candidates, stride, stop } = self;
        let width = width(of.arch);
        let vectors = candidates.len().div_ceil(width);
        // A delay reads a ring in memory, which several vectors do not make faster.
        let several =
            const { K::VECTORS > 1 } && width > 1 && !of.problem.has_delay() && stride == 0;
        // Every thread gets one vector before any gets more; then a bundle of several, which takes as
        // long however few of its lanes are filled, is filled before the next.
        let size = if several && vectors > rayon::current_num_threads() {
            K::VECTORS * width
        } else {
            candidates.len().div_ceil(vectors.max(1)).max(1)
        };
        let bundle = |chunk: &'a [Candidate]| {
            // Only a kernel that gains by several vectors is compiled for them.
            if const { K::VECTORS > 1 } && several && chunk.len() > width {
                let bundle = Bundle::<K, VECTORS> { kernel, of, candidates: chunk, stride, stop };
                if let Some(costs) = dispatch_vectors(of.arch, bundle) {
                    return costs;
                }
            }
            of.arch.dispatch(Bundle::<K, 1> { kernel, of, candidates: chunk, stride, stop })
        };
        let chunks: Vec<&[Candidate]> = candidates.chunks(size).collect();
        on_all_threads(&chunks, &|chunk| bundle(chunk)).into_iter().flatten().collect()
    }
}

/// Vectors of a bundle of several.
const VECTORS: usize = 3;

/// Candidates in one bundle of `V` vectors of lanes; with a delay of one only.
struct Bundle<'a, K, const V: usize> {
    kernel: K,
    of: &'a Evaluator<'a>,
    candidates: &'a [Candidate],
    stride: usize,
    stop: Stop<'a>,
}

impl<K: Kernel, const V: usize> WithSimd for Bundle<'_, K, V> {
    type Output = Vec<Simulated>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Simulated> {
        let Self { kernel, of, candidates, stride, stop } = self;
        let (drive, substeps) = (&of.residuals.record.drive, of.stepping.substeps);
        let zero = Lanes::<S, V>::splat(simd, 0.0);
        let mut parameters = [zero; MOST_PARAMETERS];
        // Lanes without a candidate of their own repeat the last.
        let place = |i: usize| {
            Lanes::gather(simd, |lane| {
                let candidate = candidates.get(lane).or(candidates.last());
                candidate.map_or(f64::NAN, |candidate| candidate.theta.0[i])
            })
        };
        for (i, parameter) in parameters.iter_mut().enumerate() {
            *parameter = place(i);
        }
        let (x, memory) =
            of.visited.iter().fold((zero, kernel.rest(&parameters)), |from, &volts| {
                let volts = if volts.is_nan() { place(BEFORE) } else { Number::like(zero, volts) };
                kernel.approach(&parameters, from, volts)
            });
        let start = FeedbackState { x, w: zero, memory };
        let stepping = SteppingLoop::new(&kernel, &parameters, drive.dt, substeps, of.halvings);
        let usual = index(substeps.usual);
        let residuals = &of.residuals;
        if const { V > 1 } {
            let mut sums =
                ResidualSums::new(residuals, candidates, stride, stop, zero, usual, || Direct);
            let ended = stepping.run(drive, start, &mut sums).is_some();
            sums.conclude(ended)
        } else {
            let delayed = || Delayed::new(candidates, drive.dt, x, usual);
            let reading = || of.problem.has_delay().then(delayed);
            let mut sums =
                ResidualSums::new(residuals, candidates, stride, stop, zero, usual, reading);
            let ended = stepping.run(drive, start, &mut sums).is_some();
            sums.conclude(ended)
        }
    }
}
