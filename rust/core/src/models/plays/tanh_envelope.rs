//! An envelope that saturates: what bends the input of plays.

use crate::error::{Result, finite, positive};

/// Largest second derivative of tanh, 4 / (3 sqrt(3)).
pub(in crate::models) const MOST_BEND: f64 = 0.769_800_358_919_501;

/// An envelope: c0 tanh(c1 u + c2) + c3, V of V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TanhEnvelope {
    /// Half of its range, c0, V, above 0.
    pub scale: f64,
    /// Its slope relative to c0 where it is steepest, c1, 1/V, above 0.
    pub slope: f64,
    /// Its argument at 0 V, c2.
    pub shift: f64,
    /// The middle of its range, c3, V.
    pub level: f64,
}

impl TanhEnvelope {
    /// Where it takes an input, V.
    #[must_use]
    #[inline]
    pub fn at(&self, volts: f64) -> f64 {
        self.with_slope(volts).0
    }

    /// Where it takes an input, V, and its slope there.
    #[must_use]
    #[inline]
    pub fn with_slope(&self, volts: f64) -> (f64, f64) {
        let bend = libm::tanh(self.slope * volts + self.shift);
        let slope = self.scale * self.slope * (1.0 - bend) * (1.0 + bend);
        (self.scale * bend + self.level, slope)
    }

    /// The input that it takes to `edge`, V; NaN or infinity beyond its range.
    #[must_use]
    #[inline]
    pub fn inverse(&self, edge: f64) -> f64 {
        (libm::atanh((edge - self.level) / self.scale) - self.shift) / self.slope
    }

    /// Of its four numbers, named after `prefix`.
    pub(in crate::models) fn checked(
        prefix: &str,
        [scale, slope, shift, level]: [f64; 4],
    ) -> Result<Self> {
        Ok(Self {
            scale: positive(&format!("{prefix}scale"), scale, "V")?,
            slope: positive(&format!("{prefix}slope"), slope, "1/V")?,
            shift: finite(&format!("{prefix}shift"), shift, "")?,
            level: finite(&format!("{prefix}level"), level, "V")?,
        })
    }

    /// The envelope of a fit, from the numbers of its shape and the range of the drive, V.
    ///
    /// It passes through 0 at 0 V, where the plays rest, and rises over the drive's range by as
    /// much as the drive does: thresholds and weights mean what they do without it. Its scale
    /// could be traded for the weights otherwise.
    #[must_use]
    pub fn fitted(shape: &[f64], (low, high): (f64, f64)) -> Self {
        let [ratio, bend] = [0, 1].map(|i| shape.get(i).copied().unwrap_or(1.0));
        // The ratio is cosh^2(A - B)/cosh^2(A + B), A the argument in the middle.
        let root = libm::sqrt(ratio);
        let lean = (1.0 - root) / (1.0 + root);
        let half = libm::hypot(libm::atanh(lean), bend);
        let middle = libm::atanh(lean / libm::tanh(half));
        let slope = 2.0 * half / (high - low);
        let bare =
            Self { scale: 1.0, slope, shift: middle - 0.5 * slope * (low + high), level: 0.0 };
        let scale = (high - low) / (bare.at(high) - bare.at(low));
        Self { scale, level: -scale * bare.at(0.0), ..bare }
    }
}
