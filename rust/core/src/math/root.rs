//! Roots of curves that rise.

/// Steps at most: halving the bracket of two doubles needs no more.
const STEPS: usize = 100;

/// Where a curve that rises, given with its slope, passes 0 between 0 and `end`: by Newton's
/// method, which is kept between places on both sides of the root by bisection. 0 where the curve
/// is above 0 there already, and `end` where it is below 0 still.
#[inline]
pub fn rising_root(end: f64, curve: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut low, mut high) = (0.0, end);
    let (value, slope) = curve(low);
    if value >= 0.0 {
        return low;
    }
    let mut place = inside(low, high, -value / slope);
    for _ in 0..STEPS {
        let (value, slope) = curve(place);
        if value < 0.0 {
            low = place;
        } else {
            high = place;
        }
        let next = inside(low, high, place - value / slope);
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
