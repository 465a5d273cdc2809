//! The Preisach operator: relays that switch up at one voltage and down at another.
//!
//! ```text
//! H(u) = w_0 u + sum over the strokes between reversals of +E (rise) or -E (fall)
//! E(v_i, v_j) = sum of the masses mu_kl of the cells with v_j <= v_l,  v_(k+1) <= v_i
//! ```
//!
//! Mayergoyz 1986, Physical Review Letters 56, 1518-1521, doi 10.1103/PhysRevLett.56.1518, and
//! Mayergoyz 2003, Mathematical Models of Hysteresis and Their Applications; on piezoceramic
//! actuators Ge and Jouaneh 1995, Precision Engineering 17(3), 211-221, doi
//! 10.1016/0141-6359(95)00002-U. Relays that switch up at a and down at b are spread over cells
//! between levels of a and b; [`Everett`] has the sums, [`Reversals`] the memory.
//!
//! Along a branch the output is straight between levels and wiped-out reversals: the inverse goes
//! from corner to corner and is exact. Outside the levels only `w_0` acts. With levels that are
//! equally far apart and all masses of a diagonal k = i - j equal, paths that reverse at levels
//! have the output of a play of threshold k/2 times that distance.
//!
//! A stage that never moved remembers reversals that die out at 0 V: those relays are switched up
//! whose a + b is below 0, as plays at rest at 0 V have it. The line a + b = 0 is drawn in steps
//! from level to level, on average through the middle of a cell.

use piezotrack_control::OperatorInverse;
use piezotrack_control::hysteresis::Operator;

use super::everett::{Everett, MOST_LEVELS};
use super::reversals::{MOST_REVERSALS, Reversals};
use crate::error::Result;
use crate::models::input::input_stage::{InputOperator, Remembering, Segmented, state_with};
use crate::models::parameters::values::ParameterInfo;
use crate::models::plays::prandtl_ishlinskii::direction;

/// Outputs beyond this are none.
const MOST_OUTPUT: f64 = 1e100;

/// The operator: relays on a plane of cells, V to m.
///
/// ```
/// use piezotrack_core::models::PreisachOperator;
///
/// # fn main() -> piezotrack_core::Result<()> {
/// // Relays without memory below, above, and such that switch up above 50 V and down below it.
/// let preisach =
///     PreisachOperator::new(1e-6, &[0.0, 50.0, 100.0], &[5e-6, 10e-6, 15e-6])?;
/// let mut state = preisach.rest();
/// assert!((preisach.follow(&mut state, 100.0) - 130e-6).abs() < 1e-18);
/// assert!((preisach.follow(&mut state, 50.0) - 65e-6).abs() < 1e-18);
/// assert!((preisach.follow(&mut state, 25.0) - 32.5e-6).abs() < 1e-18);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreisachOperator {
    /// Gain without memory, m/V, not 0.
    pub(in crate::models) linear: f64,
    pub(in crate::models) everett: Everett,
}

/// Its state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreisachState {
    /// Input, V.
    input: f64,
    /// Of the input within the levels.
    pub(in crate::models) reversals: Reversals,
}

piezotrack_control::snapshot!(PreisachState { input, reversals });

impl PreisachState {
    /// The input, V.
    #[must_use]
    pub fn input(&self) -> f64 {
        self.input
    }

    /// The lowest level and the reversals since, V: maxima and minima in turn.
    #[must_use]
    pub fn turns(&self) -> &[f64] {
        self.reversals.turns()
    }
}

impl PreisachOperator {
    /// From the gain without memory (m/V), the levels (V, ascending) and the masses (m) of the
    /// cells, all of one sign with it. They stand in rows of the interval in which their relays
    /// switch up, from the lowest interval in which they switch down to the same one.
    ///
    /// # Errors
    /// [`crate::error::Error::Shape`] where entries are missing or too many,
    /// [`crate::error::Error::Parameter`] where one is out of its range.
    pub fn new(linear: f64, levels: &[f64], masses: &[f64]) -> Result<Self> {
        let sign = direction(linear)?;
        Ok(Self { linear, everett: Everett::new(levels, masses, sign)? })
    }

    /// The state before any voltage.
    #[must_use]
    pub fn rest(&self) -> PreisachState {
        let (lowest, highest) = self.everett.ends();
        // As far as the levels reach to both sides.
        let reach = highest.min(-lowest);
        let mut sizes = [0.0; MOST_LEVELS + 1];
        let mut count = 0;
        for level in self.everett.levels() {
            let size = level.abs();
            if size > 0.0 && size <= reach && !sizes[..count].contains(&size) {
                sizes[count] = size;
                count += 1;
            }
        }
        sizes[..count].sort_unstable_by(|one, other| other.total_cmp(one));
        let mut reversals = Reversals::rise(lowest, lowest);
        // The last size is 0.
        for pair in sizes[..=count].windows(2) {
            reversals.follow(pair[0]);
            reversals.follow(-0.5 * (pair[0] + pair[1]));
        }
        reversals.follow(0.0_f64.clamp(lowest, highest));
        PreisachState { input: 0.0, reversals }
    }

    /// Takes the input to `volts` and returns the output, m.
    #[inline]
    pub fn follow(&self, state: &mut PreisachState, volts: f64) -> f64 {
        self.take(state, volts);
        self.value(state)
    }

    /// Output of a state, m.
    #[inline]
    fn value(&self, state: &PreisachState) -> f64 {
        let turns = state.reversals.turns();
        let places = turns.iter().copied().skip(1).chain([state.reversals.place()]);
        let strokes = turns.iter().zip(places).map(|(from, to)| self.everett.stroke(*from, to));
        self.linear * state.input + strokes.sum::<f64>()
    }

    /// Takes the input to `volts`.
    #[inline]
    fn take(&self, state: &mut PreisachState, volts: f64) {
        let (lowest, highest) = self.everett.ends();
        state.reversals.follow(volts.clamp(lowest, highest));
        state.input = volts;
    }

    /// The next corner of the output on a rise or a fall, V, or infinity.
    #[inline]
    fn corner(&self, state: &PreisachState, rises: bool) -> f64 {
        let (input, levels) = (state.input, self.everett.levels());
        let wiped = state.reversals.wiped_at(rises);
        if rises {
            levels
                .iter()
                .copied()
                .find(|level| *level > input)
                .map_or(f64::INFINITY, |level| if wiped > input { wiped.min(level) } else { level })
        } else {
            let mut below = levels.iter().rev().copied();
            below.find(|level| *level < input).map_or(f64::NEG_INFINITY, |level| {
                if wiped < input { wiped.max(level) } else { level }
            })
        }
    }

    /// The change of the output on the way to `volts`, which lies up to the next corner.
    #[inline]
    fn rise(&self, state: &PreisachState, volts: f64) -> f64 {
        let (lowest, highest) = self.everett.ends();
        let (from, to) = (state.reversals.place(), volts.clamp(lowest, highest));
        let beginning = state.reversals.beginning(volts > state.input);
        let stroke = |to: f64| self.everett.stroke(beginning, to);
        self.linear * (volts - state.input) + (stroke(to) - stroke(from))
    }
}

impl InputOperator for PreisachOperator {
    type State = PreisachState;

    fn rest(&self) -> PreisachState {
        Self::rest(self)
    }

    #[inline]
    fn follow(&self, state: &mut PreisachState, volts: f64) -> f64 {
        Self::follow(self, state, volts)
    }

    #[inline]
    fn input(&self, state: &PreisachState) -> f64 {
        state.input
    }
}

impl Remembering for PreisachOperator {
    const STATE: &'static [ParameterInfo] = &state_with(ParameterInfo::list("reversals", "m", "V"));

    fn memory(&self, state: &PreisachState) -> Vec<f64> {
        state.reversals.memory()
    }

    fn recall(
        &self,
        state: &mut PreisachState,
        _volts: f64,
        memory: &[f64],
    ) -> core::result::Result<(), String> {
        let expected = || {
            let (low, high) = self.everett.ends();
            format!(
                "maxima and minima in turn, from {low} V to {high} V, each within the two before it, \
                 {} at most",
                MOST_REVERSALS - 1
            )
        };
        let reversals = Reversals::recalled(self.everett.ends(), memory).ok_or_else(expected)?;
        *state = PreisachState { input: reversals.place(), reversals };
        Ok(())
    }
}

impl Segmented for PreisachOperator {
    fn next_breakpoint(&self, state: &PreisachState, volts: f64, _deviation: f64) -> f64 {
        let corner = self.corner(state, volts >= state.input);
        if volts >= state.input { volts.min(corner) } else { volts.max(corner) }
    }

    fn largest_curvature(&self) -> f64 {
        0.0
    }

    fn slope_jump(&self) -> f64 {
        self.everett.steepest()
    }
}

impl Operator<f64> for PreisachOperator {
    type State = PreisachState;
    type Branch = PreisachState;

    fn rest(&self) -> PreisachState {
        Self::rest(self)
    }

    fn output(&self, state: &PreisachState) -> (f64, f64) {
        let (lowest, highest) = self.everett.ends();
        let inside = (lowest..=highest).contains(&state.input);
        let from = state.turns().last().copied().unwrap_or(lowest);
        let slope = if inside { self.everett.slope(from, state.input) } else { 0.0 };
        (self.value(state), self.linear + slope)
    }

    fn branch(&self, state: &PreisachState, _direction: f64) -> PreisachState {
        *state
    }

    fn along(&self, branch: &PreisachState, distance: f64) -> PreisachState {
        let mut state = *branch;
        self.take(&mut state, branch.input + distance);
        state
    }
}

/// The inverse: output in, m, input out, V; closed along each branch.
///
/// ```
/// use piezotrack_control::OperatorInverse;
/// use piezotrack_core::models::{PreisachInverse, PreisachOperator};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let preisach = PreisachOperator::new(1e-6, &[0.0, 50.0, 100.0], &[5e-6, 10e-6, 15e-6])?;
/// let inverse = PreisachInverse(preisach);
/// let (mut there, mut back) = (preisach.rest(), inverse.rest());
/// for volts in [80.0, 20.0, 60.0, 120.0, 0.0] {
///     let output = preisach.follow(&mut there, volts);
///     assert!((inverse.follow(&mut back, output) - volts).abs() < 1e-12);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreisachInverse(pub PreisachOperator);

/// Its state: that of the operator, and the output requested last, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreisachInverseState {
    operator: PreisachState,
    output: f64,
}

piezotrack_control::snapshot!(PreisachInverseState { operator, output });

impl PreisachInverse {
    /// The state for an operator in a given state.
    #[must_use]
    pub fn memory(&self, operator: &PreisachState) -> PreisachInverseState {
        PreisachInverseState { operator: *operator, output: self.0.value(operator) }
    }

    /// The input for an output (m) on a rise or a fall of the input.
    #[inline]
    fn input(&self, from: &PreisachState, output: f64, rises: bool) -> f64 {
        let operator = &self.0;
        let (mut state, mut rest) = (*from, output - operator.value(from));
        let sign = if rises == (operator.linear > 0.0) { 1.0 } else { -1.0 };
        loop {
            let corner = operator.corner(&state, rises);
            let (before, way) = (state.input, corner - state.input);
            if corner.is_infinite() {
                return before + rest / operator.linear;
            }
            let rise = operator.rise(&state, corner);
            if sign * (rest - rise) <= 0.0 {
                // Below 0 by a rounding only.
                return before + way * (rest / rise).max(0.0);
            }
            rest -= rise;
            operator.take(&mut state, corner);
        }
    }
}

impl OperatorInverse for PreisachInverse {
    type State = PreisachInverseState;

    fn rest(&self) -> PreisachInverseState {
        self.memory(&self.0.rest())
    }

    /// Exact for a step of any length, provided that the output is monotone within it.
    #[inline]
    fn follow(&self, state: &mut PreisachInverseState, output: f64) -> f64 {
        let way = output - state.output;
        if way == 0.0 {
            return state.operator.input;
        }
        // The input falls where the output rises with negative weights.
        let rises = (way > 0.0) == (self.0.linear > 0.0);
        let reachable = output.abs() < MOST_OUTPUT;
        let volts = if reachable { self.input(&state.operator, output, rises) } else { f64::NAN };
        if !volts.is_finite() {
            return f64::NAN;
        }
        self.0.take(&mut state.operator, volts);
        state.output = output;
        volts
    }
}
