//! The Prandtl-Ishlinskii stage: plays with dead zones at the input, creep, linear dynamics.
//!
//! ```text
//! p = w_0 u + sum_i w_i z_i,  z_i = max(u - r_i, min(u + r_i, z_i))
//! h = S(p) - S(0),  S(p) = p + sum_j s_j max(p - d_j, 0)
//! d = h + sum_k c_k q_k,  tau_k q_k' = h - q_k
//! T x' + x = d   or   x'' + 2 zeta wn x' + wn^2 x = wn^2 d   or   x = d
//! ```
//!
//! Kuhnen 2003, European Journal of Control 9(4), 407-418, doi 10.3166/ejc.9.407-418, with the
//! weights in m/V. The hysteresis is exact from sample to sample; between two samples its output
//! is taken to go straight.

use piezotrack_control::hysteresis::{Operator, Play, PlayState};
use piezotrack_control::{
    CreepState, PlayInverse, PrandtlIshlinskiiInverse, PrandtlIshlinskiiInverseState,
    PrandtlIshlinskiiState,
};

use super::creep::{Dynamics, MOST_RELAXATIONS, Relaxation, RelaxationFlow, RelaxationState};
use super::plant::Plant;
use super::traits::{Experiment, Invertible, ModelInfo, Response, StageModel};
use super::values::{ParameterInfo, Values};
use crate::design::{Gains, LoopPlant};
use crate::error::{Error, Result, finite, not_negative, positive};
use crate::signal::Hold;

/// Most plays of a stage.
pub const MOST_PLAYS: usize = 32;

/// Most dead zones of a stage.
pub const MOST_ZONES: usize = 8;

/// The hysteresis operator, V to m; those plays and dead zones that are not used weigh 0.
pub type Plays = Play<f64, MOST_PLAYS, MOST_ZONES>;

/// Its inverse, m to V.
pub type PlaysInverse = PlayInverse<MOST_PLAYS, MOST_ZONES>;

const PARAMETERS: &[ParameterInfo] = &[
    ParameterInfo::new("linear", "w0", "m/V"),
    ParameterInfo::list("thresholds", "r", "V"),
    ParameterInfo::list("weights", "w", "m/V"),
    ParameterInfo::list("dead_zone_thresholds", "d", "m"),
    ParameterInfo::list("dead_zone_weights", "s", ""),
    ParameterInfo::list("creep_weights", "c", ""),
    ParameterInfo::list("creep_times", "tau", "s"),
    ParameterInfo::list("time_constant", "T", "s"),
    ParameterInfo::list("mode", "wn/2pi, zeta", "Hz, 1"),
];

const STATE: &[ParameterInfo] = &[
    ParameterInfo::new("x", "x", "m"),
    ParameterInfo::new("v", "x'", "m/s"),
    ParameterInfo::new("u", "u", "V"),
    ParameterInfo::list("plays", "z", "V"),
    ParameterInfo::list("creep", "q", "m"),
];

/// The voltage that leads a stage along a reference: the inverse of each part in turn.
pub type PlaysFeedforward = PrandtlIshlinskiiInverse<MOST_PLAYS, MOST_ZONES, MOST_RELAXATIONS>;

/// Memory of a [`PlaysFeedforward`].
pub type FeedforwardState = PrandtlIshlinskiiInverseState<MOST_PLAYS, MOST_RELAXATIONS>;

/// Samples between two questions whether to stop.
const POLL: usize = 4096;

/// A stage with play operators at its input.
///
/// ```
/// use piezotrack_core::signal::{Drive, Hold, NEVER};
/// use piezotrack_core::models::{Dynamics, PrandtlIshlinskiiStage, Relaxation, plays};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let stage = PrandtlIshlinskiiStage {
///     plays: plays(1e-6, &[10.0, 20.0], &[0.2e-6, 0.1e-6], &[], &[])?,
///     count: 2,
///     relaxation: Relaxation::new(&[], &[], Dynamics::None)?,
/// };
/// let drive = Drive::new(&[0.0, 50.0, 0.0], 0.01, Hold::First)?;
/// let method = Method::Exponential;
/// let experiment =
///     Experiment { drive: &drive, initial: None, method, accuracy: 1e-10, stop: NEVER };
/// let run = stage.simulate(&experiment)?.unwrap();
/// assert!((run.x[1] - 61e-6).abs() < 1e-15);
/// assert!((run.x[2] - 4e-6).abs() < 1e-15); // the plays stay behind
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrandtlIshlinskiiStage {
    /// Hysteresis, V to m.
    pub plays: Plays,
    /// Number of plays.
    pub count: usize,
    /// Creep and linear dynamics.
    pub relaxation: Relaxation,
}

/// Memory of a [`PrandtlIshlinskiiStage`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaysState {
    /// Plays, with the drive.
    pub plays: PlayState<f64, MOST_PLAYS>,
    /// Creep and dynamics.
    pub rest: RelaxationState,
}

/// A hysteresis from its parameters.
///
/// # Errors
/// [`Error::Shape`] where entries are missing or too many, [`Error::Parameter`] where one is out
/// of its range.
pub fn plays(
    linear: f64,
    thresholds: &[f64],
    weights: &[f64],
    corners: &[f64],
    bends: &[f64],
) -> Result<Plays> {
    same_length("weights", weights.len(), "thresholds", thresholds.len(), MOST_PLAYS)?;
    same_length(
        "dead_zone_weights",
        bends.len(),
        "dead_zone_thresholds",
        corners.len(),
        MOST_ZONES,
    )?;
    positive("linear", linear, "m/V")?;
    let mut plays = Plays {
        linear,
        // What is not used weighs 0; it stands at the end so that all ascend.
        thresholds: [thresholds.last().copied().unwrap_or(0.0); MOST_PLAYS],
        weights: [0.0; MOST_PLAYS],
        corners: [corners.last().copied().unwrap_or(0.0); MOST_ZONES],
        bends: [0.0; MOST_ZONES],
    };
    let mut before = 0.0;
    for i in 0..thresholds.len() {
        let name = format!("thresholds[{i}]");
        before = ascending(&name, not_negative(&name, thresholds[i], "V")?, before, "V")?;
        plays.thresholds[i] = before;
        plays.weights[i] = not_negative(&format!("weights[{i}]"), weights[i], "m/V")?;
    }
    let (mut before, mut slope) = (f64::NEG_INFINITY, 1.0);
    for j in 0..corners.len() {
        let name = format!("dead_zone_thresholds[{j}]");
        before = ascending(&name, finite(&name, corners[j], "m")?, before, "m")?;
        slope += finite(&format!("dead_zone_weights[{j}]"), bends[j], "")?;
        if slope <= 0.0 {
            let expected = "dead-zone weights whose sums stay above -1, or the curve turns back";
            return Err(Error::parameter(format!("dead_zone_weights[{j}]"), bends[j], expected));
        }
        (plays.corners[j], plays.bends[j]) = (before, bends[j]);
    }
    Ok(plays)
}

fn same_length(name: &str, found: usize, other: &str, wanted: usize, most: usize) -> Result<()> {
    if found == wanted && found <= most {
        return Ok(());
    }
    Err(Error::Shape {
        name: name.into(),
        found: format!("{found} entries"),
        expected: format!("as many as {other}, which has {wanted}, and {most} at most"),
    })
}

fn ascending(name: &str, value: f64, before: f64, unit: &str) -> Result<f64> {
    if value >= before {
        return Ok(value);
    }
    let expected = format!("{before} {unit} or above: they ascend");
    Err(Error::parameter(name, format!("{value} {unit}"), expected))
}

impl PrandtlIshlinskiiStage {
    /// The state before any voltage.
    #[must_use]
    pub fn at_rest(&self) -> PlaysState {
        PlaysState { plays: self.plays.rest(), rest: RelaxationState::default() }
    }

    /// A state from its values, or that at rest; a play that the drive would have pushed on
    /// stands where it does.
    ///
    /// # Errors
    /// [`Error::Shape`] where the state is of another stage; [`Error::Parameter`] where it is not
    /// finite.
    pub fn state(&self, values: Option<&Values>) -> Result<PlaysState> {
        let mut state = self.at_rest();
        let Some(values) = values else { return Ok(state) };
        let (plays, creep) = (values.list("plays"), values.list("creep"));
        let (count, relaxations) = (self.count, self.relaxation.count);
        if plays.len() != count || creep.len() != relaxations {
            return Err(Error::Shape {
                name: "initial".into(),
                found: format!("{} plays and {} relaxations", plays.len(), creep.len()),
                expected: format!("{count} plays and {relaxations} relaxations, as the stage"),
            });
        }
        if !values.iter().flat_map(|(_, numbers)| numbers).all(|value| value.is_finite()) {
            return Err(Error::parameter("initial", "not finite", "finite numbers"));
        }
        state.plays.plays[..count].copy_from_slice(plays);
        state.rest.creep[..relaxations].copy_from_slice(creep);
        state.rest.input = self.plays.follow(&mut state.plays, values.number("u")) - self.zero();
        (state.rest.x, state.rest.v) = (values.number("x"), values.number("v"));
        Ok(state)
    }

    /// The values of a state.
    fn values_of(&self, PlaysState { plays, rest }: &PlaysState) -> Values {
        let creep = rest.creep[..self.relaxation.count].to_vec();
        let stand = plays.plays[..self.count].to_vec();
        Values::of(STATE, [vec![rest.x], vec![rest.v], vec![plays.input], stand, creep])
    }

    /// What the dead zones make of 0.
    fn zero(&self) -> f64 {
        self.plays.output(&self.plays.rest()).0
    }

    /// The drive jumps to `volts`, V.
    fn jump(&self, state: &mut PlaysState, volts: f64, zero: f64) {
        let output = self.plays.follow(&mut state.plays, volts) - zero;
        self.relaxation.jump(&mut state.rest, output);
    }

    /// The inverse for references sampled every `dt` seconds.
    ///
    /// # Errors
    /// [`Error::Parameter`] where `dt` is not above 0.
    pub fn feedforward(&self, dt: f64) -> Result<PlaysFeedforward> {
        let Relaxation { dynamics, .. } = self.relaxation;
        Ok(PlaysFeedforward::new(&self.plays, self.relaxation.used(), dynamics, dt)?)
    }
}

impl StageModel for PrandtlIshlinskiiStage {
    const INFO: ModelInfo = ModelInfo {
        name: "prandtl-ishlinskii",
        title: "Prandtl-Ishlinskii",
        drive_unit: "V",
        parameters: PARAMETERS,
        state: STATE,
        published: &[],
    };

    fn build(values: &Values) -> Result<Self> {
        let list = |name| values.list(name);
        let dynamics = match (list("time_constant"), list("mode")) {
            ([], []) => Dynamics::None,
            ([time], []) => Dynamics::First { time: *time },
            ([], [frequency, damping_ratio]) => {
                Dynamics::Second { frequency: *frequency, damping_ratio: *damping_ratio }
            }
            (time, mode) => {
                let found = format!("{} and {} numbers", time.len(), mode.len());
                let expected = "one time constant, or frequency and damping ratio of a mode";
                return Err(Error::parameter("time_constant and mode", found, expected));
            }
        };
        let (corners, bends) = (list("dead_zone_thresholds"), list("dead_zone_weights"));
        Ok(Self {
            plays: plays(
                values.number("linear"),
                list("thresholds"),
                list("weights"),
                corners,
                bends,
            )?,
            count: list("thresholds").len(),
            relaxation: Relaxation::new(list("creep_weights"), list("creep_times"), dynamics)?,
        })
    }

    /// Exact from sample to sample, so its error estimate is 0.
    ///
    /// The drive jumps from where the initial state has it to its first sample. With a zero-order
    /// hold a sample shows the stage before the drive's step at that instant has any effect.
    fn simulate(&self, experiment: &Experiment<'_>) -> Result<Option<Response>> {
        let Experiment { drive, initial, method, stop, .. } = *experiment;
        method.exponential_only()?;
        let count = drive.u.len();
        let flow = self.relaxation.flow(drive.dt);
        let zero = self.zero();
        let mut state = self.state(initial)?;
        let [mut x, mut v, mut hysteresis] = [0, 1, 2].map(|_| Vec::with_capacity(count));
        for (k, &volts) in drive.u.iter().enumerate() {
            if k % POLL == 0 && stop() {
                return Ok(None);
            }
            match drive.hold {
                Hold::First if k == 0 => self.jump(&mut state, volts, zero),
                Hold::First => {
                    let output = self.plays.follow(&mut state.plays, volts) - zero;
                    self.relaxation.step(&flow, &mut state.rest, output);
                }
                Hold::Zero if k == 0 => {}
                Hold::Zero => {
                    self.jump(&mut state, drive.u[k - 1], zero);
                    let held = state.rest.input;
                    self.relaxation.step(&flow, &mut state.rest, held);
                }
            }
            if !state.rest.x.is_finite() {
                return Err(Error::Numerical(format!(
                    "the displacement is not finite from sample {k} on"
                )));
            }
            x.push(state.rest.x);
            v.push(state.rest.v);
            hysteresis.push(state.rest.input);
        }
        let last = self.values_of(&state);
        Ok(Some(Response {
            x,
            v,
            hysteresis,
            last,
            substeps: 1,
            error_estimate: 0.0,
            unique: true,
        }))
    }

    /// On its settled loop between the two voltages; its creep is slower than a loop and left
    /// out.
    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]> {
        let gains = Gains::of(&self.plays, low, high, |slope| slope)?;
        gains.plants(|gain| match self.relaxation.dynamics {
            Dynamics::None => LoopPlant::fixed_gain(gain),
            Dynamics::First { time } => {
                LoopPlant::fixed_gain(gain)?.with_amplifier(1.0 / (core::f64::consts::TAU * time))
            }
            Dynamics::Second { frequency, damping_ratio } => {
                LoopPlant::mode(gain, frequency, damping_ratio)
            }
        })
    }
}
impl Invertible for PrandtlIshlinskiiStage {
    type Inverse = PlaysFeedforward;

    fn inverse(
        &self,
        dt: f64,
        initial: Option<&Values>,
    ) -> Result<(PlaysFeedforward, FeedforwardState)> {
        let inverse = self.feedforward(dt)?;
        let start = inverse.start(&self.state(initial)?);
        Ok((inverse, start))
    }
}

impl Plant for PrandtlIshlinskiiStage {
    type State = PlaysState;
    type Flow = (RelaxationFlow, f64);

    fn rest(&self) -> PlaysState {
        self.at_rest()
    }

    fn flow(&self, step: f64) -> (RelaxationFlow, f64) {
        (self.relaxation.flow(step), self.zero())
    }

    #[inline(always)]
    fn advance(
        &self,
        (flow, zero): &(RelaxationFlow, f64),
        state: &mut PlaysState,
        from: f64,
        to: f64,
    ) {
        if (from - state.plays.input).abs() > 0.0 {
            self.jump(state, from, *zero);
        }
        let output = self.plays.follow(&mut state.plays, to) - zero;
        self.relaxation.step(flow, &mut state.rest, output);
    }

    #[inline(always)]
    fn displacement(&self, state: &PlaysState) -> f64 {
        state.rest.x
    }
}

impl From<&PlaysState> for PrandtlIshlinskiiState<MOST_PLAYS, MOST_RELAXATIONS> {
    fn from(state: &PlaysState) -> Self {
        let creep = CreepState { input: state.rest.input, reached: state.rest.creep };
        Self { plays: state.plays, creep }
    }
}
