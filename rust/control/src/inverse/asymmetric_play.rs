//! The inverse of the asymmetric Prandtl-Ishlinskii operator, by Newton's method.
//!
//! From a state, the output on a rise or a fall of the input is continuous and steeper than
//! `linear`, so that the input of an output y is no farther than `(y - y_now)/linear`; there it is
//! found between two places.

use super::OperatorInverse;
use crate::cast::Cast;
use crate::error::Result;
use crate::hysteresis::{AsymmetricPlay, AsymmetricPlayState};
use crate::number::Real;
use crate::root::rising_root;

/// Inverse of an [`AsymmetricPlay`]: output in, input out.
///
/// ```
/// use piezotrack_control::hysteresis::{AsymmetricPlay, PlayFamily};
/// use piezotrack_control::{AsymmetricPlayInverse, OperatorInverse};
///
/// let family = PlayFamily { thresholds: [1.0, 2.0], weights: [0.3, 0.2], count: 2 };
/// let operator = AsymmetricPlay { linear: 0.5_f64, range: (0.0, 10.0), families: [family; 3] };
/// let inverse = AsymmetricPlayInverse(operator);
/// let (mut there, mut back) = (operator.at_rest(), inverse.rest());
/// for input in [10.0, 2.0, 7.0, 6.5, 8.0, 0.0, -3.0, 14.0] {
///     let output = operator.follow(&mut there, input);
///     assert!((inverse.follow(&mut back, output) - input).abs() < 1e-13);
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsymmetricPlayInverse<const PLAYS: usize, T = f64>(pub AsymmetricPlay<PLAYS, T>);

/// Its state: that of the operator, and the output requested last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsymmetricPlayInverseState<const PLAYS: usize, T = f64> {
    operator: AsymmetricPlayState<PLAYS, T>,
    output: T,
}

crate::snapshot!(
    [const PLAYS: usize, T: Real] AsymmetricPlayInverseState<PLAYS, T> { operator, output }
);

impl<const PLAYS: usize> Cast for AsymmetricPlayInverse<PLAYS> {
    type In<T: Real> = AsymmetricPlayInverse<PLAYS, T>;

    fn cast<T: Real>(&self) -> Result<AsymmetricPlayInverse<PLAYS, T>> {
        Ok(AsymmetricPlayInverse(self.0.cast()?))
    }
}

impl<const PLAYS: usize, T: Real> AsymmetricPlayInverse<PLAYS, T> {
    /// The state for an operator in a given state.
    #[must_use]
    pub fn memory(
        &self,
        operator: &AsymmetricPlayState<PLAYS, T>,
    ) -> AsymmetricPlayInverseState<PLAYS, T> {
        AsymmetricPlayInverseState { operator: *operator, output: self.0.value(operator) }
    }

    /// The input for an output.
    #[inline]
    fn input(&self, from: &AsymmetricPlayState<PLAYS, T>, output: T) -> T {
        let (here, linear) = (self.0.value(from), self.0.linear);
        let sign = |rises: bool| T::of(if rises { 1.0 } else { -1.0 });
        let turn = sign(linear > T::ZERO);
        // In the direction in which the output rises with the way; falling weights turn it.
        let up = sign(output >= here);
        let side = up * turn;
        let way = |way: T| {
            let (value, slope) = self.0.ahead(from, from.input + side * way, side > T::ZERO);
            (up * (value - output), turn * slope)
        };
        from.input + side * rising_root((output - here).abs() / linear.abs(), way)
    }
}

impl<const PLAYS: usize, T: Real> OperatorInverse<T> for AsymmetricPlayInverse<PLAYS, T> {
    type State = AsymmetricPlayInverseState<PLAYS, T>;

    fn rest(&self) -> Self::State {
        self.memory(&self.0.at_rest())
    }

    /// For a step of any length, provided that the output is monotone within it: right to a share
    /// of 2^-50 of what the output's change would be over `linear` alone, in 100 steps at most,
    /// and to rounding in the few that there are otherwise.
    #[inline]
    fn follow(&self, state: &mut Self::State, output: T) -> T {
        if output - state.output == T::ZERO {
            return state.operator.input;
        }
        let volts = if output.is_usable() { self.input(&state.operator, output) } else { T::NAN };
        if !volts.is_finite() {
            return T::NAN;
        }
        self.0.follow(&mut state.operator, volts);
        state.output = output;
        volts
    }
}
