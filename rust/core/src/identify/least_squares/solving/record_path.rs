//! The way of a stage through one of the records: memory and creep before it, and its motion.

use std::sync::Arc;

use pulp::{Simd, WithSimd};

use super::fit::Fit;
use super::follower::Follower;
use super::late::Late;
use super::strides::{Stepped, Strides};
use crate::error::Result;
use crate::identify::records::history::{History, voltages_before};
use crate::math::dispatch_fused;
use crate::models::{Dynamics, Experiment, Relaxation, Rest, Values};
use crate::signal::index;

/// Signals of a record that are kept, at most: those of a longer one are made whenever they are needed.
const MOST_KEPT: usize = 1 << 22;

/// Signals of a drive, and the memory that they come from.
#[derive(Clone, Debug)]
pub(in crate::identify::least_squares) struct Path {
    pub memory: Vec<f64>,
    pub signals: Vec<f64>,
}

/// The signals of a record, sample by sample.
pub(in crate::identify::least_squares) struct Walk<'f, 'a> {
    fit: &'f Fit<'a>,
    r: usize,
    path: Path,
    kept: Option<Arc<[f64]>>,
}

impl Walk<'_, '_> {
    /// The signals at sample `k`, which comes after those before; the drive is held in between.
    #[inline(always)]
    pub fn at(&mut self, k: usize) -> &[f64] {
        let width = self.path.signals.len();
        if let Some(kept) = &self.kept {
            return &kept[self.level(k) * width..][..width];
        }
        let record = &self.fit.common.records[self.r];
        self.fit.push(&mut self.path, record.drive.u[k], record.step(k));
        &self.path.signals
    }

    /// How many times the drive has changed up to sample `k`: with it, the signals change.
    #[inline(always)]
    pub fn level(&self, k: usize) -> usize {
        self.fit.common.levels[self.r][k]
    }
}

impl<'a> Fit<'a> {
    /// The way of record `r` from its first sample on.
    pub fn walk<'f>(&'f self, r: usize) -> Walk<'f, 'a> {
        let walk = || Walk { fit: self, r, path: self.before(r), kept: None };
        let levels = &self.common.levels[r];
        let count = levels.last().map_or(0, |last| last + 1) * self.signals.count();
        if count > MOST_KEPT {
            return walk();
        }
        let make = || {
            let (mut walk, mut all) = (walk(), Vec::with_capacity(count));
            for k in (0..levels.len()).filter(|&k| k == 0 || levels[k] != levels[k - 1]) {
                all.extend_from_slice(walk.at(k));
            }
            all.into()
        };
        let kept = self.kept[r].get_or_init(make).clone();
        let path = Path { memory: Vec::new(), signals: vec![0.0; self.signals.count()] };
        Walk { fit: self, r, path, kept: Some(kept) }
    }

    /// The signals after the voltages that the stage visited slowly before record `r`.
    pub fn before(&self, r: usize) -> Path {
        let mut path =
            Path { memory: self.signals.rest(), signals: vec![0.0; self.signals.count()] };
        let begin = self.begins[r];
        for volts in voltages_before(&self.common.records[r].drive, begin.history, begin.from) {
            self.push(&mut path, volts, f64::INFINITY);
        }
        path
    }

    /// Takes the drive to `volts` within `dt` seconds.
    #[inline(always)]
    pub fn push(&self, path: &mut Path, volts: f64, dt: f64) {
        self.signals.follow(&mut path.memory, volts, dt, &mut path.signals);
    }

    /// Where the creep stands before record `r` behind each of so many inputs.
    pub fn creep_before(&self, r: usize, width: usize) -> Vec<Vec<f64>> {
        let drive = self.common.records[r].drive;
        let mut walk = self.walk(r);
        let mut inputs = vec![0.0; width];
        let mut take = |inputs: &mut Vec<f64>, k| {
            if width == 1 {
                inputs[0] = self.bent(self.sum(walk.at(k)));
            } else {
                self.inputs(walk.at(k), inputs);
            }
        };
        take(&mut inputs, 0);
        let relaxed = |input: &f64| vec![*input; self.times.len()];
        if self.begins[r].history != History::Settled || self.times.is_empty() {
            let mut reached: Vec<Vec<f64>> = inputs.iter().map(relaxed).collect();
            let departures = &self.x[self.own(r).departures];
            if let Some(whole) = reached.last_mut() {
                whole.iter_mut().zip(departures).for_each(|(q, departure)| *q += departure);
            }
            return reached;
        }
        // From 0 through the record; q repeats that begins at its end / (1 - exp(-T / tau)).
        let Ok(creep) = Relaxation::new(&vec![0.0; self.times.len()], &self.times, Dynamics::None)
        else {
            return inputs.iter().map(relaxed).collect();
        };
        let strides = Strides::of(self, r, drive.u.len());
        let creep = Stepped::new(creep, drive.dt, strides.gaps());
        let mut followers: Vec<Follower> =
            inputs.iter().map(|input| Follower::at_rest(&creep.part, *input, &[])).collect();
        let levels = &self.common.levels[r];
        let mut level = 0;
        for (place, &k) in strides.places().iter().enumerate().skip(1) {
            if levels[k] != level {
                take(&mut inputs, k);
                level = levels[k];
            }
            let flow = creep.over(strides.step(place));
            for (follower, input) in followers.iter_mut().zip(&inputs) {
                follower.next(&creep.part, flow, drive.hold.until(k), *input);
            }
        }
        let length = drive.dt * index(drive.u.len() - 1);
        let repeats = |time: &f64| -libm::expm1(-length / time);
        let factors: Vec<f64> = self.times.iter().map(repeats).collect();
        let of = |follower: &Follower| {
            follower.state.creep.iter().zip(&factors).map(|(end, factor)| end / factor).collect()
        };
        followers.iter().map(of).collect()
    }

    /// Displacement of record `r` up to the end of its window as it is read, m: without what the
    /// sensor adds.
    pub fn motion(&self, r: usize) -> Result<Vec<f64>> {
        let x = self.undelayed(r)?;
        let late = Late::new(self.delay(r), self.common.records[r].drive.dt);
        if late.is_none() {
            return Ok(x);
        }
        Ok((0..x.len()).map(|k| late.of(k, |k| x[k])).collect())
    }

    /// The same before it is read; of a held drive, what is not judged is that before.
    pub fn undelayed(&self, r: usize) -> Result<Vec<f64>> {
        let drive = self.common.records[r].drive;
        if self.exact {
            let (values, start) = (self.values(false)?, self.start(r, false)?);
            let experiment =
                Experiment { initial: Some(&start), ..Experiment::of(&drive, self.common.stop) };
            let stage = self.common.model.build(&values)?;
            return Ok(stage.simulate(&experiment)?.ok_or_else(Self::stopped)?.x);
        }
        dispatch_fused(Between { fit: self, r })
    }

    /// Displacement of record `r`, m, between whose samples the signals go in straight lines.
    #[inline(always)]
    fn between(&self, r: usize) -> Result<Vec<f64>> {
        let drive = self.common.records[r].drive;
        let end = self.windows[r].end;
        let strides = Strides::of(self, r, end);
        let whole = Stepped::new(self.relaxation()?, drive.dt, strides.gaps());
        let mut walk = self.walk(r);
        let creep = self.creep_before(r, 1);
        let mut follower: Option<Follower> = None;
        let mut motion = Vec::with_capacity(end);
        let (mut level, mut output) = (usize::MAX, 0.0);
        for (place, &k) in strides.places().iter().enumerate() {
            if walk.level(k) != level {
                (level, output) = (walk.level(k), self.bent(self.sum(walk.at(k))));
            }
            let x = match &mut follower {
                Some(follower) => {
                    let flow = whole.over(strides.step(place));
                    follower.next(&whole.part, flow, drive.hold.until(k), output)
                }
                none => none.insert(Follower::at_rest(&whole.part, output, &creep[0])).state.x,
            };
            motion.resize(k, motion.last().copied().unwrap_or(x));
            motion.push(x);
        }
        motion.resize(end, motion.last().copied().unwrap_or_default());
        Ok(motion)
    }

    /// State of the stage before the first sample of record `r`; that of its mirror image where it
    /// is to fall.
    pub fn start(&self, r: usize, falls: bool) -> Result<Values> {
        let sign = if falls { -1.0 } else { 1.0 };
        // Either the drive was turned or the displacement.
        let turned = self.common.of.has_dead_zones();
        let (of_drive, of_motion) = if turned { (sign, 1.0) } else { (1.0, sign) };
        let relaxation = self.relaxation()?;
        let first = self.common.records[r].drive.u[0];
        let mut path = self.before(r);
        self.push(&mut path, first, f64::INFINITY);
        let creep = &self.creep_before(r, 1)[0];
        let output = self.bent(self.sum(&path.signals));
        let at_rest = Follower::at_rest(&relaxation, output, creep).state.x;
        let modes = self.dynamics().further().len();
        let memory: Vec<f64> = path.memory.iter().map(|one| of_drive * one).collect();
        let creep: Vec<f64> = creep.iter().map(|q| of_motion * q).collect();
        let (x, volts) = (of_motion * at_rest, of_drive * first);
        let sum = of_motion * self.sum(&path.signals);
        let rest = Rest { x, volts, sum, memory: &memory, creep: &creep, modes };
        Ok(self.common.of.state_at_rest(&rest))
    }
}

/// Displacement of a record, where the processor has fused multiply-add.
struct Between<'f, 'a> {
    fit: &'f Fit<'a>,
    r: usize,
}

impl WithSimd for Between<'_, '_> {
    type Output = Result<Vec<f64>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        self.fit.between(self.r)
    }
}
