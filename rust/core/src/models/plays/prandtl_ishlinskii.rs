//! The Prandtl-Ishlinskii stage: plays with dead zones at the input, creep, linear dynamics.
//!
//! ```text
//! p = w_0 u + sum_i w_i z_i,  z_i = max(u - r_i, min(u + r_i, z_i))
//! H = S(p),  S(p) = p + sum_j s_j max(p - d_j, 0)
//! ```
//!
//! Kuhnen 2003, European Journal of Control 9(4), 407-418, doi 10.3166/ejc.9.407-418, with the
//! weights in m/V; [`InputStage`] says what follows the operator.
//!
//! Where `w_0` and all `w_i` are negative the displacement falls as the drive rises. The dead zones
//! act on p as before: with the signs of all weights turned, the stage does under -u what it did
//! under u.

use piezotrack_control::PlayInverse;
use piezotrack_control::hysteresis::{Operator, Play, PlayState};

use crate::error::{Error, Result, finite, not_negative, shown};
use crate::models::input::input_model::InputModel;
use crate::models::input::input_stage::{
    InputOperator, InputStage, PLAYS_STATE, Remembering, Segmented, recall_plays, state_at_rest,
};
use crate::models::input::superposition::{
    FittedWeights, Nodes, Plain, PlaySignals, Rest, Signals, SignalsOf, Superposition,
};
use crate::models::parameters::dynamics_parameters::same_length;
use crate::models::parameters::values::{ParameterInfo, Values};
use crate::models::traits::StageModel;

/// Most plays of a stage.
pub const MOST_PLAYS: usize = 32;

/// Most dead zones of a stage.
pub const MOST_ZONES: usize = 8;

/// The play operators, V to m; those plays and dead zones that are not used weigh 0.
pub type Plays = Play<f64, MOST_PLAYS, MOST_ZONES>;

const PARAMETERS: &[ParameterInfo] = &[
    ParameterInfo::new("linear", "w0", "m/V"),
    ParameterInfo::list("thresholds", "r", "V"),
    ParameterInfo::list("weights", "w", "m/V"),
    ParameterInfo::list("dead_zone_thresholds", "d", "m"),
    ParameterInfo::list("dead_zone_weights", "s", ""),
];

/// Plays with dead zones, and how many of the plays are used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlayHysteresis {
    /// The operator.
    pub plays: Plays,
    /// Plays that are used.
    pub count: usize,
    /// Dead zones that are used.
    pub zones: usize,
}

/// A stage with play operators at its input.
///
/// ```
/// use piezotrack_core::models::{
///     Dynamics, Experiment, PlayHysteresis, PrandtlIshlinskiiStage, Relaxation, StageModel,
/// };
/// use piezotrack_core::signal::{Drive, Hold, NEVER};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let stage = PrandtlIshlinskiiStage {
///     operator: PlayHysteresis::new(1e-6, &[10.0, 20.0], &[0.2e-6, 0.1e-6], &[], &[])?,
///     relaxation: Relaxation::new(&[], &[], Dynamics::None)?,
/// };
/// let drive = Drive::new(&[0.0, 50.0, 0.0], 0.01, Hold::First)?;
/// let run = stage.simulate(&Experiment::of(&drive, NEVER))?.unwrap();
/// assert!((run.x[1] - 61e-6).abs() < 1e-15);
/// assert!((run.x[2] - 4e-6).abs() < 1e-15); // the plays stay behind
/// # Ok(())
/// # }
/// ```
pub type PrandtlIshlinskiiStage = InputStage<PlayHysteresis>;

impl PlayHysteresis {
    /// The hysteresis from its parameters: weights in m/V, all of one sign, thresholds in V, those
    /// of the dead zones in m.
    ///
    /// # Errors
    /// [`Error::Shape`] where entries are missing or too many, [`Error::Parameter`] where one is
    /// out of its range.
    pub fn new(
        linear: f64,
        thresholds: &[f64],
        weights: &[f64],
        dead_zone_thresholds: &[f64],
        dead_zone_weights: &[f64],
    ) -> Result<Self> {
        let sign = direction(linear)?;
        let count = thresholds.len();
        same_length("weights", weights.len(), "thresholds", count, MOST_PLAYS)?;
        let names = ("dead_zone_weights", "dead_zone_thresholds");
        same_length(
            names.0,
            dead_zone_weights.len(),
            names.1,
            dead_zone_thresholds.len(),
            MOST_ZONES,
        )?;
        let mut plays = Plays {
            linear,
            // What is not used weighs 0; it stands at the end so that all ascend.
            thresholds: [thresholds.last().copied().unwrap_or(0.0); MOST_PLAYS],
            weights: [0.0; MOST_PLAYS],
            dead_zone_thresholds: [dead_zone_thresholds.last().copied().unwrap_or(0.0); MOST_ZONES],
            dead_zone_weights: [0.0; MOST_ZONES],
        };
        plays.thresholds[..count].copy_from_slice(&checked_thresholds(
            "thresholds",
            thresholds,
            "V",
        )?);
        for (i, weight) in weights.iter().enumerate() {
            plays.weights[i] = along(&format!("weights[{i}]"), *weight, "m/V", sign)?;
        }
        let (mut before, mut slope) = (f64::NEG_INFINITY, 1.0);
        for j in 0..dead_zone_thresholds.len() {
            let name = format!("dead_zone_thresholds[{j}]");
            before = ascending(&name, finite(&name, dead_zone_thresholds[j], "m")?, before, "m")?;
            let name = format!("dead_zone_weights[{j}]");
            slope += finite(&name, dead_zone_weights[j], "")?;
            if slope <= 0.0 {
                let expected =
                    "dead-zone weights whose sums stay above -1, or the curve turns back";
                return Err(Error::parameter(name, dead_zone_weights[j], expected));
            }
            (plays.dead_zone_thresholds[j], plays.dead_zone_weights[j]) =
                (before, dead_zone_weights[j]);
        }
        Ok(Self { plays, count, zones: dead_zone_thresholds.len() })
    }
}

/// The sign of a gain (m/V) that is not 0.
pub(in crate::models) fn direction(linear: f64) -> Result<f64> {
    if linear.is_finite() && linear != 0.0 {
        return Ok(linear.signum());
    }
    let found = format!("{} m/V", shown(linear));
    Err(Error::parameter("linear", found, "a finite number other than 0"))
}

/// A weight that does not work against `linear`, whose sign is given.
pub(in crate::models) fn along(name: &str, weight: f64, unit: &str, sign: f64) -> Result<f64> {
    if sign * finite(name, weight, unit)? >= 0.0 {
        return Ok(weight);
    }
    let side = if sign > 0.0 { "0 or above" } else { "0 or below" };
    let expected = format!("a finite number, {side}, as linear is");
    Err(Error::parameter(name, format!("{} {unit}", shown(weight)), expected))
}

/// Thresholds, which are not below 0 and ascend.
pub(in crate::models) fn checked_thresholds(
    of: &str,
    thresholds: &[f64],
    unit: &str,
) -> Result<Vec<f64>> {
    let mut before = 0.0;
    let check = |(i, threshold): (usize, &f64)| {
        let name = format!("{of}[{i}]");
        before = ascending(&name, not_negative(&name, *threshold, unit)?, before, unit)?;
        Ok(before)
    };
    thresholds.iter().enumerate().map(check).collect()
}

fn ascending(name: &str, value: f64, before: f64, unit: &str) -> Result<f64> {
    if value >= before {
        return Ok(value);
    }
    let expected = format!("{before} {unit} or above: they ascend");
    Err(Error::parameter(name, format!("{value} {unit}"), expected))
}

impl InputOperator for PlayHysteresis {
    type State = PlayState<f64, MOST_PLAYS>;

    fn rest(&self) -> Self::State {
        self.plays.rest()
    }

    #[inline(always)]
    fn follow(&self, state: &mut Self::State, volts: f64) -> f64 {
        self.plays.follow_used(state, volts, (self.count, self.zones))
    }

    #[inline(always)]
    fn input(&self, state: &Self::State) -> f64 {
        state.input
    }
}

impl Remembering for PlayHysteresis {
    fn memory(&self, state: &Self::State) -> Vec<f64> {
        state.plays[..self.count].to_vec()
    }

    fn recall(
        &self,
        state: &mut Self::State,
        _volts: f64,
        memory: &[f64],
    ) -> core::result::Result<(), String> {
        recall_plays(&mut state.plays[..self.count], memory)
    }
}

impl Segmented for PlayHysteresis {
    fn next_breakpoint(&self, state: &Self::State, volts: f64, _deviation: f64) -> f64 {
        self.plays.straight(state, volts, self.count)
    }

    fn largest_curvature(&self) -> f64 {
        0.0
    }

    fn slope_jump(&self) -> f64 {
        let Plays { linear, weights, dead_zone_weights, .. } = &self.plays;
        let moving: f64 = weights.iter().map(|weight| weight.abs()).sum();
        let bent: f64 = dead_zone_weights.iter().map(|weight| weight.abs()).sum();
        moving + (linear.abs() + moving) * bent
    }
}

impl PrandtlIshlinskiiStage {
    /// Values of its parameters.
    #[must_use]
    pub fn parameters(&self) -> Values {
        let PlayHysteresis { plays, count, zones } = &self.operator;
        let operator = [
            vec![plays.linear],
            plays.thresholds[..*count].to_vec(),
            plays.weights[..*count].to_vec(),
            plays.dead_zone_thresholds[..*zones].to_vec(),
            plays.dead_zone_weights[..*zones].to_vec(),
        ];
        Values::of(Self::INFO.parameters, operator.into_iter().chain(self.relaxation.values()))
    }
}

impl InputModel for PlayHysteresis {
    const NAME: &'static str = "prandtl-ishlinskii";
    const TITLE: &'static str = "Prandtl-Ishlinskii";
    const PARAMETERS: &'static [ParameterInfo] = PARAMETERS;

    type Inverse = PlayInverse<MOST_PLAYS, MOST_ZONES>;

    fn build(values: &Values) -> Result<Self> {
        let list = |name| values.list(name);
        PlayHysteresis::new(
            values.number("linear"),
            list("thresholds"),
            list("weights"),
            list("dead_zone_thresholds"),
            list("dead_zone_weights"),
        )
    }

    fn path(&self) -> &impl Operator<f64> {
        &self.plays
    }

    fn inverse(&self, _dt: f64) -> Result<Self::Inverse> {
        Ok(PlayInverse::new(&self.plays)?)
    }

    fn start(&self, inverse: &Self::Inverse, state: &Self::State) -> PlayState<f64, MOST_PLAYS> {
        inverse.memory(&self.plays, state)
    }
}

impl Superposition for PrandtlIshlinskiiStage {
    const DEAD_ZONES: bool = true;
    const NODES: Nodes = Nodes::Thresholds;

    fn signals(of: &SignalsOf<'_>) -> Box<dyn Signals> {
        Box::new(PlaySignals { edges: Plain, thresholds: of.nodes.to_vec() })
    }

    fn values(fitted: &FittedWeights) -> Values {
        let of = fitted.clone();
        let relaxation = of.relaxation.values();
        let operator =
            [vec![of.linear], of.nodes, of.weights, of.dead_zone_thresholds, of.dead_zone_weights];
        Values::of(Self::INFO.parameters, operator.into_iter().chain(relaxation))
    }

    /// Without the play of the drive.
    fn state_at_rest(rest: &Rest<'_>) -> Values {
        state_at_rest(PLAYS_STATE, rest, rest.memory.get(1..).unwrap_or(&[]))
    }
}
