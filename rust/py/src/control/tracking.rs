//! Closed-loop simulation of a controller on a stage, and its metrics.

use numpy::PyArray1;
use piezotrack_core::math::room;
use piezotrack_core::signal::Stop;
use piezotrack_core::signal::metrics::{self, Tracking};
use piezotrack_core::simulate::{ReferenceSamples, Timing, TrackingRun, VirtualStage, track};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::control::controller::PyController;
use crate::conversions::arrays::{array, samples};
use crate::errors::{raise, shape};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyTrackingRun>()?;
    module.add_function(wrap_pyfunction!(tracking_metrics, module)?)?;
    module.add_function(wrap_pyfunction!(period_metrics, module)?)?;
    module.add_function(wrap_pyfunction!(residual, module)?)
}

/// A stopped simulation, for which `enter` raises.
pub fn stopped<T>(run: Option<T>) -> Result<T> {
    run.ok_or_else(|| Error::Numerical("the simulation was stopped".into()))
}

/// Timing of a loop, from the attributes of Python's `Timing`.
#[derive(FromPyObject)]
pub struct LoopTiming<'py> {
    delay: f64,
    jitter: f64,
    voltages_before: Bound<'py, PyAny>,
}

impl LoopTiming<'_> {
    /// When a controller looks and acts every `interval` seconds, with instants kept in between.
    pub fn sampled(&self, interval: f64, samples: usize, substeps: usize) -> Timing {
        let Self { delay, jitter, .. } = *self;
        Timing { interval, samples, delay, jitter, substeps }
    }

    /// Voltages that the stage visits slowly before, V.
    pub fn voltages_before(&self) -> PyResult<Vec<f64>> {
        samples("voltages_before", &self.voltages_before)
    }
}

/// Reference and feedforward as Python gives them.
pub struct Arrays {
    reference: Vec<f64>,
    feedforward: Vec<f64>,
}

impl Arrays {
    pub fn new(reference: &Bound<'_, PyAny>, feedforward: &Bound<'_, PyAny>) -> PyResult<Self> {
        let reference = samples("reference", reference)?;
        let feedforward = samples("feedforward", feedforward)?;
        if reference.len() < 2 {
            let found = format!("{} samples", reference.len());
            return Err(shape("reference", &found, "at least 2"));
        }
        Ok(Self { reference, feedforward })
    }

    pub fn input(&self) -> ReferenceSamples<'_> {
        ReferenceSamples { reference: &self.reference, feedforward: &self.feedforward }
    }

    /// Simulates the closed loop of an axis from its start, or after visits to voltages.
    pub fn run(
        &self,
        axis: &VirtualStage,
        voltages_before: &[f64],
        controller: &PyController,
        timing: &Timing,
        stop: Stop<'_>,
    ) -> Result<PyTrackingRun> {
        let (apparatus, input) = (axis.apparatus(), self.input());
        let start = axis.start_after(voltages_before);
        let run = track(&apparatus, start, timing, &controller.controller, input, stop)?;
        PyTrackingRun::new(stopped(run)?)
    }
}

/// A controlled motion.
#[pyclass(name = "TrackingRun", frozen, module = "piezotrack._core")]
pub struct PyTrackingRun {
    /// At the instants kept: time, true displacement, applied voltage.
    motion: [Vec<f64>; 3],
    /// At the control samples.
    commands: Vec<piezotrack_control::Command>,
    measured: Vec<f64>,
}

impl PyTrackingRun {
    pub fn new<S>(run: TrackingRun<S>) -> Result<Self> {
        let TrackingRun { motion, commands } = run;
        let substeps = (motion.time.len() - 1) / (commands.len() - 1).max(1);
        let mut measured = room("the readings", commands.len())?;
        measured.extend(motion.measured.iter().step_by(substeps.max(1)));
        Ok(Self { motion: [motion.time, motion.displacement, motion.applied], commands, measured })
    }
}

#[pymethods]
impl PyTrackingRun {
    /// Time, true displacement, applied voltage at the instants kept.
    fn motion<'py>(&self, py: Python<'py>) -> PyResult<[Bound<'py, PyArray1<f64>>; 3]> {
        let [time, displacement, applied] = &self.motion;
        let array = |part: &Vec<f64>| array(py, part.iter().copied());
        Ok([array(time)?, array(displacement)?, array(applied)?])
    }

    /// Reading of the sensor at the control samples.
    #[getter]
    fn measured<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        array(py, self.measured.iter().copied())
    }

    /// A part of the commands by its name.
    fn part<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let pick: fn(&piezotrack_control::Command) -> f64 = match name {
            "volts" => |command| command.volts,
            "unclipped" => |command| command.unclipped,
            "feedforward" => |command| command.feedforward,
            "feedback" => |command| command.feedback,
            "repetitive" => |command| command.repetitive,
            "error" => |command| command.error,
            other => {
                let error = Error::parameter("name", other, "a part of the command");
                return Err(raise(&error));
            }
        };
        array(py, self.commands.iter().map(pick))
    }

    /// Whether each command was clipped.
    #[getter]
    fn saturated<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        array(py, self.commands.iter().map(|command| command.saturated))
    }
}

/// Largest, RMS, mean error, its deviation and peak to peak, phase lag, widest loop.
type Figures = (f64, f64, f64, f64, f64, Option<f64>, Option<f64>);

fn figures(of: &Tracking) -> Figures {
    (
        of.max_error,
        of.rms_error,
        of.mean_error,
        of.error_sd,
        of.error_peak_to_peak,
        of.phase_lag,
        of.widest_loop,
    )
}

/// Figures of a motion against its reference.
#[pyfunction]
fn tracking_metrics(
    desired: &Bound<'_, PyAny>,
    actual: &Bound<'_, PyAny>,
    dt: f64,
    frequency: Option<f64>,
) -> PyResult<Figures> {
    let (desired, actual) = (samples("desired", desired)?, samples("actual", actual)?);
    let found = metrics::tracking(&desired, &actual, dt, frequency);
    found.map(|found| figures(&found)).map_err(|error| raise(&error))
}

/// Figures of each whole period.
#[pyfunction]
fn period_metrics(
    desired: &Bound<'_, PyAny>,
    actual: &Bound<'_, PyAny>,
    dt: f64,
    period: f64,
) -> PyResult<Vec<Figures>> {
    let (desired, actual) = (samples("desired", desired)?, samples("actual", actual)?);
    let found = metrics::each_period(&desired, &actual, dt, period);
    found.map(|found| found.iter().map(figures).collect()).map_err(|error| raise(&error))
}

/// RMS, largest, correlation of neighbours, AIC, BIC of what a model leaves.
#[pyfunction]
fn residual(errors: &Bound<'_, PyAny>, fitted: usize) -> PyResult<(f64, f64, f64, f64, f64)> {
    let errors = samples("errors", errors)?;
    let found = metrics::residual(&errors, fitted).map_err(|error| raise(&error))?;
    Ok((found.rms, found.max, found.autocorrelation, found.aic, found.bic))
}
