//! Creep behind the mechanics of any stage that a swarm searches.
//!
//! ```text
//! x = xm + sum_j c_j q_j,   tau_j q_j' = xm - q_j
//! ```
//!
//! xm is the displacement of the mechanics: all that the stage inside describes. Between samples
//! it is taken as the cubic through its values and velocities, for which each step is exact
//! ([`CubicLag`]); in a closed loop, whose steps are short, as a straight line. Without relaxations
//! the stage is the one inside, bit for bit.

use piezotrack_control::CreepingInverse;
use piezotrack_control::creep::{Creep, CubicLag, Lag, advance, output};

use super::creep::{Dynamics, MOST_RELAXATIONS, Relaxation};
use super::parameters::search_ranges::{Measures, Ranges};
use super::parameters::values::{Held, ParameterInfo, ROOM, Values, extended};
use super::plant::{Plant, Settling};
use super::traits::{
    Experiment, Invertible, KernelVisitor, ModelInfo, Response, Searchable, StageModel,
    finite_state,
};
use crate::design::LoopPlant;
use crate::error::{Error, Result};
use crate::integrator::Order;
use crate::signal::all_finite;

/// Parameters of the creep, which follow those of the stage inside.
const PARAMETERS: [ParameterInfo; 2] = [
    ParameterInfo::list("creep_weights", "c", "").or_none(),
    ParameterInfo::list("creep_times", "tau", "s").or_none(),
];

/// State of the creep, which follows that of the stage inside.
const STATE: [ParameterInfo; 1] = [ParameterInfo::list("creep", "q", "m").or_none()];

/// A stage whose displacement creeps.
#[derive(Clone, Copy, Debug)]
pub struct Creeping<M> {
    /// The stage without creep.
    pub stage: M,
    /// The creep; without dynamics, which are those of the stage.
    relaxation: Relaxation,
}

/// State of a stage with creep in a closed loop.
#[derive(Clone, Copy, Debug)]
pub struct CreepingState<S> {
    stage: S,
    /// Output of each relaxation, m.
    reached: [f64; MOST_RELAXATIONS],
}

/// Steps of one length.
#[derive(Clone, Copy, Debug)]
pub struct CreepingFlow<F> {
    stage: F,
    lags: [Lag; MOST_RELAXATIONS],
}

/// The outputs of a relaxation behind the motion of the mechanics at samples every `dt` seconds,
/// from `start`, with their slopes; in equilibrium at the first sample where that is `None`.
pub(crate) fn relaxed(
    time: f64,
    dt: f64,
    start: Option<f64>,
    [x, v]: [&[f64]; 2],
) -> [Vec<f64>; 2] {
    let lag = CubicLag::new(time, dt);
    let mut reached = start.or(x.first().copied()).unwrap_or(0.0);
    let mut before: Option<[f64; 2]> = None;
    let samples = x.iter().zip(v).map(|(&x, &v)| {
        let now = [x, v * dt];
        reached = before.map_or(reached, |before| lag.step(reached, before, now));
        before = Some(now);
        (reached, (x - reached) / time)
    });
    let (reached, slopes) = samples.unzip();
    [reached, slopes]
}

impl<M> Creeping<M> {
    /// The relaxations as those of an input stage, without dynamics.
    pub(super) fn relaxation(&self) -> &Relaxation {
        &self.relaxation
    }
}

impl<M: StageModel> Creeping<M> {
    const ALL_PARAMETERS: &'static [ParameterInfo; ROOM] =
        &extended(M::INFO.parameters, &PARAMETERS);
    const ALL_STATE: &'static [ParameterInfo; ROOM] = &extended(M::INFO.state, &STATE);

    /// A stage with these relaxations.
    ///
    /// # Errors
    /// Those of [`Relaxation::new`].
    pub fn new(stage: M, weights: &[f64], times: &[f64]) -> Result<Self> {
        Ok(Self { stage, relaxation: Relaxation::new(weights, times, Dynamics::None)? })
    }

    /// The relaxations.
    #[must_use]
    pub fn creep(&self) -> &[Creep] {
        self.relaxation.used()
    }

    /// Displacement after a long time for that of the mechanics.
    fn settled_gain(&self) -> f64 {
        self.creep().iter().fold(1.0, |sum, creep| sum + creep.share)
    }

    /// The state of the mechanics within that of the stage.
    fn mechanical(&self, state: &Values) -> Result<Values> {
        let reached = state.list("creep");
        if reached.len() != self.creep().len() {
            return Err(Error::Shape {
                name: "initial".into(),
                found: format!("{} relaxations", reached.len()),
                expected: format!("{}, as the stage", self.creep().len()),
            });
        }
        let used = || self.creep().iter().zip(reached);
        let x = used().fold(state.number("x"), |x, (creep, q)| x - creep.share * q);
        let v =
            used().fold(state.number("v"), |v, (creep, q)| v - creep.share * (x - q) / creep.time);
        Ok(state.leading(M::INFO.state).with("x", x).with("v", v))
    }

    /// Adds the creep to a motion that begins with these outputs of the relaxations.
    fn creep_on(&self, response: &mut Response, reached: Option<&[f64]>, dt: f64) -> Result<()> {
        if self.creep().is_empty() {
            response.last = response.last.followed(Self::INFO.state, vec![Vec::new()]);
            return Ok(());
        }
        let mechanics = [response.x.clone(), response.v.clone()];
        let mut last = Vec::with_capacity(self.creep().len());
        for (j, creep) in self.creep().iter().enumerate() {
            let start = reached.and_then(|reached| reached.get(j)).copied();
            let [q, slopes] = relaxed(creep.time, dt, start, [&mechanics[0], &mechanics[1]]);
            response.x.iter_mut().zip(&q).for_each(|(x, q)| *x += creep.share * q);
            response.v.iter_mut().zip(&slopes).for_each(|(v, slope)| *v += creep.share * slope);
            last.extend(q.last());
        }
        for values in [&response.x, &response.v] {
            all_finite(values, dt)?;
        }
        response.error_estimate *= self.settled_gain();
        let [x, v] = [&response.x, &response.v].map(|all| all.last().copied().unwrap_or(0.0));
        let state = response.last.with("x", x).with("v", v);
        response.last = state.followed(Self::INFO.state, vec![last]);
        Ok(())
    }
}

impl<M: StageModel> StageModel for Creeping<M> {
    const INFO: ModelInfo = ModelInfo {
        parameters: Self::ALL_PARAMETERS.split_at(M::INFO.parameters.len() + PARAMETERS.len()).0,
        state: Self::ALL_STATE.split_at(M::INFO.state.len() + STATE.len()).0,
        ..M::INFO
    };

    fn build(values: &Values) -> Result<Self> {
        let stage = M::build(&values.leading(M::INFO.parameters))?;
        Self::new(stage, values.list("creep_weights"), values.list("creep_times"))
    }

    /// With the creep complete.
    fn equilibrium(&self, voltages: &[f64]) -> Result<Values> {
        let state = self.stage.equilibrium(voltages)?;
        let x = state.number("x");
        let reached = vec![x; self.creep().len()];
        let state = state.with("x", self.settled_gain() * x);
        finite_state(state.followed(Self::INFO.state, vec![reached]), voltages)
    }

    fn simulate(&self, experiment: &Experiment<'_>) -> Result<Option<Response>> {
        let initial = experiment.initial;
        let start = initial.map(|state| self.mechanical(state)).transpose()?;
        let accuracy = experiment.accuracy / self.settled_gain();
        let inside = Experiment { initial: start.as_ref(), accuracy, ..*experiment };
        let Some(mut response) = self.stage.simulate(&inside)? else { return Ok(None) };
        let reached = initial.map(|state| state.list("creep"));
        self.creep_on(&mut response, reached, experiment.drive.dt)?;
        Ok(Some(response))
    }

    /// Without the creep, which is slower than a loop.
    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]> {
        self.stage.loop_plants(low, high)
    }
}

impl<M: Plant> Plant for Creeping<M> {
    type State = CreepingState<M::State>;
    type Flow = CreepingFlow<M::Flow>;

    fn rest(&self) -> Self::State {
        let stage = self.stage.rest();
        // In equilibrium.
        let reached = [self.stage.displacement(&stage); MOST_RELAXATIONS];
        CreepingState { stage, reached }
    }

    fn flow(&self, step: f64) -> Self::Flow {
        let lags = self.relaxation.creep.map(|creep| Lag::new(creep.time, step));
        CreepingFlow { stage: self.stage.flow(step), lags }
    }

    #[inline(always)]
    fn advance(&self, flow: &Self::Flow, state: &mut Self::State, from: f64, to: f64) {
        let before = self.stage.displacement(&state.stage);
        self.stage.advance(&flow.stage, &mut state.stage, from, to);
        let after = self.stage.displacement(&state.stage);
        let used = self.relaxation.used().len();
        advance(&flow.lags[..used], &mut state.reached, before, after);
    }

    #[inline(always)]
    fn displacement(&self, state: &Self::State) -> f64 {
        output(self.relaxation.used(), self.stage.displacement(&state.stage), &state.reached)
    }
}

impl<M: Searchable> Searchable for Creeping<M> {
    const NONSMOOTH: bool = M::NONSMOOTH;

    fn ranges(measures: &Measures, held: &Held) -> Result<Ranges> {
        M::ranges(measures, held)
    }

    fn kernel<V: KernelVisitor>(held: &Held, order: Order, visitor: V) -> V::Output {
        M::kernel(held, order, visitor)
    }

    fn has_second_order(held: &Held) -> bool {
        M::has_second_order(held)
    }
}

impl<M: Invertible> Invertible for Creeping<M> {
    type Inverse = CreepingInverse<M::Inverse, MOST_RELAXATIONS>;

    fn inverse(
        &self,
        dt: f64,
        initial: Option<&Values>,
    ) -> Result<(Self::Inverse, <Self::Inverse as piezotrack_control::Inverse>::State)> {
        let (inverse, state) = self.stage.inverse(dt, initial)?;
        let inverse = CreepingInverse::new(inverse, self.creep(), dt)?;
        let state = inverse.start(state);
        Ok((inverse, state))
    }
}

impl<M: Settling> Settling for Creeping<M> {
    fn settled(&self, voltages: &[f64]) -> Self::State {
        let stage = self.stage.settled(voltages);
        let reached = [self.stage.displacement(&stage); MOST_RELAXATIONS];
        CreepingState { stage, reached }
    }
}
