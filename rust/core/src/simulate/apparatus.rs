//! A plant between its amplifier and its sensor, stepped through a stretch of time.

use std::ops::RangeInclusive;

use pulp::{Simd, WithSimd};

use super::amplifier::{Amplifier, AmplifierFlow};
use super::sensor::{Sensor, SensorState};
use crate::error::{Error, Result, positive};
use crate::math::dispatch_fused;
use crate::models::Plant;
use crate::signal::{Stop, index};

/// A plant between its amplifier and its sensor.
#[derive(Clone, Copy, Debug)]
pub struct Apparatus<'a, P> {
    /// Plant that is moved.
    pub plant: &'a P,
    /// Amplifier that turns the command into the applied voltage.
    pub amplifier: Amplifier,
    /// Sensor that reads the displacement.
    pub sensor: Sensor,
    /// Longest step of the simulation, s.
    pub step: f64,
}

/// State of an apparatus, from which an experiment can continue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApparatusState<S> {
    /// State of the plant.
    pub plant: S,
    /// Command that the amplifier follows, V.
    pub command: f64,
    /// Voltage that it gives, V.
    pub applied: f64,
    /// State of the sensor.
    pub sensor: SensorState,
}

/// Most steps of the simulation in one interval: beyond any use, and answered within a second.
const MOST_STEPS: f64 = 1e7;

/// Steps between two questions whether to stop: less than a millisecond.
const BLOCK: usize = 1 << 14;

/// Most instants of an experiment that are kept.
const MOST_INSTANTS: usize = 100_000_000;

impl<'a, P: Plant> Apparatus<'a, P> {
    /// A plant with nothing around it: the command is applied, the displacement read as it is.
    ///
    /// `step` is the longest step of the simulation, s.
    #[must_use]
    pub fn ideal(plant: &'a P, step: f64) -> Self {
        Self { plant, amplifier: Amplifier::IDEAL, sensor: Sensor::IDEAL, step }
    }

    /// The state before any command, with the sensor at its offset.
    #[must_use]
    pub fn rest(&self) -> ApparatusState<P::State> {
        let applied = self.amplifier.within_limits(0.0);
        let sensor = self.sensor.rest();
        ApparatusState { plant: self.plant.rest(), command: 0.0, applied, sensor }
    }

    /// True displacement from the sensor's zero, m.
    #[must_use]
    pub fn displacement(&self, state: &ApparatusState<P::State>) -> f64 {
        self.plant.displacement(&state.plant) - state.sensor.zero
    }

    /// Reads the sensor `interval` seconds after the last reading, m.
    pub fn read(&self, state: &mut ApparatusState<P::State>, interval: f64) -> f64 {
        self.read_beside(state, 0.0, interval)
    }

    /// As [`Self::read`], with `other` m of another axis in what the sensor sees.
    pub(super) fn read_beside(
        &self,
        state: &mut ApparatusState<P::State>,
        other: f64,
        interval: f64,
    ) -> f64 {
        let seen = self.plant.displacement(&state.plant) + other;
        self.sensor.read(&mut state.sensor, seen, interval)
    }

    /// Reads a displacement that the sensor saw, m, `interval` seconds after the last reading.
    pub(super) fn read_seen(
        &self,
        state: &mut ApparatusState<P::State>,
        seen: f64,
        interval: f64,
    ) -> f64 {
        self.sensor.read(&mut state.sensor, seen, interval)
    }

    /// Checks amplifier, sensor and step.
    pub(super) fn validate(&self) -> Result<()> {
        positive("step", self.step, "s")?;
        self.amplifier.validate()?;
        self.sensor.validate()
    }

    /// All that a stretch of `duration` seconds decides, cut into equal steps.
    pub(super) fn stretch(&self, duration: f64) -> Result<Stretch<P::Flow>> {
        let wanted = (duration / self.step * (1.0 - 1e-12)).ceil().max(1.0);
        if wanted > MOST_STEPS {
            return Err(Error::parameter(
                "step",
                format!("{:e} s", self.step),
                format!("{:e} s or more: at most {MOST_STEPS} steps fit", duration / MOST_STEPS),
            ));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 1e7")]
        let steps = wanted as usize;
        Ok(self.equal_steps(steps, duration / wanted))
    }

    /// All that so many steps of `step` seconds decide.
    pub(super) fn equal_steps(&self, steps: usize, step: f64) -> Stretch<P::Flow> {
        let (plant, amplifier) = (self.plant.flow(step), self.amplifier.flow(step));
        Stretch { steps, plant, amplifier }
    }

    /// Simulates a stretch of time in which the command is linear from one voltage to another;
    /// false where `stop` said so meanwhile.
    #[must_use]
    pub(super) fn drive(
        &self,
        stretch: &Stretch<P::Flow>,
        state: &mut ApparatusState<P::State>,
        command: [f64; 2],
        stop: Stop<'_>,
    ) -> bool {
        let mut done = 0;
        loop {
            let steps = done + 1..=stretch.steps.min(done + BLOCK);
            done = *steps.end();
            dispatch_fused(DriveStretch { apparatus: self, stretch, state, command, steps });
            if done == stretch.steps {
                return true;
            }
            if stop() {
                return false;
            }
        }
    }
}

/// A stretch of time, in equal steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch<F> {
    steps: usize,
    plant: F,
    amplifier: AmplifierFlow,
}

/// Steps through a stretch; dispatched for the fused multiply-add instruction.
struct DriveStretch<'a, P: Plant> {
    apparatus: &'a Apparatus<'a, P>,
    stretch: &'a Stretch<P::Flow>,
    state: &'a mut ApparatusState<P::State>,
    /// At the beginning and at the end of the stretch, V.
    command: [f64; 2],
    /// Those of its steps that are taken.
    steps: RangeInclusive<usize>,
}

impl<P: Plant> WithSimd for DriveStretch<'_, P> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { apparatus, stretch, state, command: [from, to], steps } = self;
        let part = (to - from) / index(stretch.steps);
        let first = *steps.start() - 1;
        let mut before = if first == 0 { from } else { part.mul_add(index(first), from) };
        for j in steps {
            let after = if j == stretch.steps { to } else { part.mul_add(index(j), from) };
            let (low, high) =
                apparatus.amplifier.advance(&stretch.amplifier, state.applied, before, after);
            apparatus.plant.advance(&stretch.plant, &mut state.plant, low, high);
            state.applied = high;
            before = after;
        }
        state.command = before;
    }
}

/// Refuses more instants than memory should hold.
pub(super) fn instants(name: &str, count: Option<usize>) -> Result<usize> {
    count.filter(|&count| count <= MOST_INSTANTS).ok_or_else(|| {
        Error::parameter(name, "too many", format!("{MOST_INSTANTS} instants at most"))
    })
}

/// Refuses a displacement that is not finite, reached at `time`, s.
pub(super) fn still_finite(displacement: f64, time: f64) -> Result<f64> {
    if displacement.is_finite() {
        return Ok(displacement);
    }
    Err(Error::Numerical(format!(
        "the simulated displacement is not finite at {time:.6} s: check that the plant's \
         parameters are in SI units, or that the loop is stable"
    )))
}
