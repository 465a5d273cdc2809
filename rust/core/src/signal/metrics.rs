//! Metrics of tracking: statistics of the error, phase lag, widest loop.
//!
//! The error is desired less actual: positive where the stage lags while it rises.

use nalgebra::{Matrix3, Vector3};

use super::drive::index;
use crate::error::{Error, Result, positive};

/// Tracking of a reference, in the unit of what was compared (m here) unless stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracking {
    /// Largest absolute error, m.
    pub max_error: f64,
    /// Root of the mean square of the error, m.
    pub rms_error: f64,
    /// Mean of the signed error, m.
    pub mean_error: f64,
    /// Standard deviation of the error about its mean, m, over all samples (not less one).
    pub error_sd: f64,
    /// Largest less smallest error, m.
    pub error_peak_to_peak: f64,
    /// By how much the fundamental of the actual motion lags behind the desired one's, rad, in
    /// (-pi, pi]; none where no frequency was given, or the desired motion has nothing there, as
    /// 0.5 and 0.75 Hz together have nothing at the 0.25 Hz of their period.
    pub phase_lag: Option<f64>,
    /// Widest loop of actual against desired, as a fraction of the desired travel; none where
    /// the desired motion does not turn.
    pub widest_loop: Option<f64>,
}

/// How a signed error is spread, in its own unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Largest absolute value.
    pub largest: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation about the mean, over all values (not less one).
    pub sd: f64,
    /// Largest less smallest.
    pub peak_to_peak: f64,
}

impl Spread {
    /// Figures of some errors; NaN where there are none.
    pub fn of(errors: impl Iterator<Item = f64> + Clone) -> Self {
        let n = index(errors.clone().count());
        let mean = errors.clone().sum::<f64>() / n;
        let square = |sum: f64| (sum / n).sqrt();
        let highest = errors.clone().fold(f64::NEG_INFINITY, f64::max);
        let lowest = errors.clone().fold(f64::INFINITY, f64::min);
        Self {
            largest: highest.max(-lowest),
            rms: square(errors.clone().map(|e| e * e).sum()),
            mean,
            sd: square(errors.map(|e| (e - mean) * (e - mean)).sum()),
            peak_to_peak: highest - lowest,
        }
    }
}

/// Figures of a whole record, `dt` seconds from sample to sample.
///
/// `frequency`, Hz, is the fundamental's where the reference has one.
///
/// ```
/// use piezotrack_core::signal::metrics::tracking;
///
/// let desired = [0.0, 1.0, 2.0, 1.0, 0.0];
/// let actual = [0.0, 0.5, 2.0, 1.5, 0.0];
/// let figures = tracking(&desired, &actual, 0.02, None).unwrap();
/// assert_eq!(figures.max_error, 0.5);
/// assert_eq!(figures.widest_loop, Some(0.5));
/// ```
///
/// # Errors
/// [`Error::Shape`] where the records are empty or differ in length; [`Error::Data`] where a
/// sample is not finite; those of [`fundamental`] where a frequency is given.
pub fn tracking(
    desired: &[f64],
    actual: &[f64],
    dt: f64,
    frequency: Option<f64>,
) -> Result<Tracking> {
    check(desired, actual)?;
    let Spread { largest, rms, mean, sd, peak_to_peak } =
        Spread::of(desired.iter().zip(actual).map(|(d, a)| d - a));
    let phase_lag = match frequency {
        Some(frequency) => lag(desired, actual, dt, frequency)?,
        None => None,
    };
    Ok(Tracking {
        max_error: largest,
        rms_error: rms,
        mean_error: mean,
        error_sd: sd,
        error_peak_to_peak: peak_to_peak,
        phase_lag,
        widest_loop: widest_loop(desired, actual)?,
    })
}

/// Figures of each whole period, `period` seconds long, from the first sample on.
///
/// What is left at the end is not scored. Each phase lag is at the frequency `1 / period`.
///
/// # Errors
/// [`Error::Parameter`] where the period is under four samples; [`Error::Data`] where the
/// record holds no whole period; those of [`tracking`].
pub fn each_period(desired: &[f64], actual: &[f64], dt: f64, period: f64) -> Result<Vec<Tracking>> {
    check(desired, actual)?;
    positive("dt", dt, "s")?;
    positive("period", period, "s")?;
    let samples = period / dt;
    if samples < 4.0 {
        let expected = format!("4 samples or more, {} s", 4.0 * dt);
        return Err(Error::parameter("period", format!("{period} s"), expected));
    }
    let mut out = Vec::new();
    let mut from = 0;
    loop {
        let end = index(out.len() + 1) * samples;
        // A hundredth of a sample short of a period still is one, as 1/0.3 s at 3 samples is.
        if end > index(desired.len()) + 0.01 {
            break;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
        let to = (end.round() as usize).min(desired.len());
        out.push(tracking(&desired[from..to], &actual[from..to], dt, Some(1.0 / period))?);
        from = to;
    }
    if out.is_empty() {
        return Err(Error::Data(format!(
            "the record lasts {} s, less than a period of {period} s",
            index(desired.len()) * dt
        )));
    }
    Ok(out)
}

/// Residual of a model on a record that it was fitted to by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Root of the mean square, m.
    pub rms: f64,
    /// Largest absolute value, m.
    pub max: f64,
    /// Correlation of each sample with the next, about the mean: near 0 where the residual is
    /// white, near 1 where the model is what limits the fit.
    pub autocorrelation: f64,
    /// Akaike's information criterion.
    pub aic: f64,
    /// Schwarz's Bayesian information criterion.
    pub bic: f64,
}

/// Figures of a residual, m, that `fitted` parameters were fitted to leave.
///
/// ```text
/// AIC = n ln(RSS/n) + 2 K,   BIC = n ln(RSS/n) + K ln n,   K = fitted + 1
/// ```
///
/// for independent, normal residuals, whose variance counts as one parameter more; only
/// differences between models of the same samples mean anything. Burnham and Anderson 2002,
/// Model Selection and Multimodel Inference, 2nd edition, sections 2.2 and 6.4, doi
/// 10.1007/b97636; Schwarz 1978, doi 10.1214/aos/1176344136. Where neighbouring residuals are
/// alike, n samples count for fewer, and both criteria ask for too many parameters.
///
/// ```
/// use piezotrack_core::signal::metrics::residual;
///
/// let figures = residual(&[1.0, -1.0, 1.0, -1.0], 2).unwrap();
/// assert_eq!((figures.rms, figures.aic), (1.0, 6.0));
/// ```
///
/// # Errors
/// [`Error::Shape`] where there is no sample; [`Error::Data`] where one is not finite.
pub fn residual(errors: &[f64], fitted: usize) -> Result<Residual> {
    if errors.is_empty() {
        let (found, expected) = ("0 samples".into(), "at least 1".into());
        return Err(Error::Shape { name: "errors".into(), found, expected });
    }
    if let Some(k) = errors.iter().position(|value| !value.is_finite()) {
        return Err(Error::Data(format!("errors has {} at sample {k}", errors[k])));
    }
    let n = index(errors.len());
    let square = errors.iter().map(|e| e * e).sum::<f64>() / n;
    let mean = errors.iter().sum::<f64>() / n;
    let spread: f64 = errors.iter().map(|e| (e - mean) * (e - mean)).sum();
    let shared: f64 = errors.windows(2).map(|pair| (pair[0] - mean) * (pair[1] - mean)).sum();
    let (fit, count) = (n * libm::log(square), index(fitted) + 1.0);
    Ok(Residual {
        rms: square.sqrt(),
        max: errors.iter().fold(0.0, |most, e| f64::max(most, e.abs())),
        autocorrelation: if spread > 0.0 { shared / spread } else { 0.0 },
        aic: fit + 2.0 * count,
        bic: fit + count * libm::log(n),
    })
}

/// Mean, and the sine that fits best at one frequency: `mean + amplitude cos(w t + phase)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fundamental {
    /// Mean, in the signal's unit.
    pub mean: f64,
    /// Amplitude, in the signal's unit.
    pub amplitude: f64,
    /// Phase at the first sample, rad, in (-pi, pi].
    pub phase: f64,
}

/// Least squares of mean, cosine and sine at `frequency`, Hz, on a signal sampled every `dt` s.
///
/// # Errors
/// [`Error::Parameter`] where the frequency is not above 0 and below half the sampling rate;
/// [`Error::Data`] where the signal is shorter than four fifths of a period: a fit to less
/// confuses mean and phase.
pub fn fundamental(signal: &[f64], dt: f64, frequency: f64) -> Result<Fundamental> {
    positive("dt", dt, "s")?;
    positive("frequency", frequency, "Hz")?;
    let turns = frequency * dt;
    if turns >= 0.5 {
        let expected = format!("below half the sampling rate, {} Hz", 0.5 / dt);
        return Err(Error::parameter("frequency", format!("{frequency} Hz"), expected));
    }
    if index(signal.len()) * turns < 0.8 {
        return Err(Error::Data(format!(
            "{} samples of {dt} s are less than a period of {frequency} Hz",
            signal.len()
        )));
    }
    let mut matrix = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for (k, &value) in signal.iter().enumerate() {
        let angle = core::f64::consts::TAU * (turns * index(k)).fract();
        let row = Vector3::new(1.0, libm::cos(angle), libm::sin(angle));
        matrix += row * row.transpose();
        right += row * value;
    }
    let fit = matrix.cholesky().map(|cholesky| cholesky.solve(&right)).ok_or_else(|| {
        Error::Numerical(format!("no sine of {frequency} Hz can be fitted to the samples"))
    })?;
    let (cosine, sine) = (fit[1], fit[2]);
    Ok(Fundamental {
        mean: fit[0],
        amplitude: libm::hypot(cosine, sine),
        phase: libm::atan2(-sine, cosine),
    })
}

/// By how much the fundamental of `actual` lags behind that of `desired`, rad, in (-pi, pi].
///
/// # Errors
/// Those of [`fundamental`]; [`Error::Data`] where `desired` has nothing at that frequency.
pub fn phase_lag(desired: &[f64], actual: &[f64], dt: f64, frequency: f64) -> Result<f64> {
    check(desired, actual)?;
    lag(desired, actual, dt, frequency)?
        .ok_or_else(|| Error::Data(format!("the reference has nothing at {frequency} Hz")))
}

/// As [`phase_lag`]; none where `desired` has nothing at that frequency.
fn lag(desired: &[f64], actual: &[f64], dt: f64, frequency: f64) -> Result<Option<f64>> {
    let (wanted, found) =
        (fundamental(desired, dt, frequency)?, fundamental(actual, dt, frequency)?);
    let size = desired.iter().fold(0.0, |most, value| f64::max(most, value.abs()));
    let lag = wanted.phase - found.phase;
    let some = wanted.amplitude > 1e-9 * size;
    Ok(some.then(|| libm::atan2(libm::sin(lag), libm::cos(lag))))
}

/// Widest loop of actual against desired, as a fraction of the desired travel.
///
/// The largest difference in the actual displacement between a rising and the neighbouring
/// falling stretch of the desired one, at the same desired displacement. `None` where the
/// desired displacement does not turn.
///
/// # Errors
/// [`Error::Shape`] where the records are empty or differ in length; [`Error::Data`] where a
/// sample is not finite.
pub fn widest_loop(desired: &[f64], actual: &[f64]) -> Result<Option<f64>> {
    check(desired, actual)?;
    let highest = desired.iter().fold(f64::NEG_INFINITY, |most, &d| most.max(d));
    let lowest = desired.iter().fold(f64::INFINITY, |least, &d| least.min(d));
    let stretches = monotone(desired, actual);
    let width = stretches.windows(2).map(|pair| gap(&pair[0], &pair[1])).reduce(f64::max);
    Ok(width.map(|width| width / (highest - lowest)))
}

/// Points (desired, actual) in the order of the desired displacement.
type Branch = Vec<(f64, f64)>;

/// Cuts a record where the desired displacement turns; each piece has its turning points.
///
/// Where it stands still the last sample counts: there the stage has had time to settle.
fn monotone(desired: &[f64], actual: &[f64]) -> Vec<Branch> {
    let mut out: Vec<Branch> = Vec::new();
    let mut piece: Branch = Vec::new();
    let mut rising = true;
    for point in desired.iter().copied().zip(actual.iter().copied()) {
        if let Some(last) = piece.last_mut() {
            let step = point.0 - last.0;
            if step == 0.0 {
                *last = point;
                continue;
            }
            let turns = piece.len() > 1 && (step > 0.0) != rising;
            rising = step > 0.0;
            if turns {
                let turning = piece.last().copied();
                out.push(core::mem::take(&mut piece));
                piece.extend(turning);
            }
        }
        piece.push(point);
    }
    if piece.len() > 1 {
        out.push(piece);
    }
    for branch in &mut out {
        branch.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    out
}

/// Largest difference of two branches where both are, at the points of either.
fn gap(one: &Branch, other: &Branch) -> f64 {
    let from = |points: &Branch, line: &Branch| {
        points
            .iter()
            .filter_map(|&(desired, actual)| Some((on(line, desired)? - actual).abs()))
            .fold(0.0, f64::max)
    };
    f64::max(from(one, other), from(other, one))
}

/// Actual displacement on a branch where the desired one is `desired`.
fn on(branch: &Branch, desired: f64) -> Option<f64> {
    let after = branch.partition_point(|point| point.0 < desired);
    let &(d1, a1) = branch.get(after)?;
    if after == 0 {
        return (d1 <= desired).then_some(a1);
    }
    let &(d0, a0) = branch.get(after - 1)?;
    Some(a0 + (a1 - a0) * ((desired - d0) / (d1 - d0)))
}

/// Refuses records that cannot be compared.
fn check(desired: &[f64], actual: &[f64]) -> Result<()> {
    if desired.is_empty() || desired.len() != actual.len() {
        return Err(Error::Shape {
            name: "actual".into(),
            found: format!("{} samples", actual.len()),
            expected: format!("{} as desired has, and 1 at least", desired.len()),
        });
    }
    for (name, record) in [("desired", desired), ("actual", actual)] {
        if let Some(k) = record.iter().position(|value| !value.is_finite()) {
            return Err(Error::Data(format!("{name} is {} at sample {k}", record[k])));
        }
    }
    Ok(())
}
