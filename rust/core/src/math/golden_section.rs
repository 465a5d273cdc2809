//! Minimum along one coordinate: a coarse grid, then golden-section search.

/// Golden section of an interval, (sqrt(5) - 1) / 2.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

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
    let mut ask = |place: f64| cost(libm::exp(place)).map(|value| (value, place));
    let mut places = vec![low];
    let mut next = low + libm::log(SPREAD);
    while next < high {
        places.push(next);
        next += libm::log(SPREAD);
    }
    places.push(high);
    let mut best = (f64::INFINITY, 0);
    for (i, &place) in places.iter().enumerate() {
        let (value, _) = ask(place)?;
        // NaN is never less.
        if value < best.0 {
            best = (value, i);
        }
    }
    let i = best.1;
    let mut a = places[i.saturating_sub(1)];
    let mut b = places[(i + 1).min(places.len() - 1)];
    let mut known = (best.0, places[i]);
    let mut inner = ask(b - GOLDEN * (b - a))?;
    let mut outer = ask(a + GOLDEN * (b - a))?;
    while b - a > accuracy {
        if inner.0 < outer.0 {
            (b, outer) = (outer.1, inner);
            inner = ask(b - GOLDEN * (b - a))?;
        } else {
            (a, inner) = (inner.1, outer);
            outer = ask(a + GOLDEN * (b - a))?;
        }
        for found in [inner, outer] {
            if found.0 < known.0 {
                known = found;
            }
        }
    }
    Some(libm::exp(known.1))
}
