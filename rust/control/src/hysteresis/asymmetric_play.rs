//! Asymmetric Prandtl-Ishlinskii operator: plays of the input, and of a concave and a convex
//! function of it.
//!
//! ```text
//! y = w_0 u + sum_i w_i P_(r_i)[u] + sum_j v_j P_(s_j)[f(u)] + sum_k c_k P_(t_k)[g(u)]
//! P_r[e]: z = max(e - r, min(e + r, z))                play (backlash) of threshold r
//! f(u) = L (1 - (1 - s)^3),  g(u) = L s^3,  s = (u - low)/L,  L = high - low,
//!                                                      each less its value at 0
//! ```
//!
//! Plays of an increasing function of the input are generalised plays (Al Janaideh, Rakheja and
//! Su 2011, IEEE/ASME Transactions on Mechatronics 16(4), 734-744, doi
//! 10.1109/TMECH.2010.2052366); sums of Prandtl-Ishlinskii operators are Preisach operators
//! (Brokate and Sprekels 1996, Hysteresis and Phase Transitions, chapter 2), so that a later
//! extremum wipes out the smaller ones within it. Loops of plays of u have point symmetry. Those
//! of f(u) are wider where f is steep, at the lower end of the range, those of g(u) at the upper
//! one: their shares make a loop wider on one side than on the other, which dead zones, without
//! memory, do not.
//!
//! f and g are the increasing cubics of the range that bend most to one side. Beyond the range
//! they go on straight: with slope 3 where they are steep, level where they are not.

use super::Operator;
use crate::cast::{Cast, all_rounded, rounded};
use crate::error::Result;
use crate::number::Real;

/// Plays with one input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlayFamily<const PLAYS: usize, T = f64> {
    /// Threshold of each play, half the width of its backlash, V, 0 or above.
    pub thresholds: [T; PLAYS],
    /// Weight of each play, of the sign of the operator's `linear`, or 0.
    pub weights: [T; PLAYS],
    /// How many are used.
    pub count: usize,
}

impl<const PLAYS: usize, T: Real> PlayFamily<PLAYS, T> {
    /// Threshold, weight and place of the plays that are used.
    #[inline]
    fn with<'a>(
        &'a self,
        plays: &'a [T; PLAYS],
    ) -> impl Iterator<Item = (T, T, T)> + use<'a, PLAYS, T> {
        let settings = self.thresholds.iter().zip(&self.weights).zip(plays);
        settings.take(self.count).map(|((threshold, weight), play)| (*threshold, *weight, *play))
    }
}

impl<const PLAYS: usize> PlayFamily<PLAYS> {
    /// Sum of the weights' sizes.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.weights.iter().take(self.count).map(|weight| weight.abs()).sum()
    }
}

impl<const PLAYS: usize> Cast for PlayFamily<PLAYS> {
    type In<T: Real> = PlayFamily<PLAYS, T>;

    fn cast<T: Real>(&self) -> Result<PlayFamily<PLAYS, T>> {
        Ok(PlayFamily {
            thresholds: all_rounded("thresholds", &self.thresholds, "V")?,
            weights: all_rounded("weights", &self.weights, "")?,
            count: self.count,
        })
    }
}

/// Curve that the plays of a family follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bend {
    /// The input.
    Straight,
    /// f, steep at the lower end of the range.
    Concave,
    /// g, steep at the upper end of it.
    Convex,
}

impl Bend {
    /// Of the three families, in their order.
    pub const ALL: [Self; 3] = [Self::Straight, Self::Concave, Self::Convex];

    /// Its value (V) and slope at an input, V, in a range (V).
    #[must_use]
    #[inline]
    pub fn at<T: Real>(self, input: T, range: (T, T)) -> (T, T) {
        let (value, slope) = self.bare(input, range);
        (value - self.bare(T::ZERO, range).0, slope)
    }

    /// The input at which it has a value, both V; infinity beyond its level end.
    #[must_use]
    #[inline]
    pub fn reaches(self, value: f64, range: (f64, f64)) -> f64 {
        let (low, high) = range;
        let length = high - low;
        let share = (value + self.bare(0.0, range).0) / length;
        match self {
            Self::Straight => value,
            Self::Concave => low + length * place(share),
            Self::Convex => high - length * place(1.0 - share),
        }
    }

    /// The largest second derivative between two inputs, 1/V; none outside of the range.
    #[must_use]
    pub fn curvature(self, one: f64, other: f64, (low, high): (f64, f64)) -> f64 {
        let length = high - low;
        if one.max(other) <= low || one.min(other) >= high {
            return 0.0;
        }
        let away = match self {
            Self::Straight => return 0.0,
            Self::Concave => (high - one).max(high - other),
            Self::Convex => (one - low).max(other - low),
        };
        6.0 * (away / length).clamp(0.0, 1.0) / length
    }

    /// The function before its value at 0 is taken off.
    #[inline]
    fn bare<T: Real>(self, input: T, (low, high): (T, T)) -> (T, T) {
        let length = high - low;
        match self {
            Self::Straight => (input, T::of(1.0)),
            Self::Concave => {
                let (share, slope) = risen((high - input) / length);
                (length * share, slope)
            }
            Self::Convex => {
                let (share, slope) = risen((input - low) / length);
                (length * (T::of(1.0) - share), slope)
            }
        }
    }
}

/// 1 - t^3 and the size of its slope, straight beyond 0 and 1.
#[inline]
fn risen<T: Real>(t: T) -> (T, T) {
    let [one, three] = [1.0, 3.0].map(T::of);
    if t <= T::ZERO {
        (one, T::ZERO)
    } else if t >= one {
        (three * (one - t), three)
    } else {
        (one - t * t * t, three * t * t)
    }
}

/// The 1 - t at which [`risen`] has a value.
#[inline]
fn place(share: f64) -> f64 {
    if share <= 0.0 {
        share / 3.0
    } else if share >= 1.0 {
        f64::INFINITY
    } else {
        1.0 - libm::cbrt(1.0 - share)
    }
}

/// Distances below this are roundings, relative to the numbers that they are between.
const ROUNDING: f64 = 1e-12;

/// Asymmetric Prandtl-Ishlinskii operator with `PLAYS` plays in each family at most.
///
/// ```
/// use piezotrack_control::hysteresis::{AsymmetricPlay, PlayFamily};
///
/// let play = |weight| PlayFamily { thresholds: [1.0], weights: [weight], count: 1 };
/// let operator = AsymmetricPlay {
///     linear: 1.0,
///     range: (0.0, 10.0),
///     families: [play(0.0), play(0.5), play(0.0)],
/// };
/// let mut state = operator.at_rest();
/// // f(10) = 10, f(5) = 8.75
/// assert_eq!(operator.follow(&mut state, 10.0), 14.5);
/// assert_eq!(operator.follow(&mut state, 5.0), 9.5); // less than the backlash of 2
/// assert_eq!(operator.follow(&mut state, 0.0), 0.5);
/// ```
///
/// It is strictly increasing, and so has an inverse, where `linear` is above 0 and no weight is
/// below; with all signs turned it is strictly decreasing. The unit of the output is free; it is
/// written Y here: V, or m for a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsymmetricPlay<const PLAYS: usize, T = f64> {
    /// Gain of the path without memory, `w_0`, Y/V, not 0.
    pub linear: T,
    /// Ends of the range in which f and g bend, V, ascending.
    pub range: (T, T),
    /// Plays of u, f(u) and g(u), their weights in Y/V.
    pub families: [PlayFamily<PLAYS, T>; 3],
}

/// State of the operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsymmetricPlayState<const PLAYS: usize, T = f64> {
    /// Input, V.
    pub input: T,
    /// Output of each play of each family, V.
    pub plays: [[T; PLAYS]; 3],
    /// Slope of the output along the last section of the path, Y/V.
    pub slope: T,
}

crate::snapshot!(
    [const PLAYS: usize, T: Real] AsymmetricPlayState<PLAYS, T> { input, plays, slope }
);

impl<const PLAYS: usize> Cast for AsymmetricPlay<PLAYS> {
    type In<T: Real> = AsymmetricPlay<PLAYS, T>;

    fn cast<T: Real>(&self) -> Result<AsymmetricPlay<PLAYS, T>> {
        let [straight, concave, convex] = &self.families;
        Ok(AsymmetricPlay {
            linear: rounded("linear", self.linear, "")?,
            range: (rounded("range", self.range.0, "V")?, rounded("range", self.range.1, "V")?),
            families: [straight.cast()?, concave.cast()?, convex.cast()?],
        })
    }
}

impl<const PLAYS: usize, T: Real> AsymmetricPlay<PLAYS, T> {
    /// The state before any input.
    #[must_use]
    pub fn at_rest(&self) -> AsymmetricPlayState<PLAYS, T> {
        AsymmetricPlayState { input: T::ZERO, plays: [[T::ZERO; PLAYS]; 3], slope: self.linear }
    }

    /// Moves the input to `input` (V) and returns the output.
    ///
    /// Exact for a step of any length, provided that the input is monotone within it.
    #[inline]
    pub fn follow(&self, state: &mut AsymmetricPlayState<PLAYS, T>, input: T) -> T {
        let rises = input >= state.input;
        *state = self.taken(state, input, rises);
        self.value(state)
    }

    /// The state after a rise or a fall to `input`.
    #[inline]
    fn taken(
        &self,
        from: &AsymmetricPlayState<PLAYS, T>,
        input: T,
        rises: bool,
    ) -> AsymmetricPlayState<PLAYS, T> {
        let mut state = AsymmetricPlayState { input, slope: self.linear, ..*from };
        for ((bend, family), plays) in Bend::ALL.iter().zip(&self.families).zip(&mut state.plays) {
            if family.count == 0 {
                continue;
            }
            let (edge, rate) = bend.at(input, self.range);
            let settings = family.thresholds.iter().zip(&family.weights);
            for (play, (threshold, weight)) in plays.iter_mut().zip(settings).take(family.count) {
                let (low, high) = (edge - *threshold, edge + *threshold);
                // A play moves with its input where it touches the side that pushes it.
                let moves = if rises { low >= *play } else { high <= *play };
                *play = low.larger(high.smaller(*play));
                if moves {
                    state.slope = state.slope + *weight * rate;
                }
            }
        }
        state
    }

    /// Output and slope where the input has gone from a state to `input` on a rise or a fall.
    #[must_use]
    #[inline]
    pub fn ahead(&self, from: &AsymmetricPlayState<PLAYS, T>, input: T, rises: bool) -> (T, T) {
        let state = self.taken(from, input, rises);
        (self.value(&state), state.slope)
    }

    /// Output of a state.
    #[must_use]
    #[inline]
    pub fn value(&self, state: &AsymmetricPlayState<PLAYS, T>) -> T {
        let weighted = self.families.iter().zip(&state.plays).map(|(family, plays)| {
            let parts = family.with(plays).map(|(_, weight, play)| weight * play);
            parts.fold(T::of(-0.0), |sum, part| sum + part)
        });
        self.linear * state.input + weighted.fold(T::of(-0.0), |sum, part| sum + part)
    }
}

impl<const PLAYS: usize> AsymmetricPlay<PLAYS> {
    /// The families and what their plays follow.
    #[inline]
    fn parts(&self) -> impl Iterator<Item = (Bend, &PlayFamily<PLAYS>)> {
        Bend::ALL.into_iter().zip(&self.families).filter(|(_, family)| family.count > 0)
    }

    /// The end of the first part of the way to `input` (V) along which the output is a straight
    /// line to within `deviation`: where a play starts to move, an end of the range is passed, or
    /// the output has bent that far.
    #[must_use]
    pub fn straight(&self, state: &AsymmetricPlayState<PLAYS>, input: f64, deviation: f64) -> f64 {
        let from = state.input;
        let rises = input >= from;
        let side = if rises { 1.0 } else { -1.0 };
        let mut end = input;
        // What is nearer is a corner that the input stands at, but for a rounding.
        let least = ROUNDING * (from.abs() + input.abs());
        let mut nearest = |corner: f64| {
            if side * (corner - from) > least && side * (end - corner) > 0.0 {
                end = corner;
            }
        };
        for ((bend, family), plays) in Bend::ALL.iter().zip(&self.families).zip(&state.plays) {
            for (threshold, weight, play) in family.with(plays) {
                if weight != 0.0 {
                    nearest(bend.reaches(play + side * threshold, self.range));
                }
            }
            if *bend != Bend::Straight && family.total() > 0.0 {
                nearest(self.range.0);
                nearest(self.range.1);
            }
        }
        let bent: f64 = self
            .parts()
            .map(|(bend, family)| family.total() * bend.curvature(from, end, self.range))
            .sum();
        let chords = libm::ceil((end - from).abs() * libm::sqrt(0.125 * bent / deviation));
        if chords > 1.0 { from + (end - from) / chords } else { end }
    }

    /// Largest size of the second derivative between corners, Y/V^2.
    #[must_use]
    pub fn bend(&self) -> f64 {
        let (low, high) = self.range;
        self.parts()
            .map(|(bend, family)| family.total() * bend.curvature(low, high, self.range))
            .sum()
    }

    /// Largest change of the slope that all corners together can make, Y/V.
    #[must_use]
    pub fn kink(&self) -> f64 {
        let steepest = |bend| if bend == Bend::Straight { 1.0 } else { 3.0 };
        self.parts().map(|(bend, family)| steepest(bend) * family.total()).sum()
    }
}

impl<const PLAYS: usize> Operator<f64> for AsymmetricPlay<PLAYS> {
    type State = AsymmetricPlayState<PLAYS>;
    type Branch = (AsymmetricPlayState<PLAYS>, f64);

    fn rest(&self) -> Self::State {
        self.at_rest()
    }

    fn output(&self, state: &Self::State) -> (f64, f64) {
        (self.value(state), state.slope)
    }

    fn branch(&self, state: &Self::State, direction: f64) -> Self::Branch {
        (*state, direction)
    }

    fn along(&self, (from, direction): &Self::Branch, distance: f64) -> Self::State {
        self.taken(from, from.input + distance, *direction > 0.0)
    }
}
