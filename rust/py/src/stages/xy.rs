//! Two axes: an XY stage, contour errors, cross-talk; and a sensor's noise at rest.

use numpy::PyArray1;
use piezotrack_core::Error;
use piezotrack_core::identify::{cross_talk, noise_at_rest};
use piezotrack_core::models::{Stage, StageState};
use piezotrack_core::signal::Drive;
use piezotrack_core::signal::contour_error::{Polyline, radial_errors};
use piezotrack_core::signal::metrics::Spread;
use piezotrack_core::simulate::{
    MissedTicks, TwoAxes, TwoStates, VirtualStage, open_loops, track_both,
};
use pyo3::prelude::*;

use crate::control::controller::PyController;
use crate::control::tracking::{Arrays, LoopTiming, PyTrackingRun, stopped};
use crate::conversions::arrays::{array, samples};
use crate::enter::enter;
use crate::errors::raise;
use crate::stages::stage::hold;
use crate::stages::virtual_stage::{OpenLoopArrays, PyVirtualStage, open_loop_arrays};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyXyStage>()?;
    module.add_function(wrap_pyfunction!(circle_errors, module)?)?;
    module.add_function(wrap_pyfunction!(path_errors, module)?)?;
    module.add_function(wrap_pyfunction!(spread, module)?)?;
    module.add_function(wrap_pyfunction!(cross_talk_share, module)?)?;
    module.add_function(wrap_pyfunction!(sensor_noise, module)?)
}

/// No visits to voltages before an experiment.
const NOWHERE: [&[f64]; 2] = [&[], &[]];

/// Two axes on one platform.
#[pyclass(name = "XYStage", frozen, module = "piezotrack._core")]
struct PyXyStage {
    axes: [VirtualStage; 2],
    cross_talk: [f64; 2],
    lag: f64,
    missed: MissedTicks,
}

impl PyXyStage {
    /// The axes between their amplifiers and sensors.
    fn apparatus(&self) -> TwoAxes<'_, Stage, Stage> {
        let Self { axes: [x, y], cross_talk, lag, missed } = self;
        let (x, y) = (x.apparatus(), y.apparatus());
        TwoAxes { x, y, cross_talk: *cross_talk, lag: *lag, missed: *missed }
    }

    /// The axes, and where an experiment starts, after visits to voltages if there are any.
    fn both(
        &self,
        voltages_before: [&[f64]; 2],
    ) -> (TwoAxes<'_, Stage, Stage>, TwoStates<StageState, StageState>) {
        let [x, y] = &self.axes;
        let [before_x, before_y] = voltages_before;
        (self.apparatus(), (x.start_after(before_x), y.start_after(before_y)))
    }
}

#[pymethods]
impl PyXyStage {
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn new(
        x: PyRef<'_, PyVirtualStage>,
        y: PyRef<'_, PyVirtualStage>,
        cross_talk: [f64; 2],
        lag: f64,
        missed: (f64, usize),
    ) -> PyResult<Self> {
        let missed = MissedTicks { chance: missed.0, most: missed.1 };
        let stage = Self { axes: [x.0, y.0], cross_talk, lag, missed };
        stage.apparatus().validate().map_err(|error| raise(&error))?;
        Ok(stage)
    }

    /// Displacement, reading and applied voltage of each axis.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        ux: &Bound<'py, PyAny>,
        uy: &Bound<'py, PyAny>,
        dt: f64,
        hold_name: &str,
    ) -> PyResult<[OpenLoopArrays<'py>; 2]> {
        let (ux, uy) = (samples("ux", ux)?, samples("uy", uy)?);
        let (x, y) = enter(py, |stop| {
            let hold = hold(hold_name)?;
            let drives = [&Drive::new(&ux, dt, hold)?, &Drive::new(&uy, dt, hold)?];
            let (axes, start) = self.both(NOWHERE);
            stopped(open_loops(&axes, start, drives, stop)?)
        })?;
        Ok([open_loop_arrays(py, &x)?, open_loop_arrays(py, &y)?])
    }

    /// Simulates the closed loops of two controllers of one interval along their references, whose
    /// timings differ in the voltages before only.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from tuples")]
    fn track(
        &self,
        py: Python<'_>,
        controllers: [PyRef<'_, PyController>; 2],
        references: [Bound<'_, PyAny>; 2],
        feedforwards: [Bound<'_, PyAny>; 2],
        timings: [LoopTiming<'_>; 2],
        substeps: usize,
    ) -> PyResult<(PyTrackingRun, PyTrackingRun)> {
        let inputs = [
            Arrays::new(&references[0], &feedforwards[0])?,
            Arrays::new(&references[1], &feedforwards[1])?,
        ];
        let before = [timings[0].voltages_before()?, timings[1].voltages_before()?];
        let [x, y] = [&*controllers[0], &*controllers[1]];
        let timing = timings[0].sampled(x.dt, 0, substeps);
        enter(py, |stop| {
            let (axes, start) = self.both([&before[0], &before[1]]);
            let inputs = [inputs[0].input(), inputs[1].input()];
            let controllers = (&x.controller, &y.controller);
            let (x, y) = stopped(track_both(&axes, start, &timing, controllers, inputs, stop)?)?;
            Ok((PyTrackingRun::new(x)?, PyTrackingRun::new(y)?))
        })
    }
}

/// Radius less distance from the centre.
#[pyfunction]
fn circle_errors<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    y: &Bound<'py, PyAny>,
    centre: [f64; 2],
    radius: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (x, y) = (samples("x", x)?, samples("y", y)?);
    let errors = radial_errors(&x, &y, centre, radius).map_err(|error| raise(&error))?;
    array(py, errors.iter().copied())
}

/// Signed distance of points from a path.
#[pyfunction]
fn path_errors<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    y: &Bound<'py, PyAny>,
    path_x: &Bound<'py, PyAny>,
    path_y: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (x, y) = (samples("x", x)?, samples("y", y)?);
    let (path_x, path_y) = (samples("path_x", path_x)?, samples("path_y", path_y)?);
    let errors = enter(py, |_| Polyline::new(&path_x, &path_y)?.signed_distances(&x, &y))?;
    array(py, errors.iter().copied())
}

/// Largest, RMS, mean, standard deviation, peak to peak.
type Figures = (f64, f64, f64, f64, f64);

fn figures(of: &Spread) -> Figures {
    (of.largest, of.rms, of.mean, of.sd, of.peak_to_peak)
}

/// Figures of a signed error.
#[pyfunction]
fn spread(errors: &Bound<'_, PyAny>) -> PyResult<Figures> {
    let errors = samples("errors", errors)?;
    if errors.is_empty() {
        return Err(raise(&Error::Data("errors has no samples: expected at least 1".into())));
    }
    Ok(figures(&Spread::of(errors.iter().copied())))
}

/// Share, its standard deviation, residual.
#[pyfunction]
fn cross_talk_share(
    driven: &Bound<'_, PyAny>,
    other: &Bound<'_, PyAny>,
) -> PyResult<(f64, f64, f64)> {
    let found = cross_talk(&samples("driven", driven)?, &samples("other", other)?);
    found.map(|found| (found.share, found.sd, found.residual)).map_err(|error| raise(&error))
}

/// Figures about the drift, the drift, resolution, levels, noise, bandwidth and its deviation.
type NoiseParts = (Figures, f64, f64, usize, f64, f64, Option<f64>);

/// A sensor's noise from a record at rest.
#[pyfunction]
fn sensor_noise(record: &Bound<'_, PyAny>, dt: f64) -> PyResult<NoiseParts> {
    let found = noise_at_rest(&samples("record", record)?, dt).map_err(|error| raise(&error))?;
    Ok((
        figures(&found.spread),
        found.drift,
        found.resolution,
        found.levels,
        found.noise,
        found.bandwidth,
        found.bandwidth_sd,
    ))
}
