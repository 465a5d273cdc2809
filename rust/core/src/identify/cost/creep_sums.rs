//! Sums over a record, for the weights of its creep, about the best offset and drift.

use crate::identify::parameters::drift::DriftSums;
use crate::identify::records::creep_weights::{
    CreepWeights, LEAST_PIVOT, MOST_CREEP, MOST_CREEP_WEIGHTS,
};
use crate::signal::index;

/// Sums over samples of the deviation r of the mechanics and the outputs g of the relaxations.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::identify) struct CreepSums {
    /// Of r, and of its square.
    pub deviation: [f64; 2],
    /// Of g.
    pub outputs: CreepWeights,
    /// Of g r.
    pub cross: CreepWeights,
    /// Of products of g, the lower triangle.
    pub products: [CreepWeights; MOST_CREEP_WEIGHTS],
    /// Of a drift of 1 with all of these, where there is a drift.
    pub drift: Option<DriftSums<f64>>,
}

/// Mean square of what is left as a function of the weights c, m^2:
/// `square - 2 slope c + c matrix c`, with the best offset and drift where they are fitted.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::identify) struct CreepCost {
    square: f64,
    slope: CreepWeights,
    matrix: [CreepWeights; MOST_CREEP_WEIGHTS],
}

/// Covariances of a drift of 1.
struct Covariances {
    /// Its mean square.
    whole: f64,
    /// Its variance.
    square: f64,
    /// With the deviation, and with each output.
    deviation: f64,
    outputs: CreepWeights,
}

/// Share of its mean square below which the variance of a drift is rounding.
const FLAT: f64 = 1e-6;

impl CreepSums {
    /// Cost over so many samples as a function of the weights, with a free offset or none, and with
    /// the drift that suits them best.
    pub fn cost(&self, samples: usize, offset: bool) -> CreepCost {
        let n = index(samples);
        let [mean, mut square] = self.deviation.map(|sum| sum / n);
        let means = self.outputs.map(|sum| sum / n);
        let mut slope = self.cross.map(|sum| sum / n);
        let mut matrix = [[0.0; MOST_CREEP_WEIGHTS]; MOST_CREEP_WEIGHTS];
        for j in 0..MOST_CREEP_WEIGHTS {
            for i in 0..=j {
                matrix[j][i] = self.products[j][i] / n;
                if offset {
                    matrix[j][i] -= means[j] * means[i];
                }
                matrix[i][j] = matrix[j][i];
            }
            if offset {
                slope[j] -= means[j] * mean;
            }
        }
        if offset {
            square -= mean * mean;
        }
        if let Some(drift) = self.with_drift(samples) {
            square -= drift.deviation * drift.deviation / drift.square;
            for j in 0..MOST_CREEP_WEIGHTS {
                slope[j] -= drift.outputs[j] * drift.deviation / drift.square;
                for (slot, other) in matrix[j].iter_mut().zip(drift.outputs) {
                    *slot -= drift.outputs[j] * other / drift.square;
                }
            }
        }
        CreepCost { square, slope, matrix }
    }

    /// Offset and drift that suit these weights best, m, of an offset that is fitted.
    pub fn offset_and_drift(&self, samples: usize, creep_weights: &CreepWeights) -> [f64; 2] {
        let n = index(samples);
        let outputs = self.outputs.iter().zip(creep_weights);
        let mean = outputs.fold(self.deviation[0] / n, |mean, (sum, c)| mean - c * (sum / n));
        let (Some(drift), Some(sums)) = (self.with_drift(samples), self.drift) else {
            return [mean, 0.0];
        };
        let along: f64 =
            drift.outputs.iter().zip(creep_weights).map(|(output, c)| output * c).sum();
        let fallen = (drift.deviation - along) / drift.square;
        [mean - fallen * (sums.shape[0] / n), fallen]
    }

    /// Whether they tell a drift from an offset: over a short part of its window they do not.
    pub fn tell_drift(&self, samples: usize) -> bool {
        self.with_drift(samples).is_none_or(|drift| drift.square > FLAT * drift.whole)
    }

    /// Covariances of a drift, which always has an offset beside it.
    fn with_drift(&self, samples: usize) -> Option<Covariances> {
        let (n, sums) = (index(samples), self.drift?);
        let mean = sums.shape[0] / n;
        let about = |product: f64, other: f64| product / n - mean * (other / n);
        Some(Covariances {
            whole: sums.shape[1] / n,
            square: about(sums.shape[1], sums.shape[0]),
            deviation: about(sums.deviation, self.deviation[0]),
            outputs: core::array::from_fn(|j| about(sums.outputs[j], self.outputs[j])),
        })
    }
}

impl CreepCost {
    /// Adds that of another record, as much as its share of the samples of all.
    pub fn add(&mut self, other: &Self, part: f64) {
        self.square += part * other.square;
        for j in 0..MOST_CREEP_WEIGHTS {
            self.slope[j] += part * other.slope[j];
            for (sum, one) in self.matrix[j].iter_mut().zip(other.matrix[j]) {
                *sum += part * one;
            }
        }
    }

    /// The best of `count` weights.
    pub fn best(&self, count: usize) -> CreepWeights {
        let mut best = ([0.0; MOST_CREEP_WEIGHTS], self.square);
        // The minimum lies on a face of the simplex, and is the minimum of that face's plane.
        for face in 1..1_usize << count {
            for full in [false, true] {
                let Some(creep_weights) = on_face(&self.matrix, &self.slope, face, full) else {
                    continue;
                };
                let total: f64 = creep_weights.iter().sum();
                let inside =
                    creep_weights.iter().all(|c| *c >= 0.0) && (full || total <= MOST_CREEP);
                let left = self.at(&creep_weights);
                if inside && left < best.1 {
                    best = (creep_weights, left);
                }
            }
        }
        best.0
    }

    /// Mean square that is left with these weights, m^2.
    pub fn at(&self, creep_weights: &CreepWeights) -> f64 {
        let mut left = self.square;
        for j in 0..MOST_CREEP_WEIGHTS {
            let along: f64 =
                (0..MOST_CREEP_WEIGHTS).map(|i| self.matrix[j][i] * creep_weights[i]).sum();
            left += creep_weights[j] * (along - 2.0 * self.slope[j]);
        }
        left
    }

    /// Largest rms of an output, m.
    pub fn size(&self) -> f64 {
        let diagonal = [0, 1, 2].map(|j: usize| self.matrix[j][j]);
        libm::sqrt(diagonal.iter().fold(0.0, |most: f64, d| most.max(*d)))
    }
}

/// The best weights of those in `face` (bit j for weight j), the others 0; where it is `full`, with
/// the largest sum. `None` where the outputs depend on each other.
fn on_face(
    matrix: &[CreepWeights; 3],
    slope: &CreepWeights,
    face: usize,
    full: bool,
) -> Option<CreepWeights> {
    let free = solve(matrix, face, slope)?;
    if !full {
        return Some(free);
    }
    let ones = solve(matrix, face, &[1.0; MOST_CREEP_WEIGHTS])?;
    let part = (free.iter().sum::<f64>() - MOST_CREEP) / ones.iter().sum::<f64>();
    Some(core::array::from_fn(|j| free[j] - part * ones[j]))
}

/// Solves the rows and columns of `face`; 0 in the others.
fn solve(matrix: &[CreepWeights; 3], face: usize, right: &CreepWeights) -> Option<CreepWeights> {
    let (mut a, mut b) = (*matrix, *right);
    let used = |j: &usize| face >> j & 1 == 1;
    for p in (0..MOST_CREEP_WEIGHTS).filter(used) {
        let pivots = a[p];
        if pivots[p].is_nan() || pivots[p] <= LEAST_PIVOT * matrix[p][p] {
            return None;
        }
        for row in (p + 1..MOST_CREEP_WEIGHTS).filter(used) {
            let factor = a[row][p] / pivots[p];
            for (slot, pivot) in a[row].iter_mut().zip(pivots).skip(p) {
                *slot -= factor * pivot;
            }
            b[row] -= factor * b[p];
        }
    }
    let mut found = [0.0; MOST_CREEP_WEIGHTS];
    for p in (0..MOST_CREEP_WEIGHTS).rev().filter(used) {
        let rest: f64 =
            (p + 1..MOST_CREEP_WEIGHTS).map(|column| a[p][column] * found[column]).sum();
        found[p] = (b[p] - rest) / a[p][p];
    }
    Some(found)
}
