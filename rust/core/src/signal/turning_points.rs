//! Turning points of a signal.

/// Samples at which a signal turns, small turns apart.
///
/// A turn counts where the signal goes back by more than `least` behind it; what comes before the
/// first and behind the last turn is not one.
///
/// ```
/// use piezotrack_core::signal::turns;
///
/// assert_eq!(turns(&[0.0, 2.0, 1.9, 4.0, 1.0, 3.0], 0.5), [3, 4]);
/// ```
#[must_use]
pub fn turns(signal: &[f64], least: f64) -> Vec<usize> {
    let mut out = Vec::new();
    let (mut low, mut high) = (0, 0);
    let mut rising = None;
    for (k, &value) in signal.iter().enumerate() {
        if value > signal[high] {
            high = k;
        }
        if value < signal[low] {
            low = k;
        }
        if rising != Some(false) && signal[high] - value > least {
            if rising.is_some() {
                out.push(high);
            }
            (rising, low) = (Some(false), k);
        } else if rising != Some(true) && value - signal[low] > least {
            if rising.is_some() {
                out.push(low);
            }
            (rising, high) = (Some(true), k);
        }
    }
    out
}
