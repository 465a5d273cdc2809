//! Noises resampled from an autoregression, and how far they move the values of a linearised fit.
//!
//! Innovations are drawn with replacement, the noise that they make is propagated through B J', and
//! the autoregression is fitted anew to what is left: Buehlmann 1997, doi 10.2307/3318584; each
//! deviation over its own standard deviation, Hall 1992, The Bootstrap and Edgeworth Expansion.

use nalgebra::{DMatrix, DVector};

use super::autoregression::Autoregression;
use super::linearised::Projected;
use crate::math::{Draws, on_all_threads};

/// Power of what each value takes of the noise of each record, in bands of frequency.
pub(super) struct Bins {
    records: Vec<Vec<(f64, Vec<f64>)>>,
    /// Variance of each value in full over that from the bands.
    corrections: Vec<f64>,
}

impl Bins {
    /// `matrix` is the covariance with all frequencies.
    pub fn of(
        records: Vec<Vec<(f64, Vec<f64>)>>,
        projected: &[Projected],
        matrix: &DMatrix<f64>,
    ) -> Self {
        let mut bins = Self { records, corrections: vec![1.0; matrix.nrows()] };
        let noises: Vec<&Autoregression> = projected.iter().map(|one| &one.sieve.noise).collect();
        let rough = bins.variances(&noises, projected);
        let over =
            |(i, rough): (usize, f64)| if rough > 0.0 { matrix[(i, i)] / rough } else { 1.0 };
        bins.corrections = rough.into_iter().enumerate().map(over).collect();
        bins
    }

    /// Variance of each value under noises.
    fn variances(&self, noises: &[&Autoregression], records: &[Projected]) -> Vec<f64> {
        let mut variances = vec![0.0; self.corrections.len()];
        for ((bins, noise), record) in self.records.iter().zip(noises).zip(records) {
            let weight = record.weight * record.weight;
            for (frequency, powers) in bins {
                let density = weight * noise.density(*frequency);
                for (variance, power) in variances.iter_mut().zip(powers) {
                    *variance += density * power;
                }
            }
        }
        variances.iter().zip(&self.corrections).map(|(v, c)| v * c).collect()
    }
}

/// Sizes of the deviations of each value over its standard deviation, a row for each draw.
///
/// The deviation of a draw is that of an autoregression of what its fit leaves, its variance times
/// `scale`; `left` are those of the records.
pub(super) fn studentised(
    records: &[Projected],
    bins: &Bins,
    b: &DMatrix<f64>,
    (left, scale): (&[Autoregression], f64),
    (draws, seed): (u32, u64),
) -> Vec<Vec<f64>> {
    let known: Vec<&Autoregression> = records.iter().map(|one| &one.sieve.noise).collect();
    let left: Vec<&Autoregression> = left.iter().collect();
    let (known, left) = (bins.variances(&known, records), bins.variances(&left, records));
    let draws: Vec<u32> = (0..draws).collect();
    on_all_threads(&draws, &|&draw| {
        let mut stream = Draws::at(seed, u64::from(draw), 0, 0, 1);
        let noises: Vec<DVector<f64>> = records
            .iter()
            .map(|one| DVector::from_vec(one.sieve.drawn(one.columns.nrows(), 1.0, &mut stream)))
            .collect();
        let mut slope = DVector::zeros(b.nrows());
        for (one, noise) in records.iter().zip(&noises) {
            slope += one.columns.tr_mul(noise) * one.weight;
        }
        let moved = b * slope;
        let refitted: Vec<Autoregression> = records
            .iter()
            .zip(noises)
            .map(|(one, noise)| {
                let mut left = noise - &one.columns * &moved;
                if one.nuisance.ncols() > 0 {
                    let parts = one.nuisance.tr_mul(&left);
                    left -= &one.nuisance * parts;
                }
                Autoregression::of(left.as_slice()).scaled(scale)
            })
            .collect();
        let refitted: Vec<&Autoregression> = refitted.iter().collect();
        let variances = bins.variances(&refitted, records);
        let over = |i: usize| {
            let variance = variances[i] * known[i] / left[i];
            if variance > 0.0 { moved[i].abs() / variance.sqrt() } else { 0.0 }
        };
        (0..moved.len()).map(over).collect()
    })
}
