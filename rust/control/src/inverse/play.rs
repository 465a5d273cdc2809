//! The inverse of the modified Prandtl-Ishlinskii operator: one of the same kind, in closed form.
//!
//! ```text
//! v = S^-1(y) = y + sum_j s'_j max(y - d'_j, 0)          inverse of the dead zones
//! u = w'_0 v + sum_i w'_i z'_i,  z'_i a play of threshold r'_i driven by v
//!
//! r'_i = |sum_{j <= i} w_j (r_i - r_j)|                   r_0 = 0
//! w'_0 = 1 / w_0,   w'_i = 1 / W_i - 1 / W_(i-1),         W_i = w_0 + ... + w_i
//! z'_i = sum_{j <= i} w_j z_i + sum_{j > i} w_j z_j       the same memory
//! d'_j = S(d_j),   s'_j = 1 / m_j - 1 / m_(j-1),          m_j = 1 + s_1 + ... + s_j
//! ```
//!
//! Kuhnen 2003, European Journal of Control 9(4), 407-418, doi 10.3166/ejc.9.407-418. A step
//! takes as long as one of the operator. It holds for negative weights too.

use super::Inverse;
use crate::cast::{Cast, all_rounded, rounded};
use crate::error::{Result, check, finite, not_negative};
use crate::hysteresis::{Operator, Play, PlayState};
use crate::number::Real;

/// Inverse of a [`Play`] with `PLAYS` play operators and `ZONES` dead zones: output in, input out.
///
/// ```
/// use piezotrack_control::PlayInverse;
/// use piezotrack_control::hysteresis::{Operator, Play};
///
/// # fn main() -> piezotrack_control::Result<()> {
/// let play = Play {
///     linear: 0.5,
///     thresholds: [1.0, 2.0],
///     weights: [0.3, 0.2],
///     dead_zone_thresholds: [4.0],
///     dead_zone_weights: [0.1],
/// };
/// let inverse = PlayInverse::new(&play)?;
/// let (mut there, mut back) = (play.rest(), inverse.rest());
/// for input in [10.0, 2.0, 7.0, 6.5, 8.0, 0.0] {
///     let output = play.follow(&mut there, input);
///     assert!((inverse.follow(&mut back, output) - input).abs() < 1e-13);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlayInverse<const PLAYS: usize, const ZONES: usize, T = f64> {
    /// Thresholds of the dead zones at the output, d'.
    dead_zone_thresholds: [T; ZONES],
    /// Changes of the slope of the inverse there, s'.
    dead_zone_weights: [T; ZONES],
    /// Play operators with transformed thresholds and weights, without dead zones.
    plays: Play<T, PLAYS, 0>,
}

impl<const PLAYS: usize, const ZONES: usize> PlayInverse<PLAYS, ZONES> {
    /// Transforms the thresholds, weights and dead zones.
    ///
    /// # Errors
    /// Where the operator has no inverse of this form: `linear` is 0 or within 1e-100 of it, a weight has another sign,
    /// thresholds or dead-zone thresholds do not ascend, or a slope of the dead zones is
    /// not above 0.
    pub fn new(play: &Play<f64, PLAYS, ZONES>) -> Result<Self> {
        let (dead_zone_thresholds, dead_zone_weights) = zones(play)?;
        Ok(Self { dead_zone_thresholds, dead_zone_weights, plays: plays(play)? })
    }

    /// The state of the inverse of the operator `play` in the state `state`.
    #[must_use]
    pub fn memory<const ANY: usize>(
        &self,
        play: &Play<f64, PLAYS, ANY>,
        state: &PlayState<f64, PLAYS>,
    ) -> PlayState<f64, PLAYS> {
        let mut inverse = self.plays.rest();
        let mut sum = play.linear;
        let weighted = play.weights.iter().zip(&state.plays);
        let mut after: f64 = weighted.map(|(weight, play)| weight * play).sum();
        inverse.input = play.linear * state.input + after;
        for i in 0..PLAYS {
            sum += play.weights[i];
            after -= play.weights[i] * state.plays[i];
            inverse.plays[i] = sum * state.plays[i] + after;
        }
        inverse
    }
}

impl<const PLAYS: usize, const ZONES: usize> Cast for PlayInverse<PLAYS, ZONES> {
    type In<T: Real> = PlayInverse<PLAYS, ZONES, T>;

    fn cast<T: Real>(&self) -> Result<PlayInverse<PLAYS, ZONES, T>> {
        Ok(PlayInverse {
            dead_zone_thresholds: all_rounded(
                "dead_zone_thresholds",
                &self.dead_zone_thresholds,
                "",
            )?,
            dead_zone_weights: all_rounded("dead_zone_weights", &self.dead_zone_weights, "")?,
            plays: Play {
                linear: rounded("linear", self.plays.linear, "")?,
                thresholds: all_rounded("thresholds", &self.plays.thresholds, "")?,
                weights: all_rounded("weights", &self.plays.weights, "")?,
                dead_zone_thresholds: [],
                dead_zone_weights: [],
            },
        })
    }
}

impl<const PLAYS: usize, const ZONES: usize, T: Real> PlayInverse<PLAYS, ZONES, T> {
    /// The state of the inverse of an operator at rest.
    #[must_use]
    pub fn rest(&self) -> PlayState<T, PLAYS> {
        self.plays.rest()
    }

    /// Moves the output of the operator to `output` and returns its input (V).
    ///
    /// Exact for a step of any length, provided that the output is monotone within it. NaN, with
    /// the state unchanged, where `output` is not finite (or beyond 1e100), or what goes into the
    /// dead zones is not.
    #[inline]
    pub fn follow(&self, state: &mut PlayState<T, PLAYS>, output: T) -> T {
        let before = self.before_dead_zones(output);
        if !(output.is_usable() && before.is_usable()) {
            return T::NAN;
        }
        self.plays.follow(state, before)
    }

    /// Input of the dead zones where `output` comes out of them: the weighted sum of the
    /// plays.
    #[must_use]
    #[inline]
    pub fn before_dead_zones(&self, output: T) -> T {
        let mut value = output;
        for (corner, bend) in self.dead_zone_thresholds.iter().zip(&self.dead_zone_weights) {
            let beyond = output - *corner;
            if beyond > T::ZERO {
                value = value + *bend * beyond;
            }
        }
        value
    }
}

/// The operator's output is the displacement; velocity and acceleration have no effect.
impl<const PLAYS: usize, const ZONES: usize, T: Real> Inverse<T> for PlayInverse<PLAYS, ZONES, T> {
    type State = PlayState<T, PLAYS>;

    fn rest(&self) -> Self::State {
        self.rest()
    }

    #[inline]
    fn step(&self, state: &mut Self::State, x: T, _v: T, _a: T) -> T {
        self.follow(state, x)
    }
}

/// Thresholds and slope changes of the inverse of the dead zones.
fn zones<const PLAYS: usize, const ZONES: usize>(
    play: &Play<f64, PLAYS, ZONES>,
) -> Result<([f64; ZONES], [f64; ZONES])> {
    let (mut dead_zone_thresholds, mut dead_zone_weights) = ([0.0; ZONES], [0.0; ZONES]);
    let (mut slope, mut height, mut before) = (1.0, 0.0, 0.0);
    for j in 0..ZONES {
        let corner = finite("dead_zone_thresholds", play.dead_zone_thresholds[j], "")?;
        if j == 0 {
            height = corner;
        } else {
            check(
                "dead_zone_thresholds",
                corner,
                "",
                corner >= before,
                "dead_zone_thresholds that ascend",
            )?;
            height += slope * (corner - before);
        }
        let next = slope + finite("dead_zone_weights", play.dead_zone_weights[j], "")?;
        check(
            "dead_zone_weights",
            play.dead_zone_weights[j],
            "",
            next > 0.0,
            "dead_zone_weights whose sums stay above -1",
        )?;
        (dead_zone_thresholds[j], dead_zone_weights[j]) = (height, (slope - next) / (next * slope));
        (slope, before) = (next, corner);
    }
    Ok((dead_zone_thresholds, dead_zone_weights))
}

/// Play operators with transformed thresholds and weights.
fn plays<const PLAYS: usize, const ZONES: usize>(
    play: &Play<f64, PLAYS, ZONES>,
) -> Result<Play<f64, PLAYS, 0>> {
    // So that no input overflows: the slopes of the inverse are not above 1/linear.
    let right = play.linear.is_finite() && play.linear.abs() >= 1e-100;
    let expected = "a finite number, 1e-100 or more from 0";
    let mut sum = check("linear", play.linear, "", right, expected)?;
    let sign = sum.signum();
    let mut inverse = Play {
        linear: 1.0 / sum,
        thresholds: [0.0; PLAYS],
        weights: [0.0; PLAYS],
        dead_zone_thresholds: [],
        dead_zone_weights: [],
    };
    // r'_i = r'_(i-1) + W_(i-1) (r_i - r_(i-1)): sums of what is not negative.
    let (mut threshold, mut before) = (0.0, 0.0);
    for i in 0..PLAYS {
        let here = not_negative("thresholds", play.thresholds[i], "V")?;
        check("thresholds", here, "V", here >= before, "thresholds that ascend")?;
        let weight = finite("weights", play.weights[i], "")?;
        check(
            "weights",
            weight,
            "",
            sign * weight >= 0.0,
            "0 or a number with the sign of linear",
        )?;
        threshold += sign * sum * (here - before);
        let next = sum + weight;
        inverse.thresholds[i] = threshold;
        inverse.weights[i] = -weight / (next * sum);
        (sum, before) = (next, here);
    }
    Ok(inverse)
}
