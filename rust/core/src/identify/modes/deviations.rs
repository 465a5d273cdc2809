//! Standard deviations of the poles of modal terms.

use super::derivatives::unknowns;
use super::factors::{Factors, scale_matrix};
use super::responses::ModalFit;
use super::terms::ModalTerms;
use crate::error::{Error, Result};
use crate::math::{room, zeros};

/// Pivots of the scaled normal equations that are directions of the gauge: those in which the
/// response does not change.
const GAUGE: f64 = 1e-10;

impl ModalFit {
    /// Standard deviations of the logarithms of decays, and of the angles, of the poles.
    ///
    /// They are those of least squares with these weights where the squared errors of the
    /// responses have the expectations `variance`, line by line and sensor by sensor (Pintelon and
    /// Schoukens 2012, System Identification, 2nd ed., section 9.5), larger by the misfit where
    /// the terms leave more.
    ///
    /// # Errors
    /// [`Error::Shape`] where sizes do not fit; [`Error::Parameter`] where a variance is negative;
    /// [`Error::Memory`].
    pub fn pole_deviations(&self, terms: &ModalTerms, variance: &[f64]) -> Result<[Vec<f64>; 2]> {
        self.check(terms)?;
        if 2 * variance.len() != self.value.len() {
            return Err(Error::Shape {
                name: "variance".into(),
                found: format!("{} entries", variance.len()),
                expected: format!("{}", self.value.len() / 2),
            });
        }
        if let Some(wrong) = variance.iter().find(|one| !(**one >= 0.0 && one.is_finite())) {
            return Err(Error::parameter("variance", wrong, "finite numbers, 0 or more"));
        }
        let (cost, error) = self.rest(terms)?;
        let mut normal = self.normal_equations(terms, &error)?.matrix;
        let entries = self.drives * self.sensors;
        let mut weights = room("the weights", variance.len())?;
        let mut expected = 0.0;
        for (line, weight) in variance.chunks_exact(entries).zip(&self.weights) {
            for value in line {
                expected += weight * value;
                weights.push(weight * weight * (0.5 * value));
            }
        }
        let spread = self.spread(terms, &weights)?;
        let (count, modes) = (unknowns(terms), terms.poles.len());
        let diagonal = (0..count).map(|k| libm::sqrt(normal[k * count + k]));
        let scale: Vec<f64> = diagonal.map(|one| if one > 0.0 { one } else { 1.0 }).collect();
        scale_matrix(&mut normal, &scale);
        let factors = Factors::new(&normal, count, GAUGE)?;
        let more = f64::max(1.0, cost / expected);
        let mut right = zeros("a right side", count)?;
        let mut found = [room("the deviations", modes)?, room("the deviations", modes)?];
        for unknown in 0..2 * modes {
            right.fill(0.0);
            right[unknown] = 1.0;
            let mut x = factors.solve(&right);
            for (value, scale) in x.iter_mut().zip(&scale) {
                *value /= scale;
            }
            let mut sum = 0.0;
            for (k, row) in spread.chunks_exact(count).enumerate() {
                let mut inner = 0.5 * row[k] * x[k];
                for (value, x) in row[k + 1..].iter().zip(&x[k + 1..]) {
                    inner += value * x;
                }
                sum += 2.0 * x[k] * inner;
            }
            let deviation = libm::sqrt((sum * more).max(0.0)) / scale[unknown];
            found[unknown / modes].push(deviation);
        }
        Ok(found)
    }
}
