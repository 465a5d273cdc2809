//! Conversion of the core's errors to piezotrack's exceptions, in one match.

use piezotrack_core::Error;
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;

mod classes {
    pyo3::import_exception!(piezotrack.errors, ParameterError);
    pyo3::import_exception!(piezotrack.errors, ShapeError);
    pyo3::import_exception!(piezotrack.errors, DataError);
    pyo3::import_exception!(piezotrack.errors, NumericalError);
}

/// The exception for an error.
pub fn raise(error: &Error) -> PyErr {
    let message = error.to_string();
    match error {
        Error::Parameter { name, value, expected } => {
            classes::ParameterError::new_err((name.clone(), value.clone(), expected.clone()))
        }
        Error::Shape { name, found, expected } => {
            classes::ShapeError::new_err((name.clone(), found.clone(), expected.clone()))
        }
        Error::Data(_) => classes::DataError::new_err(message),
        Error::Numerical(_) => classes::NumericalError::new_err(message),
        Error::Memory { .. } => PyMemoryError::new_err(message),
    }
}

/// The exception for an array of the wrong shape.
pub fn shape(name: &str, found: &str, expected: &str) -> PyErr {
    let (name, found, expected) = (name.into(), found.into(), expected.into());
    raise(&Error::Shape { name, found, expected })
}

/// The exception for a record that cannot be used.
pub fn data(message: String) -> PyErr {
    raise(&Error::Data(message))
}
