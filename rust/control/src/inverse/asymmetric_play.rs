//! The inverse of the asymmetric Prandtl-Ishlinskii operator, by Newton's method.
//!
//! From a state, the output on a rise or a fall of the input is continuous and steeper than
//! `linear`, so that the input of an output y is no farther than `(y - y_now)/linear`; there it is
//! found between two places.

use super::OperatorInverse;
use crate::error::usable;
use crate::hysteresis::{AsymmetricPlay, AsymmetricPlayState};
use crate::root::rising_root;

/// Inverse of an [`AsymmetricPlay`]: output in, input out.
///
/// ```
/// use piezotrack_control::hysteresis::{AsymmetricPlay, PlayFamily};
/// use piezotrack_control::{AsymmetricPlayInverse, OperatorInverse};
///
/// let family = PlayFamily { thresholds: [1.0, 2.0], weights: [0.3, 0.2], count: 2 };
/// let operator = AsymmetricPlay { linear: 0.5, range: (0.0, 10.0), families: [family; 3] };
/// let inverse = AsymmetricPlayInverse(operator);
/// let (mut there, mut back) = (operator.at_rest(), inverse.rest());
/// for input in [10.0, 2.0, 7.0, 6.5, 8.0, 0.0, -3.0, 14.0] {
///     let output = operator.follow(&mut there, input);
///     assert!((inverse.follow(&mut back, output) - input).abs() < 1e-13);
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsymmetricPlayInverse<const PLAYS: usize>(pub AsymmetricPlay<PLAYS>);

/// Its state: that of the operator, and the output requested last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsymmetricPlayInverseState<const PLAYS: usize> {
    operator: AsymmetricPlayState<PLAYS>,
    output: f64,
}

crate::snapshot!([const PLAYS: usize] AsymmetricPlayInverseState<PLAYS> { operator, output });

impl<const PLAYS: usize> AsymmetricPlayInverse<PLAYS> {
    /// The state for an operator in a given state.
    #[must_use]
    pub fn memory(
        &self,
        operator: &AsymmetricPlayState<PLAYS>,
    ) -> AsymmetricPlayInverseState<PLAYS> {
        AsymmetricPlayInverseState { operator: *operator, output: self.0.value(operator) }
    }

    /// The input for an output.
    #[inline]
    fn input(&self, from: &AsymmetricPlayState<PLAYS>, output: f64) -> f64 {
        let (here, linear) = (self.0.value(from), self.0.linear);
        let turn = linear.signum();
        // In the direction in which the output rises with the way; falling weights turn it.
        let up = if output >= here { 1.0 } else { -1.0 };
        let side = up * turn;
        let way = |way: f64| {
            let (value, slope) = self.0.ahead(from, from.input + side * way, side > 0.0);
            (up * (value - output), turn * slope)
        };
        from.input + side * rising_root((output - here).abs() / linear.abs(), way)
    }
}

impl<const PLAYS: usize> OperatorInverse for AsymmetricPlayInverse<PLAYS> {
    type State = AsymmetricPlayInverseState<PLAYS>;

    fn rest(&self) -> Self::State {
        self.memory(&self.0.at_rest())
    }

    /// For a step of any length, provided that the output is monotone within it: right to a share
    /// of 2^-50 of what the output's change would be over `linear` alone, in 100 steps at most,
    /// and to rounding in the few that there are otherwise.
    #[inline]
    fn follow(&self, state: &mut Self::State, output: f64) -> f64 {
        if output - state.output == 0.0 {
            return state.operator.input;
        }
        let volts = if usable(output) { self.input(&state.operator, output) } else { f64::NAN };
        if !volts.is_finite() {
            return f64::NAN;
        }
        self.0.follow(&mut state.operator, volts);
        state.output = output;
        volts
    }
}
