//! A stage composed of a hysteresis operator at the input, creep and linear dynamics.
//!
//! ```text
//! h = H(u) - H(0)                                             hysteresis
//! d = h + sum_k c_k q_k,   tau_k q_k' = h - q_k               creep
//! T x' + x = d   or   x'' + 2 zeta wn x' + wn^2 x = wn^2 d   or   x = d
//! or   x = sum_k g_k x_k, each x_k a mode as above            modes in parallel
//! ```
//!
//! A drive that goes straight from sample to sample is followed exactly: the interval is split where
//! the operator's output has a corner, and each part is stepped with the exact solution. Where the
//! output bends it is split further, so that chords are as close to it as the accuracy asks.
//! A model defines its operator; creep and dynamics are common to all.

use core::fmt::Debug;

use super::superposition::Rest;
use crate::error::{Error, Result, positive};
use crate::integrator::columns;
use crate::models::creep::{Relaxation, RelaxationFlow, RelaxationState};
use crate::models::parameters::mechanics_parameters::{V, X};
use crate::models::parameters::values::{ParameterInfo, Values};
use crate::models::plant::{Plant, Settling};
use crate::models::traits::{Experiment, Response};
use crate::signal::Hold;

/// Parts of a sampling interval at most; the last one takes the rest.
const MOST_PARTS: usize = 1 << 20;

/// Chords that stand for a bend within a step of a plant at most, which no stage of real size needs.
const MOST_CHORDS: f64 = 1000.0;

/// Corners at one place at most: rounding may find one again and again.
const MOST_IDLE: usize = 128;

/// Shares of a sampling interval below this are no part of it.
const LEAST_PART: f64 = 1e-9;

/// Accuracy of a plant's steps, m.
const ACCURACY: f64 = 1e-10;

/// Steps between two questions whether to stop.
const POLL: usize = 4096;

/// State of a stage whose operator has plays.
pub(in crate::models) const PLAYS_STATE: &[ParameterInfo] =
    &state_with(ParameterInfo::list("plays", "z", "V"));

/// Where the memory of the operator is in a state.
const MEMORY: usize = 3;

/// State of a stage whose operator has this memory.
pub(in crate::models) const fn state_with(memory: ParameterInfo) -> [ParameterInfo; 7] {
    [
        X,
        V,
        ParameterInfo::new("u", "u", "V"),
        memory,
        ParameterInfo::list("creep", "q", "m"),
        ParameterInfo::list("mode_x", "x_k", "m").or_none(),
        ParameterInfo::list("mode_v", "x_k'", "m/s").or_none(),
    ]
}

/// A state at rest with this memory of the operator, in the order of [`state_with`].
pub(in crate::models) fn state_at_rest(
    infos: &'static [ParameterInfo],
    rest: &Rest<'_>,
    memory: &[f64],
) -> Values {
    let Rest { x, volts, creep, modes, .. } = *rest;
    let (mode_x, mode_v) = (vec![x; modes], vec![0.0; modes]);
    let entries =
        [vec![x], vec![0.0], vec![volts], memory.to_vec(), creep.to_vec(), mode_x, mode_v];
    Values::of(infos, entries)
}

/// Puts plays into their slots, where there are as many.
pub(in crate::models) fn recall_plays(
    slots: &mut [f64],
    memory: &[f64],
) -> core::result::Result<(), String> {
    if slots.len() != memory.len() {
        return Err(format!("{} plays, as the stage", slots.len()));
    }
    slots.copy_from_slice(memory);
    Ok(())
}

/// A hysteresis operator that is followed from sample to sample, V to m.
pub trait InputOperator: Copy + Debug {
    /// Its state.
    type State: Copy + Debug;

    /// Whether the output depends on how fast the input moves.
    const BY_RATE: bool = false;

    /// The state before any voltage.
    fn rest(&self) -> Self::State;

    /// Sets how fast the input moves from now on, V/s.
    fn at_rate(&self, _state: &mut Self::State, _rate: f64) {}

    /// Takes the input to `volts` and returns the output, m.
    fn follow(&self, state: &mut Self::State, volts: f64) -> f64;

    /// Input of a state, V.
    fn input(&self, state: &Self::State) -> f64;
}

/// An operator whose memory can be kept as numbers.
pub trait Remembering: InputOperator {
    /// Description of a stage's state: that of plays, or the same with another name, symbol and
    /// unit of the operator's memory in their place.
    const STATE: &'static [ParameterInfo] = PLAYS_STATE;

    /// Memory of a state as numbers.
    fn memory(&self, state: &Self::State) -> Vec<f64>;

    /// Gives a state at `volts` the memory of these numbers, where the input may stand elsewhere
    /// if it can go to `volts` from there.
    ///
    /// # Errors
    /// Expected entries, where these numbers are no memory.
    fn recall(
        &self,
        state: &mut Self::State,
        volts: f64,
        memory: &[f64],
    ) -> core::result::Result<(), String>;
}

/// A hysteresis operator whose output is a straight line between corners, or nearly so.
pub trait Segmented: Remembering {
    /// The end of the first part of the way to `volts` along which the output is a straight line
    /// to within `deviation`, m: beyond the present input, and `volts` where all of the way is.
    fn next_breakpoint(&self, state: &Self::State, volts: f64, deviation: f64) -> f64;

    /// Largest second derivative of the output between corners, m/V^2.
    fn largest_curvature(&self) -> f64;

    /// Largest change of the slope that all corners together can make, m/V; infinite where it is
    /// not known.
    fn slope_jump(&self) -> f64 {
        f64::INFINITY
    }
}

/// A stage with an operator at its input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputStage<O> {
    /// Hysteresis, V to m.
    pub operator: O,
    /// Creep and linear dynamics.
    pub relaxation: Relaxation,
}

/// Memory of an [`InputStage`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputStageState<S> {
    /// Of the operator, with the drive.
    pub operator: S,
    /// Creep and dynamics.
    pub relaxation: RelaxationState,
}

/// Steps of one length.
#[derive(Clone, Copy, Debug)]
pub struct InputStageFlow {
    relaxation: RelaxationFlow,
    /// The operator's output at rest, m.
    zero: f64,
    /// Length of a step, s.
    step: f64,
    /// Largest deviation of the operator's output from the chords that stand for it, m.
    deviation: f64,
    /// The same where the drive moves by 1 V in the step, if that is more, m/V^2.
    coarsest: f64,
    /// Change of the drive below which one chord is close enough whatever the corners, V.
    least: f64,
}

impl<O: Remembering> InputStage<O> {
    /// The state before any voltage.
    #[must_use]
    pub fn at_rest(&self) -> InputStageState<O::State> {
        let relaxation = RelaxationState::default();
        InputStageState { operator: self.operator.rest(), relaxation }
    }

    /// The state in equilibrium after a slow visit to each voltage (V) in turn, from a stage that
    /// never moved: fully crept, at the static displacement, its modes at rest.
    #[must_use]
    pub fn settled_at(&self, voltages: &[f64]) -> InputStageState<O::State> {
        let mut operator = self.operator.rest();
        let zero = self.zero();
        let mut output = zero;
        for &volts in voltages {
            output = self.operator.follow(&mut operator, volts);
        }
        InputStageState { operator, relaxation: self.relaxation.settled(output - zero) }
    }

    /// A state from its values, or that at rest; a play that the drive would have pushed on
    /// stands where it does.
    ///
    /// # Errors
    /// [`Error::Shape`] where the state is of another stage; [`Error::Parameter`] where it is not
    /// finite.
    pub fn state(&self, values: Option<&Values>) -> Result<InputStageState<O::State>> {
        let mut state = self.at_rest();
        let Some(values) = values else { return Ok(state) };
        let name = O::STATE[MEMORY].name;
        let (memory, creep) = (values.list(name), values.list("creep"));
        let modes = (values.list("mode_x"), values.list("mode_v"));
        let relaxations = self.relaxation.count;
        let shape = |found, expected| Err(Error::Shape { name: "initial".into(), found, expected });
        if creep.len() != relaxations {
            let found = format!("{} relaxations", creep.len());
            return shape(found, format!("{relaxations}, as the stage"));
        }
        let further = self.relaxation.dynamics.further().len();
        if modes.0.len() != further || modes.1.len() != further {
            let (places, speeds) = (modes.0.len(), modes.1.len());
            let found = format!("{places} and {speeds} entries of mode_x and mode_v");
            let expected = format!("{further} each, as the stage has modes beside its main one");
            return shape(found, expected);
        }
        if !values.iter().flat_map(|(_, numbers)| numbers).all(|value| value.is_finite()) {
            return Err(Error::parameter("initial", "not finite", "finite numbers"));
        }
        let volts = values.number("u");
        if let Err(expected) = self.operator.recall(&mut state.operator, volts, memory) {
            return shape(format!("{} {name}", memory.len()), expected);
        }
        let relaxation = &mut state.relaxation;
        relaxation.creep[..relaxations].copy_from_slice(creep);
        relaxation.input = self.operator.follow(&mut state.operator, volts) - self.zero();
        (relaxation.x, relaxation.v) = (values.number("x"), values.number("v"));
        relaxation.mode_x[..further].copy_from_slice(modes.0);
        relaxation.mode_v[..further].copy_from_slice(modes.1);
        Ok(state)
    }

    /// The values of a state.
    pub(super) fn values_of(&self, state: &InputStageState<O::State>) -> Values {
        let InputStageState { operator, relaxation } = *state;
        let creep = relaxation.creep[..self.relaxation.count].to_vec();
        let memory = self.operator.memory(&operator);
        let (x, v, input) = (relaxation.x, relaxation.v, self.operator.input(&operator));
        let further = self.relaxation.dynamics.further().len();
        let (places, speeds) = (&relaxation.mode_x[..further], &relaxation.mode_v[..further]);
        let entries =
            [vec![x], vec![v], vec![input], memory, creep, places.to_vec(), speeds.to_vec()];
        Values::of(O::STATE, entries)
    }

    /// The operator's output at rest, m.
    #[must_use]
    pub fn zero(&self) -> f64 {
        let mut state = self.operator.rest();
        self.operator.follow(&mut state, 0.0)
    }

    /// The drive jumps to `volts`, V.
    fn jump(&self, state: &mut InputStageState<O::State>, volts: f64, zero: f64) {
        let output = self.operator.follow(&mut state.operator, volts) - zero;
        self.relaxation.jump(&mut state.relaxation, output);
    }
}

impl<O: Segmented> InputStage<O> {
    /// Steps of `step` seconds, with errors of the displacement below `accuracy`, m.
    fn steps(&self, step: f64, accuracy: f64) -> InputStageFlow {
        InputStageFlow {
            relaxation: self.relaxation.flow(step),
            zero: self.zero(),
            step,
            deviation: accuracy / self.relaxation.largest_gain(),
            coarsest: 0.0,
            least: 0.0,
        }
    }

    /// Bound of the error of one chord for each step in which the drive moves by `longest` (V) at
    /// most, m.
    fn error_bound(&self, longest: f64) -> f64 {
        if !self.relaxation.remembers() {
            return 0.0;
        }
        // A chord of length l deviates by curvature l^2 / 8 at most.
        0.125
            * self.operator.largest_curvature()
            * longest
            * longest
            * self.relaxation.largest_gain()
    }

    /// Takes the drive straight to `volts` in one step, in parts where the operator's output is
    /// not straight; returns how many.
    #[inline(always)]
    fn through(
        &self,
        flow: &InputStageFlow,
        state: &mut InputStageState<O::State>,
        volts: f64,
    ) -> usize {
        let InputStageFlow { relaxation, zero, step, deviation, coarsest, least } = flow;
        let from = self.operator.input(&state.operator);
        let deviation = deviation.max(coarsest * (volts - from) * (volts - from));
        if O::BY_RATE {
            self.operator.at_rate(&mut state.operator, (volts - from).abs() / *step);
            self.jump(state, from, *zero);
        }
        let (mut done, mut parts, mut idle) = (0.0, 1, 0);
        let splits = self.relaxation.remembers() && (volts - from).abs() > *least;
        while splits && parts < MOST_PARTS && idle < MOST_IDLE {
            let next = self.operator.next_breakpoint(&state.operator, volts, deviation);
            let reached = (next - from) / (volts - from);
            // Not a number where the drive is none.
            if reached.is_nan() || reached > 1.0 - LEAST_PART {
                break;
            }
            let output = self.operator.follow(&mut state.operator, next) - zero;
            if reached > done + LEAST_PART {
                let part = self.relaxation.flow((reached - done) * step);
                self.relaxation.step(&part, &mut state.relaxation, output);
                done = reached;
                idle = 0;
            } else {
                idle += 1;
            }
            parts += 1;
        }
        let output = self.operator.follow(&mut state.operator, volts) - zero;
        if done > 0.0 {
            let rest = self.relaxation.flow((1.0 - done) * step);
            self.relaxation.step(&rest, &mut state.relaxation, output);
        } else {
            self.relaxation.step(relaxation, &mut state.relaxation, output);
        }
        parts
    }

    /// Motion under a drive. Exact where the output has no bends between corners: its error
    /// estimate is 0 then, and a bound of the error otherwise.
    ///
    /// The drive jumps from where the initial state has it to its first sample. With a zero-order
    /// hold a sample shows the stage before the drive's step at that instant has any effect.
    pub(super) fn follow(&self, experiment: &Experiment<'_>) -> Result<Option<Response>> {
        let Experiment { drive, initial, method, accuracy, stop } = *experiment;
        method.exponential_only()?;
        let flow = self.steps(drive.dt, positive("accuracy", accuracy, "m")?);
        let zero = flow.zero;
        let mut state = self.state(initial)?;
        let (mut steps, mut longest) = (POLL, 0.0_f64);
        let [mut x, mut v, mut hysteresis] = columns(drive.u.len())?;
        for (k, &volts) in drive.u.iter().enumerate() {
            if steps >= POLL {
                if stop() {
                    return Ok(None);
                }
                steps = 0;
            }
            steps += 1;
            match drive.hold.until(k) {
                Hold::First if k == 0 => self.jump(&mut state, volts, zero),
                Hold::First => {
                    longest = longest.max((volts - drive.u[k - 1]).abs());
                    steps += self.through(&flow, &mut state, volts);
                }
                Hold::Zero if k == 0 => {}
                Hold::Zero => {
                    self.jump(&mut state, drive.u[k - 1], zero);
                    let held = state.relaxation.input;
                    self.relaxation.step(&flow.relaxation, &mut state.relaxation, held);
                }
                Hold::Jump => {
                    let held = state.relaxation.input;
                    self.relaxation.step(&flow.relaxation, &mut state.relaxation, held);
                    self.jump(&mut state, volts, zero);
                }
            }
            if !state.relaxation.x.is_finite() {
                return Err(Error::Numerical(format!(
                    "the displacement is not finite from sample {k} on"
                )));
            }
            x.push(state.relaxation.x);
            v.push(state.relaxation.v);
            hysteresis.push(state.relaxation.input);
        }
        let last = self.values_of(&state);
        Ok(Some(Response {
            x,
            v,
            hysteresis,
            last,
            substeps: 1,
            error_estimate: self.error_bound(longest).min(accuracy),
            unique: true,
        }))
    }
}

impl<O: Segmented> Plant for InputStage<O> {
    type State = InputStageState<O::State>;
    type Flow = InputStageFlow;

    fn rest(&self) -> Self::State {
        self.at_rest()
    }

    fn flow(&self, step: f64) -> InputStageFlow {
        let flow = self.steps(step, ACCURACY);
        // A chord across corners deviates by a quarter of slope_jump times its length at most.
        let least = 4.0 * flow.deviation / self.operator.slope_jump();
        let coarsest = 0.125 * self.operator.largest_curvature() / (MOST_CHORDS * MOST_CHORDS);
        InputStageFlow { coarsest, least, ..flow }
    }

    #[inline(always)]
    fn advance(&self, flow: &InputStageFlow, state: &mut Self::State, from: f64, to: f64) {
        if (from - self.operator.input(&state.operator)).abs() > 0.0 {
            self.jump(state, from, flow.zero);
        }
        self.through(flow, state, to);
    }

    #[inline(always)]
    fn displacement(&self, state: &Self::State) -> f64 {
        state.relaxation.x
    }
}

impl<O: Segmented> Settling for InputStage<O> {
    fn settled(&self, voltages: &[f64]) -> Self::State {
        self.settled_at(voltages)
    }
}
