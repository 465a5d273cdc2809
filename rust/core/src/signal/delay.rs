//! Fractional delay of a displacement.

use piezotrack_control::cubic_motion::between;

use crate::error::Result;
use crate::math::room;

/// Displacement delayed by `delay` seconds, between the samples on the cubic through
/// displacements and velocities, m; before the first sample the stage is where it starts.
///
/// # Errors
/// [`crate::Error::Memory`] where there is no room for it.
pub fn delayed(x: &[f64], v: &[f64], dt: f64, delay: f64) -> Result<Vec<f64>> {
    let mut late = room("the delayed displacement", x.len())?;
    if delay == 0.0 {
        late.extend_from_slice(x);
        return Ok(late);
    }
    let FractionalDelay { whole, part } = FractionalDelay::new(delay, dt);
    let at =
        |k: Option<usize>| k.map_or((x.first().copied().unwrap_or(0.0), 0.0), |k| (x[k], v[k]));
    let values = (0..x.len().min(v.len())).map(|k| {
        let ((x0, v0), (x1, v1)) = (at(k.checked_sub(whole + 1)), at(k.checked_sub(whole)));
        between(x0, v0 * dt, x1, v1 * dt, part)
    });
    late.extend(values);
    Ok(late)
}

/// Most samples of a delay: more than any record has, and still exact in its fraction.
const LONGEST: f64 = 1e12;

/// A delay in samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FractionalDelay {
    /// Whole samples.
    pub whole: usize,
    /// Where between the sample before and that one the displacement is read off, 0 to 1.
    pub part: f64,
}

impl FractionalDelay {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 or above")]
    pub(crate) fn new(delay: f64, dt: f64) -> Self {
        let samples = (delay / dt).clamp(0.0, LONGEST);
        let whole = libm::floor(samples);
        Self { whole: whole as usize, part: 1.0 - (samples - whole) }
    }
}
