//! Covariance of the values of a fit, and the values that ties give.

use piezotrack_core::identify::{Autoregression, Linearised, Tie, covariance, resampled_noises};
use piezotrack_core::math::bounded_rows;
use piezotrack_core::models::Model;
use pyo3::prelude::*;

use crate::conversions::arrays::samples;
use crate::enter::enter_quiet_pool;
use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(autoregression, module)?)?;
    module.add_function(wrap_pyfunction!(bounded_least_squares, module)?)?;
    module.add_function(wrap_pyfunction!(linearised_covariance, module)?)?;
    module.add_function(wrap_pyfunction!(noises_like, module)?)?;
    module.add_function(wrap_pyfunction!(tied_values, module)?)
}

/// Columns of the values and of the record alone, residual, its noise, weight.
type Record<'py> =
    (Vec<Bound<'py, PyAny>>, Vec<Bound<'py, PyAny>>, Bound<'py, PyAny>, Bound<'py, PyAny>, f64);

/// Rows of the covariance; whether each value is determined, its variance for independent noise, what
/// generalised least squares would change and the deviation of that, the step to the least squares;
/// resampled deviations; orders; changes without effect.
type Found = (
    Vec<Vec<f64>>,
    Vec<bool>,
    Vec<f64>,
    Vec<(f64, f64)>,
    Vec<f64>,
    Vec<Vec<f64>>,
    Vec<usize>,
    Vec<Vec<f64>>,
);

/// How sure the values of a fit are, whose records are linearised about it.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "extracted from lists")]
fn linearised_covariance(
    py: Python<'_>,
    records: Vec<Record<'_>>,
    precision: Vec<Vec<f64>>,
    draws: u32,
    seed: u64,
) -> PyResult<Found> {
    let columns = |name: &str, all: &[Bound<'_, PyAny>]| {
        all.iter().map(|column| samples(name, column)).collect::<PyResult<Vec<_>>>()
    };
    let read = |(values, nuisance, residual, noise, weight): &Record<'_>| {
        Ok(Linearised {
            columns: columns("columns", values)?,
            nuisance: columns("nuisance", nuisance)?,
            residual: samples("residual", residual)?,
            noise: samples("noise", noise)?,
            weight: *weight,
        })
    };
    let records = records.iter().map(read).collect::<PyResult<Vec<_>>>()?;
    let found = enter_quiet_pool(py, 0, |_| covariance(&records, &precision, draws, seed))?;
    Ok((
        found.matrix,
        found.determined,
        found.independent,
        found.shifts,
        found.steps,
        found.resampled,
        found.orders,
        found.hidden,
    ))
}

/// Coefficients and variance of the innovations of an autoregression of a noise.
#[pyfunction]
fn autoregression(noise: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, f64)> {
    let found = Autoregression::of(&samples("noise", noise)?);
    Ok((found.coefficients, found.variance))
}

/// The numbers within bounds whose products with rows are nearest to the right sides.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "extracted from lists")]
fn bounded_least_squares(
    rows: Vec<Vec<f64>>,
    right: Vec<f64>,
    bounds: Vec<(f64, f64)>,
) -> PyResult<Vec<f64>> {
    bounded_rows(&rows, &right, &bounds).map_err(|error| raise(&error))
}

/// Noises like one, their variance times a factor.
#[pyfunction]
#[pyo3(name = "resampled_noises")]
fn noises_like(
    noise: &Bound<'_, PyAny>,
    scale: f64,
    draws: u32,
    seed: u64,
) -> PyResult<Vec<Vec<f64>>> {
    Ok(resampled_noises(&samples("noise", noise)?, scale, (draws, seed)))
}

/// Values of all parameters of a model, with those that are tied from the others.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "extracted from lists")]
fn tied_values(
    model: &str,
    mut values: Vec<f64>,
    ties: Vec<(usize, String)>,
) -> PyResult<Vec<f64>> {
    let infos = Model::named(model).map_err(|error| raise(&error))?.scalars();
    let read = |(place, text): &(usize, String)| Tie::read(infos, *place, text);
    let ties = ties.iter().map(read).collect::<piezotrack_core::Result<Vec<_>>>();
    let ties = ties.map_err(|error| raise(&error))?;
    // Each round settles those that refer to what the round before settled.
    for _ in 0..ties.len() {
        for tie in &ties {
            let value = tie.value(&values);
            if let Some(slot) = values.get_mut(tie.parameter) {
                *slot = value;
            }
        }
    }
    Ok(values)
}
