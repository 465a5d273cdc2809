//! Sums over the residuals, accumulated during the simulation of a bundle of lanes.

use piezotrack_control::Number;
use piezotrack_control::creep::CubicLag;
use piezotrack_control::cubic_motion::between;
use pulp::Simd;

use super::creep_sums::CreepSums;
use crate::identify::parameters::candidate::Candidate;
use crate::identify::parameters::drift::{DriftSums, Drifting, Fading};
use crate::identify::records::creep_weights::{
    CreepWeights, MOST_CREEP, MOST_CREEP_WEIGHTS, SLACK,
};
use crate::identify::records::record::Record;
use crate::integrator::{FeedbackState, Observer};
use crate::math::Lanes;
use crate::signal::{FractionalDelay, Stop, index};

/// Cost, offset, drift and weights of the creep of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// RMS deviation, m, times the factor of the priors where there are any; infinite where the
    /// simulation blew up. Where the candidate was
    /// abandoned, a lower bound that lies above its limit.
    pub rms: f64,
    /// Offset added to the simulated displacement, m.
    pub offset: f64,
    /// Part of the reading that fades along the window, m.
    pub drift: f64,
    /// Weights of the creep.
    pub creep_weights: CreepWeights,
}

impl Costs {
    /// Cost of a candidate that could not be simulated.
    pub(in crate::identify) const FAILED: Self = Self {
        rms: f64::INFINITY,
        offset: 0.0,
        drift: 0.0,
        creep_weights: [0.0; MOST_CREEP_WEIGHTS],
    };
}

/// A record whose deviations are summed.
#[derive(Clone, Copy)]
pub(in crate::identify) struct Residuals<'a> {
    /// The record.
    pub record: &'a Record<'a>,
    /// Whether an offset is fitted.
    pub offset: bool,
    /// Subtracted from the measured displacement, m, to keep the sums small.
    pub centre: f64,
    /// Time constants of the creep whose weights are fitted, s.
    pub creep_times: &'a [f64],
    /// Whether candidates have a drift, with time constants of their own.
    pub drifts: bool,
}

impl Residuals<'_> {
    /// Cost, offset and weights from the sums, of the best weights where none are given; a bound of
    /// the cost where they are of the part of the window seen so far.
    pub(in crate::identify) fn costs(
        &self,
        sums: &CreepSums,
        given: Option<CreepWeights>,
        samples: usize,
        bound: bool,
    ) -> Costs {
        let [sum, squares] = sums.deviation;
        let count = self.creep_times.len();
        if count == 0 && sums.drift.is_none() {
            return self.conclude(sum, squares, samples);
        }
        if bound && !sums.tell_drift(samples) {
            return Costs { rms: 0.0, ..Costs::FAILED };
        }
        let cost = sums.cost(samples, self.offset);
        let creep_weights = given.unwrap_or_else(|| cost.best(count));
        let square = cost.at(&creep_weights);
        let rms = libm::sqrt(square.max(0.0));
        // Outputs that hardly differ may have been left out of the best weights.
        let rms = if bound { (rms - MOST_CREEP * SLACK * cost.size()).max(0.0) } else { rms };
        let total: f64 = creep_weights.iter().sum();
        // The outputs were taken from the centre too.
        let [mean, drift] = sums.offset_and_drift(samples, &creep_weights);
        let offset = if self.offset { mean + self.centre - self.centre * total } else { 0.0 };
        if rms.is_finite() && offset.is_finite() && square.is_finite() {
            Costs { rms, offset, drift, creep_weights }
        } else {
            Costs::FAILED
        }
    }

    /// Cost and offset from the sums of the deviation and of its square.
    fn conclude(&self, sum: f64, squares: f64, samples: usize) -> Costs {
        let (mean, mean_square) = (sum / index(samples), squares / index(samples));
        let (variance, offset) = if self.offset {
            (mean_square - mean * mean, mean + self.centre)
        } else {
            (mean_square, 0.0)
        };
        if variance.is_finite() && mean.is_finite() {
            Costs { rms: libm::sqrt(variance.max(0.0)), offset, ..Costs::FAILED }
        } else {
            Costs::FAILED
        }
    }
}

/// How the displacement of a bundle is read at a sample.
pub(in crate::identify) trait Reading<N> {
    /// Takes the state at sample `k` and gives the displacement that is read there.
    fn read(&mut self, k: usize, x: N, w: N) -> N;
}

/// Without delay.
pub(in crate::identify) struct Direct;

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

/// A relaxation of the creep behind the mechanics, in lanes, with its sums.
struct Relaxing<N, R> {
    lag: CubicLag,
    reached: N,
    reading: R,
    /// Reading at the present sample, from the centre.
    output: N,
    sum: N,
    cross: N,
    products: [N; MOST_CREEP_WEIGHTS],
}

/// Sums of the deviation and of its square, in lanes.
pub(in crate::identify) struct ResidualSums<'a, const V: usize, S: Simd, R> {
    of: &'a Residuals<'a>,
    candidates: &'a [Candidate],
    stop: Stop<'a>,
    sum: Lanes<S, V>,
    squares: Lanes<S, V>,
    /// Samples that count, so far and in all.
    seen: usize,
    samples: usize,
    reading: R,
    /// Sub-steps in a sampling interval.
    substeps: f64,
    /// Displacement and scaled velocity at the last sample.
    last: [Lanes<S, V>; 2],
    creep: Vec<Relaxing<Lanes<S, V>, R>>,
    drift: Option<Drifting<Lanes<S, V>>>,
    /// Costs of the candidates that are settled before the end.
    verdicts: Vec<Option<Costs>>,
    /// Every so many samples of the window what is read is kept; 0 for never.
    stride: usize,
    /// The sample that is kept next.
    next: usize,
    /// Kept readings: at each of these samples the displacement, and the creep's outputs.
    kept: Vec<Lanes<S, V>>,
}

/// A candidate simulated.
pub(in crate::identify) struct Simulated {
    /// Its cost.
    pub costs: Costs,
    /// Sums over the whole window; `None` where it was not simulated to its end.
    pub sums: Option<CreepSums>,
    /// Readings at the requested samples, without offset and drift, m: with the creep where the
    /// candidate has its weights given, else of the mechanics alone.
    pub reading: Vec<f64>,
    /// Readings there of each relaxation of the creep, where no weights are given, m.
    pub outputs: Vec<Vec<f64>>,
}

impl Simulated {
    /// A candidate that could not be simulated.
    pub const FAILED: Self =
        Self { costs: Costs::FAILED, sums: None, reading: Vec::new(), outputs: Vec::new() };
}

impl<'a, const V: usize, S: Simd, R> ResidualSums<'a, V, S, R> {
    /// Sums that are 0; a reading is kept every `stride` samples, or never.
    #[inline(always)]
    pub fn new(
        of: &'a Residuals<'a>,
        candidates: &'a [Candidate],
        stride: usize,
        stop: Stop<'a>,
        zero: Lanes<S, V>,
        substeps: f64,
        reading: impl Fn() -> R,
    ) -> Self {
        let verdicts = vec![None; candidates.len()];
        let relaxing = |&time: &f64| Relaxing {
            lag: CubicLag::new(time, of.record.drive.dt),
            reached: zero,
            reading: reading(),
            output: zero,
            sum: zero,
            cross: zero,
            products: [zero; MOST_CREEP_WEIGHTS],
        };
        let creep = of.creep_times.iter().map(relaxing).collect();
        let drift = of.drifts.then(|| {
            let fading = |lane: usize| {
                let time = candidates.get(lane).or(candidates.last())?.theta.drift_time()?;
                Some(Fading::new(time, of.record.drive.dt, of.record.window.len()))
            };
            let of_lane = |number: fn(Fading) -> f64| {
                zero.by_lane(|lane| fading(lane).map_or(f64::NAN, number))
            };
            Drifting::new(of_lane(|fading| fading.keep), of_lane(|fading| fading.less))
        });
        let (last, reading) = ([zero; 2], reading());
        let kept = if stride > 0 { of.record.window.len().div_ceil(stride) } else { 0 };
        let kept = Vec::with_capacity(kept * (1 + of.creep_times.len()));
        let next = if stride > 0 { of.record.window.start } else { usize::MAX };
        Self {
            of,
            candidates,
            stop,
            sum: zero,
            squares: zero,
            seen: 0,
            samples: of.record.samples(),
            reading,
            substeps,
            last,
            creep,
            drift,
            verdicts,
            stride,
            next,
            kept,
        }
    }

    /// The sums of a lane.
    fn sums(&self, lane: usize) -> CreepSums {
        let at = |lanes: &Lanes<S, V>| lanes.as_slice().get(lane).copied().unwrap_or(f64::NAN);
        let mut sums =
            CreepSums { deviation: [at(&self.sum), at(&self.squares)], ..CreepSums::default() };
        for (j, one) in self.creep.iter().enumerate() {
            sums.outputs[j] = at(&one.sum);
            sums.cross[j] = at(&one.cross);
            sums.products[j] = one.products.each_ref().map(at);
        }
        sums.drift = self.drift.as_ref().map(|drift| {
            let DriftSums { shape, deviation, outputs } = &drift.sums;
            let (shape, outputs) = (shape.each_ref().map(at), outputs.each_ref().map(at));
            DriftSums { shape, deviation: at(deviation), outputs }
        });
        sums
    }

    /// Gives up where every candidate is already beyond its limit: squares only add up, also
    /// about the mean, and with the weights of the creep, that would suit best what has been seen.
    ///
    /// A candidate's verdict is its own, whatever the other lanes hold, so it does not depend on
    /// how candidates are bundled.
    fn hopeless(&mut self) -> bool {
        let Self { of, candidates, stop, seen, samples, .. } = *self;
        if seen > 0 && seen < samples {
            let share = libm::sqrt(index(seen) / index(samples));
            for (lane, candidate) in candidates.iter().enumerate() {
                if self.verdicts[lane].is_some() {
                    continue;
                }
                let part = of.costs(&self.sums(lane), candidate.creep_weights, seen, true);
                let bound = Costs { rms: share * part.rms, ..part };
                // A hair above, so that rounding cannot abandon one that ends at its limit.
                if bound.rms > candidate.limit * (1.0 + 1e-9) {
                    self.verdicts[lane] = Some(bound);
                }
            }
        }
        stop() || self.verdicts.iter().all(Option::is_some)
    }

    /// Kept readings, a column for each candidate: of the displacement, then of each output.
    fn columns(&self) -> Vec<Vec<f64>> {
        let (entries, lanes) = (1 + self.creep.len(), self.candidates.len());
        let rows = self.kept.len() / entries;
        let count = if rows > 0 { entries * lanes } else { 0 };
        let mut columns: Vec<Vec<f64>> = (0..count).map(|_| vec![0.0; rows]).collect();
        for from in (0..rows).step_by(BLOCK) {
            let block = from..rows.min(from + BLOCK);
            for (i, column) in columns.iter_mut().enumerate() {
                let (entry, lane) = (i / lanes, i % lanes);
                let kept = self.kept[block.start * entries..block.end * entries].iter();
                let values = kept.skip(entry).step_by(entries);
                for (slot, value) in column[block.clone()].iter_mut().zip(values) {
                    *slot = value.as_slice()[lane];
                }
            }
        }
        columns
    }

    /// The costs, where the lanes `ended` or were given up before, and what was kept.
    pub fn conclude(self, ended: bool) -> Vec<Simulated> {
        let samples = self.samples;
        let lanes = self.candidates.len();
        let settled = (0..lanes).map(|lane| {
            let sums = (self.verdicts[lane].is_none() && ended).then(|| self.sums(lane));
            let creep_weights = self.candidates[lane].creep_weights;
            let costs = sums.map(|sums| self.of.costs(&sums, creep_weights, samples, false));
            (costs.or(self.verdicts[lane]).unwrap_or(Costs::FAILED), sums)
        });
        let settled: Vec<(Costs, Option<CreepSums>)> = settled.collect();
        let mut kept = self.columns().into_iter();
        let mut readings: Vec<Vec<f64>> = kept.by_ref().take(lanes).collect();
        readings.resize_with(lanes, Vec::new);
        let mut outputs: Vec<Vec<Vec<f64>>> = vec![Vec::new(); lanes];
        for (i, mut output) in kept.enumerate() {
            for q in &mut output {
                *q += self.of.centre;
            }
            outputs[i % lanes].push(output);
        }
        let each = settled.into_iter().zip(self.candidates).zip(readings.into_iter().zip(outputs));
        let simulated = each.map(|(((costs, sums), candidate), (mut reading, mut outputs))| {
            if costs.rms.is_infinite() {
                return Simulated { costs, sums, ..Simulated::FAILED };
            }
            if let Some(creep_weights) = candidate.creep_weights {
                add_creep(&mut reading, &outputs, &creep_weights);
                outputs.clear();
            }
            Simulated { costs, sums, reading, outputs }
        });
        simulated.collect()
    }
}

/// Samples whose lanes are in the nearest cache together.
const BLOCK: usize = 64;

/// Adds what is read of the relaxations of a creep, with these weights.
pub(in crate::identify) fn add_creep(
    values: &mut [f64],
    outputs: &[Vec<f64>],
    creep_weights: &CreepWeights,
) {
    for (output, share) in outputs.iter().zip(creep_weights) {
        values.iter_mut().zip(output).for_each(|(x, q)| *x += share * q);
    }
}

impl<const V: usize, S: Simd, R: Reading<Lanes<S, V>>> ResidualSums<'_, V, S, R> {
    /// Takes the relaxations to sample `k`, before the displacement there is read.
    #[inline(always)]
    fn creep(&mut self, k: usize, x: Lanes<S, V>, w: Lanes<S, V>) {
        let now = [x, w * w.like(self.substeps)];
        for one in &mut self.creep {
            // In equilibrium at the first sample.
            one.reached = if k == 0 { x } else { one.lag.step(one.reached, self.last, now) };
            let slope = one.lag.slope(x, one.reached) / x.like(self.substeps);
            one.output = one.reading.read(k, one.reached, slope) - x.like(self.of.centre);
        }
        self.last = now;
    }

    /// Adds the relaxations at a sample that counts.
    #[inline(always)]
    fn add_creep(&mut self, deviation: Lanes<S, V>) {
        for j in 0..self.creep.len() {
            let (before, rest) = self.creep.split_at_mut(j);
            let Some(one) = rest.first_mut() else { continue };
            let output = one.output;
            one.sum = one.sum + output;
            one.cross = output.mul_add(deviation, one.cross);
            for (product, other) in one.products.iter_mut().zip(before.iter()) {
                *product = output.mul_add(other.output, *product);
            }
            one.products[j] = output.mul_add(output, one.products[j]);
        }
    }
}

impl<const V: usize, S: Simd, M, R: Reading<Lanes<S, V>>> Observer<Lanes<S, V>, M>
    for ResidualSums<'_, V, S, R>
{
    #[inline(always)]
    fn sample(&mut self, k: usize, state: &FeedbackState<Lanes<S, V>, M>) {
        if !self.creep.is_empty() {
            self.creep(k, state.x, state.w);
        }
        let x = self.reading.read(k, state.x, state.w);
        let record = self.of.record;
        // Bundles of one vector only: several have no register for it.
        if const { V == 1 } && k == self.next {
            self.next += self.stride;
            self.kept.push(x);
            self.kept.extend(self.creep.iter().map(|one| one.output));
        }
        if k >= record.window.start && !record.counts(k) {
            if let Some(drift) = &mut self.drift {
                drift.pass();
            }
        } else if k >= record.window.start {
            self.seen += 1;
            let deviation = x.like(record.y[k] - self.of.centre) - x;
            self.sum = self.sum + deviation;
            self.squares = deviation.mul_add(deviation, self.squares);
            if !self.creep.is_empty() {
                self.add_creep(deviation);
            }
            if let Some(drift) = &mut self.drift {
                drift.add(deviation, self.creep.iter().map(|one| one.output));
            }
        }
    }

    fn give_up(&mut self, _k: usize) -> bool {
        self.hopeless()
    }
}

/// The last samples of a displacement that is read with a delay, each lane with its own.
pub(in crate::identify) struct Delayed<const V: usize, S: Simd> {
    /// Displacement and scaled velocity at the last samples, in a ring.
    past: Vec<[Lanes<S, V>; 2]>,
    /// Delay of each lane in whole samples.
    whole: Vec<usize>,
    /// Part that [`FractionalDelay::part`] returns.
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
        let part = zero.by_lane(|lane| late(lane).part);
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
            x.by_lane(|lane| past[(k + length - whole[lane] - more) % length][i].as_slice()[lane])
        };
        between(read(0, 1), read(1, 1), read(0, 0), read(1, 0), self.part)
    }
}
