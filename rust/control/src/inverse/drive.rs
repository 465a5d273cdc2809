//! The state of an inverse after a drive other than the one it asked for: clipped, or limited by
//! the amplifier.

use super::Inverse;

/// Most times that a step away from the reference is doubled: from a picometre to a kilometre.
const DOUBLINGS: u32 = 50;

/// Most bisections: the bits of a float64, and some for numbers near 0.
const BISECTIONS: u32 = 80;

/// First step away from the reference, m.
const FIRST: f64 = 1e-12;

/// The state of `inverse` after a sample at which the stage got the drive `volts`.
///
/// `before` is the state before that sample, and `target` displacement, velocity and acceleration
/// of the reference there. The stage went to another displacement than the reference asked for:
/// to that for which the inverse gives this drive. It is found by bisection, as the drive
/// increases with the displacement (or decreases, for a negative piezo coefficient).
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
    let mut step = FIRST;
    for _ in 0..DOUBLINGS {
        for place in [x - step, x + step] {
            let (excess, state) = at(place);
            if found.is_none() && excess.is_finite() && !beyond(excess) {
                (inside, found) = (place, Some(state));
            }
        }
        if found.is_some() {
            break;
        }
        step += step;
    }
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (outside + inside);
        let (excess, state) = at(middle);
        if beyond(excess) || excess.is_nan() {
            outside = middle;
        } else {
            (inside, found) = (middle, found.map(|_| state));
        }
        if excess.abs() <= 0.0 {
            break;
        }
    }
    found
}
