//! Terms of priors, ties and inequalities in the normal equations of a candidate.

use nalgebra::{DMatrix, DVector};

use crate::identify::cost::several_records::Records;

/// Change of a coordinate of the unit box, for the differences.
const CHANGE: f64 = 1e-4;

/// Share of a direction below which it is rounding.
const ROUNDING: f64 = 1e-9;

/// Change of a parameter with each coordinate of the unit box, at a place.
fn gradient(records: &Records<'_>, place: &[f64], parameter: usize) -> DVector<f64> {
    DVector::from_fn(place.len(), |d, _| {
        let (low, high) = ((place[d] - CHANGE).max(0.0), (place[d] + CHANGE).min(1.0));
        let at = |z: f64| {
            let mut moved = place.to_vec();
            moved[d] = z;
            records.theta(&moved).0[parameter]
        };
        (at(high) - at(low)) / (high - low)
    })
}

/// Adds the priors to normal equations, each like one more deviation: `variance` is that of a
/// deviation.
pub(in crate::identify) fn add_priors(
    records: &Records<'_>,
    place: &[f64],
    variance: f64,
    square: &mut DMatrix<f64>,
    slope: &mut DVector<f64>,
) {
    for prior in &records.problem().relations.priors {
        let value = records.theta(place).0[prior.parameter];
        let gradient = gradient(records, place, prior.parameter);
        let weight = variance / (prior.width * prior.width);
        let whole = gradient.iter().all(|change| change.is_finite());
        if whole && weight.is_finite() {
            *slope += &gradient * (weight * (prior.mean - value));
            *square += &gradient * gradient.transpose() * weight;
        }
    }
}

/// Normal equations, scaled to a diagonal of ones and decomposed.
pub(in crate::identify) struct Spread<'a> {
    /// Roots of the diagonal.
    pub sizes: &'a [f64],
    pub eigenvalues: &'a DVector<f64>,
    pub eigenvectors: &'a DMatrix<f64>,
    /// Standard deviation of a deviation, m.
    pub noise: f64,
}

impl Spread<'_> {
    /// Standard deviation of a parameter that depends on several coordinates, by propagation of
    /// their covariance; infinite where it depends on one that has no effect.
    pub fn of(&self, records: &Records<'_>, place: &[f64], parameter: usize) -> f64 {
        let gradient = gradient(records, place, parameter);
        let scaled = DVector::from_fn(gradient.len(), |d, _| {
            if gradient[d] == 0.0 { 0.0 } else { gradient[d] / self.sizes[d] }
        });
        let length = scaled.norm();
        let parts = self.eigenvectors.tr_mul(&scaled);
        let part = |(part, value): (&f64, &f64)| {
            if part.abs() <= ROUNDING * length { 0.0 } else { part * part / value.max(0.0) }
        };
        let variance: f64 = parts.iter().zip(self.eigenvalues.iter()).map(part).sum();
        let spread = self.noise * variance.sqrt();
        if spread.is_nan() { f64::INFINITY } else { spread }
    }
}
