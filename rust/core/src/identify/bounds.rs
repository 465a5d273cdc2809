//! Bounds of a search, from the data, where the caller gave none.
//!
//! Voltage and displacement fix ratios: the gain T/K, the viscous time D/K, the mass over the
//! stiffness, and the hysteresis force relative to the elastic one. Each ratio gets a generous
//! range from the stroke, the drive and the sampling, and the stiffness turns it into a bound.

use super::coordinate::Coordinate;
use super::record::Record;
use crate::error::{Error, Result, shown};
use crate::models::Model;
use crate::signal::{index, range};

/// Stiffness held where nothing in the input fixes a force, N/m.
pub const NOMINAL_STIFFNESS: f64 = 1e6;

/// What the ranges are built from.
struct Measures {
    /// Range of the displacement, m.
    stroke: f64,
    /// Stroke over the range of the drive, m/V.
    gain: f64,
    /// Whether the displacement falls where the drive rises.
    inverted: bool,
    /// Rate of change of the drive over its size, rad/s: the frequency of a sine.
    frequency: f64,
    /// The lower of that and two periods in the window, rad/s: of steps, the former is far above
    /// what moves the stage.
    slow: f64,
    /// Sampling interval, s.
    dt: f64,
}

impl Measures {
    fn of(record: &Record<'_>) -> Self {
        let u = &record.drive.u[record.window.clone()];
        let (low, high) = range(u);
        let stroke = record.stroke();
        let mean = u.iter().sum::<f64>() / index(u.len());
        let dt = record.drive.dt;
        let (_, frequency) = size_and_rate(u, dt);
        let y = &record.y[record.window.clone()];
        let level = y.iter().sum::<f64>() / index(y.len());
        let together: f64 = u.iter().zip(y).map(|(u, y)| (u - mean) * (y - level)).sum();
        let gain = stroke / (high - low);
        let twice = 2.0 * core::f64::consts::TAU / (index(u.len()) * dt);
        let slow = frequency.min(twice);
        Self { stroke, gain, inverted: together < 0.0, frequency, slow, dt }
    }
}

/// Coordinates of all parameters: the fixed ones as given, the others between derived bounds.
///
/// # Errors
/// [`Error::Data`] where the record's values are absurd; [`Error::Parameter`] where a derived
/// range is empty, which other records that passed [`Record::new`] do not lead to.
pub fn derive(
    record: &Record<'_>,
    model: Model,
    fixed: &[Option<f64>; 9],
) -> Result<[Coordinate; 9]> {
    let of = Measures::of(record);
    let usable = |value: f64| (1e-60..1e60).contains(&value);
    if ![of.stroke, of.gain, of.frequency, of.dt].into_iter().all(usable) {
        return Err(Error::Data(format!(
            "a stroke of {} m, {} m/V and a drive of {} rad/s cannot be computed with: check \
             the units of time, drive and displacement",
            shown(of.stroke),
            shown(of.gain),
            shown(of.frequency)
        )));
    }
    let ranges = match model {
        Model::Dahl => dahl_ranges(&of, fixed),
        Model::BoucWen => bouc_wen_ranges(&of, fixed),
        Model::FirstOrderDahl => first_order_dahl_ranges(&of, fixed),
        Model::BoucWenOscillator => oscillator_ranges(&of, record, fixed),
    };
    let mut coordinates = [Coordinate::Fixed(0.0); 9];
    for (i, info) in model.facts().parameters.iter().enumerate() {
        coordinates[i] = match (fixed[i], ranges.get(i)) {
            (Some(value), _) => Coordinate::Fixed(value),
            (None, Some(&(low, high))) => Coordinate::between(info.name, low, high)?,
            (None, None) => Coordinate::Fixed(0.0),
        };
    }
    Ok(coordinates)
}

/// Ranges of mass, damping and stiffness.
fn mechanical_ranges(of: &Measures, (soft, hard): (f64, f64)) -> [(f64, f64); 3] {
    // Ten times the drive's frequency up to a tenth of the sampling rate, where the paper's
    // rule for sampling still holds; never less than two octaves.
    let slowest = 10.0 * of.frequency;
    let fastest = (0.2 * core::f64::consts::PI / of.dt).max(4.0 * slowest);
    [
        (soft / (fastest * fastest), hard / (slowest * slowest)),
        (soft * 5e-3 / of.frequency, hard / of.slow),
        (soft, hard),
    ]
}

/// Ranges of the parameters of a Dahl stage, up to b0.
fn dahl_ranges(of: &Measures, fixed: &[Option<f64>; 9]) -> [(f64, f64); 8] {
    let up = fixed[8].unwrap_or(30.0);
    let value = |i: usize| fixed[i].filter(|value| *value != 0.0);
    // Half the curvature times the stroke is a stiffness.
    let hints = [value(6).map(|b1| 0.5 * b1 * up * of.stroke), value(7).map(|b0| b0 * up)];
    let (soft, hard) = stiffness_range(of, fixed, &hints);
    let [mass, damping, stiffness] = mechanical_ranges(of, (soft, hard));
    // A force of half the elastic one at full stroke, either way.
    let curvature = hard / (up.abs().max(f64::MIN_POSITIVE) * of.stroke);
    let piezo = (soft * of.gain / 3.0, hard * of.gain * 3.0);
    [
        mass,
        damping,
        stiffness,
        if of.inverted { (-piezo.1, -piezo.0) } else { piezo },
        // From 100 strokes of memory to a tenth: with a1 = 0 the operator is a lossless spring.
        (1e-2 / of.stroke, 10.0 / of.stroke),
        (1e-2 / (of.stroke * of.stroke), 40.0 / (of.stroke * of.stroke)),
        (-2.0 * curvature, 2.0 * curvature),
        // q2 is about up times the path: a friction of half the elastic force.
        (0.0, 0.5 * hard / up.abs().max(f64::MIN_POSITIVE)),
    ]
}

/// Ranges of the parameters of a Bouc-Wen stage, up to gamma.
fn bouc_wen_ranges(of: &Measures, fixed: &[Option<f64>; 9]) -> [(f64, f64); 8] {
    let [mass, damping, stiffness, ..] = *fixed;
    let scale = [mass, damping, stiffness, None, None, None, None, None, None];
    let [mass, damping, stiffness] = mechanical_ranges(of, stiffness_range(of, &scale, &[]));
    let piezo = (of.gain / 3.0, of.gain * 3.0);
    // The memory fades over the whole drive's range, or a twentieth of it; with another exponent
    // than 1, at a hysteresis of a tenth of the stroke.
    let exponent = fixed[7].unwrap_or(1.0);
    let fade = of.gain / of.stroke * libm::pow(0.1 * of.stroke, 1.0 - exponent);
    [
        mass,
        damping,
        stiffness,
        if of.inverted { (-piezo.1, -piezo.0) } else { piezo },
        (0.02, 1.5),
        (0.05 * fade, 20.0 * fade),
        (-10.0 * fade, 10.0 * fade),
        (exponent, exponent),
    ]
}

/// Ranges of the parameters of a first-order Dahl stage, up to the Coulomb force.
fn first_order_dahl_ranges(of: &Measures, fixed: &[Option<f64>; 9]) -> [(f64, f64); 8] {
    let hints = [fixed[4], fixed[5].map(|limit| 10.0 * limit / of.stroke)];
    let hints = hints.map(|hint| hint.filter(|value| *value != 0.0));
    let (soft, hard) = stiffness_range(of, fixed, &hints);
    let [mass, damping, stiffness] = mechanical_ranges(of, (soft, hard));
    let piezo = (soft * of.gain / 3.0, hard * of.gain * 3.0);
    [
        mass,
        // The loop's width is the friction's: the damping may be far too small to show.
        (1e-2 * damping.0, damping.1),
        stiffness,
        if of.inverted { (-piezo.1, -piezo.0) } else { piezo },
        // The way to the Coulomb force is a hundredth of the stroke or all of it.
        (1e-2 * soft, 10.0 * hard),
        (1e-3 * soft * of.stroke, hard * of.stroke),
        (0.0, 0.0),
        (0.0, 0.0),
    ]
}

/// Ranges of the parameters of a Bouc-Wen oscillator, up to delta: the drive is a force, and may
/// well shake it at its resonance.
fn oscillator_ranges(
    of: &Measures,
    record: &Record<'_>,
    fixed: &[Option<f64>; 9],
) -> [(f64, f64); 8] {
    let (size, rate) = size_and_rate(&record.y[record.window.clone()], of.dt);
    let (force, _) = size_and_rate(&record.drive.u[record.window.clone()], of.dt);
    let stiff = force / size;
    let spring = (0.02 * stiff, 3.0 * stiff);
    // The restoring force reaches about stiff * stroke/2.
    let [beta, exponent] = [fixed[4].unwrap_or(1.0), fixed[7].unwrap_or(1.0)];
    let fade = libm::pow(0.25 * stiff * of.stroke, 1.0 - exponent) / (beta * of.stroke);
    let (low, high) = if fade < 0.0 { (20.0 * fade, 0.0) } else { (0.0, 20.0 * fade) };
    [
        (0.05 * stiff / (rate * rate), 10.0 * stiff / (rate * rate)),
        (1e-4 * stiff / rate, 3.0 * stiff / rate),
        spring,
        spring,
        (0.0, 0.0),
        (low, high),
        (-20.0 * fade.abs(), 20.0 * fade.abs()),
        (0.0, 0.0),
    ]
}

/// RMS about the mean, and the rate of change over it, rad/s: amplitude and frequency of a sine.
fn size_and_rate(values: &[f64], dt: f64) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / index(values.len());
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    let change: f64 = values.windows(2).map(|w| (w[1] - w[0]) * (w[1] - w[0])).sum();
    (libm::sqrt(squares / index(values.len())), libm::sqrt(change / squares) / dt)
}

/// Longest delay that is searched where no bounds are given, s.
pub(super) fn longest_delay(record: &Record<'_>) -> f64 {
    let of = Measures::of(record);
    (20.0 * of.dt).min(0.1 * core::f64::consts::TAU / of.frequency)
}

/// Range of the stiffness from whichever parameter that carries force is held; `hints` are
/// stiffnesses that parameters of the hysteresis tell, to a factor of 30.
fn stiffness_range(of: &Measures, fixed: &[Option<f64>; 9], hints: &[Option<f64>]) -> (f64, f64) {
    let [mass, damping, stiffness, piezo, ..] = *fixed;
    let around = |value: f64, factor: f64| (value.abs() / factor, value.abs() * factor);
    if let Some(value) = stiffness {
        (value, value)
    } else if let Some(value) = piezo {
        around(value / of.gain, 3.0)
    } else if let Some(value) = hints.iter().copied().flatten().next() {
        around(value, 30.0)
    } else if let Some(value) = damping.filter(|value| *value != 0.0) {
        (value * of.frequency, value * of.frequency * 1e3)
    } else if let Some(value) = mass {
        let slowest = 3.0 * of.frequency;
        (value * slowest * slowest, value * slowest * slowest * 1e4)
    } else {
        (NOMINAL_STIFFNESS, NOMINAL_STIFFNESS)
    }
}
