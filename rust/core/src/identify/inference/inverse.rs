//! Inverse of normal equations of which a part may have no effect.

use nalgebra::DMatrix;

use super::linearised::ROUNDING;

/// Share of a value's direction without effect from which on it is not determined.
const WITHOUT: f64 = 1e-6;

/// Inverse of normal equations, in the directions that have an effect.
pub(super) struct Inverse {
    pub matrix: DMatrix<f64>,
    pub determined: Vec<bool>,
    pub hidden: Vec<Vec<f64>>,
}

impl Inverse {
    pub fn of(square: &DMatrix<f64>) -> Self {
        let count = square.nrows();
        if count == 0 {
            return Self { matrix: square.clone(), determined: vec![], hidden: vec![] };
        }
        let sizes: Vec<f64> = (0..count).map(|i| square[(i, i)].max(0.0).sqrt()).collect();
        let over = |i: usize, j: usize| {
            let size = sizes[i] * sizes[j];
            if size > 0.0 { square[(i, j)] / size } else { 0.0 }
        };
        let decomposed = DMatrix::from_fn(count, count, over).symmetric_eigen();
        let (values, axes) = (&decomposed.eigenvalues, &decomposed.eigenvectors);
        let seen: Vec<usize> = (0..count).filter(|&k| values[k] > ROUNDING).collect();
        let part = |i: usize, j: usize| {
            seen.iter().map(|&k| axes[(i, k)] * axes[(j, k)] / values[k]).sum::<f64>()
        };
        let matrix = DMatrix::from_fn(count, count, |i, j| {
            let size = sizes[i] * sizes[j];
            if size > 0.0 { part(i, j) / size } else { 0.0 }
        });
        let hidden = |i: usize| {
            let length: f64 = seen.iter().map(|&k| axes[(i, k)] * axes[(i, k)]).sum();
            1.0 - length > WITHOUT
        };
        let determined = (0..count).map(|i| sizes[i] > 0.0 && !hidden(i)).collect();
        let direction = |k: usize| {
            let change = |i: usize| axes[(i, k)] / if sizes[i] > 0.0 { sizes[i] } else { 1.0 };
            let largest = (0..count).map(|i| change(i).abs()).fold(f64::MIN_POSITIVE, f64::max);
            (0..count).map(|i| change(i) / largest).collect()
        };
        let unseen = (0..count).filter(|k| !seen.contains(k));
        Self { matrix, determined, hidden: unseen.map(direction).collect() }
    }
}
