//! Memory whose size follows from input: asked for, so that a refusal is an error and no abort.

use crate::error::{Error, Result};

/// An empty vector with room for `count` entries, which `what` is to hold.
///
/// # Errors
/// [`Error::Memory`] where there is no such room.
pub fn room<T>(what: &str, count: usize) -> Result<Vec<T>> {
    let mut entries = Vec::new();
    if entries.try_reserve_exact(count).is_ok() {
        return Ok(entries);
    }
    let bytes = count.saturating_mul(size_of::<T>());
    Err(Error::Memory { what: what.into(), bytes })
}

/// `count` entries of 0.
///
/// # Errors
/// [`Error::Memory`] where there is no room for them.
pub fn zeros(what: &str, count: usize) -> Result<Vec<f64>> {
    let mut entries = room(what, count)?;
    entries.resize(count, 0.0);
    Ok(entries)
}

/// Asks for all the memory of a computation at once, `count` entries of `each` bytes, and gives it
/// back: its parts, however many, will then be there.
///
/// # Errors
/// [`Error::Memory`] where they will not.
pub fn available(what: &str, count: usize, each: usize) -> Result<()> {
    room::<u8>(what, count.saturating_mul(each)).map(|_| ())
}
