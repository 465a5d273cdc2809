//! Covariance of the values of a fit by least squares whose residual is correlated.
//!
//! With the change J of the displacement with each value, the residual e and B = (J'J)^-1, the
//! covariance is B M B, M = J' G J, in which G is the covariance of an autoregression of the noise by
//! restricted likelihood: Domowitz and White 1982, doi 10.1016/0304-4076(82)90012-3; Ljung 1999,
//! System Identification, section 9.4.

use nalgebra::{DMatrix, DVector};

use super::autoregression::Autoregression;
use super::fourier::transform;
use super::inverse::Inverse;
use super::linearised::{Linearised, Projected, orthonormal, project, without};
use super::resampling::{Bins, studentised};
use super::restricted::restricted;
use crate::error::{Error, Result};
use crate::math::on_all_threads;
use crate::signal::index;

/// Parts of the frequencies that are summed side by side.
const PARTS: usize = 16;

/// Least share of the variance that the difference of two estimates has, for rounding.
const LEAST: f64 = 1e-4;

/// How sure the values of a fit are.
#[derive(Clone, Debug)]
pub struct Covariance {
    /// Covariance of the values, in their units, without the directions that have no effect.
    pub matrix: Vec<Vec<f64>>,
    /// Whether the records determine each value.
    pub determined: Vec<bool>,
    /// Changes of the values without effect on the records, the largest of each 1.
    pub hidden: Vec<Vec<f64>>,
    /// Variance of each for independent noise.
    pub independent: Vec<f64>,
    /// Change of each value by generalised least squares, and the standard deviation of that.
    pub shifts: Vec<(f64, f64)>,
    /// Change of each value to where the squares are least, to first order.
    pub steps: Vec<f64>,
    /// Deviations of each value over their own standard deviation, sizes only, of resampled noises.
    pub resampled: Vec<Vec<f64>>,
    /// Order of the autoregression of each record.
    pub orders: Vec<usize>,
}

/// Returns how sure the values of a fit are.
///
/// `precision` is the inverse of the covariance of the values that was known besides the records, of
/// none 0; `draws` noises are resampled.
///
/// # Errors
/// [`Error::Data`] where the samples are fewer than twice the values, or the lengths differ.
pub fn covariance(
    records: &[Linearised],
    precision: &[Vec<f64>],
    draws: u32,
    seed: u64,
) -> Result<Covariance> {
    let count = precision.len();
    if precision.iter().any(|row| row.len() != count) {
        return Err(Error::Data(
            "precision has rows of several lengths: expected a square matrix".into(),
        ));
    }
    check(records, count)?;
    let precision = &DMatrix::from_fn(count, count, |i, j| precision[i][j]);
    let samples: usize = records.iter().map(|one| one.residual.len()).sum();
    let fitted = count + records.iter().map(|one| one.nuisance.len()).sum::<usize>();
    let freedom = index(samples - fitted);
    let scale = index(samples) / freedom;
    let pair = |one: &Linearised| {
        let [left, longer] = Autoregression::pair_of(&one.noise);
        (left.scaled(scale), longer.scaled(scale))
    };
    let (left, longer): (Vec<_>, Vec<_>) = records.iter().map(pair).unzip();
    let noises = restricted(records, precision, longer);
    let projected: Vec<Projected> =
        records.iter().zip(noises).map(|(one, noise)| project(one, noise)).collect();
    let variance =
        records.iter().map(|one| one.weight * squares(&one.residual)).sum::<f64>() / freedom;
    let noise = records.iter().map(|one| one.weight * squares(&one.noise)).sum::<f64>() / freedom;
    let mut square = precision * variance;
    let mut slope = DVector::zeros(count);
    for (record, one) in records.iter().zip(&projected) {
        square += one.columns.tr_mul(&one.columns) * one.weight;
        let residual = DVector::from_column_slice(&record.residual);
        slope += one.columns.tr_mul(&residual) * one.weight;
    }
    let inverse = Inverse::of(&square);
    let b = &inverse.matrix;
    // A prior counts like deviations of its own.
    let mut matrix = b * (precision * (variance * variance)) * b;
    let mut bins = Vec::with_capacity(records.len());
    for one in &projected {
        let spectra = Spectra::of(&(&one.columns * b));
        matrix += spectra.covariance(&one.sieve.noise) * (one.weight * one.weight);
        bins.push(spectra.bins());
    }
    let bins = Bins::of(bins, &projected, &matrix);
    let resampled = studentised(&projected, &bins, b, (&left, scale), (draws, seed));
    let steps = b * slope;
    let shifts = shifts(records, &projected, precision, variance, (b, &steps, &matrix));
    Ok(Covariance {
        independent: (0..count).map(|i| noise * b[(i, i)]).collect(),
        matrix: matrix.row_iter().map(|row| row.iter().copied().collect()).collect(),
        determined: inverse.determined,
        hidden: inverse.hidden,
        shifts,
        steps: steps.iter().copied().collect(),
        resampled,
        orders: projected.iter().map(|one| one.sieve.noise.coefficients.len()).collect(),
    })
}

/// Refuses records from which nothing follows.
fn check(records: &[Linearised], count: usize) -> Result<()> {
    for one in records {
        let n = one.residual.len();
        let columns = one.columns.iter().chain(&one.nuisance);
        if one.noise.len() != n
            || one.columns.len() != count
            || columns.into_iter().any(|c| c.len() != n)
        {
            return Err(Error::Data("a column has another length than the residual".into()));
        }
    }
    let samples: usize = records.iter().map(|one| one.residual.len()).sum();
    let fitted = count + records.iter().map(|one| one.nuisance.len()).sum::<usize>();
    if samples < 2 * fitted.max(8) {
        return Err(Error::Data(format!(
            "{samples} samples for {fitted} values: expected {} or more",
            2 * fitted.max(8)
        )));
    }
    Ok(())
}

fn squares(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum()
}

/// Spectra of what each value takes of a noise, in columns.
struct Spectra {
    /// Of each value, from frequency 0 to half of the sampling rate.
    values: Vec<Vec<(f64, f64)>>,
    size: usize,
}

impl Spectra {
    fn of(columns: &DMatrix<f64>) -> Self {
        let size = (2 * columns.nrows()).next_power_of_two();
        let pairs: Vec<usize> = (0..columns.ncols()).step_by(2).collect();
        let column = |i: usize| columns.as_slice().chunks_exact(columns.nrows()).nth(i);
        let transformed = on_all_threads(&pairs, &|&i| {
            transform(column(i).unwrap_or(&[]), column(i + 1).unwrap_or(&[]), size)
        });
        let mut values: Vec<Vec<(f64, f64)>> = transformed.into_iter().flatten().collect();
        values.truncate(columns.ncols());
        Self { values, size }
    }

    /// Share of a line of the spectrum in the sum over all frequencies.
    fn share(&self, k: usize) -> f64 {
        let both = if k == 0 || 2 * k == self.size { 1.0 } else { 2.0 };
        both / index(self.size)
    }

    /// Variance of each value under a noise.
    fn variances(&self, noise: &Autoregression) -> Vec<f64> {
        let density = |k: usize| self.share(k) * noise.density(index(k) / index(self.size));
        let weights: Vec<f64> = (0..=self.size / 2).map(density).collect();
        let of = |spectrum: &Vec<(f64, f64)>| {
            let powers = spectrum.iter().map(|(re, im)| re * re + im * im);
            powers.zip(&weights).map(|(power, weight)| power * weight).sum()
        };
        self.values.iter().map(of).collect()
    }

    /// Covariance of the values under a noise.
    fn covariance(&self, noise: &Autoregression) -> DMatrix<f64> {
        let (count, lines) = (self.values.len(), self.size / 2 + 1);
        let parts: Vec<usize> = (0..PARTS).collect();
        let sums = on_all_threads(&parts, &|&part| {
            let range = lines * part / PARTS..lines * (part + 1) / PARTS;
            let weights: Vec<f64> = range
                .clone()
                .map(|k| self.share(k) * noise.density(index(k) / index(self.size)))
                .collect();
            let mut sum = DMatrix::zeros(count, count);
            for i in 0..count {
                for j in 0..=i {
                    let both =
                        self.values[i][range.clone()].iter().zip(&self.values[j][range.clone()]);
                    let products = both.map(|(a, b)| a.0 * b.0 + a.1 * b.1);
                    sum[(i, j)] = products.zip(&weights).map(|(p, w)| p * w).sum::<f64>();
                    sum[(j, i)] = sum[(i, j)];
                }
            }
            sum
        });
        sums.into_iter().fold(DMatrix::zeros(count, count), |sum, part| sum + part)
    }

    /// Power of each value in bands of frequency: the middle of a band, and the power of each in it.
    fn bins(&self) -> Vec<(f64, Vec<f64>)> {
        let lines = self.size / 2 + 1;
        let mut bins = Vec::new();
        let mut begin = 0;
        while begin < lines {
            let end = (begin + 1 + begin / 64).min(lines);
            let middle = 0.5 * (index(begin) + index(end - 1)) / index(self.size);
            let power = |spectrum: &Vec<(f64, f64)>| {
                (begin..end)
                    .map(|k| {
                        let (re, im) = spectrum[k];
                        self.share(k) * (re * re + im * im)
                    })
                    .sum::<f64>()
            };
            bins.push((middle, self.values.iter().map(power).collect()));
            begin = end;
        }
        bins
    }
}

/// Change of each value from least squares to generalised ones, with the standard deviation that the
/// noise alone gives it (Hausman 1978, doi 10.2307/1913827).
///
/// Both estimates are linear in the noise. The variance of their difference is that of D'n, with
/// D = W J (J' W J)^-1 - J B: the difference of their variances is no use where both are nearly the same.
fn shifts(
    records: &[Linearised],
    projected: &[Projected],
    precision: &DMatrix<f64>,
    variance: f64,
    (b, steps, matrix): (&DMatrix<f64>, &DVector<f64>, &DMatrix<f64>),
) -> Vec<(f64, f64)> {
    let count = precision.nrows();
    let mut square = precision * 1.0;
    let mut slope = DVector::zeros(count);
    let mut weighted = Vec::with_capacity(records.len());
    for (record, one) in records.iter().zip(projected) {
        let noise =
            if one.sieve.noise.variance > 0.0 { one.sieve.noise.variance } else { variance };
        let white = |columns: &[Vec<f64>]| {
            let columns: Vec<Vec<f64>> =
                columns.iter().map(|c| one.sieve.noise.innovations(c)).collect();
            let rows = columns.first().map_or(0, Vec::len);
            DMatrix::from_fn(rows, columns.len(), |t, i| columns[i][t])
        };
        let basis = orthonormal(white(&record.nuisance));
        let columns = without(&basis, white(&record.columns));
        let residual = DVector::from_vec(one.sieve.noise.innovations(&record.residual));
        square += columns.tr_mul(&columns) / noise;
        slope += columns.tr_mul(&residual) / noise;
        weighted.push(columns / noise);
    }
    let inverse = Inverse::of(&square).matrix;
    let moved = &inverse * slope - steps;
    let mut spread: Vec<f64> = (0..count).map(|i| matrix[(i, i)] * LEAST).collect();
    for (columns, one) in weighted.iter().zip(projected) {
        let mut difference = &one.columns * b * -one.weight;
        for (mut of, column) in difference.column_iter_mut().zip((columns * &inverse).column_iter())
        {
            of += DVector::from_vec(one.sieve.noise.reversed_innovations(column.as_slice()));
        }
        let variances = Spectra::of(&difference).variances(&one.sieve.noise);
        for (sum, variance) in spread.iter_mut().zip(variances) {
            *sum += variance;
        }
    }
    (0..count).map(|i| (moved[i], spread[i].max(0.0).sqrt())).collect()
}

#[cfg(test)]
mod tests {
    use super::{Linearised, covariance};
    use crate::math::Draws;
    use crate::signal::index;

    #[test]
    fn white_noise_has_the_errors_of_the_textbook() -> crate::Result<()> {
        let n = 2000;
        let t: Vec<f64> = (0..n).map(|k| index(k) / index(n)).collect();
        let noise: Vec<f64> = (0..n).map(|k| Draws::normal(7, k as u64)).collect();
        let mean = noise.iter().sum::<f64>() / index(n);
        let record = Linearised {
            columns: vec![t.iter().map(|t| t - 0.5).collect()],
            nuisance: vec![vec![1.0; n]],
            residual: noise.iter().map(|x| x - mean).collect(),
            noise: noise.iter().map(|x| x - mean).collect(),
            weight: 1.0,
        };
        let found = covariance(&[record], &[vec![0.0]], 199, 1)?;
        // Variance of a slope: s^2 / sum (t - mean)^2 = 12 s^2 / n.
        assert!((found.matrix[0][0] * index(n) / 12.0 - 1.0).abs() < 0.15);
        let mut sizes: Vec<f64> = found.resampled.iter().map(|row| row[0]).collect();
        sizes.sort_by(f64::total_cmp);
        assert!((1.6..2.4).contains(&sizes[189]));
        Ok(())
    }
}
