//! The generalised Prandtl-Ishlinskii stage: plays between envelopes at the input, creep, linear
//! dynamics.
//!
//! ```text
//! z_r = max(gamma_l(u) - r, min(gamma_r(u) + r, z_r))          play of threshold r
//! H   = w_0 z_0 + sum_i w_i z_(r_i)                            z_0: that of threshold 0
//! gamma(u) = c0 tanh(c1 u + c2) + c3                           its own four numbers each
//! ```
//!
//! `gamma_l` pushes the plays up as the input rises, `gamma_r` down as it falls. Al Janaideh,
//! Rakheja and Su 2011, IEEE/ASME Transactions on Mechatronics 16(4), 734-744, doi
//! 10.1109/TMECH.2010.2052366, with the weights in m/V and `gamma` in V. Envelopes that bend make
//! loops asymmetric, and saturate, without the dead zones of the modified operator;
//! [`InputStage`] says what follows the operator.
//!
//! The inverse is closed. On a rising stretch all plays follow one number, g = `gamma_l(u)`,
//!
//! ```text
//! H = sum_i w_i max(g - r_i, z_i)
//! ```
//!
//! which rises strictly with g beyond the first play to move, straight between the places where
//! another play starts to move, and convex: the plays that move are known after a few passes, g
//! follows, and u = `gamma_l^-1(g)` with artanh. A falling stretch is the same with signs turned.
//! With equal envelopes this is the inverse of the Prandtl-Ishlinskii operator, then `gamma^-1`.
//! There is an inverse where `gamma_l <= gamma_r`. With all weights negative the displacement falls
//! as the drive rises, and is the negative of that with positive ones.
//!
//! Operator and inverse use arrays and `libm` only, and could move to the firmware's crate.

use piezotrack_control::OperatorInverse;
use piezotrack_control::hysteresis::{Operator, PlayState};

use super::prandtl_ishlinskii::{MOST_PLAYS, PlayHysteresis};
use super::tanh_envelope::{MOST_BEND, TanhEnvelope};
use crate::error::Result;
use crate::models::input::input_model::InputModel;
use crate::models::input::input_stage::{
    InputOperator, InputStage, PLAYS_STATE, Remembering, Segmented, recall_plays, state_at_rest,
};
use crate::models::input::superposition::{
    Edges, FittedWeights, Nodes, PlaySignals, Rest, Shape, Signals, SignalsOf, Superposition,
};
use crate::models::parameters::values::{ParameterInfo, Values};
use crate::models::traits::StageModel;

/// Room for the play of threshold 0 and the others.
const SLOTS: usize = MOST_PLAYS + 1;

/// Distances below this are roundings, relative to the voltages that they are between.
const ROUNDING: f64 = 1e-12;

/// Why a fit has neither scale nor level.
const NORMALISED: &str = "weights and offset could be traded for it";

const PARAMETERS: &[ParameterInfo] = &[
    ParameterInfo::new("linear", "w0", "m/V"),
    ParameterInfo::list("thresholds", "r", "V"),
    ParameterInfo::list("weights", "w", "m/V"),
    ParameterInfo::new("scale", "c0", "V").never_searched(NORMALISED),
    ParameterInfo::new("slope", "c1", "1/V"),
    ParameterInfo::new("shift", "c2", ""),
    ParameterInfo::new("level", "c3", "V").never_searched(NORMALISED),
    ParameterInfo::optional("falling_scale", "c0'", "V"),
    ParameterInfo::optional("falling_slope", "c1'", "1/V"),
    ParameterInfo::optional("falling_shift", "c2'", ""),
    ParameterInfo::optional("falling_level", "c3'", "V"),
];

/// The operator: plays between two envelopes, V to m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeneralisedPlays {
    /// Envelope that pushes the plays up.
    rising: TanhEnvelope,
    /// Envelope that pushes them down.
    falling: TanhEnvelope,
    /// 0, then r, V; what is not used weighs 0.
    thresholds: [f64; SLOTS],
    /// `w_0`, then w, m/V.
    weights: [f64; SLOTS],
    /// Plays that are used, that of threshold 0 among them.
    count: usize,
}

/// Its state: input, plays and slope.
pub type GeneralisedPlaysState = PlayState<f64, SLOTS>;

/// A stage with such plays at its input.
///
/// ```
/// use piezotrack_core::models::{
///     Dynamics, Experiment, GeneralisedPlays, GeneralisedPrandtlIshlinskiiStage, Relaxation,
///     StageModel, TanhEnvelope,
/// };
/// use piezotrack_core::signal::{Drive, Hold, NEVER};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let envelope = TanhEnvelope { scale: 100.0, slope: 0.01, shift: 0.0, level: 0.0 };
/// let weights = [0.2e-6, 0.1e-6];
/// let stage = GeneralisedPrandtlIshlinskiiStage {
///     operator: GeneralisedPlays::new(1e-6, &[10.0, 20.0], &weights, envelope, envelope)?,
///     relaxation: Relaxation::new(&[], &[], Dynamics::None)?,
/// };
/// let drive = Drive::new(&[0.0, 50.0, 0.0], 0.01, Hold::First)?;
/// let run = stage.simulate(&Experiment::of(&drive, NEVER))?.unwrap();
/// // The envelope takes 50 V to 100 tanh(0.5) V.
/// let edge = 46.21171572600098;
/// assert!((run.x[1] - 1e-6 * (edge + 0.2 * (edge - 10.0) + 0.1 * (edge - 20.0))).abs() < 1e-15);
/// assert!((run.x[2] - 4e-6).abs() < 1e-15); // the plays stay behind
/// # Ok(())
/// # }
/// ```
pub type GeneralisedPrandtlIshlinskiiStage = InputStage<GeneralisedPlays>;

impl GeneralisedPlays {
    /// The operator from its parameters: weights in m/V, all of one sign, thresholds in V.
    ///
    /// # Errors
    /// [`crate::error::Error::Shape`] where entries are missing or too many,
    /// [`crate::error::Error::Parameter`] where one is out of its range.
    pub fn new(
        linear: f64,
        thresholds: &[f64],
        weights: &[f64],
        rising: TanhEnvelope,
        falling: TanhEnvelope,
    ) -> Result<Self> {
        let PlayHysteresis { plays, count, .. } =
            PlayHysteresis::new(linear, thresholds, weights, &[], &[])?;
        let numbers = |of: TanhEnvelope| [of.scale, of.slope, of.shift, of.level];
        let mut all = Self {
            rising: TanhEnvelope::checked("", numbers(rising))?,
            falling: TanhEnvelope::checked("falling_", numbers(falling))?,
            thresholds: [0.0; SLOTS],
            weights: [0.0; SLOTS],
            count: 1 + count,
        };
        all.weights[0] = plays.linear;
        all.weights[1..].copy_from_slice(&plays.weights);
        all.thresholds[1..].copy_from_slice(&plays.thresholds);
        Ok(all)
    }

    /// Weight of all plays together, m/V, above 0.
    fn total(&self) -> f64 {
        self.weights[..self.count].iter().sum::<f64>().abs()
    }

    /// The end of the first of equal chords from `from` to `end`, which hold no corner and no tail.
    fn chord(&self, from: f64, end: f64, weight: f64, deviation: f64) -> f64 {
        let bent = |one: &TanhEnvelope| {
            // Within the tails of the envelope, or outside.
            let middle = one.slope * 0.5 * (from + end) + one.shift;
            let tail = 0.5 * libm::log(2.0 * one.scale * weight / deviation);
            let inside = middle.abs() < tail;
            if inside { MOST_BEND * one.scale * one.slope * one.slope * weight } else { 0.0 }
        };
        let curvature = bent(&self.rising).max(bent(&self.falling));
        let chords = libm::ceil((end - from).abs() * libm::sqrt(0.125 * curvature / deviation));
        if chords > 1.0 { from + (end - from) / chords } else { end }
    }

    /// Thresholds and weights of the plays, with where those of a state stand, V.
    fn plays<'a>(
        &'a self,
        state: &'a GeneralisedPlaysState,
    ) -> impl Iterator<Item = (f64, f64, f64)> + 'a {
        let plays = self.thresholds.iter().zip(&self.weights).zip(&state.plays);
        plays.take(self.count).map(|((threshold, weight), play)| (*threshold, *weight, *play))
    }

    /// The state where the input goes from that of `from` to `volts`.
    #[inline]
    fn taken(
        &self,
        from: &GeneralisedPlaysState,
        volts: f64,
        rises: bool,
    ) -> GeneralisedPlaysState {
        let (up, slope_up) = self.rising.with_slope(volts);
        let (down, slope_down) = self.falling.with_slope(volts);
        let steep = if rises { slope_up } else { slope_down };
        let mut state = GeneralisedPlaysState { input: volts, plays: from.plays, slope: 0.0 };
        for (i, play) in state.plays.iter_mut().take(self.count).enumerate() {
            let (low, high) = (up - self.thresholds[i], down + self.thresholds[i]);
            *play = low.max(high.min(*play));
            if if rises { *play <= low } else { *play >= high } {
                state.slope += self.weights[i] * steep;
            }
        }
        state
    }

    /// Where the envelope of a direction stands for an output (m) beyond that of the state, V.
    ///
    /// With w above 0, `sum_i w_i max(g - r_i, z_i)` is convex in g: Newton's method from above, where all plays
    /// move, comes down from corner to corner and ends on the straight part that g lies on.
    #[inline]
    fn edge(&self, state: &GeneralisedPlaysState, output: f64, rises: bool) -> f64 {
        // A falling stretch is a rising one of the negative plays.
        let sign = if rises { 1.0 } else { -1.0 };
        let turn = self.weights[0].signum();
        let mut edge = f64::INFINITY;
        for _ in 0..=self.count {
            let (mut slope, mut rest) = (0.0, sign * turn * output);
            for (threshold, weight, play) in self.plays(state) {
                let weight = turn * weight;
                if sign * play + threshold < edge {
                    slope += weight;
                    rest += weight * threshold;
                } else {
                    rest -= weight * sign * play;
                }
            }
            let next = rest / slope;
            // Not so where nothing moves any more, by a rounding.
            if !(slope > 0.0 && next < edge) {
                break;
            }
            edge = next;
        }
        sign * edge
    }
}

impl Operator<f64> for GeneralisedPlays {
    type State = GeneralisedPlaysState;
    type Branch = (GeneralisedPlaysState, f64);

    fn rest(&self) -> GeneralisedPlaysState {
        let start = GeneralisedPlaysState { input: 0.0, plays: [0.0; SLOTS], slope: 0.0 };
        self.taken(&start, 0.0, true)
    }

    #[inline]
    fn output(&self, state: &GeneralisedPlaysState) -> (f64, f64) {
        (self.plays(state).map(|(_, weight, play)| weight * play).sum(), state.slope)
    }

    fn branch(&self, state: &GeneralisedPlaysState, direction: f64) -> Self::Branch {
        (*state, direction)
    }

    fn along(&self, (from, direction): &Self::Branch, distance: f64) -> GeneralisedPlaysState {
        self.taken(from, from.input + distance, *direction > 0.0)
    }
}

impl InputOperator for GeneralisedPlays {
    type State = GeneralisedPlaysState;

    fn rest(&self) -> GeneralisedPlaysState {
        Operator::rest(self)
    }

    #[inline]
    fn follow(&self, state: &mut GeneralisedPlaysState, volts: f64) -> f64 {
        *state = self.taken(state, volts, volts >= state.input);
        self.output(state).0
    }

    #[inline]
    fn input(&self, state: &GeneralisedPlaysState) -> f64 {
        state.input
    }
}

impl Remembering for GeneralisedPlays {
    fn memory(&self, state: &GeneralisedPlaysState) -> Vec<f64> {
        state.plays[..self.count].to_vec()
    }

    fn recall(
        &self,
        state: &mut GeneralisedPlaysState,
        _volts: f64,
        memory: &[f64],
    ) -> core::result::Result<(), String> {
        recall_plays(&mut state.plays[..self.count], memory)
    }
}

impl Segmented for GeneralisedPlays {
    fn next_breakpoint(&self, state: &GeneralisedPlaysState, volts: f64, deviation: f64) -> f64 {
        let from = state.input;
        let side = if volts < from { -1.0 } else { 1.0 };
        let envelope = if side > 0.0 { &self.rising } else { &self.falling };
        let edge = envelope.at(from);
        let mut end = volts;
        let least = ROUNDING * (from.abs() + volts.abs());
        let mut nearest = |corner: f64| {
            if side * (corner - from) > least && side * (end - corner) > 0.0 {
                end = corner;
            }
        };
        for (threshold, weight, play) in self.plays(state) {
            // A play that moves with the envelope already has no corner.
            if side * (play - edge) + threshold > 0.0 && weight != 0.0 {
                nearest(envelope.inverse(play + side * threshold));
            }
        }
        // Beyond the tails all that is left of an envelope's range is below the deviation.
        let weight = self.total();
        for one in [&self.rising, &self.falling] {
            let tail = 0.5 * libm::log(2.0 * one.scale * weight / deviation);
            if tail.is_nan() || tail <= 0.0 {
                continue;
            }
            let ends = [-tail, tail].map(|bent| (bent - one.shift) / one.slope);
            ends.into_iter().for_each(&mut nearest);
        }
        self.chord(from, end, weight, deviation)
    }

    fn largest_curvature(&self) -> f64 {
        let steepest = |one: &TanhEnvelope| MOST_BEND * one.scale * one.slope * one.slope;
        steepest(&self.rising).max(steepest(&self.falling)) * self.total()
    }
}

/// The inverse: output in, m, input out, V.
///
/// Between two envelopes the output stays where it is for a while after a reversal; the inverse
/// then jumps to where it goes on. It ends where that of a rising input crosses the other one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeneralisedPlaysInverse(pub GeneralisedPlays);

/// Its state: that of the operator, and the output requested last, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeneralisedPlaysInverseState {
    operator: GeneralisedPlaysState,
    output: f64,
}

piezotrack_control::snapshot!(GeneralisedPlaysInverseState { operator, output });

impl GeneralisedPlaysInverse {
    /// The state for an operator in a given state.
    #[must_use]
    pub fn memory(&self, operator: &GeneralisedPlaysState) -> GeneralisedPlaysInverseState {
        let output = self.0.output(operator).0;
        GeneralisedPlaysInverseState { operator: *operator, output }
    }
}

impl OperatorInverse for GeneralisedPlaysInverse {
    type State = GeneralisedPlaysInverseState;

    fn rest(&self) -> GeneralisedPlaysInverseState {
        self.memory(&Operator::rest(&self.0))
    }

    /// Exact for a step of any length, provided that the output is monotone within it.
    #[inline]
    fn follow(&self, state: &mut GeneralisedPlaysInverseState, output: f64) -> f64 {
        let operator = &self.0;
        let distance = output - state.output;
        if distance == 0.0 {
            return state.operator.input;
        }
        // The input falls where the output rises with negative weights.
        let rises = (distance > 0.0) == (operator.weights[0] > 0.0);
        let edge = operator.edge(&state.operator, output, rises);
        let envelope = if rises { &operator.rising } else { &operator.falling };
        let volts = envelope.inverse(edge);
        // Where the envelopes cross, plays follow the other one than the direction's.
        let crossed = operator.rising.at(volts) > operator.falling.at(volts);
        if crossed || !volts.is_finite() {
            return f64::NAN;
        }
        state.operator = operator.taken(&state.operator, volts, rises);
        state.output = output;
        volts
    }
}

impl InputModel for GeneralisedPlays {
    const NAME: &'static str = "generalised-prandtl-ishlinskii";
    const TITLE: &'static str = "generalised Prandtl-Ishlinskii";
    const PARAMETERS: &'static [ParameterInfo] = PARAMETERS;

    type Inverse = GeneralisedPlaysInverse;

    fn build(values: &Values) -> Result<Self> {
        let [scale, slope, shift, level] =
            ["scale", "slope", "shift", "level"].map(|name| values.number(name));
        let rising = TanhEnvelope { scale, slope, shift, level };
        // What is left out is as for a rising input.
        let other = |name, same| values.list(name).first().copied().unwrap_or(same);
        let falling = TanhEnvelope {
            scale: other("falling_scale", scale),
            slope: other("falling_slope", slope),
            shift: other("falling_shift", shift),
            level: other("falling_level", level),
        };
        let linear = values.number("linear");
        let (thresholds, weights) = (values.list("thresholds"), values.list("weights"));
        GeneralisedPlays::new(linear, thresholds, weights, rising, falling)
    }

    fn path(&self) -> &impl Operator<f64> {
        self
    }

    fn inverse(&self, _dt: f64) -> Result<Self::Inverse> {
        Ok(GeneralisedPlaysInverse(*self))
    }

    fn start(&self, inverse: &Self::Inverse, state: &Self::State) -> GeneralisedPlaysInverseState {
        inverse.memory(state)
    }
}

impl Edges for TanhEnvelope {
    #[inline(always)]
    fn at(&self, volts: f64) -> (f64, f64) {
        let edge = Self::at(self, volts);
        (edge, edge)
    }
}

impl Superposition for GeneralisedPrandtlIshlinskiiStage {
    const NODES: Nodes = Nodes::Thresholds;

    /// Its slope at the top of the drive over that at the bottom, and how much it bends both ways:
    /// s in `B^2 = artanh(k)^2 + s^2`, where tanh's argument runs over 2 B and
    /// k = (1 - sqrt(ratio))/(1 + sqrt(ratio)). With s near 0 it bends in one direction only.
    fn shapes() -> Vec<Shape> {
        vec![Shape::about(0.25, 4.0), Shape::about(0.005, 1.6)]
    }

    fn signals(of: &SignalsOf<'_>) -> Box<dyn Signals> {
        let edges = TanhEnvelope::fitted(of.shape, of.drive);
        Box::new(PlaySignals { edges, thresholds: of.nodes.to_vec() })
    }

    fn values(fitted: &FittedWeights) -> Values {
        let of = fitted.clone();
        let TanhEnvelope { scale, slope, shift, level } = TanhEnvelope::fitted(&of.shape, of.drive);
        let relaxation = of.relaxation.values();
        let operator = [
            vec![of.linear],
            of.nodes,
            of.weights,
            vec![scale],
            vec![slope],
            vec![shift],
            vec![level],
            vec![],
            vec![],
            vec![],
            vec![],
        ];
        Values::of(Self::INFO.parameters, operator.into_iter().chain(relaxation))
    }

    /// With the play of the drive.
    fn state_at_rest(rest: &Rest<'_>) -> Values {
        state_at_rest(PLAYS_STATE, rest, rest.memory)
    }
}
