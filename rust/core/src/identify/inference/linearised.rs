//! A record about a fit, linearised, and without what belongs to the record alone.

use nalgebra::DMatrix;

use super::autoregression::Autoregression;
use super::sieve::Sieve;

/// Share of an eigenvalue below which its direction does not change the displacement.
pub(super) const ROUNDING: f64 = 1e-10;

/// A record about a fit, linearised.
#[derive(Clone, Debug, Default)]
pub struct Linearised {
    /// Change of the displacement with each value, a column each.
    pub columns: Vec<Vec<f64>>,
    /// The same of what belongs to this record alone, as its offset and drift.
    pub nuisance: Vec<Vec<f64>>,
    /// Measured less simulated displacement, m.
    pub residual: Vec<f64>,
    /// Its part that is noise, m.
    pub noise: Vec<f64>,
    /// Weight of its squares.
    pub weight: f64,
}

/// A record without what belongs to it alone.
pub(super) struct Projected {
    /// Columns, orthogonal to the nuisance.
    pub columns: DMatrix<f64>,
    /// An orthonormal basis of the nuisance.
    pub nuisance: DMatrix<f64>,
    pub sieve: Sieve,
    pub weight: f64,
}

/// Takes the part of what belongs to the record alone off its columns; its noise is known.
pub(super) fn project(record: &Linearised, noise: Autoregression) -> Projected {
    let n = record.residual.len();
    let of = |columns: &[Vec<f64>]| DMatrix::from_fn(n, columns.len(), |t, i| columns[i][t]);
    let nuisance = orthonormal(of(&record.nuisance));
    let columns = without(&nuisance, of(&record.columns));
    Projected { columns, nuisance, sieve: Sieve::with(noise, &record.noise), weight: record.weight }
}

/// An orthonormal basis of columns, of those that are not a part of the others.
pub(super) fn orthonormal(columns: DMatrix<f64>) -> DMatrix<f64> {
    if columns.ncols() == 0 {
        return columns;
    }
    let sizes: Vec<f64> = columns.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    let scaled =
        DMatrix::from_fn(columns.nrows(), columns.ncols(), |t, i| columns[(t, i)] / sizes[i]);
    let decomposed = scaled.tr_mul(&scaled).symmetric_eigen();
    let kept: Vec<usize> =
        (0..sizes.len()).filter(|&k| decomposed.eigenvalues[k] > ROUNDING).collect();
    let axes = DMatrix::from_fn(sizes.len(), kept.len(), |i, k| {
        decomposed.eigenvectors[(i, kept[k])] / decomposed.eigenvalues[kept[k]].sqrt()
    });
    scaled * axes
}

/// Columns less their part in a basis.
pub(super) fn without(basis: &DMatrix<f64>, mut columns: DMatrix<f64>) -> DMatrix<f64> {
    if basis.ncols() > 0 {
        let parts = basis.tr_mul(&columns);
        columns -= basis * parts;
    }
    columns
}
