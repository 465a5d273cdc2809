//! The amplifier: first-order lag, slew limit, output limits.

use piezotrack_control::Number;

use crate::error::{Error, Result};

/// A voltage amplifier of gain 1; its command is what it would give at rest.
///
/// ```text
/// v' = clip((clip(c, low, high) - v) / tau, -slew, slew),   tau = 1 / (2 pi bandwidth)
/// ```
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `bandwidth` | | Hz | > 0, may be infinite |
/// | `slew` | | V/s | > 0, may be infinite |
/// | `low`, `high` | | V | low < high, may be infinite |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Amplifier {
    /// Frequency at which a small signal has lost 3 dB, Hz.
    pub bandwidth: f64,
    /// Fastest change of the output, V/s.
    pub slew: f64,
    /// Lowest output, V.
    pub low: f64,
    /// Highest output, V.
    pub high: f64,
}

/// Coefficients of an amplifier that depend on the length of a step.
#[derive(Clone, Copy, Debug)]
pub struct AmplifierFlow {
    /// Share of a gap that is closed in a step, and share of a ramp within the step that is followed.
    closed: f64,
    followed: f64,
    /// Largest change in a step, V.
    most: f64,
    /// Whether the output is the command.
    ideal: bool,
}

impl Amplifier {
    /// Gives what is asked for, at once and without limits.
    pub const IDEAL: Self = Self {
        bandwidth: f64::INFINITY,
        slew: f64::INFINITY,
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };

    /// Checks the four numbers.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the number that is out of its range.
    pub fn validate(&self) -> Result<()> {
        for (name, value, unit) in [("bandwidth", self.bandwidth, "Hz"), ("slew", self.slew, "V/s")]
        {
            if value.is_nan() || value <= 0.0 {
                let expected = "a number above 0, or infinity";
                return Err(Error::parameter(name, format!("{value} {unit}"), expected));
            }
        }
        if !(self.low < self.high && self.low < f64::INFINITY && self.high > f64::NEG_INFINITY) {
            let found = format!("{} V to {} V", self.low, self.high);
            return Err(Error::parameter("limits", found, "the lower one below the upper one"));
        }
        Ok(())
    }

    /// Time constant, s.
    #[must_use]
    pub fn lag(&self) -> f64 {
        1.0 / (core::f64::consts::TAU * self.bandwidth)
    }

    /// The nearest voltage that the amplifier can give, V; of one amplifier or of lanes of them.
    #[inline(always)]
    #[must_use]
    pub fn within_limits<N: Number>(&self, volts: N) -> N {
        volts.larger(volts.like(self.low)).smaller(volts.like(self.high))
    }

    /// Works out steps of `step` seconds.
    #[must_use]
    pub fn flow(&self, step: f64) -> AmplifierFlow {
        let lag = self.lag();
        let reach = step / lag;
        let closed = -libm::expm1(-reach);
        AmplifierFlow {
            closed,
            followed: if reach < SHORT { followed_of_short(reach) } else { 1.0 - closed / reach },
            most: self.slew * step,
            ideal: lag == 0.0 && self.slew == f64::INFINITY,
        }
    }

    /// Output at both ends of a step, V, whose command is linear from `from` to `to`.
    ///
    /// The lag is exact; the slew limit is applied to the step as a whole.
    #[inline(always)]
    #[must_use]
    pub fn advance<N: Number>(&self, flow: &AmplifierFlow, output: N, from: N, to: N) -> (N, N) {
        let (from, to) = (self.within_limits(from), self.within_limits(to));
        if flow.ideal {
            return (from, to);
        }
        let number = |value: f64| output.like(value);
        let most = number(flow.most);
        let change = (from - output) * number(flow.closed) + (to - from) * number(flow.followed);
        (output, output + change.larger(-most).smaller(most))
    }
}

/// Steps over the time constant below which their ramp is followed by the power series, whose next
/// term is below the rounding of the first.
const SHORT: f64 = 1e-2;

/// `1 - (1 - exp(-s)) / s = s/2! - s^2/3! + ... - s^6/7!`, without the difference of nearly equal
/// numbers.
fn followed_of_short(s: f64) -> f64 {
    s / 2.0
        * (1.0 - s / 3.0 * (1.0 - s / 4.0 * (1.0 - s / 5.0 * (1.0 - s / 6.0 * (1.0 - s / 7.0)))))
}
