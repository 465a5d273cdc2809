//! Distortion of several axes: inputs that act on modes beside the drives.

use piezotrack_core::identify::{DistortionRecord, ModalTerms, choose_distortion};
use pyo3::prelude::*;

use super::modal_fit::{Given, terms};
use super::modal_system::{Parts, complex};
use crate::conversions::arrays::samples;
use crate::enter::enter;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(choose, module)?)
}

/// Terms, angles, inputs, residual, weights and powers of a level.
type Level<'py> =
    (Given<'py>, Bound<'py, PyAny>, Parts<'py>, Parts<'py>, Bound<'py, PyAny>, Vec<f64>);

/// Mode, input, power, and real and imaginary part of each force.
type Force = (usize, usize, usize, f64, f64);

/// The forces, e of the drives at each level, and shares that are left.
type Chosen = (Vec<Force>, Vec<Vec<[f64; 2]>>, Vec<f64>);

/// Terms, angles, inputs, residual and weights, in the core's own numbers.
type Owned = (ModalTerms, Vec<f64>, Vec<[f64; 2]>, Vec<[f64; 2]>, Vec<f64>);

/// Forces of inputs on modes that explain a residual, the same at all levels.
#[pyfunction]
#[pyo3(name = "choose_distortion")]
#[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
fn choose(py: Python<'_>, levels: Vec<Level<'_>>, drives: usize, most: usize) -> PyResult<Chosen> {
    let owned = levels
        .iter()
        .map(|(given, angles, inputs, residual, weights, _)| {
            Ok((
                terms(given)?,
                samples("angles", angles)?,
                complex("inputs", inputs)?,
                complex("residual", residual)?,
                samples("weights", weights)?,
            ))
        })
        .collect::<PyResult<Vec<Owned>>>()?;
    let records: Vec<DistortionRecord<'_>> = owned
        .iter()
        .zip(&levels)
        .map(|((terms, angles, inputs, residual, weights), level)| DistortionRecord {
            terms,
            angles,
            inputs,
            residual,
            weights,
            powers: &level.5,
        })
        .collect();
    let found = enter(py, |stop| choose_distortion(&records, drives, most, stop))?;
    let forces = found.forces.iter().map(|one| {
        let [real, imaginary] = one.force;
        (one.mode, one.input, one.power, real, imaginary)
    });
    Ok((forces.collect(), found.linear, found.left))
}
