//! The state of an inverse after a drive other than the one it asked for: clipped, or limited by
//! the amplifier.

use super::Inverse;

/// Most times that a step away from the reference grows fourfold: from 10 pm to 3 m.
const STEPS: u32 = 20;

/// First step away from the reference, m.
const FIRST: f64 = 1e-11;

/// Most places between two that enclose the drive.
const PLACES: u32 = 40;

/// Relative difference of drives that counts as none.
const SAME: f64 = 4.0 * f64::EPSILON;

/// The state of `inverse` after a sample at which the stage got the drive `volts`.
///
/// `before` is the state before that sample, and `target` displacement, velocity and acceleration
/// of the reference there. The stage went to another displacement than the reference asked for:
/// to that for which the inverse gives this drive. It is found by false position with the weights of
/// the Illinois rule (Dowell and Jarratt 1971, doi 10.1007/BF01934364), as the drive increases with
/// the displacement (or decreases, for a negative piezo coefficient). The inverse is evaluated 81
/// times at most.
///
/// `None` where there is no such displacement.
pub fn after_drive<I: Inverse>(
    inverse: &I,
    before: &I::State,
    target: [f64; 3],
    volts: f64,
) -> Option<I::State> {
    let [x, v, a] = target;
    let at = |x: f64| {
        let mut state = *before;
        let drive = inverse.step(&mut state, x, v, a);
        (drive - volts, state)
    };
    let (asked, _) = at(x);
    let beyond = |excess: f64| (excess > 0.0) == (asked > 0.0);
    let (mut outside, mut inside, mut found) = (x, x, None);
    let (mut far, mut near) = (asked, asked);
    let mut step = FIRST;
    for _ in 0..STEPS {
        for place in [x - step, x + step] {
            let (excess, state) = at(place);
            if found.is_none() && excess.is_finite() && !beyond(excess) {
                (inside, near, found) = (place, excess, Some(state));
            }
        }
        if found.is_some() {
            break;
        }
        step *= 4.0;
    }
    found?;
    let same = SAME * ((asked + volts).abs() + volts.abs());
    if near.abs() <= same {
        return found;
    }
    // Whether the last place was beyond; neither before the first.
    let mut last = None;
    for _ in 0..PLACES {
        let crossing = outside - far * (inside - outside) / (near - far);
        let lies =
            (crossing > outside && crossing < inside) || (crossing < outside && crossing > inside);
        let place = if lies { crossing } else { 0.5 * (outside + inside) };
        let (excess, state) = at(place);
        let is_beyond = beyond(excess) || excess.is_nan();
        if excess.abs() <= same {
            return Some(state);
        }
        if is_beyond {
            (outside, far) = (place, excess);
            if last == Some(true) {
                near *= 0.5;
            }
        } else {
            (inside, near, found) = (place, excess, Some(state));
            if last == Some(false) {
                far *= 0.5;
            }
        }
        last = Some(is_beyond);
    }
    found
}
