//! Roots of curves that rise.

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
/// let root = rising_root(2.0, |x| (x * x - 2.0, 2.0 * x));
/// assert!((root - 2.0_f64.sqrt()).abs() < 1e-15);
/// ```
#[inline]
pub fn rising_root(end: f64, curve: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut low, mut high) = (0.0, end);
    let (value, slope) = curve(low);
    if value >= 0.0 {
        return low;
    }
    let mut place = inside(low, high, -value / slope);
    for step in 0..STEPS {
        let (value, slope) = curve(place);
        if value < 0.0 {
            low = place;
        } else {
            high = place;
        }
        let newton = if 2 * step < STEPS { place - value / slope } else { f64::NAN };
        let next = inside(low, high, newton);
        if value == 0.0 || (next - place).abs() <= f64::EPSILON * place {
            return place;
        }
        place = next;
    }
    place
}

/// A place, or the middle between two others where it is not between them.
#[inline]
fn inside(low: f64, high: f64, place: f64) -> f64 {
    if low < place && place < high { place } else { 0.5 * (low + high) }
}
