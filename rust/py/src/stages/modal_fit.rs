//! Modal terms of several axes: balanced, aligned, and fitted to responses.

use numpy::PyArray1;
use piezotrack_core::identify::{Descent, ModalFit, ModalTerms};
use pyo3::prelude::*;

use super::modal_system::{Parts, complex};
use crate::conversions::arrays::{array, samples};
use crate::enter::enter;
use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyModalFit>()?;
    module.add_function(wrap_pyfunction!(aligned_terms, module)?)?;
    module.add_function(wrap_pyfunction!(balanced_terms, module)?)
}

type Array<'py> = Bound<'py, PyArray1<f64>>;

/// Numbers of drives and sensors, poles, b, c and D.
pub(super) type Given<'py> = (usize, usize, Parts<'py>, Parts<'py>, Parts<'py>, Bound<'py, PyAny>);

/// Poles, b and c as real and imaginary parts, and D.
type Found<'py> =
    ((Array<'py>, Array<'py>), (Array<'py>, Array<'py>), (Array<'py>, Array<'py>), Array<'py>);

pub(super) fn terms(given: &Given<'_>) -> PyResult<ModalTerms> {
    let (drives, sensors, poles, inputs, outputs, direct) = given;
    let poles = complex("poles", poles)?;
    let (inputs, outputs) = (complex("inputs", inputs)?, complex("outputs", outputs)?);
    let direct = samples("direct", direct)?;
    ModalTerms::new([*drives, *sensors], &poles, &inputs, &outputs, &direct)
        .map_err(|error| raise(&error))
}

fn found<'py>(py: Python<'py>, terms: &ModalTerms) -> PyResult<Found<'py>> {
    let parts = |numbers: Vec<[f64; 2]>| {
        let [real, imaginary] = [0, 1].map(|part| array(py, numbers.iter().map(|one| one[part])));
        Ok::<_, PyErr>((real?, imaginary?))
    };
    let direct = array(py, terms.direct().iter().copied())?;
    Ok((parts(terms.poles())?, parts(terms.inputs())?, parts(terms.outputs())?, direct))
}

/// The same system with b and c of equal size, the largest b real, and poles above the axis.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
fn balanced_terms<'py>(py: Python<'py>, given: Given<'py>) -> PyResult<Found<'py>> {
    found(py, &terms(&given)?.balanced())
}

/// The same system with b as near to that of others as it can be.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
fn aligned_terms<'py>(
    py: Python<'py>,
    given: Given<'py>,
    other: Given<'py>,
) -> PyResult<Found<'py>> {
    let aligned = terms(&given)?.aligned(&terms(&other)?).map_err(|error| raise(&error))?;
    found(py, &aligned)
}

/// Responses that modal terms are fitted to.
#[pyclass(name = "ModalFit", frozen, module = "piezotrack._core")]
struct PyModalFit(ModalFit);

#[pymethods]
impl PyModalFit {
    /// Responses line by line and sensor by sensor, at angles per sample.
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn new(
        drives: usize,
        sensors: usize,
        angles: &Bound<'_, PyAny>,
        value: Parts<'_>,
        weights: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let (angles, weights) = (samples("angles", angles)?, samples("weights", weights)?);
        ModalFit::new([drives, sensors], &angles, &complex("value", &value)?, &weights)
            .map(Self)
            .map_err(|error| raise(&error))
    }

    /// Modes one after the other.
    fn pursue<'py>(
        &self,
        py: Python<'py>,
        expected: f64,
        most: usize,
        fixed: bool,
    ) -> PyResult<Found<'py>> {
        let terms = enter(py, |stop| self.0.pursue(expected, most, fixed, stop))?;
        found(py, &terms)
    }

    /// The terms at the minimum near some, with a price of a departure.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn refine<'py>(&self, py: Python<'py>, start: Given<'py>, held: f64) -> PyResult<Found<'py>> {
        let start = terms(&start)?;
        let terms = enter(py, |stop| self.0.refine(&start, Descent::last(held)?, stop))?;
        found(py, &terms)
    }

    /// The weighted sum of squared errors that terms leave.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn misfit(&self, py: Python<'_>, at: Given<'_>) -> PyResult<f64> {
        let at = terms(&at)?;
        enter(py, |_| self.0.misfit(&at))
    }

    /// Standard deviations of the logarithms of decays and of the angles of poles.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn pole_deviations<'py>(
        &self,
        py: Python<'py>,
        at: Given<'py>,
        variance: &Bound<'py, PyAny>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        let (at, variance) = (terms(&at)?, samples("variance", variance)?);
        let [decays, angles] = enter(py, |_| self.0.pole_deviations(&at, &variance))?;
        Ok((array(py, decays.into_iter())?, array(py, angles.into_iter())?))
    }
}
