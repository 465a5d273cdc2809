//! The rate-dependent Prandtl-Ishlinskii stage: plays whose thresholds grow with the rate of the
//! drive.
//!
//! ```text
//! p = w_0 u + sum_i w_i z_i,  z_i = max(u - r_i(t), min(u + r_i(t), z_i))
//! r_i(t) = r_i + lambda |u'(t)|
//! H = S(p),  S(p) = p + sum_j s_j max(p - d_j, 0)
//! ```
//!
//! Plays with thresholds that are functions of time: Al Janaideh and Krejci 2013, IEEE/ASME
//! Transactions on Mechatronics 18(5), 1498-1507, doi 10.1109/TMECH.2012.2205265; here all are
//! dilated alike, by a time `lambda` times the rate. The faster the drive, the wider the loop, and the
//! later its plays: a play that moves is `lambda` behind. The drive goes straight from sample to
//! sample, so that its rate, and with it the thresholds, are constant between samples.
//!
//! The inverse is exact for samples as far apart as it is made for: it solves for the voltage, whose
//! rate is that from the sample before. That equation is a contraction with the bound
//!
//! ```text
//! q = lambda / dt sum_i w_i / (w_0 + sum_i w_i) < 1
//! ```
//!
//! and is refused where q is 1 or more: a play would go back where the drive goes on.

use piezotrack_control::hysteresis::{Operator, PlayState};
use piezotrack_control::{OperatorInverse, PlayInverse};

use super::prandtl_ishlinskii::{MOST_PLAYS, MOST_ZONES, PlayHysteresis};
use crate::error::{Error, Result, not_negative, positive, shown};
use crate::models::input::input_model::InputModel;
use crate::models::input::input_stage::{
    InputOperator, InputStage, PLAYS_STATE, Remembering, Segmented, recall_plays, state_at_rest,
};
use crate::models::input::superposition::{
    FittedWeights, Nodes, Rest, Shape, Signals, SignalsOf, Superposition,
};
use crate::models::parameters::values::{ParameterInfo, Values};
use crate::models::traits::StageModel;

/// Rounds of Newton's method within a bracket, at most: as many as there are corners, and more.
const ROUNDS: usize = 200;

const PARAMETERS: &[ParameterInfo] = &[
    ParameterInfo::new("linear", "w0", "m/V"),
    ParameterInfo::list("thresholds", "r", "V"),
    ParameterInfo::list("weights", "w", "m/V"),
    ParameterInfo::new("dilation", "lambda", "s"),
    ParameterInfo::list("dead_zone_thresholds", "d", "m"),
    ParameterInfo::list("dead_zone_weights", "s", ""),
];

/// Plays that the rate of the input dilates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DilatedPlays {
    /// The plays at rest.
    pub plays: PlayHysteresis,
    /// Growth of each threshold with the rate, s.
    pub dilation: f64,
}

/// State of [`DilatedPlays`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DilatedPlaysState {
    plays: PlayState<f64, MOST_PLAYS>,
    /// Rate of the input, V/s.
    rate: f64,
}

piezotrack_control::snapshot!(DilatedPlaysState { plays, rate });

/// A stage with plays that the rate of the drive dilates.
pub type RateDependentPrandtlIshlinskiiStage = InputStage<DilatedPlays>;

impl DilatedPlays {
    /// The plays at a rate of the input, V/s.
    #[inline(always)]
    fn at(&self, rate: f64) -> PlayHysteresis {
        let mut all = self.plays;
        let wider = self.dilation * rate;
        for threshold in &mut all.plays.thresholds[..all.count] {
            *threshold += wider;
        }
        all
    }
}

impl InputOperator for DilatedPlays {
    type State = DilatedPlaysState;
    const BY_RATE: bool = true;

    fn rest(&self) -> DilatedPlaysState {
        DilatedPlaysState { plays: self.plays.plays.rest(), rate: 0.0 }
    }

    fn at_rate(&self, state: &mut DilatedPlaysState, rate: f64) {
        state.rate = rate;
    }

    fn follow(&self, state: &mut DilatedPlaysState, volts: f64) -> f64 {
        self.at(state.rate).follow(&mut state.plays, volts)
    }

    fn input(&self, state: &DilatedPlaysState) -> f64 {
        state.plays.input
    }
}

impl Remembering for DilatedPlays {
    fn memory(&self, state: &DilatedPlaysState) -> Vec<f64> {
        self.plays.memory(&state.plays)
    }

    fn recall(
        &self,
        state: &mut DilatedPlaysState,
        _volts: f64,
        memory: &[f64],
    ) -> core::result::Result<(), String> {
        recall_plays(&mut state.plays.plays[..self.plays.count], memory)
    }
}

impl Segmented for DilatedPlays {
    fn next_breakpoint(&self, state: &DilatedPlaysState, volts: f64, deviation: f64) -> f64 {
        self.at(state.rate).next_breakpoint(&state.plays, volts, deviation)
    }

    fn largest_curvature(&self) -> f64 {
        0.0
    }
}

impl InputModel for DilatedPlays {
    const NAME: &'static str = "rate-dependent-prandtl-ishlinskii";
    const TITLE: &'static str = "rate-dependent Prandtl-Ishlinskii";
    const PARAMETERS: &'static [ParameterInfo] = PARAMETERS;

    type Inverse = DilatedPlaysInverse;

    fn build(values: &Values) -> Result<Self> {
        let list = |name| values.list(name);
        let plays = PlayHysteresis::new(
            values.number("linear"),
            list("thresholds"),
            list("weights"),
            list("dead_zone_thresholds"),
            list("dead_zone_weights"),
        )?;
        let dilation = not_negative("dilation", values.number("dilation"), "s")?;
        Ok(DilatedPlays { plays, dilation })
    }

    /// At rest: quicker plays move less.
    fn path(&self) -> &impl Operator<f64> {
        &self.plays.plays
    }

    fn inverse(&self, dt: f64) -> Result<Self::Inverse> {
        DilatedPlaysInverse::new(*self, dt)
    }

    fn start(&self, _inverse: &Self::Inverse, state: &Self::State) -> DilatedPlaysInverseState {
        DilatedPlaysInverseState { operator: *state, begun: false }
    }
}

/// The inverse for samples `dt` apart: output in, m, input out, V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DilatedPlaysInverse {
    operator: DilatedPlays,
    /// Of the dead zones.
    zones: PlayInverse<MOST_PLAYS, MOST_ZONES>,
    dt: f64,
}

/// State of [`DilatedPlaysInverse`]: that of the operator, and whether it has had a sample, before
/// which there is no rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DilatedPlaysInverseState {
    operator: DilatedPlaysState,
    begun: bool,
}

piezotrack_control::snapshot!(DilatedPlaysInverseState { operator, begun });

impl DilatedPlaysInverse {
    /// The inverse for samples `dt` seconds apart.
    ///
    /// # Errors
    /// Names `dt` where it is so short that the operator has no inverse; a parameter where the
    /// plays have none.
    pub fn new(operator: DilatedPlays, dt: f64) -> Result<Self> {
        let dt = positive("dt", dt, "s")?;
        let zones = PlayInverse::new(&operator.plays.plays)?;
        let plays = &operator.plays.plays;
        let moving: f64 = plays.weights.iter().sum();
        let shortest = operator.dilation * moving / (plays.linear + moving);
        if dt <= shortest {
            let expected = format!(
                "above {} s, or plays would go back where the drive goes on: a shorter dilation, or \
                 longer intervals",
                shown(shortest)
            );
            return Err(Error::parameter("dt", format!("{} s", shown(dt)), expected));
        }
        Ok(Self { operator, zones, dt })
    }

    /// Weighted sum of the plays at `volts` and its slope, m and m/V.
    fn sum(&self, from: &DilatedPlaysState, volts: f64, per_volt: f64) -> (f64, f64) {
        let PlayHysteresis { plays, count, .. } = &self.operator.plays;
        let here = from.plays.input;
        let moved = volts - here;
        // Change of each threshold with the voltage.
        let side = if moved < 0.0 { -per_volt } else { per_volt };
        let (mut sum, mut slope) = (plays.linear * volts, plays.linear);
        for i in 0..*count {
            let threshold = side.mul_add(moved, plays.thresholds[i]);
            let mut play = (from.plays.plays[i], 0.0);
            // The rate changes first, then the voltage.
            for (at, moves) in [(here, 0.0), (volts, 1.0)] {
                if play.0 < at - threshold {
                    play = (at - threshold, moves - side);
                } else if play.0 > at + threshold {
                    play = (at + threshold, moves + side);
                }
            }
            sum += plays.weights[i] * play.0;
            slope += plays.weights[i] * play.1;
        }
        (sum, slope)
    }

    /// The voltage at which the plays sum up to `value`, m.
    ///
    /// With weights above 0 the sum rises with the voltage, in straight parts. Newton's method
    /// goes from part to part, within a bracket that halves where it would leave it.
    fn solve(&self, from: &DilatedPlaysState, value: f64, per_volt: f64) -> f64 {
        let turn = self.operator.plays.plays.linear.signum();
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut volts = from.plays.input;
        for _ in 0..ROUNDS {
            let (sum, slope) = self.sum(from, volts, per_volt);
            let left = turn * (value - sum);
            if left > 0.0 {
                low = volts;
            } else if left < 0.0 {
                high = volts;
            } else {
                break;
            }
            let mut next = volts + left / (turn * slope);
            if next <= low || next >= high {
                next = 0.5 * (low + high);
            }
            let step = (next - volts).abs();
            if step <= f64::EPSILON * volts.abs() || !next.is_finite() {
                break;
            }
            volts = next;
        }
        volts
    }
}

impl OperatorInverse for DilatedPlaysInverse {
    type State = DilatedPlaysInverseState;

    fn rest(&self) -> DilatedPlaysInverseState {
        DilatedPlaysInverseState { operator: InputOperator::rest(&self.operator), begun: false }
    }

    fn follow(&self, state: &mut DilatedPlaysInverseState, output: f64) -> f64 {
        let value = self.zones.before_dead_zones(output);
        // The first sample is where the stage stands, however it came there.
        let per_volt = if state.begun { self.operator.dilation / self.dt } else { 0.0 };
        let volts = self.solve(&state.operator, value, per_volt);
        if !volts.is_finite() {
            return f64::NAN;
        }
        let from = self.operator.input(&state.operator);
        let rate = if state.begun { (volts - from).abs() / self.dt } else { 0.0 };
        self.operator.at_rate(&mut state.operator, rate);
        self.operator.follow(&mut state.operator, from);
        self.operator.follow(&mut state.operator, volts);
        state.begun = true;
        volts
    }
}

/// Plays that the rate dilates, after the drive itself.
#[derive(Clone, Debug)]
struct DilatedSignals {
    thresholds: Vec<f64>,
    dilation: f64,
}

impl Signals for DilatedSignals {
    fn count(&self) -> usize {
        1 + self.thresholds.len()
    }

    fn rest(&self) -> Vec<f64> {
        vec![0.0; self.count()]
    }

    fn follow(&self, memory: &mut Vec<f64>, volts: f64, dt: f64, signals: &mut [f64]) {
        let from = memory.first().copied().unwrap_or(0.0);
        let wider = self.dilation * (volts - from).abs() / dt;
        for at in [from, volts] {
            let (first, plays) = memory.split_at_mut(1);
            first[0] = at;
            for (play, threshold) in plays.iter_mut().zip(&self.thresholds) {
                let threshold = threshold + wider;
                *play = (at - threshold).max((at + threshold).min(*play));
            }
        }
        signals.copy_from_slice(memory);
    }
}

impl Superposition for RateDependentPrandtlIshlinskiiStage {
    const DEAD_ZONES: bool = true;
    const NODES: Nodes = Nodes::Thresholds;

    /// The dilation, s.
    fn shapes() -> Vec<Shape> {
        vec![Shape { range: (1e-6, 1.0), neutral: 1e-9 }]
    }

    fn signals(of: &SignalsOf<'_>) -> Box<dyn Signals> {
        let dilation = of.shape.first().copied().unwrap_or(0.0);
        Box::new(DilatedSignals { thresholds: of.nodes.to_vec(), dilation })
    }

    fn values(fitted: &FittedWeights) -> Values {
        let of = fitted.clone();
        let relaxation = of.relaxation.values();
        let operator = [
            vec![of.linear],
            of.nodes,
            of.weights,
            of.shape,
            of.dead_zone_thresholds,
            of.dead_zone_weights,
        ];
        Values::of(Self::INFO.parameters, operator.into_iter().chain(relaxation))
    }

    /// Without the drive.
    fn state_at_rest(rest: &Rest<'_>) -> Values {
        state_at_rest(PLAYS_STATE, rest, rest.memory.get(1..).unwrap_or(&[]))
    }
}
