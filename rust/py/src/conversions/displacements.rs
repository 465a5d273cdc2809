//! Displacements in metres, and hints at those in another unit.

use piezotrack_control::Span;
use piezotrack_core::Error;
use pyo3::prelude::*;

use crate::errors::raise;

/// Units of length that are taken for metres by mistake, how many of them are a metre, and the
/// power of ten.
const UNITS: [(&str, f64, &str); 3] = [("um", 1e6, "e-6"), ("nm", 1e9, "e-9"), ("mm", 1e3, "e-3")];
/// Least number that is taken for one of another unit.
const LEAST: f64 = 0.01;

/// The unit that explains a displacement outside of the span, if there is one.
pub fn meant(value: f64, span: Span) -> Option<&'static (&'static str, f64, &'static str)> {
    let fits = |(_, metre, _): &&(&str, f64, &str)| span.contains(value / metre);
    UNITS.iter().find(fits).filter(|_| value.abs() >= LEAST)
}

/// The error of a session for a displacement outside of its span.
pub fn outside(name: &str, value: f64, span: Span) -> PyErr {
    let (low, high, hint) = (span.low(), span.high(), hint(value, span));
    let taken = match meant(value, span) {
        Some(("um", ..)) => ", and step_um takes um",
        _ => "",
    };
    let expected = format!(
        "a displacement from {low:.3e} to {high:.3e} m{hint}{taken}; span= sets another range"
    );
    raise(&Error::parameter(name, format!("{value} m"), expected))
}

/// A reference in metres, or the error for one of a metre or more.
pub fn in_metres(reference: f64) -> PyResult<f64> {
    if reference.is_finite() && reference.abs() >= 1.0 {
        let expected = format!("metres, below 1 m{}", hint(reference, Span::default()));
        return Err(raise(&Error::parameter("reference", format!("{reference} m"), expected)));
    }
    Ok(reference)
}

/// Hint that writes a displacement in the unit that explains it.
fn hint(value: f64, span: Span) -> String {
    match meant(value, span) {
        Some((unit, _, power)) => format!("; {value} {unit} is {value}{power} m"),
        None => String::new(),
    }
}
