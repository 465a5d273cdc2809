//! The virtual stage: its settings, its simulation, a controller on it.

use numpy::PyArray1;
use piezotrack_core::models::Creep;
use piezotrack_core::signal::Drive;
use piezotrack_core::simulate::{
    Amplifier, Axis, OpenLoop, RELAXATIONS, Sensor, StagePlay, VirtualSettings, VirtualStage,
};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::arrays::{array, samples};
use crate::control::PyController;
use crate::enter::enter;
use crate::errors::raise;
use crate::stage::hold;
use crate::tracking::{Arrays, PyTrackingRun, Sampling, stopped};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyVirtualStage>()
}

/// Unfused numbers of a virtual stage, as a dict in Python.
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
    dead_zone_thresholds: Vec<f64>,
    #[pyo3(item)]
    dead_zone_weights: Vec<f64>,
    #[pyo3(item)]
    gain: f64,
    #[pyo3(item)]
    creep_weights: Vec<f64>,
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
        equally_many(
            "dead_zone_weights",
            &self.dead_zone_weights,
            "dead_zone_thresholds",
            &self.dead_zone_thresholds,
        )?;
        equally_many("creep_weights", &self.creep_weights, "creep_times", &self.creep_times)?;
        let last = self.dead_zone_thresholds.last().copied().unwrap_or(0.0);
        let shares: [f64; RELAXATIONS] = padded("creep_weights", &self.creep_weights, 0.0)?;
        let times: [f64; RELAXATIONS] = padded("creep_times", &self.creep_times, 1.0)?;
        let creep = core::array::from_fn(|j| Creep { share: shares[j], time: times[j] });
        let play = StagePlay {
            linear: self.linear,
            thresholds: padded("thresholds", &self.thresholds, 0.0)?,
            weights: padded("weights", &self.weights, 0.0)?,
            dead_zone_thresholds: padded("dead_zone_thresholds", &self.dead_zone_thresholds, last)?,
            dead_zone_weights: padded("dead_zone_weights", &self.dead_zone_weights, 0.0)?,
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
            dead_zone_thresholds: play.dead_zone_thresholds.to_vec(),
            dead_zone_weights: play.dead_zone_weights.to_vec(),
            gain: settings.gain,
            creep_weights: settings.creep.map(|creep| creep.share).to_vec(),
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

/// The records of a driven stage.
pub fn open_loop_arrays<'py, S>(
    py: Python<'py>,
    run: &OpenLoop<S>,
) -> PyResult<OpenLoopArrays<'py>> {
    let array = |part: &Vec<f64>| array(py, part.iter().copied());
    Ok((array(&run.displacement)?, array(&run.measured)?, array(&run.applied)?))
}

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
        open_loop_arrays(py, &run)
    }

    /// Simulates closed-loop tracking of a reference.
    fn track(
        &self,
        py: Python<'_>,
        controller: &PyController,
        reference: &Bound<'_, PyAny>,
        feedforward: &Bound<'_, PyAny>,
        sampling: Sampling,
    ) -> PyResult<PyTrackingRun> {
        let input = Arrays::new(reference, feedforward)?;
        enter(py, |stop| input.run(&Axis::Virtual(self.0), &[], controller, sampling, stop))
    }
}
