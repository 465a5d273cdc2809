//! Minimum along one coordinate: a coarse grid, then Brent's method.
//!
//! Brent 1973, Algorithms for Minimization without Derivatives, chapter 5: steps to the lowest
//! point of a parabola through the three best places, and golden sections where those fail.

/// Golden section of an interval, (3 - sqrt(5)) / 2.
const GOLDEN: f64 = 0.381_966_011_250_105_1;

/// Most steps of Brent's method.
const STEPS: usize = 100;

/// Ratio of neighbouring places of the coarse look.
const SPREAD: f64 = 2.5;

/// The place between `low` and `high`, both above 0, where `cost` is least, to a relative
/// `accuracy`; `cost` may say `None` to stop.
///
/// The logarithm is searched: a time constant is known to a factor at best before.
pub fn least(
    (low, high): (f64, f64),
    accuracy: f64,
    mut cost: impl FnMut(f64) -> Option<f64>,
) -> Option<f64> {
    let (low, high) = (libm::log(low), libm::log(high));
    let mut places = vec![low];
    let mut next = low + libm::log(SPREAD);
    while next < high {
        places.push(next);
        next += libm::log(SPREAD);
    }
    places.push(high);
    let mut values = Vec::with_capacity(places.len());
    for place in &places {
        values.push(cost(libm::exp(*place))?);
    }
    let mut i = 0;
    for (k, value) in values.iter().enumerate() {
        // NaN is never less.
        if *value < values[i] || (values[i].is_nan() && !value.is_nan()) {
            i = k;
        }
    }
    let last = places.len() - 1;
    let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
    // At an end its one neighbour stands for both.
    let others = (if i == 0 { after } else { before }, if i == last { before } else { after });
    let known = [i, others.0, others.1].map(|k| (places[k], values[k]));
    let ends = (places[before], places[after]);
    brent(ends, known, 0.5 * accuracy, |place| cost(libm::exp(place))).map(libm::exp)
}

/// The lowest place between two ends to within about a `tolerance`, from three that are known, the
/// lowest of them first.
fn brent(
    (mut a, mut b): (f64, f64),
    [mut best, mut second, mut third]: [(f64, f64); 3],
    tolerance: f64,
    mut cost: impl FnMut(f64) -> Option<f64>,
) -> Option<f64> {
    let (mut step, mut earlier) = (b - a, b - a);
    for _ in 0..STEPS {
        let middle = 0.5 * (a + b);
        if (best.0 - middle).abs() <= 2.0 * tolerance - 0.5 * (b - a) {
            break;
        }
        let parabola = to_lowest(best, second, third).filter(|way| {
            let place = best.0 + way;
            a < place && place < b && way.abs() < 0.5 * earlier.abs()
        });
        earlier = step;
        step = parabola.map_or_else(
            || {
                earlier = if best.0 < middle { b - best.0 } else { a - best.0 };
                GOLDEN * earlier
            },
            |way| {
                let place = best.0 + way;
                let near = place - a < 2.0 * tolerance || b - place < 2.0 * tolerance;
                if near { tolerance.copysign(middle - best.0) } else { way }
            },
        );
        let place = best.0 + step.abs().max(tolerance).copysign(step);
        let next = (place, cost(place)?);
        if next.1 < best.1 {
            if place < best.0 {
                b = best.0;
            } else {
                a = best.0;
            }
            (best, second, third) = (next, best, second);
        } else {
            if place < best.0 {
                a = place;
            } else {
                b = place;
            }
            if next.1 < second.1 {
                (second, third) = (next, second);
            } else if next.1 < third.1 {
                third = next;
            }
        }
    }
    Some(best.0)
}

/// The way from the first of three places to the lowest point of a parabola through them.
fn to_lowest(best: (f64, f64), second: (f64, f64), third: (f64, f64)) -> Option<f64> {
    let (to_second, to_third) = (best.0 - second.0, best.0 - third.0);
    let r = to_second * (best.1 - third.1);
    let q = to_third * (best.1 - second.1);
    let way = (to_third * q - to_second * r) / (2.0 * (r - q));
    way.is_finite().then_some(way)
}
