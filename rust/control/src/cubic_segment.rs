//! The path of a reference between two samples: the cubic through displacement and velocity.

use crate::number::Real;

/// Whether the cubic that rises by `rise` with end velocities `w0` and `w1` (times the interval)
/// is monotone by a sufficient condition: no end is steeper than three times the mean (Fritsch
/// and Carlson 1980, doi 10.1137/0717021).
#[inline]
pub(crate) fn is_straight<T: Real>(w0: T, rise: T, w1: T) -> bool {
    let (zero, steepest) = (T::ZERO, T::of(3.0) * rise.abs());
    w0 * rise >= zero && w1 * rise >= zero && w0.abs() <= steepest && w1.abs() <= steepest
}

/// The moves between the turning points of that cubic, 0 for those that do not exist.
pub(crate) fn legs<T: Real>(w0: T, rise: T, w1: T) -> [T; 3] {
    // Hermite form about the start: w0 s + c2 s^2 + c3 s^3, s from 0 to 1
    let c3 = w0 + w1 - T::of(2.0) * rise;
    let c2 = rise - w0 - c3;
    let mut here = T::ZERO;
    let mut legs = [T::ZERO; 3];
    for (leg, s) in legs.iter_mut().zip(turning_times(w0, c2, c3)) {
        if s > T::ZERO && s < T::of(1.0) {
            let there = s * (w0 + s * (c2 + s * c3));
            *leg = there - here;
            here = there;
        }
    }
    legs[2] = rise - here;
    legs
}

/// The roots of w0 + 2 c2 s + 3 c3 s^2 in ascending order; NaN where they are not real.
fn turning_times<T: Real>(w0: T, c2: T, c3: T) -> [T; 2] {
    let three = T::of(3.0);
    let root = (c2 * c2 - three * c3 * w0).sqrt();
    let q = -(c2 + if c2 < T::ZERO { -root } else { root });
    let (a, b) = (q / (three * c3), w0 / q);
    if a < b { [a, b] } else { [b, a] }
}
