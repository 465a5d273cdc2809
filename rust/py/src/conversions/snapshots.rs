//! States as bytes.

use piezotrack_control::Snapshot;
use piezotrack_core::Error;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::raise;

/// A state as the bytes of its numbers.
pub fn saved<'py>(py: Python<'py>, state: &impl Snapshot) -> PyResult<Bound<'py, PyBytes>> {
    let mut count = 0_usize;
    state.save(&mut |_| count += 1);
    PyBytes::new_with(py, 8 * count, |bytes| {
        let mut slots = bytes.chunks_exact_mut(8);
        state.save(&mut |number| {
            if let Some(slot) = slots.next() {
                slot.copy_from_slice(&number.to_le_bytes());
            }
        });
        Ok(())
    })
}

/// Takes a state from the bytes that `saved` gave; where they are of another, what is left is of
/// no use.
pub fn load(state: &mut impl Snapshot, bytes: &[u8]) -> PyResult<()> {
    let mut left = bytes.chunks_exact(8).map(|one| one.try_into().map(f64::from_le_bytes));
    let whole = bytes.len().is_multiple_of(8);
    let loaded = state.load(&mut || left.next().and_then(Result::ok));
    if !whole || loaded.is_none() || left.next().is_some() {
        let expected = "the numbers of a state of the same configuration";
        return Err(raise(&Error::parameter("state", "another", expected)));
    }
    Ok(())
}
