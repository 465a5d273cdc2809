//! Roots of curves that rise.

use crate::number::Real;

/// Steps at most. The second half of them halve what is left of the bracket, so that the place is
/// right to a share of 2^-50 of it whatever the curve.
const STEPS: usize = 100;

/// Where a curve that rises, given with its slope, passes 0 between 0 and `end`: by Newton's
/// method, which is kept between places on both sides of the root by bisection. 0 where the curve
/// is above 0 there already, and `end` where it is below 0 still. The curve may have corners.
///
/// ```
/// use piezotrack_control::root::rising_root;
///
/// let root = rising_root(2.0_f64, |x| (x * x - 2.0, 2.0 * x));
/// assert!((root - 2.0_f64.sqrt()).abs() < 1e-15);
/// ```
#[inline]
pub fn rising_root<T: Real>(end: T, curve: impl Fn(T) -> (T, T)) -> T {
    let (mut low, mut high) = (T::ZERO, end);
    let (value, slope) = curve(low);
    if value >= T::ZERO {
        return low;
    }
    let mut place = inside(low, high, -value / slope);
    for step in 0..STEPS {
        let (value, slope) = curve(place);
        if value < T::ZERO {
            low = place;
        } else {
            high = place;
        }
        let newton = if 2 * step < STEPS { place - value / slope } else { T::NAN };
        let next = inside(low, high, newton);
        if value == T::ZERO || (next - place).abs() <= T::EPSILON * place {
            return place;
        }
        place = next;
    }
    place
}

/// A place, or the middle between two others where it is not between them.
#[inline]
fn inside<T: Real>(low: T, high: T, place: T) -> T {
    if low < place && place < high { place } else { T::of(0.5) * (low + high) }
}
