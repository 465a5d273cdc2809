//! Noise of a signal from sample to sample.

/// Standard deviation of normal numbers over the median of their sizes.
const OF_MEDIAN: f64 = 1.4826;

/// Fewer samples show no noise.
const LEAST_SAMPLES: usize = 16;

/// Standard deviation of the noise of a signal, in its unit, from its third differences.
///
/// A slow motion hardly shows in them, and the median is blind to steps; 0 for fewer than 16
/// samples.
///
/// ```
/// use piezotrack_core::signal::sample_noise;
///
/// let y: Vec<f64> = (0..400).map(|k| f64::from(k) + f64::from(k % 2)).collect();
/// // Of a signal that goes to and fro, third differences are eight times as large.
/// assert!((sample_noise(&y) - 1.4826 * 4.0 / 20.0_f64.sqrt()).abs() < 1e-9);
/// ```
#[must_use]
pub fn sample_noise(y: &[f64]) -> f64 {
    if y.len() < LEAST_SAMPLES {
        return 0.0;
    }
    let third = |w: &[f64]| (w[3] - 3.0 * (w[2] - w[1]) - w[0]).abs();
    let mut sizes: Vec<f64> = y.windows(4).map(third).collect();
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    // The squares of 1, 3, 3 and 1 add up to 20.
    OF_MEDIAN * *median / libm::sqrt(20.0)
}
