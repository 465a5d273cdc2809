//! The gain of a stage on its settled loop, for small motions.

use piezotrack_control::hysteresis::{BoucWen, Operator};

use super::plant::LoopPlant;
use crate::error::{Error, Result, finite};
use crate::integrator::Mechanics;
use crate::models::{BoucWenStage, Dynamics, FirstOrderDahlStage, PrandtlIshlinskiiStage};

/// Cycles after which the loop counts as settled.
const CYCLES: u32 = 20;
/// Places on each branch at which the slope is read.
const PLACES: u32 = 200;

/// Gains over a range of voltages, m/V: the least, the mean over the settled loop, the largest.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Gains([f64; 3]);

impl Gains {
    /// Of an operator whose slope `gain` makes a gain of, on the loop from `low` to `high`, V.
    fn of<O: Operator<f64>>(
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
    fn plants(self, plant: impl Fn(f64) -> Result<LoopPlant>) -> Result<[LoopPlant; 3]> {
        let [least, mean, most] = self.0;
        Ok([plant(least)?, plant(mean)?, plant(most)?])
    }
}

impl LoopPlant {
    /// A Bouc-Wen stage on its settled loop between two voltages, V: with the least gain for
    /// small motions, the mean and the largest, `d - dh/du`.
    ///
    /// # Errors
    /// Names `low`, `high` or `limits` where they are no range; [`Error::Numerical`] where the
    /// hysteresis grows without bound in it.
    pub fn bouc_wen(stage: &BoucWenStage, low: f64, high: f64) -> Result<[Self; 3]> {
        let BoucWenStage { piezo_coefficient, alpha, beta, gamma, exponent, .. } = *stage;
        let operator = BoucWen { rise: alpha * piezo_coefficient, beta, gamma, exponent };
        let gains = Gains::of(&operator, low, high, |slope| piezo_coefficient - slope)?;
        let Mechanics { mass, damping, stiffness } = stage.mechanics;
        let natural = libm::sqrt(stiffness / mass);
        let ratio = 0.5 * damping / (mass * natural);
        gains.plants(|gain| Self::mode(gain, natural / core::f64::consts::TAU, ratio))
    }

    /// A stage with first-order Dahl friction on its settled loop between the displacements that
    /// two voltages lead to without friction: `T/(K + dF/dx)` in the same way.
    ///
    /// # Errors
    /// As [`Self::bouc_wen`].
    pub fn first_order_dahl(stage: &FirstOrderDahlStage, low: f64, high: f64) -> Result<[Self; 3]> {
        let (Mechanics { mass, damping, stiffness }, piezo) =
            (stage.mechanics, stage.piezo_coefficient);
        let ends = [low, high].map(|volts| piezo * volts / stiffness);
        let ends = if piezo < 0.0 { [ends[1], ends[0]] } else { ends };
        let gain = |slope: f64| piezo / (stiffness + slope);
        let gains = Gains::of(&stage.operator(), ends[0], ends[1], gain)?;
        gains.plants(|gain| {
            let mechanics = Mechanics { mass, damping, stiffness: piezo / gain };
            Self::mechanical(&mechanics, piezo)
        })
    }

    /// A Prandtl-Ishlinskii stage in the same way; its creep is slower than a loop and left out.
    ///
    /// # Errors
    /// As [`Self::bouc_wen`].
    pub fn plays(stage: &PrandtlIshlinskiiStage, low: f64, high: f64) -> Result<[Self; 3]> {
        let gains = Gains::of(&stage.plays, low, high, |slope| slope)?;
        gains.plants(|gain| match stage.relaxation.dynamics {
            Dynamics::None => Self::fixed_gain(gain),
            Dynamics::First { time } => {
                Self::fixed_gain(gain)?.with_amplifier(1.0 / (core::f64::consts::TAU * time))
            }
            Dynamics::Second { frequency, damping_ratio } => {
                Self::mode(gain, frequency, damping_ratio)
            }
        })
    }
}
