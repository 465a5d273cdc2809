//! Responses that modal terms are fitted to, and what terms leave of them.

use pulp::{Simd, WithSimd};

use super::terms::{ModalTerms, inverse};
use crate::error::{Error, Result};
use crate::math::{dispatch_fused, room};
use crate::signal::index;

/// Lines whose functions are held at once.
pub(super) const CHUNK: usize = 128;

/// Least decay of a pole per sample, in distances of the lines: narrower modes are not seen.
/// Outside the band it is the distance from the band too.
const NARROWEST: f64 = 0.2;

/// Frequency responses of several drives and sensors with a weight of each line, in a unit in which
/// they are about 1, to which [`ModalTerms`] are fitted.
///
/// ```
/// use piezotrack_core::identify::{ModalFit, ModalTerms};
///
/// let terms = ModalTerms::new([1, 1], &[[0.6, 0.7]], &[[1.0, 0.0]], &[[0.1, 0.2]], &[0.5])?;
/// let angles: Vec<f64> = (1..40).map(|k| 0.05 * f64::from(k)).collect();
/// let zero = vec![[0.0, 0.0]; angles.len()];
/// let weights = vec![1.0; angles.len()];
/// let fit = ModalFit::new([1, 1], &angles, &zero, &weights)?;
/// assert!(fit.misfit(&terms)? > 10.0);
/// # Ok::<(), piezotrack_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ModalFit {
    pub(super) drives: usize,
    pub(super) sensors: usize,
    /// Angles of the lines per sample, rising.
    pub(super) angles: Vec<f64>,
    /// Real and imaginary parts of the points of the unit circle.
    pub(super) z: [Vec<f64>; 2],
    /// Responses: entry by entry the real parts of all lines, then the imaginary ones.
    pub(super) value: Vec<f64>,
    pub(super) weights: Vec<f64>,
    /// Square roots of the weights.
    pub(super) roots: Vec<f64>,
    /// Median distance of the lines.
    pub(super) distance: f64,
}

impl ModalFit {
    /// Responses of `[drives, sensors]` at angles of the unit circle, line by line and sensor by
    /// sensor as real and imaginary part, with a weight of each line.
    ///
    /// # Errors
    /// [`Error::Shape`] where the lists do not fit each other; [`Error::Parameter`] where angles do
    /// not rise from 0 to pi, or a weight is negative; [`Error::Memory`].
    pub fn new(
        [drives, sensors]: [usize; 2],
        angles: &[f64],
        value: &[[f64; 2]],
        weights: &[f64],
    ) -> Result<Self> {
        let (lines, entries) = (angles.len(), drives.saturating_mul(sensors));
        if entries == 0 || lines < 2 {
            return Err(Error::Shape {
                name: "angles".into(),
                found: format!("{lines} lines of {drives} drives and {sensors} sensors"),
                expected: "two lines or more, of a drive and a sensor or more".into(),
            });
        }
        let expected = [("value", value.len(), lines.saturating_mul(entries))];
        for (name, found, expected) in
            expected.into_iter().chain([("weights", weights.len(), lines)])
        {
            if found != expected {
                return Err(Error::Shape {
                    name: name.into(),
                    found: format!("{found} entries"),
                    expected: format!("{expected}"),
                });
            }
        }
        let inside = |angle: &f64| (0.0..=core::f64::consts::PI).contains(angle);
        if !angles.iter().all(inside) || angles.windows(2).any(|two| two[1] <= two[0]) {
            let ends = format!("{} to {}", angles[0], angles[lines - 1]);
            return Err(Error::parameter("angles", ends, "rising numbers from 0 to pi"));
        }
        let fine = |weight: &&f64| weight.is_finite() && **weight >= 0.0;
        if let Some(wrong) = weights.iter().find(|weight| !fine(weight)) {
            return Err(Error::parameter("weights", wrong, "finite numbers, 0 or more"));
        }
        if let Some(wrong) = value.iter().flatten().find(|value| !value.is_finite()) {
            return Err(Error::parameter("value", wrong, "finite numbers"));
        }
        let mut turned = room("the responses", 2 * value.len())?;
        for entry in 0..entries {
            for part in 0..2 {
                turned.extend(value.iter().skip(entry).step_by(entries).map(|one| one[part]));
            }
        }
        let (sines, cosines) = angles.iter().map(|angle| libm::sincos(*angle)).unzip();
        Ok(Self {
            drives,
            sensors,
            angles: angles.to_vec(),
            z: [cosines, sines],
            value: turned,
            weights: weights.to_vec(),
            roots: weights.iter().map(|weight| libm::sqrt(*weight)).collect(),
            distance: median_distance(angles),
        })
    }

    /// Number of lines.
    pub(super) fn lines(&self) -> usize {
        self.angles.len()
    }

    /// Refuses terms of other numbers of drives or sensors.
    pub(super) fn check(&self, terms: &ModalTerms) -> Result<()> {
        if (terms.drives, terms.sensors) == (self.drives, self.sensors) {
            return Ok(());
        }
        Err(Error::Shape {
            name: "terms".into(),
            found: format!("{} drives and {} sensors", terms.drives, terms.sensors),
            expected: format!("{} and {}", self.drives, self.sensors),
        })
    }

    /// The least decay per sample of a pole at an angle.
    pub(super) fn narrowest(&self, angle: f64) -> f64 {
        let (sine, cosine) = libm::sincos(angle);
        let angle = libm::atan2(sine, cosine).abs();
        let (first, last) = (self.angles[0], self.angles[self.lines() - 1]);
        (NARROWEST * self.distance).max(first - angle).max(angle - last)
    }

    /// The weighted sum of squared errors that terms leave.
    ///
    /// # Errors
    /// [`Error::Shape`] where the terms have other numbers of drives or sensors; [`Error::Memory`].
    pub fn misfit(&self, terms: &ModalTerms) -> Result<f64> {
        self.check(terms)?;
        Ok(self.rest(terms)?.0)
    }

    /// The misfit, and the errors in the order of the responses.
    pub(super) fn rest(&self, terms: &ModalTerms) -> Result<(f64, Vec<f64>)> {
        let mut error = room("the errors", self.value.len())?;
        error.extend_from_slice(&self.value);
        dispatch_fused(Rest { fit: self, terms, error: &mut error });
        let mut cost = 0.0;
        for part in error.chunks_exact(self.lines()) {
            for (weight, value) in self.weights.iter().zip(part) {
                cost += weight * (value * value);
            }
        }
        Ok((cost, error))
    }
}

/// The median of the distances of neighbours.
fn median_distance(angles: &[f64]) -> f64 {
    let mut distances: Vec<f64> = angles.windows(2).map(|two| two[1] - two[0]).collect();
    distances.sort_by(f64::total_cmp);
    let count = distances.len();
    let (low, high) = (distances[(count - 1) / 2], distances[count / 2]);
    low / index(2) + high / index(2)
}

/// Takes the response of terms from responses.
struct Rest<'a> {
    fit: &'a ModalFit,
    terms: &'a ModalTerms,
    error: &'a mut [f64],
}

impl WithSimd for Rest<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { fit, terms, error } = self;
        let lines = fit.lines();
        for (parts, direct) in error.chunks_exact_mut(2 * lines).zip(&terms.direct) {
            for value in &mut parts[..lines] {
                *value -= direct;
            }
        }
        let mut first = 0;
        while first < lines {
            let count = CHUNK.min(lines - first);
            let z = fit.z.each_ref().map(|part| &part[first..][..count]);
            for (mode, pole) in terms.poles.iter().enumerate() {
                // Real and imaginary parts of f + g, real and imaginary parts of i (f - g).
                let mut values = [[0.0; CHUNK]; 4];
                let [sum, sum_i, turn, turn_i] = &mut values;
                for k in 0..count {
                    let point = [z[0][k], z[1][k]];
                    let (f, g) = (inverse(point, *pole), inverse(point, pole.conj()));
                    sum[k] = f[0] + g[0];
                    sum_i[k] = f[1] + g[1];
                    turn[k] = g[1] - f[1];
                    turn_i[k] = f[0] - g[0];
                }
                let residue = terms.residue(mode);
                for (parts, entry) in error.chunks_exact_mut(2 * lines).zip(residue) {
                    let (real, imaginary) = parts.split_at_mut(lines);
                    for k in 0..count {
                        let value = &mut real[first + k];
                        *value = (-entry.re).mul_add(sum[k], (-entry.im).mul_add(turn[k], *value));
                    }
                    for k in 0..count {
                        let value = &mut imaginary[first + k];
                        *value =
                            (-entry.re).mul_add(sum_i[k], (-entry.im).mul_add(turn_i[k], *value));
                    }
                }
            }
            first += count;
        }
    }
}
