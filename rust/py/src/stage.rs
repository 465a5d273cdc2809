//! The Dahl stage and its simulation.

use numpy::{PyArray1, ToPyArray};
use piezotrack_core::integrator::{KinkedMotion, Order, ParameterInfo, Stepping};
use piezotrack_core::models::dahl_simulate::{self as model, Method};
use piezotrack_core::models::{
    BOUC_WEN_OSCILLATOR_PARAMETERS, BOUC_WEN_PARAMETERS, BoucWenMotion, BoucWenOscillator,
    BoucWenStage, DAHL_PARAMETERS, DahlStage, FIRST_ORDER_DAHL_PARAMETERS, FirstOrderDahlStage,
    Model, StageState, Trajectory,
};
use piezotrack_core::signal::{self, Drive, Hold, Stop};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::arrays::samples;
use crate::enter::enter;
use crate::errors::raise;

/// Values of the nine parameters, in the order of `DAHL_PARAMETERS`.
pub type Theta = [f64; 9];

/// Displacement, velocity, and two numbers that the hysteresis remembers.
type State = (f64, f64, f64, f64);

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("DAHL_PARAMETERS", plain(&DAHL_PARAMETERS))?;
    module.add("BOUC_WEN_PARAMETERS", plain(&BOUC_WEN_PARAMETERS))?;
    module.add("FIRST_ORDER_DAHL_PARAMETERS", plain(&FIRST_ORDER_DAHL_PARAMETERS))?;
    module.add("BOUC_WEN_OSCILLATOR_PARAMETERS", plain(&BOUC_WEN_OSCILLATOR_PARAMETERS))?;
    module.add_class::<PyTrajectory>()?;
    module.add_function(wrap_pyfunction!(delayed, module)?)?;
    module.add_function(wrap_pyfunction!(dahl_xu_li_2010, module)?)?;
    module.add_function(wrap_pyfunction!(dahl_simulate, module)?)?;
    module.add_function(wrap_pyfunction!(dahl_simulate_fixed, module)?)?;
    module.add_function(wrap_pyfunction!(bouc_wen_xu_li_2010, module)?)?;
    module.add_function(wrap_pyfunction!(stage_check, module)?)?;
    module.add_function(wrap_pyfunction!(bouc_wen_benchmark, module)?)?;
    module.add_function(wrap_pyfunction!(stage_simulate, module)?)
}

/// Name, symbol and unit of each.
fn plain(parameters: &[ParameterInfo]) -> Vec<(&str, &str, &str)> {
    parameters.iter().map(|info| (info.name, info.symbol, info.unit)).collect()
}

/// The hold by its name.
pub fn hold(name: &str) -> Result<Hold> {
    match name {
        "foh" => Ok(Hold::First),
        "zoh" => Ok(Hold::Zero),
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

/// A simulated motion.
#[pyclass(name = "Trajectory", frozen, module = "piezotrack._core")]
struct PyTrajectory {
    x: Vec<f64>,
    v: Vec<f64>,
    hysteresis: Vec<f64>,
    #[pyo3(get)]
    last: State,
    #[pyo3(get)]
    substeps: usize,
    #[pyo3(get)]
    well_posed: bool,
    #[pyo3(get)]
    difference: f64,
}

#[pymethods]
impl PyTrajectory {
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.x.to_pyarray(py)
    }

    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.v.to_pyarray(py)
    }

    #[getter]
    fn hysteresis<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.hysteresis.to_pyarray(py)
    }
}

impl From<Trajectory> for PyTrajectory {
    fn from(run: Trajectory) -> Self {
        let StageState { x, v, q1, q2 } = run.last;
        Self {
            x: run.x,
            v: run.v,
            hysteresis: run.hysteresis,
            last: (x, v, q1, q2),
            substeps: run.substeps,
            well_posed: run.well_posed,
            difference: run.difference,
        }
    }
}

impl From<BoucWenMotion> for PyTrajectory {
    fn from(run: BoucWenMotion) -> Self {
        let memory = &run.last.memory;
        Self {
            x: run.x,
            v: run.v,
            hysteresis: run.hysteresis,
            last: (run.last.x, run.last.v, memory.input, memory.operator.value),
            substeps: run.substeps,
            well_posed: true,
            difference: run.difference,
        }
    }
}

impl From<KinkedMotion> for PyTrajectory {
    fn from(run: KinkedMotion) -> Self {
        Self {
            x: run.x,
            v: run.v,
            hysteresis: run.hysteresis,
            last: (run.last.x, run.last.v, run.last.memory.value, 0.0),
            substeps: run.substeps,
            well_posed: true,
            difference: run.difference,
        }
    }
}

/// The displacement `delay` seconds late.
#[pyfunction]
fn delayed<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    dt: f64,
    delay: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (x, v) = (samples("x", x)?, samples("v", v)?);
    Ok(signal::delayed(&x, &v, dt, delay).to_pyarray(py))
}

/// Table 1 of Xu and Li 2010.
#[pyfunction]
fn dahl_xu_li_2010() -> Theta {
    let DahlStage { mechanics, piezo_coefficient, a1, a2, b1, b0, up } = DahlStage::xu_li_2010();
    let (mass, damping, stiffness) = (mechanics.mass, mechanics.damping, mechanics.stiffness);
    [mass, damping, stiffness, piezo_coefficient, a1, a2, b1, b0, up]
}

/// Simulates to an accuracy, choosing the sub-steps.
#[pyfunction]
#[pyo3(signature = (theta, u, dt, hold, initial, method, accuracy))]
#[expect(clippy::too_many_arguments, reason = "called from one place")]
fn dahl_simulate(
    py: Python<'_>,
    theta: Theta,
    u: &Bound<'_, PyAny>,
    dt: f64,
    hold: &str,
    initial: State,
    method: &str,
    accuracy: f64,
) -> PyResult<PyTrajectory> {
    let method = method_named(method).map_err(|error| raise(&error))?;
    run(py, theta, u, dt, hold, |stage, drive, stop| {
        model::simulate(stage, drive, state(initial), method, accuracy, stop)
    })
}

/// Simulates from rest with given sub-steps: for studies of convergence.
#[pyfunction]
fn dahl_simulate_fixed(
    py: Python<'_>,
    theta: Theta,
    u: &Bound<'_, PyAny>,
    dt: f64,
    hold: &str,
    substeps: usize,
) -> PyResult<PyTrajectory> {
    run(py, theta, u, dt, hold, |stage, drive, stop| {
        let stepping = Stepping { order: Order::Fourth, substeps };
        model::simulate_fixed(stage, drive, StageState::default(), stepping, stop)
    })
}

fn run(
    py: Python<'_>,
    theta: Theta,
    u: &Bound<'_, PyAny>,
    dt: f64,
    hold_name: &str,
    job: impl FnOnce(&DahlStage, &Drive<'_>, Stop<'_>) -> Result<Option<Trajectory>> + Send,
) -> PyResult<PyTrajectory> {
    driven(py, u, dt, hold_name, |drive, stop| job(&DahlStage::from_theta(&theta)?, drive, stop))
}

fn driven<T: Send + Into<PyTrajectory>>(
    py: Python<'_>,
    u: &Bound<'_, PyAny>,
    dt: f64,
    hold_name: &str,
    job: impl FnOnce(&Drive<'_>, Stop<'_>) -> Result<Option<T>> + Send,
) -> PyResult<PyTrajectory> {
    let u = samples("u", u)?;
    let run = enter(py, |stop| job(&Drive::new(&u, dt, hold(hold_name)?)?, stop))?;
    // None means stopped, for which `enter` has raised.
    run.map(Into::into).ok_or_else(|| raise(&Error::Numerical("the simulation was stopped".into())))
}

fn state((x, v, q1, q2): State) -> StageState {
    StageState { x, v, q1, q2 }
}

/// The parameters of Xu and Li 2010, as printed or with the stiffness corrected.
#[pyfunction]
fn bouc_wen_xu_li_2010(corrected: bool) -> [f64; 8] {
    let printed = BoucWenStage::xu_li_2010();
    let stage = if corrected { BoucWenStage::xu_li_2010_corrected() } else { printed };
    let [mass, damping, stiffness, piezo, alpha, beta, gamma, exponent, _] = stage.parameters();
    [mass, damping, stiffness, piezo, alpha, beta, gamma, exponent]
}

/// Raises where the values make no stage of the model.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "extracted from a tuple")]
fn stage_check(model: &str, theta: Vec<f64>) -> PyResult<()> {
    let check = || Model::named(model)?.check(&leading(&theta));
    check().map_err(|error| raise(&error))
}

/// As many values as asked for, zeros after the last.
fn leading<const N: usize>(theta: &[f64]) -> [f64; N] {
    core::array::from_fn(|i| theta.get(i).copied().unwrap_or(0.0))
}

/// Parameters of the Bouc-Wen benchmark.
#[pyfunction]
fn bouc_wen_benchmark() -> [f64; 8] {
    leading(&BoucWenOscillator::benchmark().parameters())
}

/// Simulates a stage of a model, by its name, from a state: displacement, velocity and what the
/// hysteresis remembers.
#[pyfunction]
#[pyo3(signature = (model, theta, u, dt, hold, initial, accuracy))]
#[expect(clippy::too_many_arguments, reason = "called from one place")]
#[expect(clippy::needless_pass_by_value, reason = "extracted from a tuple")]
fn stage_simulate(
    py: Python<'_>,
    model: &str,
    theta: Vec<f64>,
    u: &Bound<'_, PyAny>,
    dt: f64,
    hold: &str,
    initial: Vec<f64>,
    accuracy: f64,
) -> PyResult<PyTrajectory> {
    driven(py, u, dt, hold, |drive, stop| match Model::named(model)? {
        Model::BoucWen => {
            let stage = BoucWenStage::from_theta(&leading(&theta))?;
            let run = stage.simulate(drive, leading(&initial), accuracy, stop)?;
            Ok(run.map(PyTrajectory::from))
        }
        Model::FirstOrderDahl => {
            let stage = FirstOrderDahlStage::from_theta(&leading(&theta))?;
            let run = stage.simulate(drive, leading(&initial), accuracy, stop)?;
            Ok(run.map(PyTrajectory::from))
        }
        Model::BoucWenOscillator => {
            let oscillator = BoucWenOscillator::from_theta(&leading(&theta))?;
            let run = oscillator.simulate(drive, leading(&initial), accuracy, stop)?;
            Ok(run.map(PyTrajectory::from))
        }
        // Other methods than one are offered for it.
        Model::Dahl => Err(Error::parameter("model", "'dahl'", "dahl_simulate for it")),
    })
}
