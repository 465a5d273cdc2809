//! The Duhem stage of Coleman and Hodgdon: hysteresis by a differential equation at the input,
//! creep, linear dynamics.
//!
//! ```text
//! h' = alpha |u'| (f(u) - h) + g(u) u'
//! ```
//!
//! [`DuhemOperator`] has its branches and the condition under which all of them rise;
//! [`InputStage`] says what follows the operator.
//!
//! For a given alpha the output is linear in f and g, and the condition is that four quadratics in
//! them are above 0: with two pairs (f, g) that meet it, every sum with weights above 0 does. A fit
//! finds the weights of pairs on the edge of the condition by least squares, and searches alpha
//! around them. The pairs are made with the Bernstein polynomials b of the range of the drive.

use piezotrack_control::hysteresis::Operator;

use super::duhem_operator::{DuhemInverse, DuhemInverseState, DuhemOperator, DuhemParameters};
use crate::error::Result;
use crate::models::input::input_model::InputModel;
use crate::models::input::input_stage::{InputStage, Remembering, state_at_rest};
use crate::models::input::superposition::{
    FittedWeights, Nodes, Rest, Shape, Signals, SignalsOf, Superposition,
};
use crate::models::parameters::values::{ParameterInfo, Values};
use crate::models::traits::StageModel;

/// How near the edge of the condition the pairs are, as a share.
const INSIDE: f64 = 0.999;

/// Range of alpha that is searched, times the range of the drive.
const RATES: (f64, f64) = (0.3, 60.0);

const PARAMETERS: &[ParameterInfo] = &[
    ParameterInfo::new("alpha", "alpha", "1/V"),
    ParameterInfo::new("f1", "f1", "m/V"),
    ParameterInfo::new("f2", "f2", "m/V^2"),
    ParameterInfo::new("f3", "f3", "m/V^3"),
    ParameterInfo::new("g0", "g0", "m/V"),
    ParameterInfo::new("g1", "g1", "m/V^2"),
    ParameterInfo::new("g2", "g2", "m/V^3"),
    ParameterInfo::new("low", "ua", "V"),
    ParameterInfo::new("high", "ub", "V"),
];

/// A stage with the hysteresis of Coleman and Hodgdon at its input.
///
/// ```
/// use piezotrack_core::models::{
///     Dynamics, DuhemOperator, DuhemParameters, DuhemStage, Experiment, Relaxation, StageModel,
/// };
/// use piezotrack_core::signal::{Drive, Hold, NEVER};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let numbers = DuhemParameters {
///     alpha: 0.05,
///     f: [1e-6, 0.0, 0.0],
///     g: [0.7e-6, 0.0, 0.0],
///     low: 0.0,
///     high: 100.0,
/// };
/// let relaxation = Relaxation::new(&[], &[], Dynamics::None)?;
/// let stage = DuhemStage { operator: DuhemOperator::new(numbers)?, relaxation };
/// let drive = Drive::new(&[0.0, 100.0, 0.0], 0.01, Hold::First)?;
/// let run = stage.simulate(&Experiment::of(&drive, NEVER))?.unwrap();
/// let lag = |before: f64| before * f64::exp(-5.0) + 6e-6 * (1.0 - f64::exp(-5.0));
/// assert!((run.x[1] - (100e-6 - lag(0.0))).abs() < 1e-18);
/// assert!((run.x[2] - lag(-lag(0.0))).abs() < 1e-18);
/// # Ok(())
/// # }
/// ```
pub type DuhemStage = InputStage<DuhemOperator>;

impl InputModel for DuhemOperator {
    const NAME: &'static str = "duhem";
    const TITLE: &'static str = "Duhem";
    const PARAMETERS: &'static [ParameterInfo] = PARAMETERS;

    type Inverse = DuhemInverse;

    fn build(values: &Values) -> Result<Self> {
        let number = |name| values.number(name);
        let parameters = DuhemParameters {
            alpha: number("alpha"),
            f: ["f1", "f2", "f3"].map(number),
            g: ["g0", "g1", "g2"].map(number),
            low: number("low"),
            high: number("high"),
        };
        DuhemOperator::new(parameters)
    }

    fn path(&self) -> &impl Operator<f64> {
        self
    }

    fn inverse(&self, _dt: f64) -> Result<Self::Inverse> {
        Ok(DuhemInverse(*self))
    }

    fn start(&self, inverse: &Self::Inverse, state: &Self::State) -> DuhemInverseState {
        inverse.memory(state)
    }
}

/// Coefficients of f' and g of a pair, quadratics in t, which is 0 at the lower end of the range of
/// the drive and 1 at the upper one.
type Pair = ([f64; 3], [f64; 3]);

/// The pairs for an alpha of `rate` over the range of the drive.
fn pairs(rate: f64) -> Vec<Pair> {
    let bernstein = [[1.0, -2.0, 1.0], [0.0, 2.0, -2.0], [0.0, 0.0, 1.0]];
    let one = [1.0, 0.0, 0.0];
    let sum = |factor: f64, of: [f64; 3], other: [f64; 3]| -> [f64; 3] {
        core::array::from_fn(|k| factor * of[k] + other[k])
    };
    let mut pairs = vec![(sum(INSIDE, one, one), one)];
    for b in bernstein {
        // Hysteresis in a part of the range, or outside of that part.
        pairs.push((sum(INSIDE, b, one), one));
        pairs.push((sum(-INSIDE, b, sum(INSIDE, one, one)), one));
    }
    // Both bend: f' = (1 + k) g, where |g'| has to be below rate (1 - k) g.
    for width in [0.0, 0.5] {
        let steepest = INSIDE * rate * (1.0 - width);
        // For a bend at an end the steepest place is within, or at the end.
        let end = if steepest < 1.0 { 2.0 / steepest - 1.0 } else { 1.0 / (steepest * steepest) };
        for (b, least) in bernstein.into_iter().zip([end, 2.0 / steepest, end]) {
            let g = sum(least, one, b);
            pairs.push((g.map(|each| (1.0 + width) * each), g));
        }
    }
    pairs
}

/// A polynomial in t as one in volts.
fn in_volts([a, b, c]: [f64; 3], (low, high): (f64, f64)) -> [f64; 3] {
    let wide = high - low;
    let (b, c) = (b / wide, c / (wide * wide));
    [a - b * low + c * low * low, b - 2.0 * c * low, c]
}

/// The coefficients of f, without its constant, and of g in volts.
fn polynomials(pair: Pair, range: (f64, f64)) -> Pair {
    let [a, b, c] = in_volts(pair.0, range);
    ([a, 0.5 * b, c / 3.0], in_volts(pair.1, range))
}

/// Alpha, and the coefficients of f and g of the pairs in volts.
fn in_fit(shape: &[f64], (low, high): (f64, f64)) -> (f64, Vec<Pair>) {
    let rate = shape.first().copied().unwrap_or(1.0);
    let pairs = pairs(rate).into_iter().map(|pair| polynomials(pair, (low, high)));
    (rate / (high - low), pairs.collect())
}

/// The drive, and what comes out with each of the pairs, less that at rest.
#[derive(Clone, Debug)]
struct Outputs(Vec<DuhemOperator>);

impl Signals for Outputs {
    fn count(&self) -> usize {
        1 + self.0.len()
    }

    /// The drive and the outputs.
    fn rest(&self) -> Vec<f64> {
        vec![0.0; self.count()]
    }

    fn follow(&self, memory: &mut Vec<f64>, volts: f64, _dt: f64, signals: &mut [f64]) {
        if let Some((before, outputs)) = memory.split_first_mut() {
            for (operator, output) in self.0.iter().zip(outputs) {
                *output = operator.moved(*before, *output, volts);
            }
            *before = volts;
        }
        signals.copy_from_slice(memory);
    }
}

impl Superposition for DuhemStage {
    const NODES: Nodes = Nodes::None;

    /// Alpha, times the range of the drive.
    fn shapes() -> Vec<Shape> {
        vec![Shape::about(RATES.0, RATES.1)]
    }

    fn signals(of: &SignalsOf<'_>) -> Box<dyn Signals> {
        let (alpha, pairs) = in_fit(of.shape, of.drive);
        let (low, high) = of.drive;
        let operators = pairs.into_iter().filter_map(|(f, g)| {
            DuhemOperator::new(DuhemParameters { alpha, f, g, low, high }).ok()
        });
        Box::new(Outputs(operators.collect()))
    }

    fn values(fitted: &FittedWeights) -> Values {
        let (alpha, pairs) = in_fit(&fitted.shape, fitted.drive);
        // The drive itself has f' = g = 1.
        let (mut f, mut g) = ([fitted.linear, 0.0, 0.0], [fitted.linear, 0.0, 0.0]);
        for (pair, weight) in pairs.iter().zip(&fitted.weights) {
            for k in 0..3 {
                f[k] += weight * pair.0[k];
                g[k] += weight * pair.1[k];
            }
        }
        let (low, high) = fitted.drive;
        let numbers = [alpha, f[0], f[1], f[2], g[0], g[1], g[2], low, high];
        let operator = numbers.map(|number| vec![number]);
        Values::of(Self::INFO.parameters, operator.into_iter().chain(fitted.relaxation.values()))
    }

    fn state_at_rest(rest: &Rest<'_>) -> Values {
        state_at_rest(DuhemOperator::STATE, rest, &[rest.sum])
    }
}
