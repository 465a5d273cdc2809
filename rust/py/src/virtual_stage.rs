//! The virtual stage, and a controller on it or on a model.

use numpy::{PyArray1, ToPyArray};
use piezotrack_core::integrate::{Drive, Stop};
use piezotrack_core::metrics::{self, Tracking};
use piezotrack_core::simulate::{
    Amplifier, Apparatus, ApparatusState, Course, Plant, Sensor, Timing, Tracked, track,
};
use piezotrack_core::stage::{
    Creep, DahlStage, RELAXATIONS, StagePlay, VirtualSettings, VirtualStage,
};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::arrays::samples;
use crate::control::PyController;
use crate::enter::enter;
use crate::errors::{raise, shape};
use crate::stage::{Theta, hold};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyVirtualStage>()?;
    module.add_class::<PyTracked>()?;
    module.add_function(wrap_pyfunction!(track_dahl, module)?)?;
    module.add_function(wrap_pyfunction!(tracking_metrics, module)?)?;
    module.add_function(wrap_pyfunction!(period_metrics, module)?)
}

/// Plain numbers of a virtual stage, as a dict in Python.
#[derive(FromPyObject, IntoPyObject)]
struct Settings {
    #[pyo3(item)]
    bandwidth: f64,
    #[pyo3(item)]
    slew: f64,
    #[pyo3(item)]
    limits: (f64, f64),
    #[pyo3(item)]
    linear: f64,
    #[pyo3(item)]
    thresholds: Vec<f64>,
    #[pyo3(item)]
    weights: Vec<f64>,
    #[pyo3(item)]
    corners: Vec<f64>,
    #[pyo3(item)]
    bends: Vec<f64>,
    #[pyo3(item)]
    gain: f64,
    #[pyo3(item)]
    creep_shares: Vec<f64>,
    #[pyo3(item)]
    creep_times: Vec<f64>,
    #[pyo3(item)]
    frequency: f64,
    #[pyo3(item)]
    damping_ratio: f64,
    #[pyo3(item)]
    noise: f64,
    #[pyo3(item)]
    noise_bandwidth: f64,
    #[pyo3(item)]
    resolution: f64,
    #[pyo3(item)]
    sensor_range: f64,
    #[pyo3(item)]
    seed: u64,
    #[pyo3(item)]
    preconditioned: bool,
    #[pyo3(item)]
    swing: f64,
    #[pyo3(item)]
    rest: f64,
    #[pyo3(item)]
    step: f64,
}

/// As many numbers as there is room for, padded with what does nothing.
fn padded<const N: usize>(name: &str, values: &[f64], filler: f64) -> Result<[f64; N]> {
    if values.len() > N {
        let expected = format!("{N} at most");
        return Err(Error::parameter(name, format!("{} numbers", values.len()), expected));
    }
    Ok(core::array::from_fn(|i| values.get(i).copied().unwrap_or(filler)))
}

fn equally_many(name: &str, values: &[f64], other: &str, others: &[f64]) -> Result<()> {
    if values.len() == others.len() {
        return Ok(());
    }
    let expected = format!("{}, as many as {other}", others.len());
    Err(Error::Shape { name: name.into(), found: format!("{} numbers", values.len()), expected })
}

impl Settings {
    fn core(&self) -> Result<VirtualSettings> {
        equally_many("weights", &self.weights, "thresholds", &self.thresholds)?;
        equally_many("bends", &self.bends, "corners", &self.corners)?;
        equally_many("creep_shares", &self.creep_shares, "creep_times", &self.creep_times)?;
        let last = self.corners.last().copied().unwrap_or(0.0);
        let shares: [f64; RELAXATIONS] = padded("creep_shares", &self.creep_shares, 0.0)?;
        let times: [f64; RELAXATIONS] = padded("creep_times", &self.creep_times, 1.0)?;
        let creep = core::array::from_fn(|j| Creep { share: shares[j], time: times[j] });
        let play = StagePlay {
            linear: self.linear,
            thresholds: padded("thresholds", &self.thresholds, 0.0)?,
            weights: padded("weights", &self.weights, 0.0)?,
            corners: padded("corners", &self.corners, last)?,
            bends: padded("bends", &self.bends, 0.0)?,
        };
        Ok(VirtualSettings {
            amplifier: Amplifier {
                bandwidth: self.bandwidth,
                slew: self.slew,
                low: self.limits.0,
                high: self.limits.1,
            },
            play,
            gain: self.gain,
            creep,
            frequency: self.frequency,
            damping_ratio: self.damping_ratio,
            sensor: Sensor {
                noise: self.noise,
                bandwidth: self.noise_bandwidth,
                resolution: self.resolution,
                range: self.sensor_range,
                seed: self.seed,
            },
            preconditioned: self.preconditioned,
            swing: self.swing,
            rest: self.rest,
            step: self.step,
        })
    }

    fn of(settings: &VirtualSettings) -> Self {
        let VirtualSettings { amplifier, play, sensor, .. } = *settings;
        Self {
            bandwidth: amplifier.bandwidth,
            slew: amplifier.slew,
            limits: (amplifier.low, amplifier.high),
            linear: play.linear,
            thresholds: play.thresholds.to_vec(),
            weights: play.weights.to_vec(),
            corners: play.corners.to_vec(),
            bends: play.bends.to_vec(),
            gain: settings.gain,
            creep_shares: settings.creep.map(|creep| creep.share).to_vec(),
            creep_times: settings.creep.map(|creep| creep.time).to_vec(),
            frequency: settings.frequency,
            damping_ratio: settings.damping_ratio,
            noise: sensor.noise,
            noise_bandwidth: sensor.bandwidth,
            resolution: sensor.resolution,
            sensor_range: sensor.range,
            seed: sensor.seed,
            preconditioned: settings.preconditioned,
            swing: settings.swing,
            rest: settings.rest,
            step: settings.step,
        }
    }
}

/// True displacement, reading of the sensor and applied voltage.
pub type OpenLoopArrays<'py> =
    (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// A stage to experiment on.
#[pyclass(name = "VirtualStage", frozen, module = "piezotrack._core")]
pub struct PyVirtualStage(pub VirtualStage);

#[pymethods]
impl PyVirtualStage {
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from a dict")]
    fn new(settings: Settings) -> PyResult<Self> {
        let stage = settings.core().and_then(|settings| VirtualStage::new(&settings));
        stage.map(Self).map_err(|error| raise(&error))
    }

    #[staticmethod]
    fn xu_li_2010(seed: u64) -> Settings {
        Settings::of(&VirtualSettings::xu_li_2010(seed))
    }

    #[staticmethod]
    fn xu_li_2010_y(seed: u64) -> Settings {
        Settings::of(&VirtualSettings::xu_li_2010_y(seed))
    }

    /// Lowest, mean and highest gain for small motions, m/V.
    fn gains(&self) -> [f64; 3] {
        self.0.gains()
    }

    fn simulate<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        dt: f64,
        hold_name: &str,
    ) -> PyResult<OpenLoopArrays<'py>> {
        let u = samples("u", u)?;
        let run = enter(py, |stop| {
            let drive = Drive::new(&u, dt, hold(hold_name)?)?;
            stopped(self.0.simulate(&drive, stop)?)
        })?;
        Ok((
            run.displacement.to_pyarray(py),
            run.measured.to_pyarray(py),
            run.applied.to_pyarray(py),
        ))
    }

    /// Lets a controller lead the stage along a course.
    fn track(
        &self,
        py: Python<'_>,
        controller: &PyController,
        reference: &Bound<'_, PyAny>,
        feedforward: &Bound<'_, PyAny>,
        delay: f64,
        substeps: usize,
    ) -> PyResult<PyTracked> {
        let course = Arrays::new(reference, feedforward)?;
        enter(py, |stop| {
            let apparatus = self.0.apparatus();
            course.run(&apparatus, self.0.start(), controller, (delay, substeps), stop)
        })
    }
}

/// Lets a controller lead a model along a course, in steps of at most `step` seconds.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "called from one place")]
fn track_dahl(
    py: Python<'_>,
    theta: Theta,
    step: f64,
    controller: &PyController,
    reference: &Bound<'_, PyAny>,
    feedforward: &Bound<'_, PyAny>,
    delay: f64,
    substeps: usize,
) -> PyResult<PyTracked> {
    let course = Arrays::new(reference, feedforward)?;
    enter(py, |stop| {
        let stage = DahlStage::from_theta(&theta)?;
        let apparatus = Apparatus::bare(&stage, step);
        course.run(&apparatus, apparatus.rest(), controller, (delay, substeps), stop)
    })
}

/// A stopped simulation, for which `enter` raises.
pub fn stopped<T>(run: Option<T>) -> Result<T> {
    run.ok_or_else(|| Error::Numerical("the simulation was stopped".into()))
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

    pub fn course(&self) -> Course<'_> {
        Course { reference: &self.reference, feedforward: &self.feedforward }
    }

    fn run<P: Plant>(
        &self,
        apparatus: &Apparatus<'_, P>,
        start: ApparatusState<P::State>,
        controller: &PyController,
        (delay, substeps): (f64, usize),
        stop: Stop<'_>,
    ) -> Result<PyTracked> {
        let (interval, samples) = (controller.dt, self.reference.len());
        let timing = Timing { interval, samples, delay, substeps };
        let run = track(apparatus, start, &timing, &controller.controller, self.course(), stop)?;
        Ok(PyTracked::new(stopped(run)?))
    }
}

/// A controlled motion.
#[pyclass(name = "Tracked", frozen, module = "piezotrack._core")]
pub struct PyTracked {
    /// At the instants kept: time, true displacement, applied voltage.
    motion: [Vec<f64>; 3],
    /// At the control samples.
    commands: Vec<piezotrack_control::Command>,
    measured: Vec<f64>,
}

impl PyTracked {
    pub fn new<S>(run: Tracked<S>) -> Self {
        let Tracked { motion, commands } = run;
        let substeps = (motion.time.len() - 1) / (commands.len() - 1).max(1);
        let measured = motion.measured.iter().step_by(substeps.max(1)).copied().collect();
        Self { motion: [motion.time, motion.displacement, motion.applied], commands, measured }
    }
}

#[pymethods]
impl PyTracked {
    /// Time, true displacement, applied voltage at the instants kept.
    fn motion<'py>(&self, py: Python<'py>) -> [Bound<'py, PyArray1<f64>>; 3] {
        [0, 1, 2].map(|i| self.motion[i].to_pyarray(py))
    }

    /// Reading of the sensor at the control samples.
    #[getter]
    fn measured<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.measured.to_pyarray(py)
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
        Ok(PyArray1::from_iter(py, self.commands.iter().map(pick)))
    }

    /// Whether each command was clipped.
    #[getter]
    fn saturated<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_iter(py, self.commands.iter().map(|command| command.saturated))
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
