//! Single numbers from Python, refused by name.

use piezotrack_core::Error;
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyComplex, PyFloat, PyInt, PyString};

use crate::errors::raise;

/// Most samples of an array: 4 GB, of which a simulation needs several times as much.
pub const MOST_SAMPLES: usize = 500_000_000;

/// Size beyond which no sample makes sense, and its square leaves float64 soon.
pub const LARGEST: f64 = 1e100;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("INSTRUCTION_SET", piezotrack_core::math::instruction_set())?;
    module.add("INTERVALS", piezotrack_core::signal::INTERVALS)?;
    module.add("LARGEST", LARGEST)?;
    module.add("MOST_SAMPLES", MOST_SAMPLES)?;
    module.add_function(wrap_pyfunction!(as_number, module)?)?;
    module.add_function(wrap_pyfunction!(as_count, module)?)?;
    module.add_function(wrap_pyfunction!(as_truth, module)?)
}

/// A real number as a float; NaN and infinity pass, for the receiver to judge.
#[pyfunction]
fn as_number(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    if is_other(value) {
        return Err(refused(name, value, "a number"));
    }
    match value.extract::<f64>() {
        Ok(number) => Ok(number),
        Err(error) if error.is_instance_of::<PyOverflowError>(value.py()) => {
            Err(refused(name, value, "a number that float64 can hold, up to 1.8e308"))
        }
        Err(error) if !is_unsuitable(&error, value.py()) => Err(error),
        _ => Err(refused(name, value, "a number")),
    }
}

/// A whole number, 0 or above.
#[pyfunction]
fn as_count(name: &str, value: &Bound<'_, PyAny>) -> PyResult<u64> {
    match value.extract::<u64>() {
        Ok(number) if !is_other(value) => Ok(number),
        Err(error) if !is_unsuitable(&error, value.py()) => Err(error),
        _ => Err(refused(name, value, "a whole number, 0 or above and below 2^64")),
    }
}

/// True or False, and nothing that merely counts as one of them.
#[pyfunction]
fn as_truth(name: &str, value: &Bound<'_, PyAny>) -> PyResult<bool> {
    value.extract::<bool>().map_err(|_| refused(name, value, "True or False"))
}

/// Whether an error says that a value cannot be converted. Others, an interruption or what a class
/// of the caller's raises, pass on.
pub fn is_unsuitable(error: &PyErr, py: Python<'_>) -> bool {
    error.is_instance_of::<PyTypeError>(py)
        || error.is_instance_of::<PyValueError>(py)
        || error.is_instance_of::<PyOverflowError>(py)
}

/// Whether a value converts to a number and is hardly ever meant so: a truth value, a text, an array,
/// or one that would lose its imaginary part.
fn is_other(value: &Bound<'_, PyAny>) -> bool {
    if value.is_exact_instance_of::<PyFloat>() || value.is_exact_instance_of::<PyInt>() {
        return false;
    }
    let attribute = |name: &str| value.getattr(name).ok();
    let kind = attribute("dtype").and_then(|dtype| dtype.getattr("kind").ok()?.extract().ok());
    let dimensions = attribute("ndim").and_then(|count| count.extract::<usize>().ok());
    value.is_instance_of::<PyBool>()
        || value.is_instance_of::<PyString>()
        || value.is_instance_of::<PyComplex>()
        || kind.is_some_and(|kind: String| kind == "c")
        || dimensions.is_some_and(|count| count > 0)
}

fn refused(name: &str, value: &Bound<'_, PyAny>, expected: &str) -> PyErr {
    let shown = value.repr().map_or_else(|_| "too long to print".into(), |text| text.to_string());
    // A number of a thousand digits is no help in full.
    let shown = if shown.len() > 60 {
        format!("{}...", shown.chars().take(57).collect::<String>())
    } else {
        shown
    };
    raise(&Error::parameter(name, shown, expected))
}
