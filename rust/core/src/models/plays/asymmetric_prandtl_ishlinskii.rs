//! The asymmetric Prandtl-Ishlinskii stage: plays of the drive, and of a concave and a convex
//! function of it, at the input, creep, linear dynamics.
//!
//! ```text
//! H = w_0 u + sum_i w_i P_(r_i)[u] + sum_j v_j P_(s_j)[f(u)] + sum_k c_k P_(t_k)[g(u)]
//! f(u) = L (1 - (1 - s)^3),  g(u) = L s^3,  s = (u - low)/L,  L = high - low
//! ```
//!
//! A sum of generalised Prandtl-Ishlinskii operators, Al Janaideh, Rakheja and Su 2011, IEEE/ASME
//! Transactions on Mechatronics 16(4), 734-744, doi 10.1109/TMECH.2010.2052366;
//! [`AsymmetricPlay`] says more of f and g. They are fixed by the range: a record of loops of one
//! height determines how wide they are at every voltage, but not how f and g have to bend for that.
//! Least squares find the shares of the three families, and with them the side on which loops are
//! wider.

use piezotrack_control::hysteresis::{
    AsymmetricPlay, AsymmetricPlayState, Bend, Operator, PlayFamily,
};
use piezotrack_control::{AsymmetricPlayInverse, AsymmetricPlayInverseState};

use super::cubic_curve::checked_range;
use super::prandtl_ishlinskii::{MOST_PLAYS, along, checked_thresholds, direction};
use crate::error::Result;
use crate::models::input::input_model::InputModel;
use crate::models::input::input_stage::{
    InputOperator, InputStage, PLAYS_STATE, Remembering, Segmented, recall_plays, state_at_rest,
};
use crate::models::input::superposition::{
    FittedWeights, Nodes, Rest, Signals, SignalsOf, Superposition,
};
use crate::models::parameters::dynamics_parameters::same_length;
use crate::models::parameters::values::{ParameterInfo, Values};
use crate::models::traits::StageModel;
use crate::signal::index;

/// The operator of a stage, V to m.
pub type AsymmetricPlays = AsymmetricPlay<MOST_PLAYS>;

const PARAMETERS: &[ParameterInfo] = &[
    ParameterInfo::new("linear", "w0", "m/V"),
    ParameterInfo::new("low", "ua", "V"),
    ParameterInfo::new("high", "ub", "V"),
    ParameterInfo::list("thresholds", "r", "V"),
    ParameterInfo::list("weights", "w", "m/V"),
    ParameterInfo::list("concave_thresholds", "s", "V").or_none(),
    ParameterInfo::list("concave_weights", "v", "m/V").or_none(),
    ParameterInfo::list("convex_thresholds", "t", "V").or_none(),
    ParameterInfo::list("convex_weights", "c", "m/V").or_none(),
];

/// Names of thresholds and weights of each family.
const FAMILIES: [(&str, &str); 3] = [
    ("thresholds", "weights"),
    ("concave_thresholds", "concave_weights"),
    ("convex_thresholds", "convex_weights"),
];

/// A stage with plays of the drive and of functions of it at its input.
///
/// ```
/// use piezotrack_core::models::{
///     AsymmetricPrandtlIshlinskiiStage, Dynamics, Experiment, Relaxation, StageModel,
///     asymmetric_plays,
/// };
/// use piezotrack_core::signal::{Drive, Hold, NEVER};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// // One play of f(u), whose f(50 V) is 87.5 V, beside the drive.
/// let families = [(&[][..], &[][..]), (&[7.5], &[0.1e-6]), (&[], &[])];
/// let stage = AsymmetricPrandtlIshlinskiiStage {
///     operator: asymmetric_plays(1e-6, (0.0, 100.0), families)?,
///     relaxation: Relaxation::new(&[], &[], Dynamics::None)?,
/// };
/// let drive = Drive::new(&[0.0, 50.0, 0.0], 0.01, Hold::First)?;
/// let run = stage.simulate(&Experiment::of(&drive, NEVER))?.unwrap();
/// assert!((run.x[1] - 58e-6).abs() < 1e-15);
/// assert!((run.x[2] - 0.75e-6).abs() < 1e-15); // the play stays behind
/// # Ok(())
/// # }
/// ```
pub type AsymmetricPrandtlIshlinskiiStage = InputStage<AsymmetricPlays>;

/// The operator from its gain (m/V), the range of its functions (V), and thresholds (V) and
/// weights (m/V, of the sign of the gain) of the plays of the drive, f and g.
///
/// # Errors
/// [`crate::Error::Shape`] where entries are missing or too many, [`crate::Error::Parameter`]
/// where one is out of its range.
pub fn asymmetric_plays(
    linear: f64,
    (low, high): (f64, f64),
    families: [(&[f64], &[f64]); 3],
) -> Result<AsymmetricPlays> {
    let sign = direction(linear)?;
    let range = checked_range(low, high)?;
    let none = PlayFamily { thresholds: [0.0; MOST_PLAYS], weights: [0.0; MOST_PLAYS], count: 0 };
    let mut operator = AsymmetricPlays { linear, range, families: [none; 3] };
    let given = FAMILIES.iter().zip(families).zip(&mut operator.families);
    for ((&(name, weights_name), (thresholds, weights)), family) in given {
        let count = thresholds.len();
        same_length(weights_name, weights.len(), name, count, MOST_PLAYS)?;
        family.count = count;
        family.thresholds[..count].copy_from_slice(&checked_thresholds(name, thresholds, "V")?);
        for (i, (slot, weight)) in family.weights.iter_mut().zip(weights).enumerate() {
            *slot = along(&format!("{weights_name}[{i}]"), *weight, "m/V", sign)?;
        }
    }
    Ok(operator)
}

impl InputOperator for AsymmetricPlays {
    type State = AsymmetricPlayState<MOST_PLAYS>;

    fn rest(&self) -> Self::State {
        self.at_rest()
    }

    #[inline]
    fn follow(&self, state: &mut Self::State, volts: f64) -> f64 {
        AsymmetricPlays::follow(self, state, volts)
    }

    #[inline]
    fn input(&self, state: &Self::State) -> f64 {
        state.input
    }
}

/// Its memory is that of the plays of the drive, of f, and of g, one after the other.
impl Remembering for AsymmetricPlays {
    fn memory(&self, state: &Self::State) -> Vec<f64> {
        let used = |(family, plays): (&PlayFamily<MOST_PLAYS>, &[f64; MOST_PLAYS])| {
            plays[..family.count].to_vec()
        };
        self.families.iter().zip(&state.plays).flat_map(used).collect()
    }

    fn recall(
        &self,
        state: &mut Self::State,
        _volts: f64,
        memory: &[f64],
    ) -> core::result::Result<(), String> {
        let mut slots = self.memory(state);
        recall_plays(&mut slots, memory)?;
        let mut left = slots.as_slice();
        for (family, plays) in self.families.iter().zip(&mut state.plays) {
            let (here, after) = left.split_at(family.count);
            plays[..family.count].copy_from_slice(here);
            left = after;
        }
        Ok(())
    }
}

impl Segmented for AsymmetricPlays {
    fn next_breakpoint(&self, state: &Self::State, volts: f64, deviation: f64) -> f64 {
        AsymmetricPlays::straight(self, state, volts, deviation)
    }

    fn largest_curvature(&self) -> f64 {
        AsymmetricPlays::bend(self)
    }

    fn slope_jump(&self) -> f64 {
        AsymmetricPlays::kink(self)
    }
}

impl InputModel for AsymmetricPlays {
    const NAME: &'static str = "asymmetric-prandtl-ishlinskii";
    const TITLE: &'static str = "asymmetric Prandtl-Ishlinskii";
    const PARAMETERS: &'static [ParameterInfo] = PARAMETERS;

    type Inverse = AsymmetricPlayInverse<MOST_PLAYS>;

    fn build(values: &Values) -> Result<Self> {
        let number = |name| values.number(name);
        let families =
            FAMILIES.map(|(thresholds, weights)| (values.list(thresholds), values.list(weights)));
        let range = (number("low"), number("high"));
        asymmetric_plays(number("linear"), range, families)
    }

    fn path(&self) -> &impl Operator<f64> {
        self
    }

    fn inverse(&self, _dt: f64) -> Result<Self::Inverse> {
        Ok(AsymmetricPlayInverse(*self))
    }

    fn start(
        &self,
        inverse: &Self::Inverse,
        state: &Self::State,
    ) -> AsymmetricPlayInverseState<MOST_PLAYS> {
        inverse.memory(state)
    }
}

/// Shares of a family that are found at most. Loops of one height determine the sum of the weights
/// whose plays turn at a voltage, not those of neighbours in three families: weights that are free
/// take the noise, and foretell loops of other heights worse.
const MOST_SHARES: usize = 8;

/// Where thresholds lie between those whose weights are found: the weights go straight from one to
/// the next, as a density of thresholds.
#[derive(Clone, Copy, Debug)]
struct Density {
    thresholds: usize,
}

impl Density {
    /// How many weights are found.
    fn count(self) -> usize {
        self.thresholds.min(MOST_SHARES)
    }

    /// The weights found on both sides of a threshold, and how far it is from the first to the
    /// second.
    fn between(self, threshold: usize) -> (usize, usize, f64) {
        let last = self.count().saturating_sub(1);
        let steps = self.thresholds.saturating_sub(1).max(1);
        // Whole numbers, so that a threshold whose weight is found has all of it.
        let (first, rest) = (threshold * last / steps, threshold * last % steps);
        (first, (first + 1).min(last), index(rest) / index(steps))
    }

    /// Weights of all thresholds.
    fn weights(self, found: &[f64]) -> Vec<f64> {
        let weight = |threshold| {
            let (first, second, way) = self.between(threshold);
            let of = |k: usize| found.get(k).copied().unwrap_or(0.0);
            of(first) + way * (of(second) - of(first))
        };
        (0..self.thresholds).map(weight).collect()
    }
}

/// The drive, and plays of it, of f and of g with the same thresholds, in the sums whose weights
/// are found.
#[derive(Clone, Debug)]
struct FamilySignals {
    range: (f64, f64),
    thresholds: Vec<f64>,
    density: Density,
}

impl Signals for FamilySignals {
    fn count(&self) -> usize {
        1 + Bend::ALL.len() * self.density.count()
    }

    fn rest(&self) -> Vec<f64> {
        vec![0.0; Bend::ALL.len() * self.thresholds.len()]
    }

    fn follow(&self, memory: &mut Vec<f64>, volts: f64, _dt: f64, signals: &mut [f64]) {
        signals.fill(0.0);
        let Some((drive, sums)) = signals.split_first_mut() else { return };
        *drive = volts;
        if self.thresholds.is_empty() {
            return;
        }
        let families = memory.chunks_exact_mut(self.thresholds.len());
        let sums = sums.chunks_exact_mut(self.density.count());
        for ((bend, plays), sums) in Bend::ALL.into_iter().zip(families).zip(sums) {
            let (edge, _) = bend.at(volts, self.range);
            for (i, (play, threshold)) in plays.iter_mut().zip(&self.thresholds).enumerate() {
                *play = (edge - threshold).max((edge + threshold).min(*play));
                let (first, second, way) = self.density.between(i);
                sums[first] += (1.0 - way) * *play;
                sums[second] += way * *play;
            }
        }
    }
}

impl Superposition for AsymmetricPrandtlIshlinskiiStage {
    const NODES: Nodes = Nodes::Thresholds;
    const CREEP_GAIN: Option<f64> = Some(0.015);

    fn signals(of: &SignalsOf<'_>) -> Box<dyn Signals> {
        let density = Density { thresholds: of.nodes.len() };
        Box::new(FamilySignals { range: of.drive, thresholds: of.nodes.to_vec(), density })
    }

    fn values(fitted: &FittedWeights) -> Values {
        let of = fitted.clone();
        let density = Density { thresholds: of.nodes.len() };
        let family = |k: usize| {
            let found = of.weights.iter().skip(k * density.count()).take(density.count()).copied();
            [of.nodes.clone(), density.weights(&found.collect::<Vec<f64>>())]
        };
        let numbers = [of.linear, of.drive.0, of.drive.1].map(|number| vec![number]);
        let operator = numbers.into_iter().chain((0..Bend::ALL.len()).flat_map(family));
        Values::of(Self::INFO.parameters, operator.chain(of.relaxation.values()))
    }

    fn state_at_rest(rest: &Rest<'_>) -> Values {
        state_at_rest(PLAYS_STATE, rest, rest.memory)
    }
}
