//! The polynomial Prandtl-Ishlinskii stage: plays beside a polynomial at the input, creep, linear
//! dynamics.
//!
//! ```text
//! H = c(u) + sum_i w_i z_i,  z_i = max(u - r_i, min(u + r_i, z_i))
//! c = a1 u + a2 u^2 + a3 u^3,  low <= u <= high
//! ```
//!
//! Gu, Yang and Zhu 2014, IEEE Transactions on Industrial Electronics 61(3), 1583-1595, doi
//! 10.1109/TIE.2013.2257153: a polynomial without memory in place of the weighted drive makes the
//! loops asymmetric. Beyond the range c goes on straight. It has to rise all along the range, or
//! to fall where the weights are negative, so that there is an inverse.
//!
//! Between two corners of the plays, and within one part of c, the output is a cubic in u: the
//! inverse goes from corner to corner to the one before its output, and finds u there by Newton's
//! method.

use piezotrack_control::OperatorInverse;
use piezotrack_control::hysteresis::{Operator, PlayState};

use super::cubic_curve::{Cubic, CubicCurve, checked_range};
use super::prandtl_ishlinskii::{MOST_PLAYS, PlayHysteresis};
use crate::error::{Error, Result, finite, shown};
use crate::math::rising_root;
use crate::models::input::input_model::InputModel;
use crate::models::input::input_stage::{
    InputOperator, InputStage, PLAYS_STATE, Remembering, Segmented, recall_plays, state_at_rest,
};
use crate::models::input::superposition::{
    FittedWeights, Nodes, Plain, PlaySignals, Rest, Signals, SignalsOf, Superposition,
};
use crate::models::parameters::values::{ParameterInfo, Values};
use crate::models::traits::StageModel;

/// Outputs beyond this are none.
const MOST_OUTPUT: f64 = 1e100;

/// Distances below this are roundings, relative to the voltages that they are between.
const ROUNDING: f64 = 1e-12;

const PARAMETERS: &[ParameterInfo] = &[
    ParameterInfo::new("a1", "a1", "m/V"),
    ParameterInfo::new("a2", "a2", "m/V^2"),
    ParameterInfo::new("a3", "a3", "m/V^3"),
    ParameterInfo::new("low", "ua", "V"),
    ParameterInfo::new("high", "ub", "V"),
    ParameterInfo::list("thresholds", "r", "V"),
    ParameterInfo::list("weights", "w", "m/V"),
];

/// The operator: plays beside a polynomial, V to m.
///
/// ```
/// use piezotrack_core::models::PolynomialPlays;
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let plays =
///     PolynomialPlays::new([1e-6, 2e-9, 0.0], (0.0, 100.0), &[10.0, 20.0], &[0.2e-6, 0.1e-6])?;
/// let mut state = plays.rest();
/// assert!((plays.follow(&mut state, 50.0) - 66e-6).abs() < 1e-18);
/// assert!((plays.follow(&mut state, 0.0) - 4e-6).abs() < 1e-18); // the plays stay behind
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolynomialPlays {
    /// c, m.
    curve: CubicCurve,
    /// The plays, which have no part in proportion to the drive.
    plays: PlayHysteresis,
    /// 1 where the output rises with the input, -1 where it falls.
    turn: f64,
}

/// Its state: input, plays and their slope.
pub type PolynomialPlaysState = PlayState<f64, MOST_PLAYS>;

impl PolynomialPlays {
    /// The operator from a1, a2 and a3 (m/V, m/V^2, m/V^3), the range (V) that they are for,
    /// thresholds (V) and weights (m/V, of the sign of the slope of the polynomial).
    ///
    /// # Errors
    /// [`Error::Shape`] where entries are missing or too many, [`Error::Parameter`] where one is
    /// out of its range, and naming `a1` where the polynomial does not rise or fall all along.
    pub fn new(
        polynomial: [f64; 3],
        (low, high): (f64, f64),
        thresholds: &[f64],
        weights: &[f64],
    ) -> Result<Self> {
        let units = ["m/V", "m/V^2", "m/V^3"];
        for ((name, value), unit) in ["a1", "a2", "a3"].iter().zip(polynomial).zip(units) {
            finite(name, value, unit)?;
        }
        let range = checked_range(low, high)?;
        let [a1, a2, a3] = polynomial;
        let inside = Cubic([0.0, a1, a2, a3]);
        let (least, most) = inside.slopes(low, high);
        let along = least > 0.0 || most < 0.0;
        if !(along && least.is_finite() && most.is_finite()) {
            let found = format!(
                "with a2 and a3 such that the slope is from {} m/V to {} m/V between {low} V and {high} V",
                shown(least),
                shown(most)
            );
            let expected = "a polynomial that rises all along, or falls all along";
            return Err(Error::parameter("a1", found, expected));
        }
        let turn = least.signum();
        let mut plays = PlayHysteresis::new(turn, thresholds, weights, &[], &[])?;
        plays.plays.linear = 0.0;
        Ok(Self { curve: CubicCurve::new(inside, range), plays, turn })
    }

    /// Thresholds (V) and weights (m/V) of the plays, and where those of a state stand, V.
    fn plays<'a>(
        &'a self,
        state: &'a PolynomialPlaysState,
    ) -> impl Iterator<Item = (f64, f64, f64)> + 'a {
        let PlayHysteresis { plays, count, .. } = &self.plays;
        let settings = plays.thresholds.iter().zip(&plays.weights).zip(&state.plays);
        settings.take(*count).map(|((threshold, weight), play)| (*threshold, *weight, *play))
    }

    /// The state before any voltage.
    #[must_use]
    pub fn rest(&self) -> PolynomialPlaysState {
        self.plays.plays.rest()
    }

    /// Takes the input to `volts` and returns the output, m.
    #[inline]
    pub fn follow(&self, state: &mut PolynomialPlaysState, volts: f64) -> f64 {
        let PlayHysteresis { plays, count, .. } = &self.plays;
        let weighted = plays.follow_used(state, volts, (*count, 0));
        self.curve.at(volts) + weighted
    }

    /// Output of a state, m.
    #[inline]
    fn value(&self, state: &PolynomialPlaysState) -> f64 {
        let weighted: f64 = self.plays(state).map(|(_, weight, play)| weight * play).sum();
        self.curve.at(state.input) + weighted
    }

    /// The polynomial of c that holds just beyond `volts`.
    #[inline]
    fn polynomial(&self, volts: f64, rises: bool) -> &Cubic {
        &self.curve.parts[self.curve.part(volts, rises).0]
    }

    /// The nearest place on a rise or a fall where the output is another cubic, V, or infinity.
    #[inline]
    fn corner(&self, state: &PolynomialPlaysState, rises: bool, least: f64) -> f64 {
        let side = if rises { 1.0 } else { -1.0 };
        let mut end = self.curve.part(state.input, rises).1;
        for (threshold, weight, play) in self.plays(state) {
            let corner = play + side * threshold;
            // What is nearer is a corner that the input stands at, but for a rounding.
            let ahead = side * (corner - state.input) > least;
            if ahead && side * (end - corner) > 0.0 && weight != 0.0 {
                end = corner;
            }
        }
        end
    }
}

impl InputOperator for PolynomialPlays {
    type State = PolynomialPlaysState;

    fn rest(&self) -> PolynomialPlaysState {
        Self::rest(self)
    }

    #[inline]
    fn follow(&self, state: &mut PolynomialPlaysState, volts: f64) -> f64 {
        Self::follow(self, state, volts)
    }

    #[inline]
    fn input(&self, state: &PolynomialPlaysState) -> f64 {
        state.input
    }
}

impl Remembering for PolynomialPlays {
    fn memory(&self, state: &PolynomialPlaysState) -> Vec<f64> {
        state.plays[..self.plays.count].to_vec()
    }

    fn recall(
        &self,
        state: &mut PolynomialPlaysState,
        _volts: f64,
        memory: &[f64],
    ) -> core::result::Result<(), String> {
        recall_plays(&mut state.plays[..self.plays.count], memory)
    }
}

impl Segmented for PolynomialPlays {
    fn next_breakpoint(&self, state: &PolynomialPlaysState, volts: f64, deviation: f64) -> f64 {
        let (from, rises) = (state.input, volts >= state.input);
        let end = self.corner(state, rises, ROUNDING * (from.abs() + volts.abs()));
        let to = if rises { volts.min(end) } else { volts.max(end) };
        let curve = self.polynomial(from, rises);
        let curvature = curve.curvature(from).abs().max(curve.curvature(to).abs());
        let chords = libm::ceil((to - from).abs() * libm::sqrt(0.125 * curvature / deviation));
        if chords > 1.0 { from + (to - from) / chords } else { to }
    }

    fn largest_curvature(&self) -> f64 {
        let inside = &self.curve.parts[1];
        inside.curvature(self.curve.low).abs().max(inside.curvature(self.curve.high).abs())
    }

    fn slope_jump(&self) -> f64 {
        let (least, most) = self.curve.parts[1].slopes(self.curve.low, self.curve.high);
        let moving: f64 = self.plays.plays.weights.iter().map(|weight| weight.abs()).sum();
        moving + (most - least)
    }
}

impl Operator<f64> for PolynomialPlays {
    type State = PolynomialPlaysState;
    type Branch = (PolynomialPlaysState, f64);

    fn rest(&self) -> PolynomialPlaysState {
        Self::rest(self)
    }

    fn output(&self, state: &PolynomialPlaysState) -> (f64, f64) {
        let slope = self.polynomial(state.input, true).slope(state.input);
        (self.value(state), slope + state.slope)
    }

    fn branch(&self, state: &PolynomialPlaysState, direction: f64) -> Self::Branch {
        (*state, direction)
    }

    fn along(&self, (from, _): &Self::Branch, distance: f64) -> PolynomialPlaysState {
        let mut state = *from;
        self.follow(&mut state, from.input + distance);
        state
    }
}

/// Corners on the way to an output, at most: each play has one, the polynomial two.
const MOST_CORNERS: usize = 2 * MOST_PLAYS + 4;

/// The inverse: output in, m, input out, V, by Newton's method between corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolynomialPlaysInverse(pub PolynomialPlays);

/// Its state: that of the operator, and the output requested last, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolynomialPlaysInverseState {
    operator: PolynomialPlaysState,
    output: f64,
}

piezotrack_control::snapshot!(PolynomialPlaysInverseState { operator, output });

impl PolynomialPlaysInverse {
    /// The state for an operator in a given state.
    #[must_use]
    pub fn memory(&self, operator: &PolynomialPlaysState) -> PolynomialPlaysInverseState {
        PolynomialPlaysInverseState { operator: *operator, output: self.0.value(operator) }
    }

    /// The input for an output (m) on a rise or a fall of the input.
    #[inline]
    fn input(&self, from: &PolynomialPlaysState, output: f64, rises: bool) -> f64 {
        let operator = &self.0;
        let side = if rises { 1.0 } else { -1.0 };
        let mut state = *from;
        for _ in 0..MOST_CORNERS {
            let start = state.input;
            // A corner that a rounding is ahead is here: it would be found again and again.
            let least = ROUNDING * start.abs();
            let end = operator.corner(&state, rises, least);
            // The plays that move on this part, and their share of the slope.
            let moving: f64 = operator
                .plays(&state)
                .filter(|(threshold, _, play)| side * (play + side * threshold - start) <= least)
                .map(|(_, weight, _)| weight)
                .sum();
            let (curve, value) = (operator.polynomial(start, rises), operator.value(&state));
            let rest = value - curve.at(start) - output;
            let above = |way: f64| {
                let volts = start + side * way;
                let value = curve.at(volts) + side * moving * way + rest;
                (side * operator.turn * value, (curve.slope(volts) + moving).abs())
            };
            if end.is_infinite() {
                // Straight from here on.
                let (value, slope) = above(0.0);
                return start + side * (-value / slope).max(0.0);
            }
            let reach = (end - start).abs();
            if above(reach).0 >= 0.0 {
                return start + side * rising_root(reach, above);
            }
            operator.follow(&mut state, end);
        }
        f64::NAN
    }
}

impl OperatorInverse for PolynomialPlaysInverse {
    type State = PolynomialPlaysInverseState;

    fn rest(&self) -> PolynomialPlaysInverseState {
        self.memory(&self.0.rest())
    }

    /// Exact to rounding for a step of any length, provided that the output is monotone within it.
    #[inline]
    fn follow(&self, state: &mut PolynomialPlaysInverseState, output: f64) -> f64 {
        let way = output - state.output;
        if way == 0.0 {
            return state.operator.input;
        }
        // The input falls where the output rises with a falling polynomial.
        let rises = (way > 0.0) == (self.0.turn > 0.0);
        let reachable = output.abs() < MOST_OUTPUT;
        let volts = if reachable { self.input(&state.operator, output, rises) } else { f64::NAN };
        if !volts.is_finite() {
            return f64::NAN;
        }
        self.0.follow(&mut state.operator, volts);
        state.output = output;
        volts
    }
}

/// A stage with plays beside a polynomial at its input.
///
/// ```
/// use piezotrack_core::models::{
///     Dynamics, Experiment, PolynomialPlays, PolynomialPrandtlIshlinskiiStage, Relaxation,
///     StageModel,
/// };
/// use piezotrack_core::signal::{Drive, Hold, NEVER};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let polynomial = [1e-6, 2e-9, 0.0];
/// let stage = PolynomialPrandtlIshlinskiiStage {
///     operator: PolynomialPlays::new(polynomial, (0.0, 100.0), &[10.0], &[0.2e-6])?,
///     relaxation: Relaxation::new(&[], &[], Dynamics::None)?,
/// };
/// let drive = Drive::new(&[0.0, 50.0, 0.0], 0.01, Hold::First)?;
/// let run = stage.simulate(&Experiment::of(&drive, NEVER))?.unwrap();
/// assert!((run.x[1] - 63e-6).abs() < 1e-18);
/// assert!((run.x[2] - 2e-6).abs() < 1e-18); // the play stays behind
/// # Ok(())
/// # }
/// ```
pub type PolynomialPrandtlIshlinskiiStage = InputStage<PolynomialPlays>;

impl InputModel for PolynomialPlays {
    const NAME: &'static str = "polynomial-prandtl-ishlinskii";
    const TITLE: &'static str = "polynomial Prandtl-Ishlinskii";
    const PARAMETERS: &'static [ParameterInfo] = PARAMETERS;

    type Inverse = PolynomialPlaysInverse;

    fn build(values: &Values) -> Result<Self> {
        let number = |name| values.number(name);
        PolynomialPlays::new(
            ["a1", "a2", "a3"].map(number),
            (number("low"), number("high")),
            values.list("thresholds"),
            values.list("weights"),
        )
    }

    fn path(&self) -> &impl Operator<f64> {
        self
    }

    fn inverse(&self, _dt: f64) -> Result<Self::Inverse> {
        Ok(PolynomialPlaysInverse(*self))
    }

    fn start(&self, inverse: &Self::Inverse, state: &Self::State) -> PolynomialPlaysInverseState {
        inverse.memory(state)
    }
}

/// Polynomials that rise from 0 at 0 V, with Bernstein polynomials of the range as slopes: their
/// sums with weights above 0 rise too.
fn rising_polynomials((low, high): (f64, f64)) -> [[f64; 3]; 3] {
    let wide = high - low;
    let (down, up) = ([high / wide, -1.0 / wide], [-low / wide, 1.0 / wide]);
    let slope = |one: [f64; 2], other: [f64; 2], factor: f64| {
        let middle = one[0] * other[1] + one[1] * other[0];
        [factor * one[0] * other[0], factor * middle, factor * one[1] * other[1]]
    };
    let slopes = [slope(down, down, 1.0), slope(down, up, 2.0), slope(up, up, 1.0)];
    slopes.map(|[a, b, c]| [a, 0.5 * b, c / 3.0])
}

/// The drive, plays, and the rising polynomials.
#[derive(Clone, Debug)]
struct PlaysAndPolynomials {
    plays: PlaySignals<Plain>,
    polynomials: [CubicCurve; 3],
}

impl Signals for PlaysAndPolynomials {
    fn count(&self) -> usize {
        self.plays.count() + self.polynomials.len()
    }

    fn rest(&self) -> Vec<f64> {
        self.plays.rest()
    }

    fn follow(&self, memory: &mut Vec<f64>, volts: f64, dt: f64, signals: &mut [f64]) {
        let (plays, bent) = signals.split_at_mut(self.plays.count());
        self.plays.follow(memory, volts, dt, plays);
        for (signal, polynomial) in bent.iter_mut().zip(&self.polynomials) {
            *signal = polynomial.at(volts) - polynomial.at(0.0);
        }
    }
}

impl Superposition for PolynomialPrandtlIshlinskiiStage {
    const NODES: Nodes = Nodes::Thresholds;

    fn signals(of: &SignalsOf<'_>) -> Box<dyn Signals> {
        let curve = |[a, b, c]: [f64; 3]| CubicCurve::new(Cubic([0.0, a, b, c]), of.drive);
        let plays = PlaySignals { edges: Plain, thresholds: of.nodes.to_vec() };
        let polynomials = rising_polynomials(of.drive).map(curve);
        Box::new(PlaysAndPolynomials { plays, polynomials })
    }

    fn values(fitted: &FittedWeights) -> Values {
        let of = fitted.clone();
        let (weights, bent) = of.weights.split_at(of.nodes.len().min(of.weights.len()));
        let mut sum = [of.linear, 0.0, 0.0];
        for (polynomial, weight) in rising_polynomials(of.drive).iter().zip(bent) {
            for (entry, coefficient) in sum.iter_mut().zip(polynomial) {
                *entry += weight * coefficient;
            }
        }
        let [a1, a2, a3] = sum.map(|coefficient| vec![coefficient]);
        let (low, high) = (vec![of.drive.0], vec![of.drive.1]);
        let operator = [a1, a2, a3, low, high, of.nodes, weights.to_vec()];
        Values::of(Self::INFO.parameters, operator.into_iter().chain(of.relaxation.values()))
    }

    /// Without the play of the drive.
    fn state_at_rest(rest: &Rest<'_>) -> Values {
        state_at_rest(PLAYS_STATE, rest, rest.memory.get(1..).unwrap_or(&[]))
    }
}
