//! The one file that touches buffers: shape, type, layout, size and finiteness are checked here.

use numpy::{
    Element, PyArray1, PyArrayDescrMethods, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods,
    dtype,
};
use piezotrack_core::math::room;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyTuple};

use crate::conversions::numbers::{LARGEST, MOST_SAMPLES, is_unsuitable};
use crate::errors::{data, raise, shape};

const EXPECTED: &str = "a one-dimensional array of numbers";

/// Copies a one-dimensional array of finite numbers.
///
/// A copy, so that no other thread can change what a search reads while the GIL is released.
pub fn samples(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = unconverted(name, value)?;
    let kind = array.dtype().kind();
    if !matches!(kind, b'b' | b'i' | b'u' | b'f') {
        let found = format!("values of type {}", array.dtype());
        return Err(shape(name, &found, "real numbers"));
    }
    if array.ndim() != 1 {
        let found = format!("{} dimensions, shape {:?}", array.ndim(), array.shape());
        return Err(shape(name, &found, EXPECTED));
    }
    if array.len() > MOST_SAMPLES {
        let found = format!("{} samples", array.len());
        return Err(shape(name, &found, &format!("{MOST_SAMPLES} at most")));
    }
    let array = packed(&array)?;
    let array = array.try_readonly()?;
    let entries = array.as_slice()?;
    let mut samples = room(&format!("a copy of {name}"), entries.len()).map_err(|e| raise(&e))?;
    samples.extend_from_slice(entries);
    let fits = |value: &f64| value.abs() < LARGEST;
    if let Some(k) = samples.iter().position(|value| !fits(value)) {
        let value = samples[k];
        let expected = if value.is_finite() {
            format!("numbers below {LARGEST:e}")
        } else {
            "finite numbers only".into()
        };
        return Err(data(format!("{name}[{k}] is {value:e}: expected {expected}")));
    }
    Ok(samples)
}

/// The array that `NumPy` makes of a value; of any type, shape and layout.
fn unconverted<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    // Subclasses are not taken as they are: a masked array would lose its mask.
    if let Ok(array) = value.cast_exact::<PyUntypedArray>() {
        return Ok(array.clone());
    }
    let py = value.py();
    let refused = |error: PyErr| {
        if is_unsuitable(&error, py) { shape(name, &kind(value), EXPECTED) } else { error }
    };
    let array = if value.hasattr("mask")? && value.hasattr("filled")? {
        // A masked sample is a missing one.
        let floats = value.call_method1("astype", ("float64",)).map_err(refused)?;
        floats.call_method1("filled", (f64::NAN,)).map_err(refused)?
    } else {
        py.import("numpy")?.call_method1("asarray", (value,)).map_err(refused)?
    };
    array.cast_into().map_err(|_| shape(name, &kind(value), EXPECTED))
}

/// The same numbers as aligned float64, one after the other in memory.
///
/// Only such an array may be read from here: the field of a packed record has other strides than
/// whole numbers, and may begin at any byte.
fn packed<'py>(array: &Bound<'py, PyUntypedArray>) -> PyResult<Bound<'py, PyArray1<f64>>> {
    if array.is_c_contiguous()
        && array.is_aligned()
        && let Ok(packed) = array.cast::<PyArray1<f64>>()
    {
        return Ok(packed.clone());
    }
    let py = array.py();
    let numpy = py.import("numpy")?;
    let wanted = PyTuple::new(py, ["C_CONTIGUOUS", "ALIGNED", "ENSUREARRAY"])?;
    // A number beyond float64 becomes infinite, and is refused as that; a warning says no more.
    let before = numpy.call_method("seterr", (), Some(&[("over", "ignore")].into_py_dict(py)?))?;
    let converted = numpy.call_method1("require", (array, "float64", wanted));
    numpy.call_method("seterr", (), Some(before.cast()?))?;
    Ok(converted?.cast_into()?)
}

/// A `NumPy` array with these entries.
///
/// # Errors
/// `MemoryError` where there is no room for it.
pub fn array<T: Element + Copy>(
    py: Python<'_>,
    entries: impl ExactSizeIterator<Item = T>,
) -> PyResult<Bound<'_, PyArray1<T>>> {
    // NumPy's own constructor raises where the one of the numpy crate would panic.
    let empty = py.import("numpy")?.call_method1("empty", (entries.len(), dtype::<T>(py)))?;
    let array = empty.cast_into::<PyArray1<T>>()?;
    for (slot, entry) in array.try_readwrite()?.as_slice_mut()?.iter_mut().zip(entries) {
        *slot = entry;
    }
    Ok(array)
}

fn kind(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map_or_else(|_| "another type".into(), |name| format!("type {name}"))
}
