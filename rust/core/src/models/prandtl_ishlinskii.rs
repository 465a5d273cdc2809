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

use super::creep::{MOST_RELAXATIONS, Relaxation, RelaxationFlow, RelaxationState};
use super::plant::Plant;
use crate::error::{Error, Result, finite, not_negative, positive};
use crate::signal::{Drive, Hold, Stop};

/// Most plays of a stage.
pub const MOST_PLAYS: usize = 32;

/// Most dead zones of a stage.
pub const MOST_ZONES: usize = 8;

/// The hysteresis operator, V to m; those plays and dead zones that are not used weigh 0.
pub type Plays = Play<f64, MOST_PLAYS, MOST_ZONES>;

/// Its inverse, m to V.
pub type PlaysInverse = PlayInverse<MOST_PLAYS, MOST_ZONES>;

/// The inverse of a stage for feedforward, with room for as many parts as a stage can have.
pub type PlaysFeedforward = PrandtlIshlinskiiInverse<MOST_PLAYS, MOST_ZONES, MOST_RELAXATIONS>;

/// State of a [`PlaysFeedforward`].
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
///     relaxation: Relaxation::new(&[], &[], Dynamics::None)?,
/// };
/// let drive = Drive::new(&[0.0, 50.0, 0.0], 0.01, Hold::First)?;
/// let run = stage.simulate(&drive, stage.at_rest(), NEVER)?.unwrap();
/// assert!((run.x[1] - 61e-6).abs() < 1e-15);
/// assert!((run.x[2] - 4e-6).abs() < 1e-15); // the plays stay behind
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrandtlIshlinskiiStage {
    /// Hysteresis, V to m.
    pub plays: Plays,
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

/// Motion of a stage at the samples of its drive.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaysMotion {
    /// Displacement, m.
    pub x: Vec<f64>,
    /// What comes out of the hysteresis, h, m.
    pub hysteresis: Vec<f64>,
    /// State at the last sample.
    pub last: PlaysState,
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
    same_length("bends", bends.len(), "corners", corners.len(), MOST_ZONES)?;
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
        let name = format!("corners[{j}]");
        before = ascending(&name, finite(&name, corners[j], "m")?, before, "m")?;
        slope += finite(&format!("bends[{j}]"), bends[j], "")?;
        if slope <= 0.0 {
            let expected = "bends whose sums stay above -1, or the curve turns back";
            return Err(Error::parameter(format!("bends[{j}]"), bends[j], expected));
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

    /// The state with the drive at `volts`, V, the first plays and relaxations as given, and
    /// displacement and velocity; a play that the drive would have pushed on stands where it does.
    #[must_use]
    pub fn state(&self, volts: f64, plays: &[f64], creep: &[f64], x: f64, v: f64) -> PlaysState {
        let mut state = self.at_rest();
        for (slot, play) in state.plays.plays.iter_mut().zip(plays) {
            *slot = *play;
        }
        for (slot, reached) in state.rest.creep.iter_mut().zip(creep) {
            *slot = *reached;
        }
        state.rest.input = self.plays.follow(&mut state.plays, volts) - self.zero();
        (state.rest.x, state.rest.v) = (x, v);
        state
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

    /// Displacement under a sampled drive; `None` where `stop` said so meanwhile.
    ///
    /// The drive jumps from where `start` has it to its first sample. With a zero-order hold a
    /// sample shows the stage before the drive's step at that instant has any effect.
    ///
    /// # Errors
    /// [`Error::Numerical`] where the displacement is not finite.
    pub fn simulate(
        &self,
        drive: &Drive<'_>,
        start: PlaysState,
        stop: Stop<'_>,
    ) -> Result<Option<PlaysMotion>> {
        let count = drive.u.len();
        let flow = self.relaxation.flow(drive.dt);
        let zero = self.zero();
        let mut state = start;
        let (mut x, mut hysteresis) = (Vec::with_capacity(count), Vec::with_capacity(count));
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
            hysteresis.push(state.rest.input);
        }
        Ok(Some(PlaysMotion { x, hysteresis, last: state }))
    }

    /// The inverse for references sampled every `dt` seconds.
    ///
    /// # Errors
    /// [`Error::Parameter`] where `dt` is not above 0, or the stage has no inverse.
    pub fn inverse(&self, dt: f64) -> Result<PlaysFeedforward> {
        let Relaxation { dynamics, .. } = self.relaxation;
        Ok(PlaysFeedforward::new(&self.plays, self.relaxation.used(), dynamics, dt)?)
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
