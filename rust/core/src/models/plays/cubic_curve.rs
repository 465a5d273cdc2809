//! A cubic without memory on a range of the drive, which goes on straight beyond it.
//!
//! Polynomials are fitted to a range; beyond it they soon turn back, and a stage with them would.

use crate::error::{Error, Result, finite};

/// A polynomial of third degree, from the constant on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::models) struct Cubic(pub(in crate::models) [f64; 4]);

impl Cubic {
    /// Its value.
    #[inline]
    pub(in crate::models) fn at(&self, place: f64) -> f64 {
        let [a, b, c, d] = self.0;
        a + place * (b + place * (c + place * d))
    }

    /// Its derivative.
    #[inline]
    pub(in crate::models) fn slope(&self, place: f64) -> f64 {
        let [_, b, c, d] = self.0;
        b + place * (2.0 * c + place * (3.0 * d))
    }

    /// Its second derivative.
    #[inline]
    pub(in crate::models) fn curvature(&self, place: f64) -> f64 {
        let [_, _, c, d] = self.0;
        2.0 * c + 6.0 * d * place
    }

    /// Its third derivative.
    pub(in crate::models) fn twist(&self) -> f64 {
        6.0 * self.0[3]
    }

    /// Another one added, times a factor.
    pub(in crate::models) fn plus(&self, factor: f64, other: &Self) -> Self {
        Self(core::array::from_fn(|k| self.0[k] + factor * other.0[k]))
    }

    /// Its derivative as a polynomial.
    pub(in crate::models) fn derivative(&self) -> Self {
        let [_, b, c, d] = self.0;
        Self([b, 2.0 * c, 3.0 * d, 0.0])
    }

    /// The least and the largest value of its derivative between two places.
    pub(in crate::models) fn slopes(&self, low: f64, high: f64) -> (f64, f64) {
        // Where the derivative turns, if that is between them.
        let turn = (-self.curvature(0.0) / self.twist()).clamp(low, high);
        let inner = if turn.is_nan() { low } else { turn };
        let at = [low, inner, high].map(|place| self.slope(place));
        (
            at.into_iter().fold(f64::INFINITY, f64::min),
            at.into_iter().fold(-f64::INFINITY, f64::max),
        )
    }
}

/// The curve: one cubic below its range, one in it, one above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::models) struct CubicCurve {
    /// End of the range, V.
    pub(in crate::models) low: f64,
    /// End of the range, V.
    pub(in crate::models) high: f64,
    /// The polynomials.
    pub(in crate::models) parts: [Cubic; 3],
}

impl CubicCurve {
    /// From a polynomial and its range, V.
    pub(in crate::models) fn new(inside: Cubic, (low, high): (f64, f64)) -> Self {
        let tangent = |place: f64| {
            let slope = inside.slope(place);
            Cubic([inside.at(place) - slope * place, slope, 0.0, 0.0])
        };
        Self { low, high, parts: [tangent(low), inside, tangent(high)] }
    }

    /// Its value.
    #[inline]
    pub(in crate::models) fn at(&self, volts: f64) -> f64 {
        self.parts[self.part(volts, true).0].at(volts)
    }

    /// Which polynomial holds just beyond `volts` on a rise or a fall, and up to where.
    #[inline]
    pub(in crate::models) fn part(&self, volts: f64, rises: bool) -> (usize, f64) {
        let Self { low, high, .. } = *self;
        match (rises, volts) {
            (true, volts) if volts < low => (0, low),
            (true, volts) if volts < high => (1, high),
            (true, _) => (2, f64::INFINITY),
            (false, volts) if volts > high => (2, high),
            (false, volts) if volts > low => (1, low),
            (false, _) => (0, f64::NEG_INFINITY),
        }
    }
}

/// The ends of a range of the drive, V.
///
/// # Errors
/// Names `low` or `high` where one is not finite, or not above the other.
pub(in crate::models) fn checked_range(low: f64, high: f64) -> Result<(f64, f64)> {
    let (low, high) = (finite("low", low, "V")?, finite("high", high, "V")?);
    if low < high {
        return Ok((low, high));
    }
    Err(Error::parameter("high", format!("{high} V"), format!("above low, {low} V")))
}
