//! Stability and margins of the sampled loop of a controller and a linearised stage.

use piezotrack_core::Result;
use piezotrack_core::design::{GainRange, LoopPlant, SampledLoop, Verdict};
use pyo3::prelude::*;

use crate::control::controller::PyController;
use crate::enter::enter;
use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyLoopPlant>()?;
    module.add_function(wrap_pyfunction!(check_loop, module)?)?;
    module.add_function(wrap_pyfunction!(loop_response, module)?)
}

/// A row by row, B, C, D and the delay, s.
type Matrices = (Vec<f64>, Vec<f64>, Vec<f64>, f64, f64);

/// A stage for small motions, from the controller's voltage to displacement.
#[pyclass(name = "LoopPlant", frozen, module = "piezotrack._core")]
#[derive(Clone)]
pub struct PyLoopPlant(LoopPlant);

#[pymethods]
impl PyLoopPlant {
    /// A row by row, B, C, D and the delay, s: what `from_matrices` takes.
    fn matrices(&self) -> Matrices {
        let (a, b, c, d, delay) = self.0.matrices();
        (a, b.to_vec(), c.to_vec(), d, delay)
    }

    #[staticmethod]
    #[expect(clippy::needless_pass_by_value, reason = "as Python gives them")]
    fn from_matrices(a: Vec<f64>, b: Vec<f64>, c: Vec<f64>, d: f64, delay: f64) -> PyResult<Self> {
        let plant = LoopPlant::state_space(&a, &b, &c, d).and_then(|one| one.with_delay(delay));
        plant.map(Self).map_err(|error| raise(&error))
    }

    #[getter]
    fn static_gain(&self) -> f64 {
        self.0.static_gain()
    }
}

impl PyLoopPlant {
    /// The plant itself.
    pub fn plant(&self) -> &LoopPlant {
        &self.0
    }

    /// Three plants, with a delay more.
    pub fn delayed(plants: Result<[LoopPlant; 3]>, delay: f64) -> PyResult<[Self; 3]> {
        let build = || -> Result<[Self; 3]> {
            let [low, middle, high] = plants?;
            let delayed = |plant: LoopPlant| plant.with_delay(delay).map(Self);
            Ok([delayed(low)?, delayed(middle)?, delayed(high)?])
        };
        build().map_err(|error| raise(&error))
    }
}

/// Verdict on a loop, as a dict in Python.
#[derive(IntoPyObject)]
struct Check {
    stable: bool,
    exact: bool,
    outside: Option<usize>,
    hidden: usize,
    slowest: Option<(f64, f64, f64)>,
    gains: Option<(f64, f64)>,
    periods: Option<f64>,
    small_gain: Option<f64>,
    gain_margin: Option<f64>,
    phase_margin: Option<f64>,
    delay_margin: Option<f64>,
    crossover: Option<f64>,
    sensitivity: f64,
    hint: Option<String>,
}

impl Check {
    fn of(verdict: Verdict) -> Self {
        let margins = verdict.margins;
        Self {
            stable: verdict.stable,
            exact: verdict.exact,
            outside: verdict.outside,
            hidden: verdict.hidden,
            slowest: verdict.slowest.map(|root| (root.radius, root.frequency, root.samples)),
            gains: verdict.gains.map(|GainRange { low, high }| (low, high)),
            periods: verdict.periods,
            small_gain: verdict.small_gain,
            gain_margin: margins.gain,
            phase_margin: margins.phase,
            delay_margin: margins.delay,
            crossover: margins.crossover,
            sensitivity: margins.sensitivity,
            hint: verdict.hint,
        }
    }
}

/// Checks the loop of a controller and a plant.
#[pyfunction]
fn check_loop(py: Python<'_>, controller: &PyController, plant: &PyLoopPlant) -> PyResult<Check> {
    let verdict =
        enter(py, |_| SampledLoop::of(&plant.0, &controller.controller, controller.dt)?.check())?;
    Ok(Check::of(verdict))
}

/// Open loop, sensitivity, complementary sensitivity and what a period leaves, at frequencies.
type Curves = (Vec<[f64; 2]>, Vec<[f64; 2]>, Vec<[f64; 2]>, Vec<f64>);

/// The loop at some frequencies, Hz; complex numbers as pairs.
#[pyfunction]
fn loop_response(
    py: Python<'_>,
    controller: &PyController,
    plant: &PyLoopPlant,
    frequency: Vec<f64>,
) -> PyResult<Curves> {
    let response = enter(py, move |_| {
        SampledLoop::of(&plant.0, &controller.controller, controller.dt)?.response(&frequency)
    })?;
    Ok((response.open, response.sensitivity, response.complementary, response.learning))
}
