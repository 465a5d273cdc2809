//! The Duhem operator of Coleman and Hodgdon: hysteresis by a differential equation.
//!
//! ```text
//! h' = alpha |u'| (f(u) - h) + g(u) u'
//! f(u) = f1 u + f2 u^2 + f3 u^3,   g(u) = g0 + g1 u + g2 u^2,   low <= u <= high
//! ```
//!
//! Coleman and Hodgdon 1986, International Journal of Engineering Science 24(6), 897-919; Hodgdon
//! 1988, IEEE Transactions on Magnetics 24(6), 3120-3122; with a straight f and a constant g it
//! is the model of piezo actuators of Adriaens, de Koning and Banning 2000, IEEE/ASME Transactions
//! on Mechatronics 5(4), 331-341, doi 10.1109/3516.891044. Beyond the range f goes on straight and
//! g stays as it is.
//!
//! Each branch is closed, a polynomial P and an exponential: with r = g - f', e = h - f,
//!
//! ```text
//! h = P(u) + (h_0 - P(u_0)) exp(-alpha |u - u_0|)
//! P = f + r/alpha - r'/alpha^2 + r''/alpha^3     on a rise
//! P = f - r/alpha - r'/alpha^2 - r''/alpha^3     on a fall
//! ```
//!
//! Every branch rises where, on the range,
//!
//! ```text
//! |g'| < alpha f'   and   |g'| < alpha (2 g - f')
//! ```
//!
//! The slopes that a rise and a fall from a state would have, s and t, add up to 2 g, and neither
//! can reach 0: where s does on a rise, `s' = alpha f' + g'` is above 0, and so on for the other
//! three. Other parameters are refused, so that there is an inverse. All branches fall where f and
//! g with the other sign meet the same condition.

use piezotrack_control::OperatorInverse;
use piezotrack_control::hysteresis::Operator;

use crate::error::{Error, Result, finite, positive, shown};
use crate::math::rising_root;
use crate::models::input::input_stage::{InputOperator, Remembering, Segmented, state_with};
use crate::models::parameters::values::ParameterInfo;
use crate::models::plays::cubic_curve::{Cubic, CubicCurve, checked_range};

/// Outputs beyond this are none.
const MOST_OUTPUT: f64 = 1e100;

/// Doublings of a way beyond the range until an output is reached.
const DOUBLINGS: usize = 200;

/// The numbers of the equation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DuhemParameters {
    /// How fast a branch approaches its limit, alpha, 1/V, above 0.
    pub alpha: f64,
    /// f1, f2, f3, m/V, m/V^2, m/V^3.
    pub f: [f64; 3],
    /// g0, g1, g2, m/V, m/V^2, m/V^3.
    pub g: [f64; 3],
    /// Lower end of the range of the drive, V.
    pub low: f64,
    /// Upper end of the range of the drive, V.
    pub high: f64,
}

/// The operator, V to m.
///
/// ```
/// use piezotrack_core::models::{DuhemOperator, DuhemParameters};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let duhem = DuhemOperator::new(DuhemParameters {
///     alpha: 0.05,
///     f: [1e-6, 0.0, 0.0],
///     g: [0.7e-6, 0.0, 0.0],
///     low: 0.0,
///     high: 100.0,
/// })?;
/// let mut state = duhem.rest();
/// // The rise lags behind f by up to 0.3e-6 / 0.05 m.
/// let lag = 6e-6 * (1.0 - f64::exp(-5.0));
/// assert!((duhem.follow(&mut state, 100.0) - (100e-6 - lag)).abs() < 1e-18);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DuhemOperator {
    parameters: DuhemParameters,
    /// Limit of a rise, m.
    rising: CubicCurve,
    /// Limit of a fall, m.
    falling: CubicCurve,
    /// f(0), m: the output at rest.
    zero: f64,
    /// Largest |g|, m/V.
    most: f64,
    /// 1 where the output rises with the input, -1 where it falls.
    turn: f64,
}

/// Its state: input, output, and slope of the branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DuhemState {
    /// V.
    pub input: f64,
    /// m.
    pub output: f64,
    /// m/V.
    slope: f64,
}

piezotrack_control::snapshot!(DuhemState { input, output, slope });

impl DuhemOperator {
    /// The operator.
    ///
    /// # Errors
    /// [`Error::Parameter`] where one is out of its range, and naming `f1` or `g0` where not every
    /// branch rises or not every branch falls.
    pub fn new(parameters: DuhemParameters) -> Result<Self> {
        let DuhemParameters { alpha, f, g, low, high } = parameters;
        positive("alpha", alpha, "1/V")?;
        for (name, value, unit) in [
            ("f1", f[0], "m/V"),
            ("f2", f[1], "m/V^2"),
            ("f3", f[2], "m/V^3"),
            ("g0", g[0], "m/V"),
            ("g1", g[1], "m/V^2"),
            ("g2", g[2], "m/V^3"),
        ] {
            finite(name, value, unit)?;
        }
        let range = checked_range(low, high)?;
        let f = Cubic([0.0, f[0], f[1], f[2]]);
        let reversible = Cubic([0.0, g[0], 0.5 * g[1], g[2] / 3.0]);
        let turn = reversible.slope(0.5 * (low + high)).signum();
        check_branches(&f, &reversible, alpha, range, turn)?;
        let apart = reversible.plus(-1.0, &f).derivative();
        let limit = |side: f64| {
            let (first, second) = (apart.derivative(), apart.derivative().derivative());
            let bent = f.plus(side / alpha, &apart);
            let bent = bent.plus(-1.0 / (alpha * alpha), &first);
            bent.plus(side / (alpha * alpha * alpha), &second)
        };
        let (least, most) = reversible.slopes(low, high);
        let outside = CubicCurve::new(f, range);
        let ends = [low, high].map(|end| apart.at(end));
        // Where f is straight and g constant, r is constant too.
        let with_limits = |side: f64| {
            let mut parts = outside.parts;
            parts[0].0[0] += side * ends[0] / alpha;
            parts[1] = limit(side);
            parts[2].0[0] += side * ends[1] / alpha;
            CubicCurve { parts, ..outside }
        };
        let (part, _) = outside.part(0.0, true);
        let zero = outside.parts[part].at(0.0);
        Ok(Self {
            parameters,
            rising: with_limits(1.0),
            falling: with_limits(-1.0),
            zero,
            most: least.abs().max(most.abs()),
            turn,
        })
    }

    /// Its numbers.
    #[must_use]
    pub fn parameters(&self) -> &DuhemParameters {
        &self.parameters
    }

    /// The state before any voltage: on f.
    #[must_use]
    pub fn rest(&self) -> DuhemState {
        self.taken(&DuhemState { input: 0.0, output: self.zero, slope: 0.0 }, 0.0)
    }

    /// Takes the input to `volts` and returns the output, m.
    #[inline]
    pub fn follow(&self, state: &mut DuhemState, volts: f64) -> f64 {
        *state = self.taken(state, volts);
        state.output
    }

    /// The output beyond that at rest after a way from one voltage to another, m, from such an
    /// output.
    #[inline]
    pub(in crate::models) fn moved(&self, from: f64, output: f64, volts: f64) -> f64 {
        let state = DuhemState { input: from, output: self.zero + output, slope: 0.0 };
        self.taken(&state, volts).output - self.zero
    }

    /// Limit of a rise or a fall.
    #[inline]
    fn limit(&self, rises: bool) -> &CubicCurve {
        if rises { &self.rising } else { &self.falling }
    }

    /// Output and slope where a branch of one polynomial takes the state of `from`.
    #[inline]
    fn on(&self, limit: &Cubic, from: &DuhemState, volts: f64) -> (f64, f64) {
        let alpha = self.parameters.alpha;
        let side = if volts < from.input { -1.0 } else { 1.0 };
        let far = from.output - limit.at(from.input);
        let left = far * libm::exp(-alpha * (volts - from.input).abs());
        (limit.at(volts) + left, limit.slope(volts) - side * alpha * left)
    }

    /// The state where the input goes from that of `from` to `volts`.
    #[inline]
    fn taken(&self, from: &DuhemState, volts: f64) -> DuhemState {
        let rises = volts >= from.input;
        let limit = self.limit(rises);
        let mut state = *from;
        // Through three parts at most.
        for _ in 0..3 {
            let (part, end) = limit.part(state.input, rises);
            let to = if rises { volts.min(end) } else { volts.max(end) };
            let (output, slope) = self.on(&limit.parts[part], &state, to);
            state = DuhemState { input: to, output, slope };
            if if rises { to >= volts } else { to <= volts } {
                break;
            }
        }
        DuhemState { input: volts, ..state }
    }
}

/// Refuses f and g with which not every branch rises, or falls where `turn` is -1: see above.
fn check_branches(
    f: &Cubic,
    reversible: &Cubic,
    alpha: f64,
    (low, high): (f64, f64),
    turn: f64,
) -> Result<()> {
    let bent = reversible.derivative();
    let least = |curve: &Cubic| {
        let (least, most) = curve.slopes(low, high);
        if turn > 0.0 { least } else { -most }
    };
    let after = reversible.plus(1.0, reversible).plus(-1.0, f);
    for (name, what, curve) in [("f1", "f'", f), ("g0", "2 g - f'", &after)] {
        let lower =
            least(&curve.plus(1.0 / alpha, &bent)).min(least(&curve.plus(-1.0 / alpha, &bent)));
        if lower.is_nan() || lower <= 0.0 {
            let found = format!(
                "such that {what}, less |g'|/alpha, is {} m/V somewhere from {low} V to {high} V",
                shown(turn * lower)
            );
            let sign = if turn > 0.0 { "above" } else { "below" };
            let expected = format!("f and g with which that is {sign} 0, or there is no inverse");
            return Err(Error::parameter(name, found, expected));
        }
    }
    Ok(())
}

impl InputOperator for DuhemOperator {
    type State = DuhemState;

    fn rest(&self) -> DuhemState {
        Self::rest(self)
    }

    #[inline]
    fn follow(&self, state: &mut DuhemState, volts: f64) -> f64 {
        Self::follow(self, state, volts)
    }

    #[inline]
    fn input(&self, state: &DuhemState) -> f64 {
        state.input
    }
}

impl Remembering for DuhemOperator {
    const STATE: &'static [ParameterInfo] = &state_with(ParameterInfo::new("output", "h", "m"));

    /// The output, beyond that at rest.
    fn memory(&self, state: &DuhemState) -> Vec<f64> {
        vec![state.output - self.zero]
    }

    fn recall(
        &self,
        state: &mut DuhemState,
        volts: f64,
        memory: &[f64],
    ) -> core::result::Result<(), String> {
        let [output] = *memory else { return Err("one output".into()) };
        *state = DuhemState { input: volts, output: self.zero + output, slope: 0.0 };
        Ok(())
    }
}

impl Segmented for DuhemOperator {
    fn next_breakpoint(&self, state: &DuhemState, volts: f64, deviation: f64) -> f64 {
        let rises = volts >= state.input;
        let limit = self.limit(rises);
        let (part, end) = limit.part(state.input, rises);
        let to = if rises { volts.min(end) } else { volts.max(end) };
        // The second derivative of a polynomial of third degree is largest at an end.
        let (curve, alpha) = (&limit.parts[part], self.parameters.alpha);
        let bent = curve.curvature(state.input).abs().max(curve.curvature(to).abs());
        let curvature = bent + alpha * alpha * (state.output - curve.at(state.input)).abs();
        let chords =
            libm::ceil((to - state.input).abs() * libm::sqrt(0.125 * curvature / deviation));
        if chords > 1.0 { state.input + (to - state.input) / chords } else { to }
    }

    fn largest_curvature(&self) -> f64 {
        let DuhemParameters { alpha, low, high, .. } = self.parameters;
        let of = |limit: &CubicCurve| {
            let inside = &limit.parts[1];
            let bent = inside.curvature(low).abs().max(inside.curvature(high).abs());
            let (least, most) = inside.slopes(low, high);
            // The slope of a branch is within 0 and twice g.
            bent + alpha * (2.0 * self.most + least.abs().max(most.abs()))
        };
        of(&self.rising).max(of(&self.falling))
    }

    /// The slope of a branch is within 0 and twice g.
    fn slope_jump(&self) -> f64 {
        2.0 * self.most
    }
}

impl Operator<f64> for DuhemOperator {
    type State = DuhemState;
    type Branch = DuhemState;

    fn rest(&self) -> DuhemState {
        Self::rest(self)
    }

    fn output(&self, state: &DuhemState) -> (f64, f64) {
        (state.output, state.slope)
    }

    fn branch(&self, state: &DuhemState, _direction: f64) -> DuhemState {
        *state
    }

    fn along(&self, branch: &DuhemState, distance: f64) -> DuhemState {
        self.taken(branch, branch.input + distance)
    }
}

/// The inverse: output in, m, input out, V, by Newton's method along each branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DuhemInverse(pub DuhemOperator);

/// Its state: that of the operator, and the output requested last, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DuhemInverseState {
    operator: DuhemState,
    output: f64,
}

piezotrack_control::snapshot!(DuhemInverseState { operator, output });

impl DuhemInverse {
    /// The state for an operator in a given state.
    #[must_use]
    pub fn memory(&self, operator: &DuhemState) -> DuhemInverseState {
        DuhemInverseState { operator: *operator, output: operator.output }
    }

    /// The input for an output (m) on a rise or a fall of the input; NaN where there is none.
    #[inline]
    fn input(&self, from: &DuhemState, output: f64, rises: bool) -> f64 {
        let operator = &self.0;
        let limit = operator.limit(rises);
        let side = if rises { 1.0 } else { -1.0 };
        let mut state = *from;
        loop {
            let (part, end) = limit.part(state.input, rises);
            let curve = |way: f64| {
                let (value, slope) =
                    operator.on(&limit.parts[part], &state, state.input + side * way);
                (side * operator.turn * (value - output), slope.abs())
            };
            let reach = (end - state.input).abs();
            let reach = if reach.is_finite() { reach } else { far_enough(&curve) };
            if curve(reach).0 >= 0.0 {
                return state.input + side * rising_root(reach, curve);
            }
            if end.is_infinite() {
                return f64::NAN;
            }
            state = operator.taken(&state, end);
        }
    }
}

/// A way at which a curve that rises is above 0; infinity where it does not come to be.
fn far_enough(curve: &impl Fn(f64) -> (f64, f64)) -> f64 {
    let (value, slope) = curve(0.0);
    let mut way = 2.0 * (-value / slope).max(1.0);
    for _ in 0..DOUBLINGS {
        if curve(way).0 >= 0.0 {
            return way;
        }
        way *= 2.0;
    }
    f64::INFINITY
}

impl OperatorInverse for DuhemInverse {
    type State = DuhemInverseState;

    fn rest(&self) -> DuhemInverseState {
        self.memory(&self.0.rest())
    }

    /// Exact to rounding for a step of any length, provided that the output is monotone within it.
    #[inline]
    fn follow(&self, state: &mut DuhemInverseState, output: f64) -> f64 {
        let way = output - state.output;
        if way == 0.0 {
            return state.operator.input;
        }
        // The input falls where the output rises with f and g below 0.
        let rises = (way > 0.0) == (self.0.turn > 0.0);
        let reachable = output.abs() < MOST_OUTPUT;
        let volts = if reachable { self.input(&state.operator, output, rises) } else { f64::NAN };
        if !volts.is_finite() {
            return f64::NAN;
        }
        state.operator = self.0.taken(&state.operator, volts);
        state.output = output;
        volts
    }
}
