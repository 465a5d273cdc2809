//! Two axes: an XY stage, contour errors, cross-talk; and a sensor's noise at rest.

use numpy::{PyArray1, ToPyArray};
use piezotrack_core::identify::{cross_talk, noise_at_rest};
use piezotrack_core::models::{DahlStage, Plant, StageState};
use piezotrack_core::signal::contour_error::{Polyline, radial_errors};
use piezotrack_core::signal::metrics::Spread;
use piezotrack_core::signal::{Drive, NEVER, Stop};
use piezotrack_core::simulate::{
    Apparatus, ApparatusState, TwoAxes, TwoStates, VirtualStage, VirtualState, open_loops,
    track_both,
};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::arrays::samples;
use crate::control::PyController;
use crate::enter::enter;
use crate::errors::raise;
use crate::stage::{Theta, hold};
use crate::tracking::{Arrays, Pace, PyTracked, stopped, timing};
use crate::virtual_stage::{OpenLoopArrays, PyVirtualStage};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyXyStage>()?;
    module.add_function(wrap_pyfunction!(circle_errors, module)?)?;
    module.add_function(wrap_pyfunction!(path_errors, module)?)?;
    module.add_function(wrap_pyfunction!(spread, module)?)?;
    module.add_function(wrap_pyfunction!(cross_talk_share, module)?)?;
    module.add_function(wrap_pyfunction!(sensor_noise, module)?)
}

/// An axis as Python gives it: a virtual stage, or a model's parameters and its longest step, s.
#[derive(FromPyObject)]
enum Given<'py> {
    Virtual(PyRef<'py, PyVirtualStage>),
    Dahl(Theta, f64),
}

/// One axis.
#[derive(Clone, Copy)]
#[expect(clippy::large_enum_variant, reason = "two in a stage")]
enum Axis {
    Virtual(VirtualStage),
    Dahl(DahlStage, f64),
}

impl Given<'_> {
    fn axis(&self) -> Result<Axis> {
        Ok(match self {
            Self::Virtual(stage) => Axis::Virtual(stage.0),
            Self::Dahl(theta, step) => Axis::Dahl(DahlStage::from_theta(theta)?, *step),
        })
    }
}

/// What is done with two axes, whatever they are.
trait Job {
    type Done;

    fn run<X: Plant, Y: Plant>(
        &self,
        axes: &TwoAxes<'_, X, Y>,
        start: TwoStates<X::State, Y::State>,
        stop: Stop<'_>,
    ) -> Result<Self::Done>;
}

/// A virtual stage as it begins.
fn virtual_axis(
    stage: &VirtualStage,
) -> (Apparatus<'_, VirtualStage>, ApparatusState<VirtualState>) {
    (stage.apparatus(), stage.start())
}

/// A model as it begins.
fn dahl_axis(
    stage: &DahlStage,
    step: f64,
) -> (Apparatus<'_, DahlStage>, ApparatusState<StageState>) {
    let apparatus = Apparatus::bare(stage, step);
    (apparatus, apparatus.rest())
}

/// Two axes on one platform.
#[pyclass(name = "XYStage", frozen, module = "piezotrack._core")]
struct PyXyStage {
    x: Axis,
    y: Axis,
    cross_talk: [f64; 2],
    lag: f64,
}

impl PyXyStage {
    /// Does a job with axes of either kind.
    fn with<J: Job>(&self, job: &J, stop: Stop<'_>) -> Result<J::Done> {
        match (&self.x, &self.y) {
            (Axis::Virtual(x), Axis::Virtual(y)) => {
                self.go(job, virtual_axis(x), virtual_axis(y), stop)
            }
            (Axis::Virtual(x), Axis::Dahl(y, step)) => {
                self.go(job, virtual_axis(x), dahl_axis(y, *step), stop)
            }
            (Axis::Dahl(x, step), Axis::Virtual(y)) => {
                self.go(job, dahl_axis(x, *step), virtual_axis(y), stop)
            }
            (Axis::Dahl(x, step), Axis::Dahl(y, other)) => {
                self.go(job, dahl_axis(x, *step), dahl_axis(y, *other), stop)
            }
        }
    }

    fn go<J: Job, X: Plant, Y: Plant>(
        &self,
        job: &J,
        (x, start_x): (Apparatus<'_, X>, ApparatusState<X::State>),
        (y, start_y): (Apparatus<'_, Y>, ApparatusState<Y::State>),
        stop: Stop<'_>,
    ) -> Result<J::Done> {
        let axes = TwoAxes { x, y, cross_talk: self.cross_talk, lag: self.lag };
        job.run(&axes, (start_x, start_y), stop)
    }
}

/// Two controllers on their courses.
struct Following<'a> {
    controllers: [&'a PyController; 2],
    courses: [Arrays; 2],
    pace: Pace,
}

impl Job for Following<'_> {
    type Done = (PyTracked, PyTracked);

    fn run<X: Plant, Y: Plant>(
        &self,
        axes: &TwoAxes<'_, X, Y>,
        start: TwoStates<X::State, Y::State>,
        stop: Stop<'_>,
    ) -> Result<Self::Done> {
        let Self { controllers: [x, y], courses, pace } = self;
        let timing = timing(x, 0, *pace);
        let courses = [courses[0].course(), courses[1].course()];
        let controllers = (&x.controller, &y.controller);
        let (x, y) = stopped(track_both(axes, start, &timing, controllers, courses, stop)?)?;
        Ok((PyTracked::new(x), PyTracked::new(y)))
    }
}

/// Two drives.
struct Driven<'a>([Drive<'a>; 2]);

/// Displacement, reading and applied voltage.
type Motion = [Vec<f64>; 3];

impl Job for Driven<'_> {
    type Done = [Motion; 2];

    fn run<X: Plant, Y: Plant>(
        &self,
        axes: &TwoAxes<'_, X, Y>,
        start: TwoStates<X::State, Y::State>,
        stop: Stop<'_>,
    ) -> Result<Self::Done> {
        let (x, y) = stopped(open_loops(axes, start, [&self.0[0], &self.0[1]], stop)?)?;
        Ok([[x.displacement, x.measured, x.applied], [y.displacement, y.measured, y.applied]])
    }
}

#[pymethods]
impl PyXyStage {
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn new(x: Given<'_>, y: Given<'_>, cross_talk: [f64; 2], lag: f64) -> PyResult<Self> {
        struct Check;
        impl Job for Check {
            type Done = ();

            fn run<X: Plant, Y: Plant>(
                &self,
                axes: &TwoAxes<'_, X, Y>,
                _: TwoStates<X::State, Y::State>,
                _: Stop<'_>,
            ) -> Result<()> {
                axes.validate()
            }
        }
        let build = || -> Result<Self> {
            let stage = Self { x: x.axis()?, y: y.axis()?, cross_talk, lag };
            stage.with(&Check, NEVER)?;
            Ok(stage)
        };
        build().map_err(|error| raise(&error))
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
        let run = enter(py, |stop| {
            let hold = hold(hold_name)?;
            let drives = [Drive::new(&ux, dt, hold)?, Drive::new(&uy, dt, hold)?];
            self.with(&Driven(drives), stop)
        })?;
        Ok(run.map(|[x, y, u]| (x.to_pyarray(py), y.to_pyarray(py), u.to_pyarray(py))))
    }

    /// Lets two controllers of one interval lead the axes along their courses.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from tuples")]
    fn track(
        &self,
        py: Python<'_>,
        controllers: [PyRef<'_, PyController>; 2],
        references: [Bound<'_, PyAny>; 2],
        feedforwards: [Bound<'_, PyAny>; 2],
        pace: Pace,
    ) -> PyResult<(PyTracked, PyTracked)> {
        let courses = [
            Arrays::new(&references[0], &feedforwards[0])?,
            Arrays::new(&references[1], &feedforwards[1])?,
        ];
        let controllers = [&*controllers[0], &*controllers[1]];
        let job = Following { controllers, courses, pace };
        enter(py, |stop| self.with(&job, stop))
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
    Ok(errors.to_pyarray(py))
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
    Ok(errors.to_pyarray(py))
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
