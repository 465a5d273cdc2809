//! Noise of a sensor at rest: quantisation step, rms and bandwidth.

use crate::error::{Error, Result, positive};
use crate::signal::metrics::Spread;
use crate::signal::{index, without_drift};

/// Fewest samples of a record at rest.
const FEWEST: usize = 100;

/// Noise of a displacement sensor, as [`crate::simulate::Sensor`] makes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Of the record, about its drift, m.
    pub spread: Spread,
    /// How far the cubic that is taken for the drift goes, m.
    pub drift: f64,
    /// Smallest step of the reading, m; 0 where the readings are on no grid.
    pub resolution: f64,
    /// Different readings in the record.
    pub levels: usize,
    /// Noise before quantisation, m rms.
    pub noise: f64,
    /// Frequency at which its spectrum has lost 3 dB, Hz; infinite for white noise.
    pub bandwidth: f64,
    /// Standard deviation of the bandwidth, Hz; none for white noise.
    pub bandwidth_sd: Option<f64>,
}

/// Finds a sensor's noise in a record at rest, m, sampled every `dt` s.
///
/// A cubic, as creep makes it, is taken off. The step is that of which all readings
/// are whole multiples apart. Quantisation adds `step^2 / 12` to the variance, white (Widrow 1956,
/// doi 10.1109/TCT.1956.1086334); what is left is taken to be white noise through a first-order
/// low-pass, whose correlation from sample to sample is `r = exp(-2 pi bandwidth dt)`: with c0
/// and c1 the record's variance and its covariance one sample apart,
///
/// ```text
/// noise^2 = c0 - step^2 / 12,   r = c1 / noise^2
/// ```
///
/// # Errors
/// [`Error::Parameter`] where `dt` is not above 0; [`Error::Shape`] where there are less than
/// 100 samples; [`Error::Data`] where one is not finite, or the record does not change.
pub fn noise_at_rest(record: &[f64], dt: f64) -> Result<Noise> {
    positive("dt", dt, "s")?;
    if record.len() < FEWEST {
        return Err(Error::Shape {
            name: "record".into(),
            found: format!("{} samples", record.len()),
            expected: format!("{FEWEST} at least"),
        });
    }
    if let Some(k) = record.iter().position(|value| !value.is_finite()) {
        return Err(Error::Data(format!("record is {} at sample {k}", record[k])));
    }
    let (left, drift) = without_drift(record);
    let spread = Spread::of(left.iter().copied());
    let Grid { step: resolution, levels } = grid(record);
    if levels < 2 {
        return Err(Error::Data(format!(
            "all {} samples are {:e} m: no noise shows, so the sensor's step is larger than it",
            record.len(),
            record[0]
        )));
    }
    let n = index(record.len());
    let covariance = left.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / (n - 1.0);
    let power = spread.sd * spread.sd - resolution * resolution / 12.0;
    // Noise of less than a step leaves no power once the quantisation's share is taken off.
    let noise = power.max(0.0).sqrt();
    let correlation = if power > 0.0 { (covariance / power).min(1.0 - 1.0 / n) } else { 0.0 };
    let rate = core::f64::consts::TAU * dt;
    let sd = ((1.0 - correlation * correlation) / n).sqrt();
    // Correlations within the statistical error count as 0.
    let coloured = correlation > 3.0 * sd;
    let bandwidth = if coloured { -libm::log(correlation) / rate } else { f64::INFINITY };
    let bandwidth_sd = coloured.then(|| sd / (correlation * rate));
    Ok(Noise { spread, drift, resolution, levels, noise, bandwidth, bandwidth_sd })
}

/// The grid that readings are on.
struct Grid {
    /// Its step, m; 0 for none.
    step: f64,
    levels: usize,
}

/// Different readings, and the step of which they all are multiples apart.
///
/// The smallest gap is the initial estimate; over wider and wider gaps it is sharpened, and refused
/// where a reading is a tenth of a step off.
fn grid(record: &[f64]) -> Grid {
    let mut levels = record.to_vec();
    levels.sort_by(f64::total_cmp);
    let span = levels[levels.len() - 1] - levels[0];
    // Readings that were printed and parsed differ in their last digit.
    levels.dedup_by(|next, kept| *next - *kept <= 1e-6 * span);
    let gaps = || levels.windows(2).map(|pair| pair[1] - pair[0]);
    let smallest = gaps().fold(f64::INFINITY, f64::min);
    let count = levels.len();
    // As many levels as samples are no grid, but numbers.
    if count < 2 || 2 * count > record.len() {
        return Grid { step: 0.0, levels: count };
    }
    let mut step = smallest;
    let mut sorted: Vec<f64> = gaps().collect();
    sorted.sort_by(f64::total_cmp);
    for width in sorted.iter().copied().chain([span]) {
        let steps = libm::round(width / step);
        if (width / step - steps).abs() > 0.1 {
            return Grid { step: 0.0, levels: count };
        }
        step = width / steps;
    }
    Grid { step, levels: count }
}
