//! The Python module `piezotrack._core`: this file only registers the contents of the others.

mod arrays;
mod checkpoint;
mod coefficients;
mod control;
mod descents;
mod design;
mod displacements;
mod enter;
mod errors;
mod identify;
mod inverse;
mod least_squares;
mod models;
mod numbers;
mod objective;
mod parts;
mod problem;
mod snapshots;
mod stage;
mod step;
mod swarm;
mod tracking;
mod tune;
mod virtual_stage;
mod xy;

use pyo3::prelude::*;

/// The compiled core of piezotrack.
#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    numbers::register(module)?;
    models::register(module)?;
    stage::register(module)?;
    inverse::register(module)?;
    identify::register(module)?;
    descents::register(module)?;
    objective::register(module)?;
    step::register(module)?;
    swarm::register(module)?;
    parts::register(module)?;
    control::register(module)?;
    design::register(module)?;
    least_squares::register(module)?;
    virtual_stage::register(module)?;
    tracking::register(module)?;
    tune::register(module)?;
    xy::register(module)
}
