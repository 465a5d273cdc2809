//! Data that all fits of some records share.

use core::sync::atomic::{AtomicUsize, Ordering};

use super::weights_record::WeightsRecord;
use crate::identify::records::thinned::Thinned;
use crate::models::{AnySuperposition, Model};
use crate::signal::{Stop, index, range, sample_noise};

/// Least share of the mean slope that passes without memory: with less the inverse is no use.
const LEAST_LINEAR: f64 = 1e-3;

/// Data that all fits of some records share.
pub(super) struct Common<'a> {
    pub model: Model,
    pub of: &'static dyn AnySuperposition,
    pub records: Vec<WeightsRecord<'a>>,
    /// How much a sample of each record counts.
    pub weights: Vec<f64>,
    /// Whether the records are mirror images of ones that fall.
    pub falls: bool,
    pub stop: Stop<'a>,
    /// Range of the drive in the windows, V.
    pub drive: (f64, f64),
    /// Largest range of the displacement in a window, m.
    pub stroke: f64,
    /// Noise of the readings, of the record that has most, m.
    pub noise: f64,
    /// How many times the drive of each record has changed up to each sample.
    pub levels: Vec<Vec<usize>>,
    /// Simulations so far.
    evaluations: AtomicUsize,
}

impl<'a> Common<'a> {
    pub fn new(
        (model, of): (Model, &'static dyn AnySuperposition),
        records: Vec<WeightsRecord<'a>>,
        falls: bool,
        stop: Stop<'a>,
    ) -> Self {
        let span = |one: &WeightsRecord<'a>| range(&one.y[one.start..]);
        let stroke = records.iter().map(span).map(|(low, high)| high - low).fold(0.0, f64::max);
        let drive = ends(records.iter().map(|one| range(&one.drive.u[one.start..])));
        let noise = records.iter().map(|one| sample_noise(&one.y[one.start..])).fold(0.0, f64::max);
        let weights = records.iter().map(|one| one.weight).collect();
        let levels = records.iter().map(WeightsRecord::levels).collect();
        let evaluations = AtomicUsize::new(0);
        Self { model, of, records, weights, falls, stop, drive, stroke, noise, levels, evaluations }
    }

    /// Counts simulations.
    pub fn count(&self, simulations: usize) {
        self.evaluations.fetch_add(simulations, Ordering::Relaxed);
    }

    /// Simulations that were counted.
    pub fn evaluations(&self) -> usize {
        self.evaluations.load(Ordering::Relaxed)
    }

    /// The same records with every so many of the samples of each.
    pub fn thinned<'b>(&self, kept: &'b [Thinned]) -> Common<'b>
    where
        'a: 'b,
    {
        let thin = |(one, kept): (&WeightsRecord<'a>, &'b Thinned)| {
            let (drive, start) = (kept.drive(&one.drive), kept.place(one.start));
            WeightsRecord { drive, y: &kept.y, start, left_out: &kept.left_out, ..*one }
        };
        let records: Vec<WeightsRecord<'b>> = self.records.iter().zip(kept).map(thin).collect();
        let weights =
            self.weights.iter().zip(kept).map(|(weight, kept)| weight * index(kept.every));
        let few = Common::new((self.model, self.of), records, self.falls, self.stop);
        Common { weights: weights.collect(), ..few }
    }

    /// Least weight of the first signal, m/V.
    pub fn least_linear(&self) -> f64 {
        LEAST_LINEAR * self.stroke / (self.drive.1 - self.drive.0)
    }

    /// Range of all drives, warm-up included, V.
    pub fn reached(&self) -> (f64, f64) {
        ends(self.records.iter().map(|one| range(one.drive.u)))
    }

    /// Samples that count, of all records.
    pub fn samples(&self) -> usize {
        self.records.iter().map(WeightsRecord::samples).sum()
    }

    /// The record that lasts longest.
    pub fn longest(&self) -> &WeightsRecord<'a> {
        let mut longest = &self.records[0];
        for one in &self.records {
            if one.length() > longest.length() {
                longest = one;
            }
        }
        longest
    }

    /// The shortest interval between samples, s.
    pub fn shortest_interval(&self) -> f64 {
        self.records.iter().map(|one| one.drive.dt).fold(f64::INFINITY, f64::min)
    }
}

/// Ends of several ranges together.
fn ends(ranges: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    ranges.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (least, most)| {
        (f64::min(low, least), f64::max(high, most))
    })
}
