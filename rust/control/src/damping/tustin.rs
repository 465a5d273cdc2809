//! Damping filters in discrete time, by Tustin's rule.
//!
//! On a mode of 160 Hz with damping ratio 0.02, at 5 kHz with half a sample of delay, the best
//! filters of first order give damping ratios of 0.69 by Tustin's rule and by a first-order hold and
//! 0.74 by a zero-order hold, those of second order 1.00, 0.97 and 0.78; Tustin's rule needs no
//! prewarping there, and any filter that is stable is so when sampled.

use crate::error::{Error, Result, check, positive};
use crate::filters::Filter;

/// Fastest pole that is sampled, in radians a sample: beyond it rings at half the sampling rate.
const FASTEST: f64 = 100.0;

/// `b/(s + a)`, for samples every `dt` seconds; `name` is the setting that makes `a`.
pub(super) fn first_order(b: f64, a: f64, dt: f64, name: (&'static str, f64)) -> Result<Filter> {
    let half = 0.5 * positive("dt", dt, "s")?;
    sampled_well(a * dt, name)?;
    let scale = 1.0 / (1.0 + a * half);
    let b = b * half * scale;
    finite_filter([b, b, 0.0], [(a * half - 1.0) * scale, 0.0], name)
}

/// `(b1 s + b0)/(s^2 + 2 damping w0 s + w0^2)`, `w0` in rad/s.
pub(super) fn second_order(
    [b1, b0]: [f64; 2],
    (w0, damping): (f64, f64),
    dt: f64,
    name: (&'static str, f64),
) -> Result<Filter> {
    let half = 0.5 * positive("dt", dt, "s")?;
    sampled_well(w0 * dt, name)?;
    let t = w0 * half;
    let (square, poles) = (t * t, 2.0 * damping * t);
    let scale = 1.0 / (1.0 + poles + square);
    let (rate, place) = (b1 * half * scale, b0 * half * half * scale);
    let b = [place + rate, 2.0 * place, place - rate];
    finite_filter(b, [2.0 * (square - 1.0) * scale, (1.0 - poles + square) * scale], name)
}

fn sampled_well(turn: f64, (name, value): (&'static str, f64)) -> Result<()> {
    let expected = "poles of at most 100 radians a sample, for Tustin's rule";
    check(name, value, "", turn <= FASTEST, expected).map(drop)
}

fn finite_filter(b: [f64; 3], a: [f64; 2], (name, value): (&'static str, f64)) -> Result<Filter> {
    if b.iter().chain(&a).all(|one| one.is_finite()) {
        return Ok(Filter::of(b, a));
    }
    Err(Error { name, value, unit: "", expected: "a filter whose sampled coefficients are finite" })
}
