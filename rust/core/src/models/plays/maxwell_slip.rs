//! The Maxwell-slip stage: elasto-slide elements in parallel with a spring.
//!
//! ```text
//! k x + sum_i F_i = T u,   F_i = k_i e_i
//! e_i = min(r_i, max(-r_i, e_i + dx)),   r_i = f_i/k_i
//! ```
//!
//! Goldfarb and Celanovic 1997, IEEE Control Systems 17(3), 69-79, doi 10.1109/37.588158: element i
//! is a spring `k_i` that slips at the force `f_i`. Without mass the drive is a weighted sum of stops
//! of the displacement, and the displacement therefore a weighted sum of plays of the drive, with
//! thresholds and weights in closed form (Krejci and Kuhnen 2001, doi 10.1049/ip-cta:20010375). With
//! the elements in the order of `r_i`, and `A_i = 1 + (k_(i+1) + ... + k_n)/k` the stiffness over k
//! once the first i of them slip,
//!
//! ```text
//! x = w_0 u + sum_i w_i z_i,   z_i a play of threshold s_i
//! w_0 = (T/k)/A_0,   w_i = (T/k)(1/A_i - 1/A_(i-1)),   s_i - s_(i-1) = A_(i-1) (r_i - r_(i-1))/|T/k|
//! ```
//!
//! So the stage is one of [`super::prandtl_ishlinskii::PrandtlIshlinskiiStage`], with dynamics behind its hysteresis, and
//! identified like it; its parameters are those of the elements. Drive and displacement determine
//! forces over k only.

use piezotrack_control::hysteresis::{Operator, PlayState};

use super::prandtl_ishlinskii::{
    MOST_PLAYS, PlayHysteresis, PrandtlIshlinskiiStage, checked_thresholds,
};
use crate::error::{Result, not_negative, not_zero};
use crate::models::input::input_model::InputModel;
use crate::models::input::input_stage::{InputOperator, InputStage, Remembering, Segmented};
use crate::models::input::superposition::{
    FittedWeights, Nodes, Rest, Signals, SignalsOf, Superposition,
};
use crate::models::parameters::dynamics_parameters::same_length;
use crate::models::parameters::values::{ParameterInfo, Values};
use crate::models::traits::StageModel;

const PARAMETERS: &[ParameterInfo] = &[
    ParameterInfo::new("piezo_coefficient", "T/k", "m/V"),
    ParameterInfo::list("stiffness_ratios", "k_i/k", ""),
    ParameterInfo::list("slip_displacements", "f_i/k_i", "m"),
];

/// Elasto-slide elements in parallel with a spring, as the plays that they are equivalent to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaxwellSlip {
    /// The plays, V to m.
    pub plays: PlayHysteresis,
}

/// A stage with elasto-slide elements.
///
/// ```
/// use piezotrack_core::models::{
///     Dynamics, Experiment, InputStage, MaxwellSlip, Relaxation, StageModel,
/// };
/// use piezotrack_core::signal::{Drive, Hold, NEVER};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// // A spring of 1 N/um with an element of half of it that slips at 4 um; 1 N/V.
/// let stage = InputStage {
///     operator: MaxwellSlip::new(1e-6, &[0.5], &[4e-6])?,
///     relaxation: Relaxation::new(&[], &[], Dynamics::None)?,
/// };
/// let drive = Drive::new(&[0.0, 12.0, 9.0], 0.01, Hold::First)?;
/// let run = stage.simulate(&Experiment::of(&drive, NEVER))?.unwrap();
/// assert!((run.x[1] - 10e-6).abs() < 1e-18); // 10 N + 2 N
/// assert!((run.x[2] - 8e-6).abs() < 1e-18); // 8 N + 1 N
/// # Ok(())
/// # }
/// ```
pub type MaxwellSlipStage = InputStage<MaxwellSlip>;

impl MaxwellSlip {
    /// The elements with these stiffnesses over that of the spring, and these displacements at which
    /// they slip, m, of a spring with this displacement for 1 V, m.
    ///
    /// # Errors
    /// [`crate::Error::Shape`] where entries are missing or too many, [`crate::Error::Parameter`]
    /// where one is out of its range.
    pub fn new(gain: f64, ratios: &[f64], slips: &[f64]) -> Result<Self> {
        not_zero("piezo_coefficient", gain, "m/V")?;
        let names = ("stiffness_ratios", "slip_displacements");
        same_length(names.0, ratios.len(), names.1, slips.len(), MOST_PLAYS)?;
        for (i, ratio) in ratios.iter().enumerate() {
            not_negative(&format!("stiffness_ratios[{i}]"), *ratio, "")?;
        }
        let slips = checked_thresholds("slip_displacements", slips, "m")?;
        let mut held = 1.0 + ratios.iter().rev().sum::<f64>();
        let linear = gain / held;
        let (mut volts, mut before) = (0.0, 0.0);
        let (mut thresholds, mut weights) = (Vec::new(), Vec::new());
        for (i, (ratio, slip)) in ratios.iter().zip(slips).enumerate() {
            volts += held * (slip - before) / gain.abs();
            // The sum anew, not a difference, which would leave the roundings of the others.
            let left = 1.0 + ratios[i + 1..].iter().rev().sum::<f64>();
            weights.push(gain * ratio / (held * left));
            thresholds.push(volts);
            (held, before) = (left, slip);
        }
        Ok(Self { plays: PlayHysteresis::new(linear, &thresholds, &weights, &[], &[])? })
    }
}

/// Displacement for 1 V, stiffness ratios and slip displacements of plays with this linear part and
/// these thresholds and weights: what [`MaxwellSlip::new`] undoes.
fn elements(linear: f64, thresholds: &[f64], weights: &[f64]) -> [Vec<f64>; 3] {
    let gain = linear + weights.iter().sum::<f64>();
    let (mut sum, mut slip, mut before) = (linear, 0.0, 0.0);
    let (mut ratios, mut slips) = (Vec::new(), Vec::new());
    for (threshold, weight) in thresholds.iter().zip(weights) {
        slip += sum.abs() * (threshold - before);
        slips.push(slip);
        ratios.push(gain * weight / (sum * (sum + weight)));
        (sum, before) = (sum + weight, *threshold);
    }
    [vec![gain], ratios, slips]
}

impl InputOperator for MaxwellSlip {
    type State = PlayState<f64, MOST_PLAYS>;

    fn rest(&self) -> Self::State {
        self.plays.rest()
    }

    #[inline(always)]
    fn follow(&self, state: &mut Self::State, volts: f64) -> f64 {
        self.plays.follow(state, volts)
    }

    #[inline(always)]
    fn input(&self, state: &Self::State) -> f64 {
        state.input
    }
}

impl Remembering for MaxwellSlip {
    fn memory(&self, state: &Self::State) -> Vec<f64> {
        self.plays.memory(state)
    }

    fn recall(
        &self,
        state: &mut Self::State,
        volts: f64,
        memory: &[f64],
    ) -> core::result::Result<(), String> {
        self.plays.recall(state, volts, memory)
    }
}

impl Segmented for MaxwellSlip {
    fn next_breakpoint(&self, state: &Self::State, volts: f64, deviation: f64) -> f64 {
        self.plays.next_breakpoint(state, volts, deviation)
    }

    fn largest_curvature(&self) -> f64 {
        self.plays.largest_curvature()
    }

    fn slope_jump(&self) -> f64 {
        self.plays.slope_jump()
    }
}

impl InputModel for MaxwellSlip {
    const NAME: &'static str = "maxwell-slip";
    const TITLE: &'static str = "Maxwell slip";
    const PARAMETERS: &'static [ParameterInfo] = PARAMETERS;

    type Inverse = <PlayHysteresis as InputModel>::Inverse;

    fn build(values: &Values) -> Result<Self> {
        MaxwellSlip::new(
            values.number("piezo_coefficient"),
            values.list("stiffness_ratios"),
            values.list("slip_displacements"),
        )
    }

    fn path(&self) -> &impl Operator<f64> {
        &self.plays.plays
    }

    fn inverse(&self, dt: f64) -> Result<Self::Inverse> {
        self.plays.inverse(dt)
    }

    fn start(&self, inverse: &Self::Inverse, state: &Self::State) -> PlayState<f64, MOST_PLAYS> {
        self.plays.start(inverse, state)
    }
}

impl MaxwellSlipStage {
    /// The same stage with the plays.
    #[must_use]
    pub fn as_plays(&self) -> PrandtlIshlinskiiStage {
        InputStage { operator: self.operator.plays, relaxation: self.relaxation }
    }
}

/// Plays are found, and say which elements they are.
impl Superposition for MaxwellSlipStage {
    const NODES: Nodes = Nodes::Thresholds;

    fn signals(of: &SignalsOf<'_>) -> Box<dyn Signals> {
        PrandtlIshlinskiiStage::signals(of)
    }

    fn values(fitted: &FittedWeights) -> Values {
        let operator = elements(fitted.linear, &fitted.nodes, &fitted.weights);
        Values::of(Self::INFO.parameters, operator.into_iter().chain(fitted.relaxation.values()))
    }

    fn state_at_rest(rest: &Rest<'_>) -> Values {
        PrandtlIshlinskiiStage::state_at_rest(rest)
    }
}
