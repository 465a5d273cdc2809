//! Settings of the descents.

use piezotrack_core::identify::DescentSettings;
use pyo3::prelude::*;

use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyDescents>()
}

/// Checked settings of a search by descents.
#[pyclass(name = "DescentSettings", frozen, module = "piezotrack._core")]
pub struct PyDescents(pub DescentSettings);

#[pymethods]
impl PyDescents {
    #[new]
    #[pyo3(signature = (*, samples, starts, agreeing, rounds))]
    fn new(samples: usize, starts: usize, agreeing: usize, rounds: usize) -> PyResult<Self> {
        let settings = DescentSettings { samples, starts, agreeing, rounds };
        settings.validate().map_err(|error| raise(&error))?;
        Ok(Self(settings))
    }
}
