//! The virtual stage: its parts, its simulation, a controller on it.

use numpy::PyArray1;
use piezotrack_core::models::Stage;
use piezotrack_core::signal::Drive;
use piezotrack_core::simulate::{
    Amplifier, OpenLoop, Preconditioning, Sensor, VirtualRun, VirtualStage,
};
use pyo3::prelude::*;

use crate::control::controller::PyController;
use crate::control::design::PyLoopPlant;
use crate::control::tracking::{Arrays, LoopTiming, PyTrackingRun, stopped};
use crate::conversions::arrays::{array, samples};
use crate::enter::enter;
use crate::errors::raise;
use crate::stages::models::{Named, named};
use crate::stages::stage::{PyStage, hold};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyVirtualStage>()?;
    module.add_class::<PyVirtualRun>()
}

/// Bandwidth, slew rate, lowest and highest output.
type AmplifierNumbers = (f64, f64, f64, f64);

/// Noise, its bandwidth, resolution, range, delay, offset, seed.
type SensorNumbers = (f64, f64, f64, f64, f64, f64, u64);

/// Swing and rest of the preconditioning.
type Cycles = Option<(f64, f64)>;

fn amplifier((bandwidth, slew, low, high): AmplifierNumbers) -> Amplifier {
    Amplifier { bandwidth, slew, low, high }
}

fn sensor(numbers: SensorNumbers) -> Sensor {
    let (noise, bandwidth, resolution, range, delay, offset, seed) = numbers;
    Sensor { noise, bandwidth, resolution, range, delay, offset, seed }
}

/// Name of the model, parameters of the stage, amplifier, sensor, preconditioning and step.
type Parts = (&'static str, Named, AmplifierNumbers, SensorNumbers, Cycles, f64);

fn parts(of: &VirtualStage) -> Parts {
    let VirtualStage { stage, amplifier, sensor, preconditioning, step } = of;
    let Amplifier { bandwidth, slew, low, high } = *amplifier;
    let Sensor { noise, bandwidth: reach, resolution, range, delay, offset, seed } = *sensor;
    // The published ones have plays.
    let parameters = match stage {
        Stage::PrandtlIshlinskii(plays) => named(&plays.parameters()),
        _ => Named::new(),
    };
    (
        stage.model().info().name,
        parameters,
        (bandwidth, slew, low, high),
        (noise, reach, resolution, range, delay, offset, seed),
        preconditioning.map(|cycles| (cycles.swing, cycles.rest)),
        *step,
    )
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
    fn new(
        stage: &PyStage,
        of_amplifier: AmplifierNumbers,
        of_sensor: SensorNumbers,
        cycles: Cycles,
        step: f64,
    ) -> PyResult<Self> {
        let stage = VirtualStage {
            stage: stage.0,
            amplifier: amplifier(of_amplifier),
            sensor: sensor(of_sensor),
            preconditioning: cycles.map(|(swing, rest)| Preconditioning { swing, rest }),
            step,
        };
        stage.validate().map_err(|error| raise(&error))?;
        Ok(Self(stage))
    }

    /// The parts of the stage of Xu and Li 2010.
    #[staticmethod]
    fn xu_li_2010(seed: u64) -> Parts {
        parts(&VirtualStage::xu_li_2010(seed))
    }

    /// Those of its other axis.
    #[staticmethod]
    fn xu_li_2010_y(seed: u64) -> Parts {
        parts(&VirtualStage::xu_li_2010_y(seed))
    }

    /// The stage with amplifier and sensor delay for small motions between two voltages: least,
    /// middle and largest gain.
    fn loop_plants(&self, low: f64, high: f64, delay: f64) -> PyResult<[PyLoopPlant; 3]> {
        PyLoopPlant::delayed(self.0.loop_plants(low, high), delay)
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

    /// Simulates closed-loop tracking of a reference, after visits to voltages or from the start,
    /// in steps of at most `step` seconds, with `substeps` instants kept in each control interval.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn track(
        &self,
        py: Python<'_>,
        controller: &PyController,
        reference: &Bound<'_, PyAny>,
        feedforward: &Bound<'_, PyAny>,
        timing: LoopTiming<'_>,
        substeps: usize,
    ) -> PyResult<PyTrackingRun> {
        let before = timing.voltages_before()?;
        let input = Arrays::new(reference, feedforward)?;
        let timing = timing.sampled(controller.dt, input.input().reference.len(), substeps);
        enter(py, |stop| input.run(&self.0, &before, controller, &timing, stop))
    }
}

/// A virtual stage that goes on from command to command.
#[pyclass(name = "VirtualRun", module = "piezotrack._core")]
struct PyVirtualRun(VirtualRun);

#[pymethods]
impl PyVirtualRun {
    #[new]
    fn new(stage: &PyVirtualStage) -> Self {
        Self(VirtualRun::new(stage.0))
    }

    /// Moves on through as many intervals as commands: true displacement, reading of the sensor
    /// and applied voltage at the end of each, where its command goes out.
    fn advance<'py>(
        &mut self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        dt: f64,
    ) -> PyResult<OpenLoopArrays<'py>> {
        let u = samples("u", u)?;
        let run = enter(py, |stop| stopped(self.0.advance(&u, dt, stop)?))?;
        open_loop_arrays(py, &run)
    }
}
