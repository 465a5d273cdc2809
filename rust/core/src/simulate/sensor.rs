//! The displacement sensor: noise of a bandwidth, a smallest step, a range, a zero, a delay.

use piezotrack_control::Number;

use crate::error::{Error, Result, finite, not_negative};
use crate::math::Draws;

/// A displacement sensor.
///
/// The noise is white noise through a first-order low-pass: its autocorrelation over a time t
/// is `exp(-2 pi bandwidth t)`, at whatever instants it is read. Readings are whole multiples of
/// the resolution, and stop at the ends of the range.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `noise` | | m rms | >= 0 |
/// | `bandwidth` | | Hz | > 0, infinite for white noise |
/// | `resolution` | | m | >= 0, 0 for none |
/// | `range` | | m | > `resolution`, may be infinite |
/// | `delay` | | s | >= 0 |
/// | `offset` | | m | finite |
/// | `seed` | | | any |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Noise before quantisation, m rms.
    pub noise: f64,
    /// Frequency at which its spectrum has lost 3 dB, Hz.
    pub bandwidth: f64,
    /// Smallest step of the reading, m.
    pub resolution: f64,
    /// Displacement that can be read to either side, m.
    pub range: f64,
    /// Time by which the displacement read is older than the reading, s.
    pub delay: f64,
    /// Reading of a stage that has never moved, or is preconditioned, m.
    pub offset: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// Memory of a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorState {
    /// Readings so far.
    pub count: u64,
    /// Noise in the last one, m.
    pub noise: f64,
    /// Displacement that reads 0, m.
    pub zero: f64,
}

impl Sensor {
    /// Reads the displacement as it is.
    pub const IDEAL: Self = Self {
        noise: 0.0,
        bandwidth: f64::INFINITY,
        resolution: 0.0,
        range: f64::INFINITY,
        delay: 0.0,
        offset: 0.0,
        seed: 0,
    };

    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the number that is out of its range.
    pub fn validate(&self) -> Result<()> {
        not_negative("noise", self.noise, "m")?;
        not_negative("resolution", self.resolution, "m")?;
        if self.bandwidth.is_nan() || self.bandwidth <= 0.0 {
            let found = format!("{} Hz", self.bandwidth);
            return Err(Error::parameter("noise_bandwidth", found, "above 0, or infinity"));
        }
        if self.range.is_nan() || self.range <= self.resolution {
            let found = format!("{} m", self.range);
            return Err(Error::parameter("range", found, "more than the resolution"));
        }
        not_negative("delay", self.delay, "s")?;
        finite("offset", self.offset, "m")?;
        Ok(())
    }

    /// The memory before any reading: 0 m read as the offset.
    #[must_use]
    pub fn rest(&self) -> SensorState {
        SensorState { zero: -self.offset, ..SensorState::default() }
    }

    /// Makes `displacement`, m, read the offset, to the nearest step of the sensor.
    pub fn set_zero(&self, state: &mut SensorState, displacement: f64) {
        state.zero = self.quantised(displacement) - self.offset;
    }

    /// The reading, m, at `displacement`, m, `interval` seconds after the one before.
    #[must_use]
    pub fn read(&self, state: &mut SensorState, displacement: f64, interval: f64) -> f64 {
        let noise = self.next_noise(state, interval);
        self.quantised(displacement + noise) - state.zero
    }

    /// The noise of the next reading, m.
    pub(crate) fn next_noise(&self, state: &mut SensorState, interval: f64) -> f64 {
        if self.noise > 0.0 {
            let memory = if state.count == 0 {
                0.0
            } else {
                libm::exp(-core::f64::consts::TAU * self.bandwidth * interval.max(1e-12))
            };
            let fresh = self.noise * libm::sqrt(1.0 - memory * memory);
            state.noise = memory * state.noise + fresh * Draws::normal(self.seed, state.count);
        }
        state.count += 1;
        state.noise
    }

    /// The nearest value that can be read, m, of one displacement or of lanes of them; the lowest
    /// where that is NaN.
    #[inline(always)]
    pub(crate) fn quantised<N: Number<Lane = f64>>(&self, value: N) -> N {
        if self.resolution == 0.0 {
            return value.like(-self.range).larger(value).smaller(value.like(self.range));
        }
        // An even number of steps has one more below zero than above.
        let lowest = -(self.range / self.resolution).round();
        let step = value.like(self.resolution);
        let code = N::lanewise([value / step], |[code]| code.round());
        value.like(lowest).larger(code).smaller(value.like(-lowest - 1.0)) * step
    }
}
