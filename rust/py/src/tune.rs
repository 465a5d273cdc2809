//! The search for the settings of a controller.

use piezotrack_core::signal::contour_error::Polyline;
use piezotrack_core::simulate::{ReferenceSamples, Timing, VirtualStage};
use piezotrack_core::tune::{
    Aim, ErrorSignal, Found, Judge, Nominal, Outline, PathTask, PlantSet, Requirements, Robustness,
    RunMetrics, Setting, Settings, Sought, SoughtController, Structure, Task, Template, Tuning,
    Worst,
};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::control::controller::PyController;
use crate::control::design::PyLoopPlant;
use crate::control::tracking::LoopTiming;
use crate::conversions::arrays::samples;
use crate::enter::enter_quiet_pool;
use crate::errors::raise;
use crate::stages::virtual_stage::PyVirtualStage;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyTask>()?;
    module.add_class::<PyPathTask>()?;
    module.add_class::<PySoughtController>()?;
    module.add_function(wrap_pyfunction!(check_margins, module)?)?;
    module.add_function(wrap_pyfunction!(tune, module)?)?;
    module.add_function(wrap_pyfunction!(tuning_costs, module)?)
}

/// Checks margins that a loop is to keep.
#[pyfunction]
fn check_margins(gain: f64, phase: f64, sensitivity: f64, learning: f64) -> PyResult<()> {
    piezotrack_core::tune::check_margins(gain, phase, sensitivity, learning)
        .map_err(|error| raise(&error))
}

/// A motion that controllers are judged by.
#[derive(Clone)]
#[pyclass(name = "Task", frozen, module = "piezotrack._core")]
pub struct PyTask {
    stage: VirtualStage,
    voltages_before: Vec<f64>,
    timing: Timing,
    reference: Vec<f64>,
    feedforward: Vec<f64>,
    beside: Vec<f64>,
    from: usize,
    error: ErrorSignal,
}

#[pymethods]
impl PyTask {
    #[new]
    #[pyo3(signature = (*, stage, timing, dt, reference, feedforward, beside, first, measured))]
    #[expect(clippy::too_many_arguments, reason = "all named in Python")]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn new(
        stage: &PyVirtualStage,
        timing: LoopTiming<'_>,
        dt: f64,
        reference: &Bound<'_, PyAny>,
        feedforward: &Bound<'_, PyAny>,
        beside: &Bound<'_, PyAny>,
        first: usize,
        measured: bool,
    ) -> PyResult<Self> {
        let reference = samples("reference", reference)?;
        Ok(Self {
            stage: stage.0,
            voltages_before: timing.voltages_before()?,
            timing: timing.sampled(dt, reference.len(), 1),
            reference,
            feedforward: samples("feedforward", feedforward)?,
            beside: samples("beside", beside)?,
            from: first,
            error: if measured { ErrorSignal::Measured } else { ErrorSignal::True },
        })
    }

    /// Rms and largest error, effort, slew and clipped share of each controller's loop.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from a list")]
    fn figures(
        &self,
        py: Python<'_>,
        controllers: Vec<PyRef<'_, PyController>>,
        threads: usize,
    ) -> PyResult<Vec<FigureNumbers>> {
        let controllers: Vec<_> = controllers.iter().map(|one| one.controller).collect();
        let found =
            enter_quiet_pool(py, threads, |stop| self.task().ready()?.figures(&controllers, stop))?;
        Ok(found.iter().map(numbers).collect())
    }
}

impl PyTask {
    fn task(&self) -> Task<'_> {
        let samples =
            ReferenceSamples { reference: &self.reference, feedforward: &self.feedforward };
        Task {
            stage: &self.stage,
            voltages_before: &self.voltages_before,
            timing: self.timing,
            samples,
            beside: &self.beside,
            shown_at: 0.0,
            from: self.from,
            error: self.error,
        }
    }
}

/// A path that controllers are judged by, on both axes of an XY stage.
#[pyclass(name = "PathTask", frozen, module = "piezotrack._core")]
pub struct PyPathTask {
    axes: [PyTask; 2],
    lag: f64,
    outline: Outline,
}

#[pymethods]
impl PyPathTask {
    /// `circle` has centre and radius, m; without it `path` has points along x and y.
    #[new]
    #[pyo3(signature = (x, y, *, lag, circle, path))]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn new(
        x: PyRef<'_, PyTask>,
        y: PyRef<'_, PyTask>,
        lag: f64,
        circle: Option<(f64, f64, f64)>,
        path: (Bound<'_, PyAny>, Bound<'_, PyAny>),
    ) -> PyResult<Self> {
        let outline = if let Some((at_x, at_y, radius)) = circle {
            Outline::Circle([at_x, at_y], radius)
        } else {
            let (along_x, along_y) = (samples("path_x", &path.0)?, samples("path_y", &path.1)?);
            Outline::Points(Polyline::new(&along_x, &along_y).map_err(|error| raise(&error))?)
        };
        Ok(Self { axes: [x.clone(), y.clone()], lag, outline })
    }

    /// As of `Task`, of the contour error, for pairs of controllers.
    #[expect(clippy::needless_pass_by_value, reason = "extracted from a list")]
    fn figures(
        &self,
        py: Python<'_>,
        controllers: Vec<(PyRef<'_, PyController>, PyRef<'_, PyController>)>,
        threads: usize,
    ) -> PyResult<Vec<FigureNumbers>> {
        let (x, y): (Vec<_>, Vec<_>) =
            controllers.iter().map(|(x, y)| (x.controller, y.controller)).unzip();
        let found =
            enter_quiet_pool(py, threads, |stop| self.task()?.ready()?.figures([&x, &y], stop))?;
        Ok(found.iter().map(numbers).collect())
    }
}

impl PyPathTask {
    fn task(&self) -> Result<PathTask<'_>> {
        let [x, y] = &self.axes;
        PathTask::new(x.task(), y.task(), self.lag, self.outline.clone())
    }
}

/// Either of them.
#[derive(FromPyObject)]
enum AnyTask<'py> {
    Axis(PyRef<'py, PyTask>),
    Path(PyRef<'py, PyPathTask>),
}

impl AnyTask<'_> {
    fn judge(&self) -> Result<Judge<'_>> {
        Ok(match self {
            Self::Axis(task) => Judge::Axis(task.task()),
            Self::Path(task) => Judge::Path(Box::new(task.task()?)),
        })
    }
}

/// Rms error, largest error, effort, slew, clipped share.
type FigureNumbers = (f64, f64, f64, f64, f64);

fn numbers(of: &RunMetrics) -> FigureNumbers {
    (of.rms, of.largest, of.effort, of.slew, of.clipped)
}

/// A value and the plant that has it.
type WorstNumbers = (f64, usize);

/// Roots outside, gain margin, phase margin, sensitivity, learning gain.
type RobustnessNumbers = (WorstNumbers, WorstNumbers, WorstNumbers, WorstNumbers, WorstNumbers);

fn robustness(of: &Robustness) -> RobustnessNumbers {
    let pair = |worst: Worst| (worst.value, worst.plant);
    (
        pair(of.unstable),
        pair(of.gain_margin),
        pair(of.phase_margin),
        pair(of.sensitivity),
        pair(of.learning),
    )
}

/// Settings found by a search, as a dict in Python.
#[derive(IntoPyObject)]
struct FoundSettings {
    settings: Vec<Vec<(&'static str, f64)>>,
    robustness: RobustnessNumbers,
    figures: Vec<FigureNumbers>,
    excess: f64,
    cost: f64,
    candidates: usize,
    loops: usize,
    history: Vec<f64>,
    searches: usize,
    agreeing: usize,
    spread: Vec<f64>,
}

impl FoundSettings {
    fn of(found: &Found) -> Self {
        let named =
            |axis: &Settings| axis.iter().map(|(one, value)| (one.name(), *value)).collect();
        Self {
            settings: found.settings.iter().map(named).collect(),
            robustness: robustness(&found.robustness),
            figures: found.figures.iter().map(numbers).collect(),
            excess: found.excess,
            cost: found.cost,
            candidates: found.candidates,
            loops: found.loops,
            history: found.history.clone(),
            searches: found.searches,
            agreeing: found.agreeing,
            spread: found.spread.clone(),
        }
    }
}

/// A feedback law from its name, and the nominal plant of an observer.
fn structure((name, gain, time): &(String, f64, f64)) -> Result<Structure> {
    let nominal = Nominal { gain: *gain, time: *time };
    Ok(match name.as_str() {
        "pid" | "pi" | "pd" => Structure::Pid,
        "lead-lag" => Structure::LeadLag,
        "sliding-mode" => Structure::SlidingMode,
        "integral-resonant" => Structure::IntegralResonant,
        "positive-position" => Structure::PositivePosition,
        "positive-velocity-position" => Structure::PositiveVelocityPosition,
        "disturbance-observer" => Structure::DisturbanceObserver(nominal),
        "perturbation-estimator" => Structure::PerturbationEstimator(nominal),
        other => {
            let expected = "the name of a feedback law";
            return Err(Error::parameter("law", format!("'{other}'"), expected));
        }
    })
}

/// Gain margin, phase margin (rad), sensitivity, learning gain.
type MarginNumbers = (f64, f64, f64, f64);

/// Objective and bounds, from the attributes of Python's `Goal`.
#[derive(FromPyObject)]
struct Goal {
    minimise: String,
    effort: f64,
    slew: f64,
    largest_error: f64,
    largest_saturation: f64,
    tolerances: Vec<f64>,
}

/// Budget and seed, from the attributes of Python's `TuningSearch`.
#[derive(FromPyObject)]
struct Search {
    particles: usize,
    iterations: usize,
    seed: u64,
}

/// Problem of a search, from the attributes of Python's `TuningProblem`.
#[derive(FromPyObject)]
struct Problem {
    goal: Goal,
    search: Search,
    threads: usize,
}

impl Problem {
    /// The search of it.
    fn tuning<'a>(
        &self,
        margins: MarginNumbers,
        axes: &[PyRef<'_, PySoughtController>],
        tasks: Vec<Judge<'a>>,
        stages: usize,
    ) -> Tuning<'a> {
        let Self { goal, search, .. } = self;
        Tuning {
            axes: axes.iter().map(|axis| axis.0.clone()).collect(),
            required: goal.required(margins),
            aim: goal.aim(tasks.len()),
            tasks,
            stages,
            tolerances: goal.tolerances.clone(),
            effort: goal.effort,
            particles: search.particles,
            iterations: search.iterations,
            seed: search.seed,
            starts: Vec::new(),
        }
    }
}

impl Goal {
    /// Figure to minimise; without motions the effect of a disturbance.
    fn aim(&self, motions: usize) -> Aim {
        match self.minimise.as_str() {
            _ if motions == 0 => Aim::Disturbance,
            "largest" => Aim::Largest,
            "effort" => Aim::Effort,
            _ => Aim::Rms,
        }
    }

    /// Requirements on every loop: margins, and the bounds of the goal.
    fn required(&self, margins: MarginNumbers) -> Requirements {
        let (gain_margin, phase_margin, sensitivity, learning) = margins;
        Requirements {
            gain_margin,
            phase_margin,
            sensitivity,
            learning,
            slew: self.slew,
            largest_saturation: self.largest_saturation,
            largest_error: self.largest_error,
        }
    }
}

/// A controller of which settings are sought.
#[pyclass(name = "SoughtController", frozen, module = "piezotrack._core")]
pub struct PySoughtController(SoughtController);

#[pymethods]
impl PySoughtController {
    #[new]
    #[pyo3(signature = (*, controller, period, sign, law, sought, plants))]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from lists")]
    fn new(
        controller: &PyController,
        period: Option<f64>,
        sign: f64,
        law: (String, f64, f64),
        sought: Vec<(String, f64, f64, bool)>,
        plants: Vec<PyRef<'_, PyLoopPlant>>,
    ) -> PyResult<Self> {
        let dt = controller.dt;
        let build = || -> Result<SoughtController> {
            let sought: Result<Vec<Sought>> = sought
                .iter()
                .map(|(name, low, high, logarithmic)| {
                    let setting = Setting::named(name)?;
                    Ok(Sought { setting, low: *low, high: *high, logarithmic: *logarithmic })
                })
                .collect();
            let plants: Vec<_> = plants.iter().map(|plant| plant.plant().clone()).collect();
            let structure = structure(&law)?;
            let template = Template { base: controller.controller, dt, period, structure, sign };
            let plants = PlantSet::new(&plants, dt)?;
            Ok(SoughtController { sought: sought?, template, plants })
        };
        build().map(Self).map_err(|error| raise(&error))
    }
}

/// Searches the settings of a controller, or of those of both axes, with margins that may have some
/// in reserve.
#[pyfunction]
#[pyo3(signature = (problem, *, margins, axes, tasks, stages, starts))]
#[expect(clippy::needless_pass_by_value, reason = "extracted from lists")]
fn tune(
    py: Python<'_>,
    problem: Problem,
    margins: MarginNumbers,
    axes: Vec<PyRef<'_, PySoughtController>>,
    tasks: Vec<AnyTask<'_>>,
    stages: usize,
    starts: Vec<Vec<f64>>,
) -> PyResult<FoundSettings> {
    let judges: Result<Vec<Judge<'_>>> = tasks.iter().map(AnyTask::judge).collect();
    let judges = judges.map_err(|error| raise(&error))?;
    let tuning = Tuning { starts, ..problem.tuning(margins, &axes, judges, stages) };
    let found = enter_quiet_pool(py, problem.threads, |stop| tuning.search(stop))?;
    Ok(FoundSettings::of(&found))
}

/// Excess and cost of places of the unit box, as the search ranks them; for benches.
#[pyfunction]
#[pyo3(signature = (problem, *, margins, axes, tasks, stages, places))]
#[expect(clippy::needless_pass_by_value, reason = "extracted from lists")]
fn tuning_costs(
    py: Python<'_>,
    problem: Problem,
    margins: MarginNumbers,
    axes: Vec<PyRef<'_, PySoughtController>>,
    tasks: Vec<AnyTask<'_>>,
    stages: usize,
    places: Vec<Vec<f64>>,
) -> PyResult<Vec<(f64, f64)>> {
    let judges: Result<Vec<Judge<'_>>> = tasks.iter().map(AnyTask::judge).collect();
    let judges = judges.map_err(|error| raise(&error))?;
    let tuning = problem.tuning(margins, &axes, judges, stages);
    enter_quiet_pool(py, problem.threads, |stop| tuning.costs(&places, stop))
}
