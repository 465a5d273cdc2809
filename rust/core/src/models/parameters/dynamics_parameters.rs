//! Creep and linear dynamics as parameters of a stage, and as the plant of a loop.

use super::values::{ParameterInfo, Values};
use crate::design::LoopPlant;
use crate::error::{Error, Result, not_negative, positive};
use crate::models::creep::{Dynamics, FURTHER, Mode, Relaxation};

/// Parameters of creep and dynamics, which follow those of the operator.
pub(in crate::models) const DYNAMICS: [ParameterInfo; 8] = [
    ParameterInfo::list("creep_weights", "c", ""),
    ParameterInfo::list("creep_times", "tau", "s"),
    ParameterInfo::optional("time_constant", "T", "s"),
    ParameterInfo::optional("frequency", "fn", "Hz"),
    ParameterInfo::optional("damping_ratio", "zeta", ""),
    ParameterInfo::list("mode_weights", "g", "").or_none(),
    ParameterInfo::list("mode_frequencies", "f", "Hz").or_none(),
    ParameterInfo::list("mode_damping_ratios", "zeta_k", "").or_none(),
];

impl Relaxation {
    /// Creep and dynamics from the values of a stage.
    pub(in crate::models) fn build(values: &Values) -> Result<Self> {
        let list = |name| values.list(name);
        let modal = (list("time_constant"), list("frequency"), list("damping_ratio"));
        let dynamics = match modal {
            ([], [], []) => Dynamics::None,
            ([time], [], []) => Dynamics::First { time: *time },
            ([], [frequency], [damping_ratio]) => {
                let further = further_modes(values)?;
                Dynamics::modes(*frequency, *damping_ratio, &further)?
            }
            ([time, ..], _, _) => {
                let expected = "None beside a frequency or a damping ratio";
                return Err(Error::parameter("time_constant", format!("{time} s"), expected));
            }
            _ => {
                let expected = "both or neither";
                return Err(Error::parameter("frequency and damping_ratio", "one", expected));
            }
        };
        if !(list("mode_weights").is_empty() || matches!(dynamics, Dynamics::Modes(_))) {
            let found = format!("{} entries", list("mode_weights").len());
            let expected = "none without a frequency and a damping ratio";
            return Err(Error::parameter("mode_weights", found, expected));
        }
        Self::new(list("creep_weights"), list("creep_times"), dynamics)
    }

    /// The values of creep and dynamics, in the order of [`DYNAMICS`].
    pub(in crate::models) fn values(&self) -> [Vec<f64>; 8] {
        let creep = self.used();
        let [time, frequency, damping_ratio] = match self.dynamics {
            Dynamics::None => [vec![], vec![], vec![]],
            Dynamics::First { time } => [vec![time], vec![], vec![]],
            Dynamics::Second { frequency, damping_ratio } => {
                [vec![], vec![frequency], vec![damping_ratio]]
            }
            Dynamics::Modes(modes) => {
                let [main, ..] = modes.all();
                [vec![], vec![main.frequency], vec![main.damping_ratio]]
            }
        };
        let further = self.dynamics.further();
        let each = |number: fn(&Mode) -> f64| further.iter().map(number).collect();
        let weights = creep.iter().map(|creep| creep.share).collect();
        let times = creep.iter().map(|creep| creep.time).collect();
        [
            weights,
            times,
            time,
            frequency,
            damping_ratio,
            each(|mode| mode.weight),
            each(|mode| mode.frequency),
            each(|mode| mode.damping_ratio),
        ]
    }

    /// A stage of some static gain (m/V) with these dynamics; its creep is slower than a loop and
    /// left out.
    pub(in crate::models) fn loop_plant(&self, gain: f64) -> Result<LoopPlant> {
        match self.dynamics {
            Dynamics::None => LoopPlant::fixed_gain(gain),
            Dynamics::First { time } => {
                LoopPlant::fixed_gain(gain)?.with_amplifier(1.0 / (core::f64::consts::TAU * time))
            }
            Dynamics::Second { frequency, damping_ratio } => {
                LoopPlant::mode(gain, frequency, damping_ratio)
            }
            Dynamics::Modes(modes) => {
                let each = |mode: &Mode| (gain * mode.weight, mode.frequency, mode.damping_ratio);
                let modes: Vec<_> = modes.used().iter().map(each).collect();
                LoopPlant::modes(&modes)
            }
        }
    }
}

/// The modes beside the main one, from the values of a stage.
fn further_modes(values: &Values) -> Result<Vec<Mode>> {
    let [weights, frequencies, damping_ratios] =
        ["mode_weights", "mode_frequencies", "mode_damping_ratios"].map(|name| values.list(name));
    same_length("mode_frequencies", frequencies.len(), "mode_weights", weights.len(), FURTHER)?;
    let (name, found) = ("mode_damping_ratios", damping_ratios.len());
    same_length(name, found, "mode_weights", weights.len(), FURTHER)?;
    let mode = |k: usize| {
        let (name, weight) = (format!("mode_weights[{k}]"), weights[k]);
        if weight.abs() >= 1.0 || weight.is_nan() {
            return Err(Error::parameter(name, weight, "a number between -1 and 1"));
        }
        let frequency = positive(&format!("mode_frequencies[{k}]"), frequencies[k], "Hz")?;
        let name = format!("mode_damping_ratios[{k}]");
        Ok(Mode { weight, frequency, damping_ratio: not_negative(&name, damping_ratios[k], "")? })
    };
    (0..weights.len()).map(mode).collect()
}

/// Refuses lists of different lengths, and longer ones than there is room for.
pub(in crate::models) fn same_length(
    name: &str,
    found: usize,
    other: &str,
    wanted: usize,
    most: usize,
) -> Result<()> {
    if found == wanted && found <= most {
        return Ok(());
    }
    Err(Error::Shape {
        name: name.into(),
        found: format!("{found} entries"),
        expected: format!("as many as {other}, which has {wanted}, and {most} at most"),
    })
}
