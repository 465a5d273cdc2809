//! The Prandtl-Ishlinskii stage: simulation, inverse, identification.

use numpy::{PyArray1, ToPyArray};
use piezotrack_core::design::LoopPlant;
use piezotrack_core::identify::{
    DynamicsKind, PlaysFit, PlaysRecord, PlaysSettings, identify_plays,
};
use piezotrack_core::math::Rows;
use piezotrack_core::models::{
    Dynamics, FeedforwardState, PlaysFeedforward, PlaysMotion, PlaysState, PrandtlIshlinskiiStage,
    Relaxation, plays,
};
use piezotrack_core::signal::Drive;
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::arrays::samples;
use crate::control::PyController;
use crate::design::PyLoopPlant;
use crate::enter::enter;
use crate::errors::raise;
use crate::stage::hold;
use crate::tracking::{Arrays, Pace, PyTracked};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyPlays>()?;
    module.add_class::<PyPlaysMotion>()?;
    module.add_class::<PyPlaysInverse>()?;
    module.add_class::<PyPlaysFit>()?;
    module.add_function(wrap_pyfunction!(fit_plays, module)?)?;
    module.add_function(wrap_pyfunction!(nnls, module)?)
}

/// Drive, plays, creep, displacement and velocity.
type State = (f64, Vec<f64>, Vec<f64>, f64, f64);

/// A stage with play operators at its input.
#[pyclass(name = "Plays", frozen, module = "piezotrack._core")]
struct PyPlays {
    stage: PrandtlIshlinskiiStage,
    count: usize,
}

#[pymethods]
impl PyPlays {
    #[new]
    #[pyo3(signature = (*, linear, thresholds, weights, corners, bends, creep_shares, creep_times, time_constant, mode))]
    #[expect(clippy::too_many_arguments, clippy::needless_pass_by_value, reason = "from Python")]
    fn new(
        linear: f64,
        thresholds: Vec<f64>,
        weights: Vec<f64>,
        corners: Vec<f64>,
        bends: Vec<f64>,
        creep_shares: Vec<f64>,
        creep_times: Vec<f64>,
        time_constant: Option<f64>,
        mode: Option<(f64, f64)>,
    ) -> PyResult<Self> {
        let build = || -> Result<Self> {
            let dynamics = match (time_constant, mode) {
                (Some(time), _) => Dynamics::First { time },
                (None, Some((frequency, damping_ratio))) => {
                    Dynamics::Second { frequency, damping_ratio }
                }
                (None, None) => Dynamics::None,
            };
            let stage = PrandtlIshlinskiiStage {
                plays: plays(linear, &thresholds, &weights, &corners, &bends)?,
                relaxation: Relaxation::new(&creep_shares, &creep_times, dynamics)?,
            };
            Ok(Self { stage, count: thresholds.len() })
        };
        build().map_err(|error| raise(&error))
    }

    /// Displacement under a drive.
    fn simulate(
        &self,
        py: Python<'_>,
        u: &Bound<'_, PyAny>,
        dt: f64,
        hold_name: &str,
        initial: Option<State>,
    ) -> PyResult<PyPlaysMotion> {
        let u = samples("u", u)?;
        let motion = enter(py, |stop| {
            let drive = Drive::new(&u, dt, hold(hold_name)?)?;
            self.stage.simulate(&drive, self.state(initial)?, stop)
        })?;
        let (count, creep) = (self.count, self.stage.relaxation.count);
        // None means stopped, for which `enter` has raised.
        motion
            .map(|motion| PyPlaysMotion { motion, count, creep })
            .ok_or_else(|| raise(&Error::Numerical("the simulation was stopped".into())))
    }

    /// The voltage along a whole reference, from a state or from a stage that never moved.
    #[pyo3(signature = (dt, x, v, a, initial=None))]
    fn feedforward<'py>(
        &self,
        py: Python<'py>,
        dt: f64,
        x: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
        initial: Option<State>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (x, v, a) = (samples("x", x)?, samples("v", v)?, samples("a", a)?);
        let volts = || -> Result<Vec<f64>> {
            let inverse = self.stage.inverse(dt)?;
            let mut state = inverse.start(&self.state(initial)?);
            let mut volts = Vec::with_capacity(x.len());
            for (k, ((&x, &v), &a)) in x.iter().zip(&v).zip(&a).enumerate() {
                let value = inverse.step(&mut state, x, v, a);
                if !value.is_finite() {
                    return Err(Error::Numerical(format!(
                        "the inverse has no voltage for sample {k} of the reference ({x:e} m, \
                         {v:e} m/s, {a:e} m/s^2): check its units and its sampling"
                    )));
                }
                volts.push(value);
            }
            Ok(volts)
        };
        volts().map(|volts| volts.to_pyarray(py)).map_err(|error| raise(&error))
    }

    /// Lets a controller lead the stage along a course, in steps of at most `step` seconds.
    fn track(
        &self,
        py: Python<'_>,
        step: f64,
        controller: &PyController,
        reference: &Bound<'_, PyAny>,
        feedforward: &Bound<'_, PyAny>,
        pace: Pace,
    ) -> PyResult<PyTracked> {
        let course = Arrays::new(reference, feedforward)?;
        enter(py, |stop| course.bare(&self.stage, step, controller, pace, stop))
    }

    /// The stage for small motions between two voltages: least, mean and largest gain.
    fn loop_plants(&self, low: f64, high: f64, delay: f64) -> PyResult<[PyLoopPlant; 3]> {
        PyLoopPlant::late(LoopPlant::plays(&self.stage, low, high), delay)
    }

    /// The inverse at work, sample by sample.
    #[pyo3(signature = (dt, initial=None))]
    fn inverse(&self, dt: f64, initial: Option<State>) -> PyResult<PyPlaysInverse> {
        let build = || -> Result<PyPlaysInverse> {
            let inverse = self.stage.inverse(dt)?;
            let start = inverse.start(&self.state(initial)?);
            Ok(PyPlaysInverse { inverse, start, state: start })
        };
        build().map_err(|error| raise(&error))
    }
}

impl PyPlays {
    /// A state from Python, or that at rest.
    fn state(&self, given: Option<State>) -> Result<PlaysState> {
        let Some((u, plays, creep, x, v)) = given else { return Ok(self.stage.at_rest()) };
        let (count, relaxations) = (self.count, self.stage.relaxation.count);
        if plays.len() != count || creep.len() != relaxations {
            return Err(Error::Shape {
                name: "initial".into(),
                found: format!("{} plays and {} relaxations", plays.len(), creep.len()),
                expected: format!("{count} plays and {relaxations} relaxations, as the stage"),
            });
        }
        if ![u, x, v].iter().chain(&plays).chain(&creep).all(|value| value.is_finite()) {
            return Err(Error::parameter("initial", "not finite", "finite numbers"));
        }
        Ok(self.stage.state(u, &plays, &creep, x, v))
    }
}

/// A simulated motion.
#[pyclass(name = "PlaysMotion", frozen, module = "piezotrack._core")]
struct PyPlaysMotion {
    motion: PlaysMotion,
    count: usize,
    creep: usize,
}

#[pymethods]
impl PyPlaysMotion {
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.motion.x.to_pyarray(py)
    }

    #[getter]
    fn hysteresis<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.motion.hysteresis.to_pyarray(py)
    }

    #[getter]
    fn last(&self) -> State {
        let PlaysState { plays, rest } = &self.motion.last;
        let creep = rest.creep[..self.creep].to_vec();
        (plays.input, plays.plays[..self.count].to_vec(), creep, rest.x, rest.v)
    }
}

/// The inverse at work, sample by sample.
#[pyclass(name = "PlaysInverse", module = "piezotrack._core")]
struct PyPlaysInverse {
    inverse: PlaysFeedforward,
    start: FeedforwardState,
    state: FeedforwardState,
}

#[pymethods]
impl PyPlaysInverse {
    /// NaN where there is no voltage.
    fn step(&mut self, x: f64, v: f64, a: f64) -> f64 {
        self.inverse.step(&mut self.state, x, v, a)
    }

    fn reset(&mut self) {
        self.state = self.start;
    }
}

/// A stage as identified.
#[pyclass(name = "PlaysFit", frozen, module = "piezotrack._core")]
struct PyPlaysFit {
    fit: PlaysFit,
    count: usize,
    zones: usize,
}

#[pymethods]
impl PyPlaysFit {
    #[getter]
    fn linear(&self) -> f64 {
        self.fit.stage.plays.linear
    }

    #[getter]
    fn weights(&self) -> Vec<f64> {
        self.fit.stage.plays.weights[..self.count].to_vec()
    }

    #[getter]
    fn corners(&self) -> Vec<f64> {
        self.fit.stage.plays.corners[..self.zones].to_vec()
    }

    #[getter]
    fn bends(&self) -> Vec<f64> {
        self.fit.stage.plays.bends[..self.zones].to_vec()
    }

    #[getter]
    fn creep_shares(&self) -> Vec<f64> {
        let part = &self.fit.stage.relaxation;
        part.creep[..part.count].iter().map(|creep| creep.share).collect()
    }

    #[getter]
    fn time_constant(&self) -> Option<f64> {
        match self.fit.stage.relaxation.dynamics {
            Dynamics::First { time } => Some(time),
            _ => None,
        }
    }

    #[getter]
    fn mode(&self) -> Option<(f64, f64)> {
        match self.fit.stage.relaxation.dynamics {
            Dynamics::Second { frequency, damping_ratio } => Some((frequency, damping_ratio)),
            _ => None,
        }
    }

    #[getter]
    fn offset(&self) -> f64 {
        self.fit.offset
    }

    #[getter]
    fn rms(&self) -> f64 {
        self.fit.rms
    }

    #[getter]
    fn evaluations(&self) -> usize {
        self.fit.evaluations
    }

    #[getter]
    fn at_bound(&self) -> bool {
        self.fit.at_bound
    }
}

/// Identifies a stage from a record.
#[pyfunction]
#[pyo3(name = "identify_plays", signature = (*, u, y, dt, hold_name, start, thresholds, zones, creep_times, dynamics, offset))]
#[expect(clippy::too_many_arguments, reason = "called from one place")]
fn fit_plays(
    py: Python<'_>,
    u: &Bound<'_, PyAny>,
    y: &Bound<'_, PyAny>,
    dt: f64,
    hold_name: &str,
    start: usize,
    thresholds: Vec<f64>,
    zones: usize,
    creep_times: Vec<f64>,
    dynamics: &str,
    offset: bool,
) -> PyResult<PyPlaysFit> {
    let (u, y) = (samples("u", u)?, samples("y", y)?);
    let count = thresholds.len();
    let fit = enter(py, |stop| {
        let drive = Drive::new(&u, dt, hold(hold_name)?)?;
        let dynamics = match dynamics {
            "none" => DynamicsKind::None,
            "first" => DynamicsKind::First,
            "second" => DynamicsKind::Second,
            other => {
                let expected = "None, 'first' or 'second'";
                return Err(Error::parameter("dynamics", format!("'{other}'"), expected));
            }
        };
        let settings = PlaysSettings { thresholds, zones, times: creep_times, dynamics, offset };
        identify_plays(&PlaysRecord { drive, y: &y, start }, &settings, stop)
    })?;
    fit.map(|fit| PyPlaysFit { fit, count, zones })
        .ok_or_else(|| raise(&Error::Numerical("the search was stopped".into())))
}

/// Non-negative least squares, for tests: rows of A, b, which unknowns are free of sign.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "from Python")]
fn nnls(a: Vec<Vec<f64>>, b: Vec<f64>, free: Vec<bool>) -> PyResult<Vec<f64>> {
    let unknowns = free.len();
    if a.len() != b.len() || a.iter().any(|row| row.len() != unknowns) {
        return Err(crate::errors::shape("a", "another shape", "len(b) rows of len(free)"));
    }
    let mut rows = Rows::new(unknowns);
    for (row, right) in a.iter().zip(&b) {
        rows.push(row, *right);
    }
    Ok(rows.solve(&free))
}
