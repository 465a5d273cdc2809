//! Stages of every model: their simulation, their inverse and their loop.

use numpy::PyArray1;
use piezotrack_core::error::finite;
use piezotrack_core::models::{Experiment, Method, Model, Response, Stage, Values};
use piezotrack_core::signal::{self, Drive, Hold};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::control::design::PyLoopPlant;
use crate::control::tracking::stopped;
use crate::conversions::arrays::{array, samples};
use crate::enter::enter;
use crate::errors::raise;
use crate::stages::inverse::PyInverse;
use crate::stages::models::{Named, named};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyStage>()?;
    module.add_class::<PyResponse>()?;
    module.add_function(wrap_pyfunction!(delayed, module)?)
}

/// The hold by its name.
pub fn hold(name: &str) -> Result<Hold> {
    match name {
        "foh" => Ok(Hold::First),
        "zoh" => Ok(Hold::Zero),
        "jump" => Ok(Hold::Jump),
        other => Err(Error::parameter("hold", format!("'{other}'"), "'foh' or 'zoh'")),
    }
}

fn method_named(name: &str) -> Result<Method> {
    match name {
        "exponential" => Ok(Method::Exponential),
        "rk4" => Ok(Method::Rk4),
        "rk45" => Ok(Method::Rk45),
        other => {
            Err(Error::parameter("method", format!("'{other}'"), "'exponential', 'rk4' or 'rk45'"))
        }
    }
}

/// A stage of a model, by the model's name and the parameters' names.
#[pyclass(name = "Stage", frozen, module = "piezotrack._core")]
pub struct PyStage(pub Stage);

impl PyStage {
    fn state(&self, given: Option<Named>) -> Result<Option<Values>> {
        let Some(given) = given else { return Ok(None) };
        let values = Values::named(self.0.model().info().state, given)?;
        for (name, numbers) in values.iter() {
            for &number in numbers {
                finite(&format!("{name} of initial"), number, "")?;
            }
        }
        Ok(Some(values))
    }
}

#[pymethods]
impl PyStage {
    #[new]
    fn new(model: &str, parameters: Named) -> PyResult<Self> {
        let build = || {
            let model = Model::named(model)?;
            model.build(&Values::named(model.info().parameters, parameters)?)
        };
        build().map(Self).map_err(|error| raise(&error))
    }

    /// State in equilibrium after a slow visit to each voltage in turn, from rest.
    fn equilibrium(&self, voltages: &Bound<'_, PyAny>) -> PyResult<Named> {
        let voltages = samples("voltages", voltages)?;
        let state = self.0.equilibrium(&voltages).map_err(|error| raise(&error))?;
        Ok(named(&state))
    }

    /// Motion under a drive, from a state or from rest.
    #[pyo3(signature = (u, dt, hold_name, *, initial, method, accuracy))]
    #[expect(clippy::too_many_arguments, reason = "called from one place")]
    fn simulate(
        &self,
        py: Python<'_>,
        u: &Bound<'_, PyAny>,
        dt: f64,
        hold_name: &str,
        initial: Option<Named>,
        method: &str,
        accuracy: f64,
    ) -> PyResult<PyResponse> {
        let u = samples("u", u)?;
        let run = enter(py, |stop| {
            let drive = Drive::new(&u, dt, hold(hold_name)?)?;
            let (initial, method) = (self.state(initial)?, method_named(method)?);
            let initial = initial.as_ref();
            let experiment = Experiment { drive: &drive, initial, method, accuracy, stop };
            stopped(self.0.simulate(&experiment)?)
        })?;
        Ok(PyResponse(run))
    }

    /// The stage for small motions between two voltages: least, middle and largest gain.
    fn loop_plants(&self, low: f64, high: f64, delay: f64) -> PyResult<[PyLoopPlant; 3]> {
        PyLoopPlant::delayed(self.0.loop_plants(low, high), delay)
    }

    /// The inverse for samples every `dt` seconds, from a state or from a stage that never moved.
    #[pyo3(signature = (dt, *, offset, delay, initial))]
    fn inverse(
        &self,
        dt: f64,
        offset: f64,
        delay: f64,
        initial: Option<Named>,
    ) -> PyResult<PyInverse> {
        let build = || -> Result<PyInverse> {
            let (inverse, start) = self.0.inverse(dt, self.state(initial)?.as_ref())?;
            PyInverse::of_stage(inverse, &start, dt, offset, delay)
        };
        build().map_err(|error| raise(&error))
    }
}

/// A simulated motion.
#[pyclass(name = "Response", frozen, module = "piezotrack._core")]
struct PyResponse(Response);

#[pymethods]
impl PyResponse {
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        array(py, self.0.x.iter().copied())
    }

    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        array(py, self.0.v.iter().copied())
    }

    #[getter]
    fn hysteresis<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        array(py, self.0.hysteresis.iter().copied())
    }

    /// State at the last sample.
    #[getter]
    fn last(&self) -> Named {
        named(&self.0.last)
    }

    #[getter]
    fn substeps(&self) -> usize {
        self.0.substeps
    }

    #[getter]
    fn error_estimate(&self) -> f64 {
        self.0.error_estimate
    }

    #[getter]
    fn unique(&self) -> bool {
        self.0.unique
    }
}

/// The displacement with a delay.
#[pyfunction]
fn delayed<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    dt: f64,
    delay: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (x, v) = (samples("x", x)?, samples("v", v)?);
    let delayed = signal::delayed(&x, &v, dt, delay).map_err(|error| raise(&error))?;
    array(py, delayed.iter().copied())
}
