//! Closed loops of many controllers on one stage, in lanes.
//!
//! The plant and its amplifier go in lanes, a controller in each. Controllers with a PID go in lanes
//! too, with the bits of the code that firmware runs; others are stepped by that code. The noise of a
//! sensor depends on nothing that a controller does, so all lanes get the same.

use piezotrack_control::{
    Controller, ControllerState, Feedback, LanedCommand, Lockstep, Number, PidState, SampledPid,
    step_each,
};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::parts::{Part, coarse_step, parts};
use super::run_metrics::{RunMetrics, Score};
use crate::error::{Error, Result};
use crate::math::{Lanes, dispatch_vectors, on_all_threads, room, width, zeros};
use crate::models::{LanedPlant, LanedVisitor, StageState};
use crate::parts::{Law, LawState};
use crate::signal::{Stop, index};
use crate::simulate::{
    ApparatusState, DELAY_LINE, ReferenceSamples, Sensor, Timing, VirtualStage, closed_loop,
};

/// Which error counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorSignal {
    /// Reference less reading: what a person sees on hardware.
    Measured,
    /// Reference less true displacement, without noise and quantisation of the sensor.
    True,
}

/// A motion that controllers are judged by.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The stage, with its amplifier and sensor.
    pub stage: &'a VirtualStage,
    /// Voltages that it visits slowly before, V.
    pub voltages_before: &'a [f64],
    /// When the controllers look and act; the samples are those of the reference.
    pub timing: Timing,
    /// Reference and feedforward.
    pub samples: ReferenceSamples<'a>,
    /// Displacement that other axes add at each sample, m; empty for nothing.
    pub beside: &'a [f64],
    /// Part of the control interval at which its motion is shown to what judges it beside other axes,
    /// 0 to below 1; the figures of this axis are always of its samples.
    pub shown_at: f64,
    /// Samples before the first that counts.
    pub from: usize,
    /// Which error counts.
    pub error: ErrorSignal,
}

/// Instants of a control interval at which a loop by itself is shown.
const INSTANTS: usize = 20;

impl<'a> Task<'a> {
    /// Brings the stage to where the loops begin, and draws the noise of its sensor.
    ///
    /// # Errors
    /// Names delay or jitter of the timing; where memory does not suffice, or feedforward and
    /// reference differ in length.
    pub fn ready(&'a self) -> Result<ReadyTask<'a>> {
        self.timing.validate()?;
        let (found, expected) = (self.samples.feedforward.len(), self.samples.reference.len());
        if found != expected {
            return Err(Error::Shape {
                name: "feedforward".into(),
                found: format!("{found} samples"),
                expected: format!("{expected}, as many as the reference"),
            });
        }
        let found = self.beside.len();
        if found != 0 && found != expected {
            return Err(Error::Shape {
                name: "beside".into(),
                found: format!("{found} samples"),
                expected: format!("{expected}, as many as the reference, or none"),
            });
        }
        let start = self.stage.start_after(self.voltages_before);
        let noise = noises(self, &start)?;
        Ok(ReadyTask { task: self, start, noise })
    }

    /// Displacement that other axes add at sample `k`, m.
    #[inline(always)]
    fn beside(&self, k: usize) -> f64 {
        self.beside.get(k).copied().unwrap_or(0.0)
    }

    /// The loop of one controller.
    fn alone(
        &self,
        controller: &Controller<Law>,
        start: &ApparatusState<StageState>,
        stop: Stop<'_>,
    ) -> Result<Motion> {
        let ReferenceSamples { reference, feedforward } = self.samples;
        let substeps = if self.shown_at > 0.0 { INSTANTS } else { 1 };
        let timing = Timing { samples: reference.len(), substeps, ..self.timing };
        let length = controller.repetitive.map_or(0, |part| part.length());
        let mut state = controller.rest(zeros(DELAY_LINE, length)?)?;
        let mut commands = room("the commands", reference.len())?;
        let command = |k: usize, measured: f64| {
            let measured = measured + self.beside(k);
            let command = controller.step(&mut state, reference[k], measured, feedforward[k]);
            commands.push(command);
            command.volts
        };
        let stage =
            VirtualStage { step: coarse_step(self.stage, self.timing.interval), ..*self.stage };
        let apparatus = stage.apparatus();
        let run = match closed_loop(&apparatus, start.clone(), &timing, command, stop) {
            Ok(Some(run)) => run,
            // Also where the loop diverged.
            Ok(None) | Err(Error::Numerical(_)) => return Ok(Motion::failed()),
            Err(other) => return Err(other),
        };
        let mut score = Score::new(self.timing.interval, 0.0);
        let mut shown = room("the motion", commands.len())?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let later = libm::round(self.shown_at * index(substeps)) as usize;
        for (k, command) in commands.iter().enumerate() {
            let at = k * substeps;
            let own = run.displacement[at] + self.beside(k);
            // Of the last sample there is nothing later.
            let then = run.displacement.get(at + later).map_or(own, |then| then + self.beside(k));
            let noise = match self.error {
                ErrorSignal::Measured => run.measured[at] - run.displacement[at],
                ErrorSignal::True => 0.0,
            };
            let clipped = f64::from(u8::from(command.saturated));
            score.take(k >= self.from, reference[k] - own - noise, command.volts, clipped);
            shown.push(then + noise);
        }
        Ok(Motion { figures: score.figures(0), shown })
    }
}

/// A loop that was simulated.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    pub(super) figures: RunMetrics,
    /// Reading or true displacement, as is judged, in each control interval, m; empty where it
    /// failed, or was not asked for.
    pub(super) shown: Vec<f64>,
}

impl Motion {
    fn failed() -> Self {
        Self { figures: RunMetrics::FAILED, shown: Vec::new() }
    }
}

/// A task whose stage is where the loops begin.
#[derive(Clone, Debug)]
pub struct ReadyTask<'a> {
    task: &'a Task<'a>,
    start: ApparatusState<StageState>,
    /// Of each reading, m.
    noise: Vec<f64>,
}

impl ReadyTask<'_> {
    /// Metrics of each controller in its loop, in their order, computed on the threads of the present
    /// pool; the bits are the same for any number of them. Where `stop` said so,
    /// [`RunMetrics::FAILED`].
    ///
    /// With sampling jitter, and for a stage without lanes, each loop is simulated by itself.
    ///
    /// # Errors
    /// Those of [`crate::simulate::track`], and where memory does not suffice.
    pub fn figures(
        &self,
        controllers: &[Controller<Law>],
        stop: Stop<'_>,
    ) -> Result<Vec<RunMetrics>> {
        let motions = self.motions(controllers, false, stop)?;
        Ok(motions.into_iter().map(|motion| motion.figures).collect())
    }

    /// The same, where `shown` with what is judged at each sample.
    pub(super) fn motions(
        &self,
        controllers: &[Controller<Law>],
        shown: bool,
        stop: Stop<'_>,
    ) -> Result<Vec<Motion>> {
        let Self { task, start, noise } = self;
        if task.timing.jitter == 0.0 {
            let loops = Loops { task, start, noise, controllers, shown, stop };
            let voltages = task.stage.visits_before(task.voltages_before);
            if let Some(found) = task.stage.stage.in_lanes(&voltages, &start.plant, loops) {
                return found;
            }
        }
        controllers.par_iter().map(|controller| task.alone(controller, start, stop)).collect()
    }
}

/// Loops of one task, to be spread over threads and lanes.
struct Loops<'a> {
    task: &'a Task<'a>,
    start: &'a ApparatusState<StageState>,
    noise: &'a [f64],
    controllers: &'a [Controller<Law>],
    shown: bool,
    stop: Stop<'a>,
}

impl LanedVisitor for Loops<'_> {
    type Output = Result<Vec<Motion>>;

    fn visit<P: LanedPlant>(self, plant: P) -> Self::Output {
        let Self { task, start, noise, controllers, shown, stop } = self;
        let arch = Arch::new();
        let width = width(arch);
        let parts = parts(task.stage, &task.timing, task.shown_at, plant.longest());
        // Every thread gets a vector to fill before any gets a second one.
        let vectors = controllers.len().div_ceil(width);
        let most = if width > 1 { P::VECTORS } else { 1 };
        let each = vectors.div_ceil(rayon::current_num_threads()).clamp(1, most);
        let chunks: Vec<&[Controller<Law>]> = controllers.chunks(width * each).collect();
        let found: Result<Vec<Vec<Motion>>> = on_all_threads(&chunks, &|chunk: &&[_]| {
            let chunk = *chunk;
            let (plant, parts) = (&plant, &parts);
            let samples = if shown { noise.len() } else { 0 };
            let traces = (0..chunk.len()).map(|_| room("the motions", samples));
            let traces: Result<Vec<_>> = traces.collect();
            let loops = Chunk {
                task,
                start,
                plant,
                noise,
                parts,
                stepped: Stepped::new(chunk)?,
                traces: traces?,
                stop,
            };
            // Each is compiled for as many vectors as it gains by, and for no other number.
            if width == 1 {
                return Ok(Simd::vectorize(pulp::Scalar, Bundle::<P, 1>(loops)));
            }
            let found = if const { P::VECTORS > 1 } {
                dispatch_vectors(arch, Bundle::<P, VECTORS>(loops))
            } else {
                dispatch_vectors(arch, Bundle::<P, 1>(loops))
            };
            Ok(found.unwrap_or_default())
        })
        .into_iter()
        .collect();
        Ok(found?.concat())
    }
}

/// Noise of each reading, m.
fn noises(task: &Task<'_>, start: &ApparatusState<StageState>) -> Result<Vec<f64>> {
    let mut noise = room("the sensor's noise", task.samples.reference.len())?;
    let mut sensor = start.sensor;
    for k in 0..task.samples.reference.len() {
        let interval = if k == 0 { 0.0 } else { task.timing.interval };
        noise.push(task.stage.sensor.next_noise(&mut sensor, interval));
    }
    Ok(noise)
}

/// Controllers of a chunk, with their states.
enum Stepped<'a> {
    /// With a PID all of them, in lanes.
    Together(Vec<Controller<SampledPid>>, States<PidState>),
    /// One by one.
    Each(&'a [Controller<Law>], States<LawState>),
}

type States<S> = Vec<ControllerState<S, Vec<f64>>>;

impl<'a> Stepped<'a> {
    fn new(controllers: &'a [Controller<Law>]) -> Result<Self> {
        let pids: Option<Vec<_>> = controllers.iter().map(with_pid).collect();
        Ok(match pids {
            Some(pids) => {
                let states = rests(&pids)?;
                Self::Together(pids, states)
            }
            None => Self::Each(controllers, rests(controllers)?),
        })
    }
}

/// The controller as one of a PID, where it has one.
fn with_pid(one: &Controller<Law>) -> Option<Controller<SampledPid>> {
    let Controller { limits, span, ref feedback, repetitive, filters, follows } = *one;
    let Law::Pid(feedback) = *feedback else { return None };
    Some(Controller { limits, span, feedback, repetitive, filters, follows })
}

fn rests<F: Feedback>(controllers: &[Controller<F>]) -> Result<States<F::State>> {
    let rest = |one: &Controller<F>| {
        let length = one.repetitive.map_or(0, |part| part.length());
        Ok(one.rest(zeros(DELAY_LINE, length)?)?)
    };
    controllers.iter().map(rest).collect()
}

/// Loops that are simulated together.
struct Chunk<'a, P> {
    task: &'a Task<'a>,
    start: &'a ApparatusState<StageState>,
    plant: &'a P,
    noise: &'a [f64],
    parts: &'a (usize, Vec<Part>),
    stepped: Stepped<'a>,
    /// Room for what is judged at each sample, where that is asked for.
    traces: Vec<Vec<f64>>,
    stop: Stop<'a>,
}

/// Loops in `V` vectors of lanes.
struct Bundle<'a, P, const V: usize>(Chunk<'a, P>);

/// Samples between two questions whether to stop.
const POLL: usize = 1 << 12;

impl<P: LanedPlant, const V: usize> WithSimd for Bundle<'_, P, V> {
    type Output = Vec<Motion>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Motion> {
        let Chunk { task, start, plant, noise, parts, mut stepped, mut traces, stop } = self.0;
        let (stage, loops) = (task.stage, traces.len());
        let traced = traces.iter().any(|trace| trace.capacity() > 0);
        let (whole, parts) = parts;
        let zero = Lanes::<S, V>::splat(simd, 0.0);
        let flows: Vec<_> = parts
            .iter()
            .map(|part| (plant.flow(zero, part.step), stage.amplifier.flow(part.step), part))
            .collect();
        let eye = Eye { sensor: &stage.sensor, zero: start.sensor.zero, error: task.error };
        let mut line;
        let (mut together, mut each) = match stepped {
            Stepped::Together(ref pids, ref mut states) => {
                line = line_in_lanes(zero, pids);
                (Some(Lockstep::new(zero, pids, states, &mut line)), None)
            }
            Stepped::Each(laws, ref mut states) => (None, Some((laws, states))),
        };
        let mut state = plant.start(zero);
        let mut applied = zero.like(start.applied);
        let held = zero.like(start.command);
        // A ring, and the place of the newest in it.
        let (mut issued, mut newest) = (vec![held; whole + 2], 0);
        let mut score = Score::new(task.timing.interval, zero);
        let samples = task.samples.reference.iter().zip(task.samples.feedforward);
        for (k, ((&reference, &feedforward), &drawn)) in samples.zip(noise).enumerate() {
            if k % POLL == POLL - 1 && stop() {
                return vec![Motion::failed(); loops];
            }
            let beside = zero.like(task.beside(k));
            let x = plant.displacement(&state) + beside;
            let measured = eye.reading(x, drawn);
            let command = match (&mut together, &mut each) {
                (Some(all), _) => all.step(reference, measured, feedforward),
                (None, Some((laws, states))) => {
                    step_each(laws, states, reference, measured, feedforward)
                }
                (None, None) => LanedCommand { volts: held, saturated: zero },
            };
            let actual = eye.judged(measured, x);
            if traced && task.shown_at == 0.0 {
                show(&mut traces, actual.as_slice());
            }
            let error = zero.like(reference) - actual;
            score.take(k >= task.from, error, command.volts, command.saturated);
            newest = following(newest, whole + 2);
            issued[newest] = command.volts;
            let acted = following(newest, whole + 2);
            let acts = following(acted, whole + 2);
            for (flow, amplifier, part) in &flows {
                let command = issued[if part.newest { acts } else { acted }];
                let (low, high) = stage.amplifier.advance(amplifier, applied, command, command);
                plant.advance(flow, &mut state, low, high);
                applied = high;
                if traced && part.shown {
                    // Noise that no command has answered yet.
                    let drawn = noise.get(k + 1).copied().unwrap_or(drawn);
                    let x = plant.displacement(&state) + beside;
                    show(&mut traces, eye.judged(eye.reading(x, drawn), x).as_slice());
                }
            }
        }
        let motion = |(lane, shown)| Motion { figures: score.figures(lane), shown };
        traces.into_iter().enumerate().map(motion).collect()
    }
}

/// Longest delay line in lanes, in entries: of a longer one they are not faster.
const LONGEST_LINE: usize = 1 << 14;

/// A delay line in lanes for controllers that can have one; empty for others, and where there is no
/// memory for it, without which they step one by one.
fn line_in_lanes<N: Number<Lane = f64>>(zero: N, pids: &[Controller<SampledPid>]) -> Vec<N> {
    let entries = Lockstep::<N, Vec<f64>>::room(pids);
    if entries > LONGEST_LINE {
        return Vec::new();
    }
    let mut line = room(DELAY_LINE, entries).unwrap_or_default();
    let entries = line.capacity().min(entries);
    line.resize(entries, zero);
    line
}

/// The sensor as controllers and their judge see it.
struct Eye<'a> {
    sensor: &'a Sensor,
    /// Displacement that reads 0, m.
    zero: f64,
    error: ErrorSignal,
}

// Not closures, which are inlined by force only here.
impl Eye<'_> {
    #[inline(always)]
    fn reading<N: Number<Lane = f64>>(&self, x: N, noise: f64) -> N {
        self.sensor.quantised(x + x.like(noise)) - x.like(self.zero)
    }

    #[inline(always)]
    fn judged<N: Number<Lane = f64>>(&self, reading: N, x: N) -> N {
        match self.error {
            ErrorSignal::Measured => reading,
            ErrorSignal::True => x - x.like(self.zero),
        }
    }
}

/// The place after one in a ring.
#[inline(always)]
fn following(place: usize, length: usize) -> usize {
    if place + 1 < length { place + 1 } else { 0 }
}

/// Adds what is judged to the traces that have room for it: all, or none.
fn show(traces: &mut [Vec<f64>], judged: &[f64]) {
    for (trace, value) in traces.iter_mut().zip(judged) {
        if trace.len() < trace.capacity() {
            trace.push(*value);
        }
    }
}

/// Vectors of a bundle of several: steps of one hide how long those of the other take.
const VECTORS: usize = 2;
