//! Settings as C gives them.

use core::ffi::{CStr, c_char};
use core::slice;

use piezotrack_core::parts::{ControllerParts, Named};
use piezotrack_core::{Error, Result};

use crate::running::FeedforwardParts;

/// A part, a parameter or a state, with its numbers.
#[repr(C)]
pub struct Numbers {
    /// Its name; NULL for none.
    pub name: *const c_char,
    /// Its numbers.
    pub values: *const f64,
    /// How many there are.
    pub count: usize,
}

/// Parts of a controller, by name. Units are SI: m, V, s, Hz. What is 0 or NULL has its default, so
/// name what you set: `piezotrack_settings settings = {.dt = 0.001, .high = 75.0};`
///
/// The feedback law is one of
///
/// | name | values |
/// | --- | --- |
/// | "pid" | kp (V/m), ti, td (s), tt (s; NAN for its default) |
/// | "state-space" | n, then A row by row, B, C, D (V/m), and n for back-calculation or none |
/// | "lead-lag" | kp (V/m), lead, lag (s), 1 for matched poles or 0 |
/// | "sliding-mode" | switching gain (V), layer (m), ti, td, tf (s) |
/// | "disturbance-observer" | those of the PID; gain (m/V), time (s), cutoff (Hz) |
/// | "perturbation-estimator" | those of the sliding mode; gain (m/V), time (s), cutoff (Hz) |
/// | "scheduled-pid" | counts of amplitudes and rates, both (m, Hz), the first of each; PIDs |
/// | "hysteresis-observer" | those of the PID; gain (m/V), time (s), correction, stroke (m); a1, a2, curvature of a Dahl hysteresis, or rise, beta, gamma, exponent of a Bouc-Wen one |
/// | "integral-resonant" | those of the PID; gain (V/m/s), feedthrough (m/V) |
/// | "positive-position" | those of the PID; gain (V/m), frequency (Hz), damping ratio |
/// | "positive-velocity-position" | those of the PID; gains of velocity and position (V/m), frequency (Hz), damping ratio |
#[repr(C)]
pub struct Settings {
    /// Sampling interval, s.
    pub dt: f64,
    /// Lowest voltage, V.
    pub low: f64,
    /// Highest voltage, V.
    pub high: f64,
    /// Lowest displacement that the sensor can show, m; both 0 for -10 to 10 mm.
    pub span_low: f64,
    /// Highest displacement that the sensor can show, m.
    pub span_high: f64,
    /// Largest displacement in a sampling interval, m; 0 for any.
    pub max_jump: f64,
    /// Feedback law.
    pub law: Numbers,
    /// Repetitive control: "lag", "compensated-lag", "zero-phase" or "none" for its smoothing, with
    /// period (s), kq (V/m), time constant (s) or order, forgetting factor, lead (samples), 1 to
    /// pause under saturation or 0.
    pub repetitive: Numbers,
    /// Filters of the measurement: "low-pass" with its cutoff (Hz), "notch" with frequency (Hz),
    /// width and depth.
    pub filters: *const Numbers,
    /// How many there are, 2 at most.
    pub filter_count: usize,
    /// Model of the stage whose inverse is the feedforward, by its name as in Python
    /// ("prandtl-ishlinskii"), or "neural network"; NULL for no feedforward. With it the filters of
    /// the last three laws act on the deviation from the reference, also in `piezotrack_step_given`.
    pub model: *const c_char,
    /// Parameters of the model, by their names; lists and what is optional may be left out. Names
    /// and units are those of the stage's class in Python: "prandtl-ishlinskii" has `linear` (m/V),
    /// `thresholds` (V) with `weights` (m/V), `dead_zone_thresholds` (m) with `dead_zone_weights`,
    /// `creep_weights` with `creep_times` (s), and `time_constant` (s), or `frequency` (Hz) and
    /// `damping_ratio`. `piezotrack export --to library` writes those of any controller. A "neural
    /// network" has `centre`, 3 `scales`, `thresholds`, `hidden`, `biases`, `outputs`, `direct` and
    /// `constant`, as `NetworkNumbers` of the crate.
    pub parameters: *const Numbers,
    /// How many there are.
    pub parameter_count: usize,
    /// State of the stage at the start, by the names of the model's states; NULL for a stage that
    /// never moved.
    pub initial: *const Numbers,
    /// How many there are.
    pub initial_count: usize,
    /// Reading of the sensor where the stage rests without drive, m.
    pub offset: f64,
    /// Time by which the displacement lags behind the drive beyond the model, s.
    pub delay: f64,
}

/// The parts of a controller and of its feedforward, borrowed from settings.
///
/// # Safety
/// Each pointer of `settings` is NULL, or points to as many elements as its count says, or to a
/// text that ends with 0.
pub unsafe fn parts(
    settings: &Settings,
) -> Result<(ControllerParts<'_>, Option<FeedforwardParts<'_>>)> {
    let span = (settings.span_low, settings.span_high);
    // SAFETY: pointers and counts are the caller's promise.
    unsafe {
        let parts = ControllerParts {
            dt: settings.dt,
            limits: (settings.low, settings.high),
            span: (span != (0.0, 0.0)).then_some(span),
            max_jump: (settings.max_jump != 0.0).then_some(settings.max_jump),
            law: named("law", &settings.law)?,
            repetitive: named("repetitive", &settings.repetitive)?,
            filters: list("filters", settings.filters, settings.filter_count)?,
            follows: !settings.model.is_null(),
        };
        let Some(model) = text("model", settings.model)? else {
            no_model(settings)?;
            return Ok((parts, None));
        };
        let feedforward = FeedforwardParts {
            model,
            parameters: list("parameters", settings.parameters, settings.parameter_count)?,
            initial: list("initial", settings.initial, settings.initial_count)?,
            offset: settings.offset,
            delay: settings.delay,
        };
        Ok((parts, Some(feedforward)))
    }
}

/// Refuses what only an inverse has, where there is no model.
fn no_model(settings: &Settings) -> Result<()> {
    for (name, value, unit) in [("offset", settings.offset, "m"), ("delay", settings.delay, "s")] {
        // Also NaN.
        if value != 0.0 {
            return Err(Error::parameter(name, format!("{value:?} {unit}"), "0, as model is NULL"));
        }
    }
    Ok(())
}

/// A list of which each entry has a name.
unsafe fn list<'a>(what: &str, entries: *const Numbers, count: usize) -> Result<Vec<Named<'a>>> {
    let entries = unsafe { elements(what, entries, count)? };
    let one = |(i, entry)| {
        let place = format!("{what}[{i}]");
        unsafe { named(&place, entry)? }
            .ok_or_else(|| Error::parameter(format!("{place}.name"), "NULL", "a name"))
    };
    entries.iter().enumerate().map(one).collect()
}

unsafe fn named<'a>(what: &str, entry: &Numbers) -> Result<Option<Named<'a>>> {
    let Some(name) = (unsafe { text(&format!("{what}.name"), entry.name)? }) else {
        return match entry.count {
            0 => Ok(None),
            count => {
                let expected = format!("a name, as there are {count} values");
                Err(Error::parameter(format!("{what}.name"), "NULL", expected))
            }
        };
    };
    let values = unsafe { elements(&format!("{what}.values"), entry.values, entry.count)? };
    Ok(Some((name, values)))
}

unsafe fn elements<'a, T>(what: &str, first: *const T, count: usize) -> Result<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    if first.is_null() {
        let expected = format!("{count} elements, as the count beside it says");
        return Err(Error::parameter(what, "NULL", expected));
    }
    if count > isize::MAX.cast_unsigned() / size_of::<T>() || !first.is_aligned() {
        let expected = format!("an aligned pointer to {count} elements");
        return Err(Error::parameter(what, "out of reach", expected));
    }
    // SAFETY: it is not NULL, is aligned, and has these elements by the caller's promise.
    Ok(unsafe { slice::from_raw_parts(first, count) })
}

unsafe fn text<'a>(what: &str, first: *const c_char) -> Result<Option<&'a str>> {
    if first.is_null() {
        return Ok(None);
    }
    // SAFETY: it is not NULL and ends with 0 by the caller's promise.
    match unsafe { CStr::from_ptr(first) }.to_str() {
        Ok(text) if !text.chars().any(char::is_control) => Ok(Some(text)),
        _ => Err(Error::parameter(what, "no text", "a name in UTF-8, without control characters")),
    }
}
