//! The Python module `piezotrack._core`: this file only registers the contents of the others.

mod control;
mod conversions;
mod enter;
mod errors;
mod identify;
mod stages;
mod tune;

use pyo3::prelude::*;

/// The compiled core of piezotrack.
#[pymodule(gil_used = false)]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    conversions::numbers::register(module)?;
    stages::models::register(module)?;
    stages::stage::register(module)?;
    stages::inverse::register(module)?;
    identify::identification::register(module)?;
    identify::covariance::register(module)?;
    identify::descents::register(module)?;
    identify::local_fit::register(module)?;
    identify::objective::register(module)?;
    identify::step::register(module)?;
    identify::swarm::register(module)?;
    control::parts::register(module)?;
    control::controller::register(module)?;
    control::design::register(module)?;
    identify::least_squares::register(module)?;
    stages::virtual_stage::register(module)?;
    control::tracking::register(module)?;
    tune::register(module)?;
    stages::xy::register(module)?;
    stages::modal_system::register(module)?;
    stages::modal_fit::register(module)?;
    stages::distorted::register(module)?;
    stages::distortion::register(module)?;
    stages::regressors::register(module)
}
