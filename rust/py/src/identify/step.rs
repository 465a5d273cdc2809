//! Step responses, and turning points of a signal.

use numpy::PyArray1;
use piezotrack_core::identify::{self, Conventional, StepReadings, StepResponse};
use piezotrack_core::signal;
use pyo3::prelude::*;

use crate::conversions::arrays::{array, samples};
use crate::errors::raise;
use crate::stages::stage::hold;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyConventional>()?;
    module.add_class::<PyStepResponse>()?;
    module.add_function(wrap_pyfunction!(read_step, module)?)?;
    module.add_function(wrap_pyfunction!(turns, module)?)?;
    module.add_function(wrap_pyfunction!(turns_often, module)?)
}

/// Results of the paper's formulas for readings.
#[pyclass(name = "Conventional", frozen, module = "piezotrack._core")]
struct PyConventional(Conventional);

#[pymethods]
impl PyConventional {
    #[new]
    #[pyo3(signature = (*, voltage, steady_state, peaks, period, frequency, static_gain, resonance_gain, initial_slope))]
    #[expect(clippy::too_many_arguments, reason = "named, in Python")]
    fn new(
        voltage: f64,
        steady_state: f64,
        peaks: Vec<f64>,
        period: f64,
        frequency: f64,
        static_gain: f64,
        resonance_gain: f64,
        initial_slope: f64,
    ) -> PyResult<Self> {
        let readings = StepReadings {
            voltage,
            steady_state,
            peaks,
            period,
            frequency,
            static_gain,
            resonance_gain,
            initial_slope,
        };
        readings.conventional().map(Self).map_err(|error| raise(&error))
    }

    /// Overshoot ratio, decrement, both damping ratios, natural frequency, time constant.
    fn mode(&self) -> (f64, f64, f64, f64, f64, f64) {
        let found = &self.0;
        (
            found.overshoot_ratio,
            found.decrement,
            found.damping_ratio,
            found.damping_by_decrement,
            found.natural_frequency,
            found.time_constant,
        )
    }

    /// a1, a2, b1, b0.
    fn hysteresis(&self) -> (f64, f64, f64, f64) {
        (self.0.a1, self.0.a2, self.0.b1, self.0.b0)
    }

    /// Stiffness and piezo coefficient from two levels, each V and m.
    fn separate(&self, one: (f64, f64), two: (f64, f64)) -> PyResult<(f64, f64)> {
        identify::separate(&self.0, one, two).map_err(|error| raise(&error))
    }

    /// Piezo coefficient with which a stiffness stands at a level, V and m.
    fn piezo_coefficient(&self, stiffness: f64, level: (f64, f64)) -> PyResult<f64> {
        self.0.piezo_coefficient(stiffness, level).map_err(|error| raise(&error))
    }
}

/// A step response as read off a record.
#[pyclass(name = "StepResponse", frozen, module = "piezotrack._core")]
struct PyStepResponse(StepResponse);

#[pymethods]
impl PyStepResponse {
    /// Voltage, steady state, period, frequency, static and resonance gain, initial slope.
    fn readings(&self) -> (f64, f64, f64, f64, f64, f64, f64) {
        let read = &self.0.readings;
        (
            read.voltage,
            read.steady_state,
            read.period,
            read.frequency,
            read.static_gain,
            read.resonance_gain,
            read.initial_slope,
        )
    }

    #[getter]
    fn peaks(&self) -> Vec<f64> {
        self.0.readings.peaks.clone()
    }

    #[getter]
    fn peak_times(&self) -> Vec<f64> {
        self.0.peak_times.clone()
    }

    /// Last sample before the step, number of samples before it, first sample not read.
    #[getter]
    fn samples(&self) -> (usize, usize, usize) {
        (self.0.before, self.0.samples_before, self.0.end)
    }

    /// Whether the drive moves again behind what was read.
    #[getter]
    fn cut(&self) -> bool {
        self.0.cut
    }

    /// Displacement before the step, noise, time constants shown, creep.
    #[getter]
    fn quality(&self) -> (f64, f64, f64, f64) {
        (self.0.rest, self.0.noise, self.0.decays, self.0.creep)
    }

    /// Frequencies and gains.
    fn spectrum<'py>(&self, py: Python<'py>) -> PyResult<[Bound<'py, PyArray1<f64>>; 2]> {
        let (frequency, gain) = &self.0.spectrum;
        Ok([array(py, frequency.iter().copied())?, array(py, gain.iter().copied())?])
    }
}

/// Reads a step response off a record.
#[pyfunction]
fn read_step(
    u: &Bound<'_, PyAny>,
    y: &Bound<'_, PyAny>,
    dt: f64,
    hold_name: &str,
) -> PyResult<PyStepResponse> {
    let (u, y) = (samples("u", u)?, samples("y", y)?);
    hold(hold_name)
        .and_then(|hold| identify::read_step(&u, &y, dt, hold))
        .map(PyStepResponse)
        .map_err(|error| raise(&error))
}

/// Samples at which a signal turns by more than `least`.
#[pyfunction]
fn turns(signal: &Bound<'_, PyAny>, least: f64) -> PyResult<Vec<usize>> {
    Ok(signal::turns(&samples("signal", signal)?, least))
}

/// Whether a drive turns so often that a loop which is not closed does not look like a drift.
#[pyfunction]
fn turns_often(u: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(identify::turns_often(&samples("u", u)?))
}
