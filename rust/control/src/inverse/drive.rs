//! The state of an inverse after a drive other than the one it asked for: clipped, or limited by
//! the amplifier.

use super::Inverse;
use crate::number::Real;

/// Step that shows by how much the drive increases with the displacement, m.
const PROBE: f64 = 1e-9;

/// Most times that the way from the reference grows fourfold; it begins beyond Newton's step.
const STEPS: u32 = 8;

/// Length of the first way, in Newton's steps.
const BEYOND: f64 = 1.25;

/// Most places between two that enclose the drive.
const PLACES: u32 = 24;

/// Relative difference of drives that counts as none: some 1e-16 m.
const SAME: f64 = 4096.0 * f64::EPSILON;

/// The same in roundings, where those are larger: in single precision.
const ROUNDINGS: f64 = 16.0;

/// The state of `inverse` after a sample at which the stage got the drive `volts`, and by how much
/// the stage was off the reference there, in displacement (m) and velocity (m/s).
///
/// `before` is the state before that sample, `target` displacement, velocity and acceleration
/// of the reference there, and `off` by how much the stage was off it at the sample before, `dt`
/// earlier. A stage that is off by d in place of d0 has moved by (d - d0)/dt faster than the
/// reference, and was accelerated by ((d - d0)/dt - w0)/dt more. The d is found for which the inverse
/// gives this drive, by false position with the weights of the Illinois rule (Dowell and Jarratt
/// 1971, doi 10.1007/BF01934364), as the drive increases with it (or decreases, for a negative piezo
/// coefficient), from two places that enclose it: d0, and one beyond the step of Newton's method. The
/// inverse is evaluated 42 times at most, some 8 times mostly.
///
/// `None` where there is no such displacement.
pub fn after_drive<T: Real, I: Inverse<T>>(
    inverse: &I,
    before: &I::State,
    target: [T; 3],
    off: [T; 2],
    dt: T,
    volts: T,
) -> Option<(I::State, [T; 2])> {
    let [x, v, a] = target;
    let (zero, half, probe) = (T::ZERO, T::of(0.5), T::of(PROBE));
    let at = |way: T| {
        let mut state = *before;
        let faster = way / dt;
        let (x, v, a) = (x + off[0] + way, v + faster, a + (faster - off[1]) / dt);
        (inverse.step(&mut state, x, v, a) - volts, state)
    };
    let (asked, _) = at(zero);
    let beyond = |excess: T| (excess > zero) == (asked > zero);
    let after = |way: T| [off[0] + way, way / dt];
    let (mut outside, mut inside, mut found) = (zero, zero, None);
    let (mut far, mut near) = (asked, asked);
    let newton = -asked * probe / (at(probe).0 - asked);
    let mut way =
        if newton.abs() > zero && newton.is_finite() { T::of(BEYOND) * newton } else { probe };
    'search: for _ in 0..STEPS {
        for place in [way, -way] {
            let (excess, state) = at(place);
            if excess.is_finite() && !beyond(excess) {
                (inside, near, found) = (place, excess, Some((state, after(place))));
                break 'search;
            }
        }
        way = way * T::of(4.0);
    }
    found?;
    let same = T::of(SAME).larger(T::of(ROUNDINGS) * T::EPSILON);
    let same = same * ((asked + volts).abs() + volts.abs());
    if near.abs() <= same {
        return found;
    }
    // Whether the last place was beyond; neither before the first.
    let mut last = None;
    for _ in 0..PLACES {
        let crossing = outside - far * (inside - outside) / (near - far);
        let lies =
            (crossing > outside && crossing < inside) || (crossing < outside && crossing > inside);
        let place = if lies { crossing } else { half * (outside + inside) };
        let (excess, state) = at(place);
        let is_beyond = beyond(excess) || excess.is_nan();
        if excess.abs() <= same {
            return Some((state, after(place)));
        }
        if is_beyond {
            (outside, far) = (place, excess);
            if last == Some(true) {
                near = near * half;
            }
        } else {
            (inside, near, found) = (place, excess, Some((state, after(place))));
            if last == Some(false) {
                far = far * half;
            }
        }
        last = Some(is_beyond);
    }
    found
}
