//! Traits that the file of a model implements, and the description of a model.

use core::fmt;

use piezotrack_control::Snapshot;
use piezotrack_control::inverse::Inverse;

use super::parameters::search_ranges::{Measures, Ranges};
use super::parameters::values::{Held, ParameterInfo, Values};
use super::plant::{KernelModel, Plant};
use crate::design::LoopPlant;
use crate::error::{Error, Result, shown};
use crate::integrator::{Instant, Kernel, Motion, Order};
use crate::signal::{Drive, Stop};

/// Published parameters: their name, and what makes them.
pub type Published = (&'static str, fn() -> Values);

/// Name and parts of a model.
#[derive(Clone, Copy)]
pub struct ModelInfo {
    /// The name that both languages use.
    pub name: &'static str,
    /// Title in tables and pictures.
    pub title: &'static str,
    /// Unit of the drive: V, or N of a model under a force.
    pub drive_unit: &'static str,
    /// Its parameters; of a model that a swarm searches, mass, damping and stiffness first.
    pub parameters: &'static [ParameterInfo],
    /// Its state: displacement and velocity, and the state of the hysteresis.
    pub state: &'static [ParameterInfo],
    /// Published parameters by a name.
    pub published: &'static [Published],
}

impl fmt::Debug for ModelInfo {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name)
    }
}

/// How a stage is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Linear part exact, hysteresis exact along its input, coupled to fourth order.
    Exponential,
    /// Classical Runge-Kutta of fourth order, in equal steps.
    Rk4,
    /// Dormand-Prince of order 5(4), adaptive.
    Rk45,
}

impl Method {
    /// Refuses methods that a model other than Dahl's does not have.
    ///
    /// # Errors
    /// Names `method`.
    pub fn exponential_only(self) -> Result<()> {
        let name = match self {
            Self::Exponential => return Ok(()),
            Self::Rk4 => "'rk4'",
            Self::Rk45 => "'rk45'",
        };
        Err(Error::parameter("method", name, "'exponential': only a Dahl stage has the others"))
    }
}

/// A simulation that is asked for.
#[derive(Clone, Copy)]
pub struct Experiment<'a> {
    /// Drive of the stage.
    pub drive: &'a Drive<'a>,
    /// State at the first sample; at rest where there is none.
    pub initial: Option<&'a Values>,
    /// How to integrate.
    pub method: Method,
    /// Largest error of the displacement, m.
    pub accuracy: f64,
    /// Asked whether to give up.
    pub stop: Stop<'a>,
}

impl<'a> Experiment<'a> {
    /// From rest, exponential, to 0.1 nm.
    #[must_use]
    pub fn of(drive: &'a Drive<'a>, stop: Stop<'a>) -> Self {
        Self { drive, initial: None, method: Method::Exponential, accuracy: 1e-10, stop }
    }
}

/// Motion of a stage at the samples of its drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Displacement, m.
    pub x: Vec<f64>,
    /// Velocity, m/s.
    pub v: Vec<f64>,
    /// Hysteresis force, N; of plays at the input what comes out of the hysteresis, m.
    pub hysteresis: Vec<f64>,
    /// State at the last sample.
    pub last: Values,
    /// Steps of the integrator in each sampling interval.
    pub substeps: usize,
    /// Largest difference in displacement from a coarser simulation, m; 0 where there was none.
    pub error_estimate: f64,
    /// Whether the solution is unique: false once a stage with b0 other than 0 could have started
    /// from rest in either direction.
    pub unique: bool,
}

impl Response {
    /// A motion, with the state at its end.
    pub(super) fn of<M>(motion: Motion<M>, last: Values, unique: bool) -> Self {
        let Motion { x, v, hysteresis, substeps, error_estimate, .. } = motion;
        Self { x, v, hysteresis, last, substeps, error_estimate, unique }
    }
}

/// A model of a stage: its parameters, its motion, and its gain in a loop.
pub trait StageModel: Plant + Copy {
    /// Name and parts.
    const INFO: ModelInfo;

    /// The stage with these parameters.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    fn build(values: &Values) -> Result<Self>;

    /// State in equilibrium after a slow visit to each voltage in turn, from rest.
    ///
    /// # Errors
    /// [`Error::Numerical`] where the stage has no equilibrium there.
    fn equilibrium(&self, voltages: &[f64]) -> Result<Values>;

    /// Motion under a drive; `None` where it was stopped.
    ///
    /// # Errors
    /// Names what cannot be used; [`Error::Numerical`] where the motion does not stay finite or
    /// the accuracy is out of reach.
    fn simulate(&self, experiment: &Experiment<'_>) -> Result<Option<Response>>;

    /// The stage for small motions between two voltages: at the least gain, at a middle one and
    /// at the largest.
    ///
    /// # Errors
    /// Names `limits` where they are no range; [`Error::Numerical`] where the hysteresis grows
    /// without bound between them.
    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]>;
}

/// A model with an inverse that runs at the sample rate.
pub trait Invertible: StageModel {
    /// The inverse, whose state can be kept as numbers.
    type Inverse: Inverse<State: Snapshot> + Clone;

    /// The inverse for samples every `dt` seconds, and its state for a stage in the state
    /// `initial`, or for one that never moved.
    ///
    /// # Errors
    /// Names the parameter, or `dt`, that is out of its range, or `initial` where the model's
    /// inverse begins at rest only.
    fn inverse(
        &self,
        dt: f64,
        initial: Option<&Values>,
    ) -> Result<(Self::Inverse, <Self::Inverse as Inverse>::State)>;
}

/// Refuses an initial state for the inverse of a model that begins at rest only.
pub(super) fn from_rest_only(initial: Option<&Values>) -> Result<()> {
    if initial.is_none() {
        return Ok(());
    }
    let expected = "none: the inverse of this model begins with a stage that never moved";
    Err(Error::parameter("initial", "a state", expected))
}

/// A model whose scalar parameters a swarm searches.
pub trait Searchable: StageModel {
    /// Whether the force has kinks at reversals: the middle of the box of parameters then stands
    /// for all in the choice of the step. At its corners the kinks are a nanometre wide, which
    /// would make every candidate a dozen times as expensive, and the hysteresis of an oscillator
    /// can grow without bound, which no number of steps resolves.
    const NONSMOOTH: bool = false;

    /// Ranges of the parameters that are not held.
    ///
    /// # Errors
    /// Names a held parameter with which no range exists.
    fn ranges(measures: &Measures, held: &Held) -> Result<Ranges>;

    /// Calls a visitor with the kernel of an order; `held` has what all candidates share.
    fn kernel<V: KernelVisitor>(held: &Held, order: Order, visitor: V) -> V::Output;

    /// Whether there is a kernel of second order too.
    #[must_use]
    fn has_second_order(_held: &Held) -> bool {
        false
    }
}

/// An operation on a kernel of any type.
pub trait KernelVisitor {
    /// Its result.
    type Output;

    /// Performs it.
    fn visit<K: Kernel>(self, kernel: K) -> Self::Output;
}

/// The first of some numbers; zeros where there are fewer.
pub(super) fn leading<const N: usize>(numbers: &[f64]) -> [f64; N] {
    core::array::from_fn(|i| numbers.get(i).copied().unwrap_or(0.0))
}

/// A state, unless it is not finite.
///
/// # Errors
/// [`Error::Numerical`] where it is not.
pub(super) fn finite_state(state: Values, voltages: &[f64]) -> Result<Values> {
    if state.iter().flat_map(|(_, numbers)| numbers).all(|number| number.is_finite()) {
        return Ok(state);
    }
    let volts = voltages.last().copied().unwrap_or(0.0);
    Err(Error::Numerical(format!("the stage has no equilibrium at a drive of {}", shown(volts))))
}

/// A model that one kernel describes, with its name and its inverse.
pub trait LumpedModel: KernelModel {
    /// Name and parts.
    const INFO: ModelInfo;

    /// The inverse, which begins with a stage that never moved.
    type Inverse: Inverse<State: Snapshot> + Clone;

    /// See [`StageModel::build`].
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    fn build(values: &Values) -> Result<Self>;

    /// See [`StageModel::loop_plants`].
    ///
    /// # Errors
    /// Those that it has there.
    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]>;

    /// The inverse for samples every `dt` seconds.
    ///
    /// # Errors
    /// Names the parameter, or `dt`, that is out of its range.
    fn inverse(&self, dt: f64) -> Result<Self::Inverse>;
}

impl<M: LumpedModel> StageModel for M {
    const INFO: ModelInfo = <M as LumpedModel>::INFO;

    fn build(values: &Values) -> Result<Self> {
        <M as LumpedModel>::build(values)
    }

    fn equilibrium(&self, voltages: &[f64]) -> Result<Values> {
        let Instant { x, v, memory } = self.lumped().equilibrium(voltages);
        let state = [vec![x, v], self.state(&memory)].concat();
        finite_state(Values::scalars(<M as LumpedModel>::INFO.state, &state), voltages)
    }

    fn simulate(&self, experiment: &Experiment<'_>) -> Result<Option<Response>> {
        let Experiment { drive, initial, method, accuracy, stop } = *experiment;
        method.exponential_only()?;
        let lumped = self.lumped();
        let mut start = lumped.rest();
        if let Some(initial) = initial {
            let state: Vec<f64> = initial.iter().filter_map(|(_, n)| n.first().copied()).collect();
            let [x, v] = leading(&state);
            start = Instant { x, v, memory: self.memory(&state) };
        }
        let motion = lumped.simulate(drive, start, accuracy, stop)?;
        Ok(motion.map(|motion| {
            let end = &motion.last;
            let state = [vec![end.x, end.v], self.state(&end.memory)].concat();
            Response::of(motion, Values::scalars(<M as LumpedModel>::INFO.state, &state), true)
        }))
    }

    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]> {
        LumpedModel::loop_plants(self, low, high)
    }
}

impl<M: LumpedModel> Invertible for M {
    type Inverse = <M as LumpedModel>::Inverse;

    fn inverse(
        &self,
        dt: f64,
        initial: Option<&Values>,
    ) -> Result<(Self::Inverse, <Self::Inverse as Inverse>::State)> {
        from_rest_only(initial)?;
        let inverse = LumpedModel::inverse(self, dt)?;
        let start = inverse.rest();
        Ok((inverse, start))
    }
}
