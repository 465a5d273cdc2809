//! Sampled drive signals, the request to stop, and small operations on samples.

use crate::error::{Error, Result, positive};

/// Asked now and then whether to give up; answers at once.
pub type Stop<'a> = &'a (dyn Fn() -> bool + Sync);

/// Never gives up.
pub const NEVER: Stop<'static> = &|| false;

/// Course of the drive between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// First order: a straight line from sample to sample.
    First,
    /// Zero order: each value is held until the next.
    Zero,
    /// First order, but the first value is held until the second, at which the drive jumps.
    Jump,
}

impl Hold {
    /// Course of the drive over the interval that ends at sample `k`.
    #[inline(always)]
    #[must_use]
    pub fn until(self, k: usize) -> Self {
        if self == Self::Jump && k != 1 { Self::First } else { self }
    }
}

/// A drive voltage, sampled evenly.
#[derive(Clone, Copy, Debug)]
pub struct Drive<'a> {
    /// Voltage at the samples, V.
    pub u: &'a [f64],
    /// Sampling interval, s.
    pub dt: f64,
    /// Course between the samples.
    pub hold: Hold,
}

/// Sampling intervals beyond which numbers derived from them leave `f64`, s.
pub const INTERVALS: (f64, f64) = (1e-12, 1e9);

impl<'a> Drive<'a> {
    /// Checks the interval and the samples.
    ///
    /// # Errors
    /// [`Error::Parameter`] where `dt` is not from 1 ps to 1e9 s, [`Error::Shape`] where `u` is empty.
    pub fn new(u: &'a [f64], dt: f64, hold: Hold) -> Result<Self> {
        sampling_interval(dt)?;
        if u.is_empty() {
            return Err(Error::Shape {
                name: "u".into(),
                found: "0 samples".into(),
                expected: "at least 1".into(),
            });
        }
        Ok(Self { u, dt, hold })
    }

    /// Value at the start of the interval that begins at sample `k`, and its change over it.
    #[inline(always)]
    #[must_use]
    pub fn interval(&self, k: usize) -> (f64, f64) {
        let straight = self.hold.until(k + 1) == Hold::First;
        (self.u[k], if straight { self.u[k + 1] - self.u[k] } else { 0.0 })
    }
}

/// Refuses a sampling interval (s) that is not from 1 ps to 1e9 s.
pub(crate) fn sampling_interval(dt: f64) -> Result<f64> {
    positive("dt", dt, "s")?;
    let (shortest, longest) = INTERVALS;
    if (shortest..=longest).contains(&dt) {
        return Ok(dt);
    }
    let expected = format!("{shortest:e} to {longest:e} s");
    Err(Error::parameter("dt", format!("{dt:e} s"), expected))
}

/// Refuses a motion that does not stay finite.
pub(crate) fn all_finite(x: &[f64], dt: f64) -> Result<()> {
    let Some(k) = x.iter().position(|x| !x.is_finite()) else { return Ok(()) };
    Err(Error::Numerical(format!(
        "the simulated motion is not finite from sample {k} on ({:.6} s): check that \
         parameters and drive are in SI units",
        dt * index(k)
    )))
}

/// A number of samples as a factor; exact below 2^53.
#[expect(clippy::cast_precision_loss, reason = "no array has 2^53 entries")]
#[inline(always)]
pub(crate) fn index(n: usize) -> f64 {
    n as f64
}

/// Largest absolute difference between two signals at the same sample.
pub(crate) fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |most, (a, b)| f64::max(most, (a - b).abs()))
}

/// Smallest and largest value.
pub(crate) fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| {
        (f64::min(low, v), f64::max(high, v))
    })
}
