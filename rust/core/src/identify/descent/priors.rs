//! Terms of priors in the normal equations of a candidate.

use nalgebra::{DMatrix, DVector};

use crate::identify::cost::several_records::Records;

/// Change of a coordinate of the unit box, for the differences.
const CHANGE: f64 = 1e-4;

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
