//! Modified Prandtl-Ishlinskii operator: weighted play operators followed by dead-zone operators.
//!
//! ```text
//! z_i = max(u - r_i, min(u + r_i, z_i))           play (backlash) of threshold r_i
//! v   = w_0 u + sum_i w_i z_i                      Prandtl-Ishlinskii
//! y   = v + sum_j s_j max(v - d_j, 0)              one-sided dead zones
//! ```
//!
//! Kuhnen 2003, European Journal of Control 9(4), 407-418, doi 10.3166/ejc.9.407-418, with
//! one-sided dead zones of the form max(v - d, 0) only: a piezo driven from 0 V up needs no
//! others. Play operators alone give loops with point symmetry; the dead zones, which have no
//! memory, make the loops asymmetric.

use super::Operator;
use crate::Number;

/// Modified Prandtl-Ishlinskii operator with `PLAYS` play operators and `ZONES` dead zones.
///
/// ```
/// use piezotrack_control::hysteresis::{Operator, Play};
///
/// let (dead_zone_thresholds, dead_zone_weights) = ([], []);
/// let play = Play {
///     linear: 0.0,
///     thresholds: [3.0],
///     weights: [1.0],
///     dead_zone_thresholds,
///     dead_zone_weights,
/// };
/// let mut state = play.rest();
/// assert_eq!(play.follow(&mut state, 10.0), 7.0);
/// assert_eq!(play.follow(&mut state, 5.0), 7.0); // the backlash is 6 wide
/// assert_eq!(play.follow(&mut state, 0.0), 3.0);
/// ```
///
/// It is strictly increasing, and so has an inverse, where `linear` and all partial sums of
/// 1 + `dead_zone_weights` are positive and no weight is negative. With `linear` and all weights
/// negative it is strictly decreasing: the dead zones act on the sum as before, so that the output
/// is that of positive weights for the negative input.
///
/// The unit of the output is free; it is written Y here: V, or m for a stage.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `linear` | w0 | Y/V | not 0 |
/// | `thresholds` | r | V | >= 0, ascending |
/// | `weights` | w | Y/V | 0, or of the sign of w0 |
/// | `dead_zone_thresholds` | d | Y | ascending |
/// | `dead_zone_weights` | s | 1 | partial sums above -1 |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Play<N, const PLAYS: usize, const ZONES: usize> {
    /// Gain of the path without memory, w0: the slope right after a reversal.
    pub linear: N,
    /// Threshold of each play operator, half the width of its backlash, r, V.
    pub thresholds: [N; PLAYS],
    /// Weight of each play operator, w.
    pub weights: [N; PLAYS],
    /// Threshold of each dead zone, d, in the unit of the output.
    pub dead_zone_thresholds: [N; ZONES],
    /// Weight of each dead zone: the change of the slope at its threshold, s.
    pub dead_zone_weights: [N; ZONES],
}

/// Distances below this are roundings, relative to the numbers that they are between.
const ROUNDING: f64 = 1e-12;

/// State of the operator: its input, the output of each play operator, and the slope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlayState<N, const PLAYS: usize> {
    /// Input, V.
    pub input: N,
    /// Output of each play operator, V.
    pub plays: [N; PLAYS],
    /// Slope of the weighted sum along the last section of the path.
    pub slope: N,
}

crate::snapshot!([N: crate::Snapshot, const PLAYS: usize] PlayState<N, PLAYS> { input, plays, slope });

/// A state about to be left in one direction.
#[derive(Clone, Copy, Debug)]
pub struct PlayBranch<N, const PLAYS: usize> {
    from: PlayState<N, PLAYS>,
    direction: N,
}

impl<N: Number, const PLAYS: usize, const ZONES: usize> Play<N, PLAYS, ZONES> {
    /// Moves the input to `input` (V) and returns the output.
    ///
    /// Exact for a step of any length, provided that the input is monotone within it.
    #[inline(always)]
    pub fn follow(&self, state: &mut PlayState<N, PLAYS>, input: N) -> N {
        let distance = input - state.input;
        let branch = self.branch(state, distance.where_negative(-one(input), one(input)));
        // The input itself, not the old one plus the difference, which may be rounded.
        *state = self.at(&branch, input);
        self.output(state).0
    }

    /// The state where the input has become `input`.
    #[inline(always)]
    fn at(&self, branch: &PlayBranch<N, PLAYS>, input: N) -> PlayState<N, PLAYS> {
        let zero = input.like(0.0);
        let mut plays = branch.from.plays;
        let mut slope = self.linear;
        for (i, play) in plays.iter_mut().enumerate() {
            let (low, high) = (input - self.thresholds[i], input + self.thresholds[i]);
            *play = low.larger(high.smaller(*play));
            // A play moves with the input where it touches the side that pushes it.
            let gap = branch.direction.where_negative(*play - high, low - *play);
            slope = slope + gap.where_negative(zero, self.weights[i]);
        }
        PlayState { input, plays, slope }
    }
}

impl<const PLAYS: usize, const ZONES: usize> Play<f64, PLAYS, ZONES> {
    /// As [`Self::follow`], where the plays after the first `used` and the dead zones after the
    /// first `zones` weigh 0; of one state or of lanes of them.
    #[inline(always)]
    pub fn follow_used<N: Number>(
        &self,
        state: &mut PlayState<N, PLAYS>,
        input: N,
        (used, zones): (usize, usize),
    ) -> N {
        let way = input - state.input;
        let output = self.moved(&mut state.plays, input, (used, zones));
        let zero = input.like(0.0);
        let mut slope = input.like(self.linear);
        let settings = self.thresholds.iter().zip(&self.weights);
        for ((threshold, weight), play) in settings.zip(&state.plays).take(used) {
            let (threshold, weight) = (input.like(*threshold), input.like(*weight));
            let (low, high) = (input - threshold, input + threshold);
            let gap = way.where_negative(*play - high, low - *play);
            slope = slope + gap.where_negative(zero, weight);
        }
        (state.input, state.slope) = (input, slope);
        output
    }

    /// Moves the plays with the input to `input` (V) and returns the output, as
    /// [`Self::follow_used`], where the slope is of no use.
    #[inline(always)]
    pub fn moved<N: Number>(
        &self,
        plays: &mut [N; PLAYS],
        input: N,
        (used, zones): (usize, usize),
    ) -> N {
        let number = |value: f64| input.like(value);
        let mut value = number(self.linear) * input;
        let settings = self.thresholds.iter().zip(&self.weights);
        for ((threshold, weight), play) in settings.zip(plays).take(used) {
            let threshold = number(*threshold);
            *play = (input - threshold).larger((input + threshold).smaller(*play));
            value = value + number(*weight) * *play;
        }
        let zero = number(0.0);
        let mut bent = value;
        let settings = self.dead_zone_thresholds.iter().zip(&self.dead_zone_weights);
        for (corner, bend) in settings.take(zones) {
            let beyond = value - number(*corner);
            bent = bent + beyond.where_negative(zero, number(*bend) * beyond);
        }
        bent
    }

    /// The end of the first part of the way to `input` (V) along which the output is a straight
    /// line: where a play starts to move, or the weighted sum passes a dead zone's threshold;
    /// `input` where all of the way is. Those after the first `used` plays weigh 0.
    #[must_use]
    pub fn straight(&self, state: &PlayState<f64, PLAYS>, input: f64, used: usize) -> f64 {
        let from = state.input;
        let side = if input < from { -1.0 } else { 1.0 };
        let plays = || {
            let settings = self.thresholds.iter().zip(&self.weights);
            settings.zip(&state.plays).take(used).map(|((r, w), z)| (*r, *w, *z))
        };
        let mut end = input;
        // What is nearer is a corner that the input stands at, but for a rounding.
        let least = ROUNDING * (from.abs() + input.abs());
        for (threshold, weight, play) in plays() {
            let corner = play + side * threshold;
            if side * (corner - from) > least && side * (end - corner) > 0.0 && weight != 0.0 {
                end = corner;
            }
        }
        if self.dead_zone_weights.iter().all(|weight| *weight == 0.0) {
            return end;
        }
        let (mut before, mut after) = (self.linear * from, self.linear * end);
        for (threshold, weight, play) in plays() {
            before += weight * play;
            after += weight * (end - threshold).max((end + threshold).min(play));
        }
        let rise = after - before;
        let least = ROUNDING * (before.abs() + after.abs()) / rise.abs();
        let mut share = 1.0;
        for (corner, weight) in self.dead_zone_thresholds.iter().zip(&self.dead_zone_weights) {
            let place = (corner - before) / rise;
            if place > least && place < share && *weight != 0.0 {
                share = place;
            }
        }
        if share < 1.0 { from + share * (end - from) } else { end }
    }
}

impl<N: Number, const PLAYS: usize, const ZONES: usize> Operator<N> for Play<N, PLAYS, ZONES> {
    type State = PlayState<N, PLAYS>;
    type Branch = PlayBranch<N, PLAYS>;

    #[inline(always)]
    fn rest(&self) -> PlayState<N, PLAYS> {
        let zero = self.linear.like(0.0);
        PlayState { input: zero, plays: [zero; PLAYS], slope: self.linear }
    }

    #[inline(always)]
    fn output(&self, state: &PlayState<N, PLAYS>) -> (N, N) {
        let mut value = self.linear * state.input;
        for (weight, play) in self.weights.iter().zip(&state.plays) {
            value = value + *weight * *play;
        }
        let zero = value.like(0.0);
        let (mut bent, mut factor) = (value, one(value));
        for (corner, bend) in self.dead_zone_thresholds.iter().zip(&self.dead_zone_weights) {
            let beyond = value - *corner;
            bent = bent + beyond.where_negative(zero, *bend * beyond);
            factor = factor + beyond.where_negative(zero, *bend);
        }
        (bent, factor * state.slope)
    }

    #[inline(always)]
    fn branch(&self, state: &PlayState<N, PLAYS>, direction: N) -> PlayBranch<N, PLAYS> {
        PlayBranch { from: *state, direction }
    }

    #[inline(always)]
    fn along(&self, branch: &PlayBranch<N, PLAYS>, distance: N) -> PlayState<N, PLAYS> {
        self.at(branch, branch.from.input + distance)
    }
}

#[inline(always)]
fn one<N: Number>(like: N) -> N {
    like.like(1.0)
}
