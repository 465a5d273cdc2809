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
    // Subclasses are not taken as they are: a masked array would lose its mask.
    if let Ok(array) = value.cast_exact::<PyArrayDyn<f64>>() {
        return Ok(array.readonly());
    }
    let refused = |_| shape(name, &kind(value), "a one-dimensional array of numbers");
    let py = value.py();
    let numpy = py.import("numpy")?;
    let value = if value.hasattr("mask")? && value.hasattr("filled")? {
        // A masked sample is a missing one.
        let floats = value.call_method1("astype", ("float64",)).map_err(refused)?;
        floats.call_method1("filled", (f64::NAN,)).map_err(refused)?
    } else {
        numpy.call_method1("asarray", (value,)).map_err(refused)?
    };
    let dtype: String = value.getattr("dtype")?.getattr("kind")?.extract()?;
    if !matches!(dtype.as_str(), "b" | "i" | "u" | "f") {
        let found = format!("values of type {}", value.getattr("dtype")?);
        return Err(shape(name, &found, "real numbers"));
    }
    let keywords = [("dtype", "float64")].into_py_dict(py)?;
    let converted = numpy.call_method("asarray", (&value,), Some(&keywords))?;
    Ok(converted.cast::<PyArrayDyn<f64>>()?.readonly())
}

fn kind(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map_or_else(|_| "another type".into(), |name| format!("type {name}"))
}
