//! Effect of each unknown of the stage on its displacement, sample by sample.
//!
//! All signals go through the same creep and dynamics: several at a time, in lanes.

use core::ops::Range;

use pulp::{Simd, WithSimd};

use super::fit::Fit;
use super::follower::{Follower, follow};
use super::record_path::Walk;
use super::strides::{Stepped, Strides};
use crate::error::Result;
use crate::math::{Lanes, dispatch_fused};
use crate::models::{Relaxation, RelaxationState};
use crate::signal::{Hold, index};

/// Change of a logarithm for a derivative by differences.
const NUDGE: f64 = 1e-5;

/// Samples that are computed at once.
const BLOCK: usize = 128;

/// Vectors of lanes that go through a step together, which hides its latency.
const VECTORS: usize = 4;

/// Most lanes of a vector of those that [`dispatch_fused`] chooses from.
const MOST_LANES: usize = 4;

/// Parts that the columns go through.
struct Parts {
    whole: Stepped,
    /// Behind the creep: what its relaxations have reached goes through the dynamics alone.
    bare: Stepped,
    /// With each number of the dynamics changed a little.
    nudged: Vec<Stepped>,
    /// Factors by which each relaxation's departure decays within each of the steps.
    decay: Vec<Vec<f64>>,
}

impl Parts {
    fn of(fit: &Fit<'_>, dt: f64, gaps: &[usize]) -> Result<Self> {
        let stepped = |part| Stepped::new(part, dt, gaps);
        let bare = Relaxation::new(&[], &[], fit.dynamics())?;
        let factor = |time: &f64, gap: &usize| libm::exp(-dt * index(*gap) / time);
        let decays = |gap| fit.times.iter().map(|time| factor(time, gap)).collect();
        let slots = fit.layout().poles();
        let nudged = slots.map(|slot| {
            let mut other = fit.clone();
            other.x[slot] += NUDGE;
            Ok(stepped(other.relaxation()?))
        });
        let nudged: Result<Vec<_>> = nudged.collect();
        Ok(Self {
            whole: stepped(fit.relaxation()?),
            bare: stepped(bare),
            nudged: nudged?,
            decay: gaps.iter().map(decays).collect(),
        })
    }
}

/// The columns of a record: weights, dead zones, corners, weights of the creep, numbers of the
/// dynamics and departures.
pub(in crate::identify::least_squares) struct Columns<'f, 'a> {
    fit: &'f Fit<'a>,
    walk: Walk<'f, 'a>,
    hold: Hold,
    parts: Parts,
    strides: Strides,
    at: usize,
    /// Inputs of weights, dead zones and corners, then that of the stage, in rows of `width`.
    inputs: Vec<f64>,
    width: usize,
    inner: usize,
    /// Behind the inputs, the stage last, then followers of nothing up to `width`.
    followers: Vec<Follower>,
    /// Level that each relaxation has reached, behind the dynamics.
    reached: Vec<Follower>,
    /// Remainder of each departure, and that behind the dynamics.
    left: Vec<f64>,
    faded: Vec<Follower>,
    /// The stage with each number of the dynamics changed a little.
    nudged: Vec<Follower>,
    /// Displacements behind the inputs, in rows of `width`.
    moved: Vec<f64>,
    /// The stage's displacements, and what its relaxations have reached.
    stage: Vec<RelaxationState>,
    /// The columns, in rows of `total`.
    rows: Vec<f64>,
    total: usize,
}

impl<'f, 'a> Columns<'f, 'a> {
    pub fn of(fit: &'f Fit<'a>, r: usize) -> Result<Self> {
        let (layout, own, record) = (fit.layout(), fit.own(r), &fit.common.records[r]);
        let strides = Strides::of(fit, r, fit.windows[r].end);
        let parts = Parts::of(fit, record.drive.dt, strides.gaps())?;
        let inner = layout.weights + layout.bends + layout.corners;
        let bundle = VECTORS * MOST_LANES;
        let width = (inner + 1).div_ceil(bundle) * bundle;
        let total = layout.count() + own.departures.len();
        let creep = fit.creep_before(r, inner + 1);
        let mut first = vec![0.0; inner + 1];
        let mut walk = fit.walk(r);
        fit.inputs(walk.at(0), &mut first);
        let ready = |(input, q): (&f64, &Vec<f64>)| Follower::at_rest(&parts.whole.part, *input, q);
        let bare = |q: &f64| Follower::at_rest(&parts.bare.part, *q, &[]);
        let mut followers: Vec<Follower> = first.iter().zip(&creep).map(ready).collect();
        let stage = followers[inner];
        followers.resize(width, Follower::at_rest(&parts.whole.part, 0.0, &[]));
        let departed = &fit.x[layout.creep_weights()][..own.departures.len()];
        Ok(Self {
            reached: creep.last().map_or(&[][..], Vec::as_slice).iter().map(bare).collect(),
            left: departed.to_vec(),
            faded: departed.iter().map(bare).collect(),
            nudged: vec![stage; parts.nudged.len()],
            walk: fit.walk(r),
            hold: record.drive.hold,
            strides,
            at: 0,
            inputs: vec![0.0; BLOCK * width],
            moved: vec![0.0; BLOCK * width],
            stage: Vec::with_capacity(BLOCK),
            rows: vec![0.0; BLOCK * total],
            fit,
            parts,
            width,
            inner,
            followers,
            total,
        })
    }

    /// Number of columns.
    pub fn count(&self) -> usize {
        self.total
    }

    /// Row `i` of the samples that [`Self::next`] returned.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * self.total..][..self.total]
    }

    /// Displacement of the stage in that row, m.
    pub fn displacement(&self, i: usize) -> f64 {
        self.stage[i].x
    }

    /// Computes the rows of the next samples, and returns which these are.
    pub fn next(&mut self) -> Option<Vec<usize>> {
        let first = self.at;
        let places: Vec<usize> =
            self.strides.places()[first..].iter().copied().take(BLOCK).collect();
        let count = places.len();
        if count == 0 {
            return None;
        }
        let mut level = usize::MAX;
        for (i, &k) in places.iter().enumerate() {
            let from = i * self.width;
            if self.walk.level(k) == level {
                let before = from - self.width;
                self.inputs.copy_within(before..=before + self.inner, from);
            } else {
                level = self.walk.level(k);
                self.fit.inputs(self.walk.at(k), &mut self.inputs[from..=from + self.inner]);
            }
        }
        // The first sample of all is where the followers are at rest.
        if first == 0 {
            for (moved, follower) in self.moved.iter_mut().zip(&self.followers) {
                *moved = follower.state.x;
            }
        }
        let steps: Vec<(usize, Hold)> =
            (first..first + count).map(|at| (self.strides.step(at), self.hold.until(at))).collect();
        dispatch_fused(OfStage { columns: self, steps: &steps });
        let mut step = usize::from(first == 0);
        for alike in steps[step..].chunk_by(|a, b| a == b) {
            let (length, hold) = alike[0];
            dispatch_fused(Bundles {
                part: &self.parts.whole,
                length,
                hold,
                followers: &mut self.followers,
                inputs: &self.inputs,
                moved: &mut self.moved,
                steps: step..step + alike.len(),
            });
            step += alike.len();
        }
        for i in 0..count {
            let moved = &self.moved[i * self.width..][..self.inner];
            self.rows[i * self.total..][..self.inner].copy_from_slice(moved);
        }
        self.at += count;
        Some(places)
    }

    /// Follows the columns of the stage's own input and creep over so many intervals each.
    #[inline(always)]
    fn follow_stage(&mut self, steps: &[(usize, Hold)]) {
        let Parts { whole, bare, nudged, decay } = &self.parts;
        let mut stage = self.followers[self.inner];
        self.stage.clear();
        for (i, &(length, hold)) in steps.iter().enumerate() {
            let input = self.inputs[i * self.width + self.inner];
            if self.at + i > 0 {
                stage.next(&whole.part, whole.over(length), hold, input);
                // These move from sample to sample whatever the hold.
                for (column, q) in self.reached.iter_mut().zip(stage.state.creep) {
                    bare.part.step(bare.over(length), &mut column.state, q);
                }
                let faded = self.faded.iter_mut().zip(&mut self.left).zip(&decay[length]);
                for ((column, left), factor) in faded {
                    *left *= factor;
                    bare.part.step(bare.over(length), &mut column.state, *left);
                }
                for (column, one) in self.nudged.iter_mut().zip(nudged) {
                    column.next(&one.part, one.over(length), hold, input);
                }
            }
            self.stage.push(stage.state);
            let x = stage.state.x;
            let moved = |one: &Follower| one.state.x;
            let slopes = self.nudged.iter().map(|one| (one.state.x - x) / NUDGE);
            let values = self.reached.iter().map(moved).chain(slopes);
            let row = &mut self.rows[i * self.total..][self.inner..self.total];
            for (slot, value) in row.iter_mut().zip(values.chain(self.faded.iter().map(moved))) {
                *slot = value;
            }
        }
    }
}

/// Columns of the stage's own input and creep along some samples.
struct OfStage<'s, 'f, 'a> {
    columns: &'s mut Columns<'f, 'a>,
    steps: &'s [(usize, Hold)],
}

impl WithSimd for OfStage<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        self.columns.follow_stage(self.steps);
    }
}

/// Followers in lanes along some samples, by steps of one length.
struct Bundles<'s> {
    part: &'s Stepped,
    /// Which of the steps.
    length: usize,
    hold: Hold,
    followers: &'s mut [Follower],
    inputs: &'s [f64],
    moved: &'s mut [f64],
    steps: Range<usize>,
}

impl WithSimd for Bundles<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let lanes = VECTORS * S::F64_LANES;
        let width = self.followers.len();
        let (part, flow) = (&self.part.part, self.part.over(self.length));
        for (b, bundle) in self.followers.chunks_exact_mut(lanes).enumerate() {
            let mut state = RelaxationState {
                input: gathered(simd, bundle, |one| one.state.input),
                creep: core::array::from_fn(|j| gathered(simd, bundle, |one| one.state.creep[j])),
                x: gathered(simd, bundle, |one| one.state.x),
                v: gathered(simd, bundle, |one| one.state.v),
                mode_x: core::array::from_fn(|j| gathered(simd, bundle, |one| one.state.mode_x[j])),
                mode_v: core::array::from_fn(|j| gathered(simd, bundle, |one| one.state.mode_v[j])),
            };
            let mut before = gathered(simd, bundle, |one| one.before);
            for k in self.steps.clone() {
                let from = k * width + b * lanes;
                let inputs = &self.inputs[from..from + lanes];
                let input = Lanes::<S, VECTORS>::gather(simd, |i| inputs[i]);
                follow(part, flow, self.hold, &mut state, [before, input]);
                before = input;
                self.moved[from..from + lanes].copy_from_slice(state.x.as_slice());
            }
            for (i, follower) in bundle.iter_mut().enumerate() {
                let of = |lanes: &Lanes<S, VECTORS>| lanes.as_slice()[i];
                follower.state = RelaxationState {
                    input: of(&state.input),
                    creep: core::array::from_fn(|j| of(&state.creep[j])),
                    x: of(&state.x),
                    v: of(&state.v),
                    mode_x: core::array::from_fn(|j| of(&state.mode_x[j])),
                    mode_v: core::array::from_fn(|j| of(&state.mode_v[j])),
                };
                follower.before = of(&before);
            }
        }
    }
}

/// A number of each follower, in lanes.
#[inline(always)]
fn gathered<S: Simd>(
    simd: S,
    bundle: &[Follower],
    of: impl Fn(&Follower) -> f64,
) -> Lanes<S, VECTORS> {
    Lanes::gather(simd, |i| of(&bundle[i]))
}
