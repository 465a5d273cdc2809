//! Controllers of a bundle of loops: PID controllers in lanes, others one by one.

use piezotrack_control::{
    Controller, ControllerState, Number, Outcome, RepetitiveState, SampledPid, SampledRepetitive,
};
use pulp::Simd;

use crate::error::Result;
use crate::math::{Lanes, room, zeros};
use crate::parts::{Law, LawState};
use crate::simulate::DELAY_LINE;

/// Controllers that are stepped at once, each on its lane.
pub(super) trait Bundled<N> {
    /// Commands for readings, V, and 1 in the lanes where they are clipped, 0 in others.
    fn step(&mut self, reference: f64, readings: N, feedforward: f64) -> [N; 2];

    /// Whether all that was stepped is right: where not, others have to step it again.
    fn holds(&self) -> bool;
}

/// Controllers of any kind, each stepped by the code that firmware runs.
pub(super) struct OneByOne<'a> {
    controllers: &'a [Controller<Law>],
    states: Vec<ControllerState<LawState, Vec<f64>>>,
}

impl<'a> OneByOne<'a> {
    /// The controllers at rest.
    pub fn new(controllers: &'a [Controller<Law>]) -> Result<Self> {
        let mut states = room("the controllers", controllers.len())?;
        for one in controllers {
            let length = one.repetitive.map_or(0, |part| part.length());
            states.push(one.rest(zeros(DELAY_LINE, length)?)?);
        }
        Ok(Self { controllers, states })
    }
}

impl<S: Simd, const V: usize> Bundled<Lanes<S, V>> for OneByOne<'_> {
    #[inline(always)]
    fn step(
        &mut self,
        reference: f64,
        readings: Lanes<S, V>,
        feedforward: f64,
    ) -> [Lanes<S, V>; 2] {
        let (mut volts, mut clipped) = (readings.like(0.0), readings.like(0.0));
        let lanes = volts.as_mut_slice().iter_mut().zip(clipped.as_mut_slice());
        let controllers = self.controllers.iter().zip(&mut self.states);
        for (((volts, clipped), reading), (controller, state)) in
            lanes.zip(readings.as_slice()).zip(controllers)
        {
            let command = controller.step(state, reference, *reading, feedforward);
            *volts = command.volts;
            *clipped = f64::from(u8::from(command.saturated));
        }
        [volts, clipped]
    }

    fn holds(&self) -> bool {
        true
    }
}

/// PID controllers in lanes, with the operations of [`Controller::step`] in its order.
///
/// They suppose what nearly every loop keeps, and say at the end whether it was so: readings within
/// the span, and finite numbers.
pub(super) struct PidLanes<N> {
    /// Weights of the rise of the error, of the error and of its bend, and of the excess.
    weights: [N; 4],
    low: N,
    high: N,
    /// Output without an integral part at the first error, V/m; not a number with one.
    first: Option<N>,
    volts: N,
    errors: [N; 2],
    excess: N,
    /// The least and the largest reading.
    ends: [N; 2],
    /// Displacements within which readings are right.
    span: [N; 2],
    /// Repetitive parts, the range of their limits, and memories.
    learners: Vec<(SampledRepetitive, f64, RepetitiveState<Vec<f64>>)>,
}

impl<S: Simd, const V: usize> PidLanes<Lanes<S, V>> {
    /// The controllers at rest; none where one is of another kind, has filters or looks for jumps,
    /// or where reference or feedforward are beyond what all take as they are.
    pub fn new(
        zero: Lanes<S, V>,
        controllers: &[Controller<Law>],
        reference: &[f64],
        feedforward: &[f64],
    ) -> Result<Option<Self>> {
        let mut pids: Vec<SampledPid> = room("the controllers", controllers.len())?;
        let (wanted, added) = (ends(reference), ends(feedforward));
        for one in controllers {
            let (low, high) = (one.limits.low(), one.limits.high());
            let (least, most) = (low - (high - low), high + (high - low));
            let plain = one.filters == [None; 2]
                && one.span.max_jump().is_infinite()
                && wanted.iter().all(|end| one.span.may_ask_for(*end))
                && added.iter().all(|end| *end >= least && *end <= most)
                && one.repetitive.is_some() == controllers[0].repetitive.is_some();
            match one.feedback {
                Law::Pid(pid) if plain => pids.push(pid),
                _ => return Ok(None),
            }
        }
        let mut learners = Vec::new();
        for one in controllers {
            if let Some(part) = one.repetitive {
                let memory = part.rest(zeros(DELAY_LINE, part.length())?)?;
                learners.push((part, one.limits.high() - one.limits.low(), memory));
            }
        }
        // Lanes without a controller do as the last one.
        let last = controllers.len() - 1;
        let each = |of: &dyn Fn(usize) -> f64| zero.each(|lane| of(lane.min(last)));
        let weight = |k: usize| each(&|lane| pids[lane].weights()[k]);
        Ok(Some(Self {
            weights: [weight(0), weight(1), weight(2), each(&|lane| pids[lane].tracking())],
            low: each(&|lane| controllers[lane].limits.low()),
            high: each(&|lane| controllers[lane].limits.high()),
            first: Some(each(&|lane| {
                let [proportional, integral, _] = pids[lane].weights();
                if integral == 0.0 { proportional } else { f64::NAN }
            })),
            volts: zero,
            errors: [zero; 2],
            excess: zero,
            ends: [zero.like(f64::INFINITY), zero.like(f64::NEG_INFINITY)],
            span: [
                each(&|lane| controllers[lane].span.low()),
                each(&|lane| controllers[lane].span.high()),
            ],
            learners,
        }))
    }

    /// Voltages of the repetitive parts.
    #[inline(always)]
    fn repeated(&mut self) -> Lanes<S, V> {
        let mut found = self.volts.like(0.0);
        let before = self.errors[0].as_slice().iter().zip(self.excess.as_slice());
        let lanes = found.as_mut_slice().iter_mut().zip(before);
        for ((slot, (&error, &excess)), (part, range, memory)) in lanes.zip(&mut self.learners) {
            *slot = part.step(memory, Outcome { error, excess }, *range);
        }
        found
    }
}

impl<S: Simd, const V: usize> Bundled<Lanes<S, V>> for PidLanes<Lanes<S, V>> {
    #[inline(always)]
    fn step(
        &mut self,
        reference: f64,
        readings: Lanes<S, V>,
        feedforward: f64,
    ) -> [Lanes<S, V>; 2] {
        let repeated = self.repeated();
        let error = readings.like(reference) - readings;
        self.ends = [self.ends[0].smaller(readings), self.ends[1].larger(readings)];
        if let Some(first) = self.first.take() {
            self.errors = [error; 2];
            let (gains, errors) = (first.as_slice(), error.as_slice());
            self.volts = readings
                .each(|lane| if gains[lane].is_nan() { 0.0 } else { gains[lane] * errors[lane] });
        }
        let [before, last] = self.errors;
        let rise = error - before;
        let bend = rise - (before - last);
        let [proportional, integral, derivative, tracking] = self.weights;
        let change =
            proportional * rise + integral * error + derivative * bend + tracking * self.excess;
        self.volts = self.volts + change;
        self.errors = [error, before];
        let unclipped = self.volts + readings.like(feedforward) + repeated;
        let volts = unclipped.larger(self.low).smaller(self.high);
        self.excess = volts - unclipped;
        let beyond = self.excess.smaller(-self.excess);
        [volts, beyond.where_negative(readings.like(1.0), readings.like(0.0))]
    }

    /// Numbers that left their range stay so, as sums go on with them.
    fn holds(&self) -> bool {
        let lanes = |one: &Lanes<S, V>, test: &dyn Fn(f64) -> bool| {
            one.as_slice().iter().all(|value| test(*value))
        };
        lanes(&self.volts, &f64::is_finite)
            && lanes(&self.excess, &f64::is_finite)
            && !(self.ends[0] - self.span[0]).any_negative()
            && !(self.span[1] - self.ends[1]).any_negative()
    }
}

/// The least and the largest value; not a number where one is none.
fn ends(values: &[f64]) -> [f64; 2] {
    let start = [f64::INFINITY, f64::NEG_INFINITY];
    values.iter().fold(start, |[low, high], &value| {
        if value.is_nan() { [value; 2] } else { [low.smaller(value), high.larger(value)] }
    })
}
