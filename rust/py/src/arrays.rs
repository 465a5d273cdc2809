//! The one file that touches buffers: shape, type and finiteness are checked here.

use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;

use crate::errors::{data, shape};

/// Copies a one-dimensional array of finite numbers.
///
/// A copy, so that no other thread can change what a search reads while the GIL is released.
pub fn samples(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = as_float_array(name, value)?;
    if array.ndim() != 1 {
        let found = format!("{} dimensions, shape {:?}", array.ndim(), array.shape());
        return Err(shape(name, &found, "a one-dimensional array of numbers"));
    }
    let samples = array.as_array().iter().copied().collect::<Vec<f64>>();
    if let Some(k) = samples.iter().position(|value| !value.is_finite()) {
        let value = samples[k];
        return Err(data(format!("{name}[{k}] is {value}: expected finite numbers only")));
    }
    Ok(samples)
}

fn as_float_array<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    if let Ok(array) = value.cast::<PyArrayDyn<f64>>() {
        return Ok(array.readonly());
    }
    let numpy = value.py().import("numpy")?;
    let keywords = [("dtype", "float64")].into_py_dict(value.py())?;
    let converted = numpy.call_method("asarray", (value,), Some(&keywords));
    match converted.as_ref().map(|array| array.cast::<PyArrayDyn<f64>>()) {
        Ok(Ok(array)) => Ok(array.readonly()),
        _ => Err(shape(name, &kind(value), "a one-dimensional array of numbers")),
    }
}

fn kind(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map_or_else(|_| "another type".into(), |name| format!("type {name}"))
}
