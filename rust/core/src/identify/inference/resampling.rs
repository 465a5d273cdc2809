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
        scale: f64,
    ) -> Self {
        let mut bins = Self { records, corrections: vec![1.0; matrix.nrows()] };
        let noises: Vec<&Autoregression> = projected.iter().map(|one| &one.sieve.noise).collect();
        let rough = bins.variances(&noises, projected, scale);
        let over =
            |(i, rough): (usize, f64)| if rough > 0.0 { matrix[(i, i)] / rough } else { 1.0 };
        bins.corrections = rough.into_iter().enumerate().map(over).collect();
        bins
    }

    /// Variance of each value under noises.
    fn variances(&self, noises: &[&Autoregression], records: &[Projected], scale: f64) -> Vec<f64> {
        let mut variances = vec![0.0; self.corrections.len()];
        for ((bins, noise), record) in self.records.iter().zip(noises).zip(records) {
            let weight = scale * record.weight * record.weight;
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

/// Sizes of the deviations of each value over their own standard deviations, a row for each draw.
pub(super) fn studentised(
    records: &[Projected],
    bins: &Bins,
    b: &DMatrix<f64>,
    scale: f64,
    (draws, seed): (u32, u64),
) -> Vec<Vec<f64>> {
    let draws: Vec<u32> = (0..draws).collect();
    on_all_threads(&draws, &|&draw| {
        let mut stream = Draws::at(seed, u64::from(draw), 0, 0, 1);
        let noises: Vec<DVector<f64>> =
            records.iter().map(|one| resampled(one, scale, &mut stream)).collect();
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
                Autoregression::of(left.as_slice())
            })
            .collect();
        let refitted: Vec<&Autoregression> = refitted.iter().collect();
        let variances = bins.variances(&refitted, records, scale);
        let over = |(moved, variance): (&f64, f64)| {
            if variance > 0.0 { moved.abs() / variance.sqrt() } else { 0.0 }
        };
        moved.iter().zip(variances).map(over).collect()
    })
}

/// A noise from innovations drawn with replacement.
fn resampled(record: &Projected, scale: f64, stream: &mut Draws) -> DVector<f64> {
    DVector::from_vec(record.sieve.drawn(record.columns.nrows(), scale, stream))
}
