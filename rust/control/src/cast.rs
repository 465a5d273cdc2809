//! Parts of a controller in another real type: single precision for a board.
//!
//! Settings are in `f64`, and so are their checks. What is sampled for a rate is computed in `f64`
//! too, and [`Cast::cast`] rounds each of its coefficients once to another real type. A step is in
//! that type from the first operation to the last: a processor whose floating-point unit is of
//! single precision, such as the Cortex-M4F, calls no library for it.
//!
//! ```
//! use piezotrack_control::{Cast, Controller, Limits, Pid};
//!
//! let pid = Pid::new(0.120e6, 0.009, 0.044, None)?.at(0.02)?;
//! let single = Controller::new(Limits::new(0.0, 75.0)?, pid).cast::<f32>()?;
//! let mut state = single.rest([])?;
//! let volts: f32 = single.step(&mut state, 1e-6, 0.0, 0.5).volts;
//! assert!((volts - 0.766_666_7).abs() < 1e-6);
//! # Ok::<(), piezotrack_control::Error>(())
//! ```

use crate::error::{Result, check};
use crate::number::Real;

/// A part of a controller that has been computed in `f64`, for one sampling interval.
pub trait Cast {
    /// The same part in another real type.
    type In<T: Real>;

    /// The part with each of its numbers rounded to the nearest of the type `T`.
    ///
    /// # Errors
    /// Names the number that overflows in this type. One too small for it becomes 0.
    fn cast<T: Real>(&self) -> Result<Self::In<T>>;
}

/// No part.
impl Cast for () {
    type In<T: Real> = ();

    fn cast<T: Real>(&self) -> Result<()> {
        Ok(())
    }
}

/// `value` in another real type; an error where it becomes infinite.
pub(crate) fn rounded<T: Real>(name: &'static str, value: f64, unit: &'static str) -> Result<T> {
    let cast = T::of(value);
    let right = cast.is_finite() || !value.is_finite();
    check(name, value, unit, right, "a number that the real type can hold")?;
    Ok(cast)
}

/// The same for several numbers.
pub(crate) fn all_rounded<T: Real, const N: usize>(
    name: &'static str,
    values: &[f64; N],
    unit: &'static str,
) -> Result<[T; N]> {
    let mut out = [T::ZERO; N];
    for (slot, value) in out.iter_mut().zip(values) {
        *slot = rounded(name, *value, unit)?;
    }
    Ok(out)
}
