//! The gain of a stage on its settled loop, for small motions.

use piezotrack_control::hysteresis::Operator;

use super::plant::LoopPlant;
use crate::error::{Error, Result, finite};

/// Cycles after which the loop counts as settled.
const CYCLES: u32 = 20;
/// Places on each branch at which the slope is read.
const PLACES: u32 = 200;

/// Gains over a range of voltages, m/V: the least, the mean over the settled loop, the largest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gains([f64; 3]);

impl Gains {
    /// Of an operator whose slope `gain` makes a gain of, on the loop from `low` to `high`, V.
    pub(crate) fn of<O: Operator<f64>>(
        operator: &O,
        low: f64,
        high: f64,
        gain: impl Fn(f64) -> f64,
    ) -> Result<Self> {
        finite("low", low, "V")?;
        finite("high", high, "V")?;
        let span = high - low;
        if span <= 0.0 {
            let found = format!("{low} V to {high} V");
            return Err(Error::parameter("limits", found, "the lower one below the upper one"));
        }
        let lead = |state: &O::State, way: f64| {
            let direction = if way < 0.0 { -1.0 } else { 1.0 };
            operator.along(&operator.branch(state, direction), way)
        };
        let mut state = lead(&operator.rest(), low);
        for _ in 0..CYCLES {
            state = lead(&lead(&state, span), -span);
        }
        let bottom = operator.output(&state).0;
        let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut read = |state: &O::State| {
            let here = gain(operator.output(state).1);
            (lowest, highest) = (lowest.min(here), highest.max(here));
        };
        let mut top = bottom;
        for direction in [1.0, -1.0] {
            let part = direction * span / f64::from(PLACES);
            // Just after the reversal, where most of the hysteresis stands still.
            read(&lead(&state, 1e-9 * part));
            for _ in 0..PLACES {
                state = lead(&state, part);
                read(&state);
            }
            if direction > 0.0 {
                top = operator.output(&state).0;
            }
        }
        let mean = gain((top - bottom) / span);
        if ![lowest, mean, highest].iter().all(|gain| gain.is_finite()) {
            return Err(Error::Numerical(format!(
                "the hysteresis does not stay finite from {low} V to {high} V: is it passive?"
            )));
        }
        Ok(Self(if mean < 0.0 { [highest, mean, lowest] } else { [lowest, mean, highest] }))
    }

    /// The plant with each of them.
    pub(crate) fn plants(self, plant: impl Fn(f64) -> Result<LoopPlant>) -> Result<[LoopPlant; 3]> {
        let [least, mean, most] = self.0;
        Ok([plant(least)?, plant(mean)?, plant(most)?])
    }
}
