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

/// Terms, angles, inputs, residual and weights of a level.
type Level<'py> = (Given<'py>, Bound<'py, PyAny>, Parts<'py>, Parts<'py>, Bound<'py, PyAny>);

/// Pairs of a mode and an input; real and imaginary parts of e of each level; shares that are left.
type Chosen = (Vec<[usize; 2]>, Vec<Vec<[f64; 2]>>, Vec<f64>);

/// Terms, angles, inputs, residual and weights, in the core's own numbers.
type Owned = (ModalTerms, Vec<f64>, Vec<[f64; 2]>, Vec<[f64; 2]>, Vec<f64>);

/// Pairs of a mode and an input that explain a residual, the same at all levels.
#[pyfunction]
#[pyo3(name = "choose_distortion")]
#[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
fn choose(py: Python<'_>, levels: Vec<Level<'_>>, drives: usize) -> PyResult<Chosen> {
    let owned = levels
        .iter()
        .map(|(given, angles, inputs, residual, weights)| {
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
        .map(|(terms, angles, inputs, residual, weights)| DistortionRecord {
            terms,
            angles,
            inputs,
            residual,
            weights,
        })
        .collect();
    let found = enter(py, |stop| choose_distortion(&records, drives, stop))?;
    Ok((found.pairs, found.forces, found.left))
}
