//! Sub-steps of a search: chosen once, from the bounds, the sampling rate and the drive.

use rayon::prelude::*;

use super::motion::motion;
use crate::identify::parameters::candidate::{DELAY, Theta};
use crate::identify::problem::Problem;
use crate::identify::records::history::History;
use crate::identify::records::record::Record;
use crate::integrator::{Mechanics, Order, Stepping, Substeps, first_substeps, steps_for};
use crate::models::Model;
use crate::signal::{Drive, Stop, index, range};

/// Accuracy that a search asks of its simulations, m.
const ACCURACY: f64 = 2e-10;

/// The same as a share of the stroke, where that is more: of what moves by millimetres.
const SHARE: f64 = 2e-6;

/// Most sub-steps that a search takes in one sampling interval.
const MOST: usize = 256;

/// Steps of second order that cost what one of fourth order does.
const WORTH: usize = 2;

/// Change of the drive over an interval beyond which it jumps, in root mean squares of all changes.
const JUMP: f64 = 4.0;

/// The cheapest stepping with which the stages at the corners of the box and in its middle are
/// accurate to 0.2 nm, or to two millionths of the stroke.
///
/// A stage that goes more than twice the measured stroke is left out, and so is one that no
/// sub-steps make accurate: such a candidate costs more than any stage worth finding, however
/// exactly it is computed.
pub(in crate::identify) fn choose(
    record: &Record<'_>,
    problem: &Problem,
    stop: Stop<'_>,
) -> Stepping {
    let excerpts = excerpts(&record.drive);
    let stroke = 2.0 * record.stroke();
    let accuracy = ACCURACY.max(SHARE * record.stroke());
    let thetas = representatives(problem);
    let jump = jump(&record.drive);
    let trials: Vec<(Trial<'_>, Substeps)> = thetas
        .par_iter()
        .flat_map_iter(|theta| excerpts.iter().map(move |drive| (theta, drive)))
        .filter_map(|(theta, drive)| {
            let trial = Trial { model: problem.model, theta, drive, jump, accuracy, stop };
            let (substeps, x) = trial.steps(Order::Fourth, MOST)?;
            let (low, high) = range(&x);
            (high - low <= stroke).then_some((trial, substeps))
        })
        .collect();
    let fourth = most(trials.iter().map(|trial| trial.1));
    if problem.model.has_second_order(&problem.held()) {
        let second: Option<Vec<Substeps>> = trials
            .par_iter()
            .map(|(trial, _)| Some(trial.steps(Order::Second, WORTH * fourth.at_jumps)?.0))
            .collect();
        let second = second.map(|steps| most(steps.into_iter()));
        let worth = second.filter(|steps| {
            steps.usual <= WORTH * fourth.usual && steps.at_jumps <= WORTH * fourth.at_jumps
        });
        if let Some(substeps) = worth {
            return Stepping { order: Order::Second, substeps };
        }
    }
    Stepping { order: Order::Fourth, substeps: fourth }
}

/// Change of a drive over an interval beyond which it jumps, V; infinite where it never does.
fn jump(drive: &Drive<'_>) -> f64 {
    let changes = || (1..drive.u.len()).map(|k| drive.interval(k - 1).1.abs());
    let mean = changes().map(|change| change * change).sum::<f64>() / index(drive.u.len());
    let jump = JUMP * mean.sqrt();
    if changes().any(|change| change > jump) { jump } else { f64::INFINITY }
}

/// The steps with which all that need some of these are accurate; one where none does.
fn most(all: impl Iterator<Item = Substeps>) -> Substeps {
    all.fold(Substeps::even(1), |most, one| Substeps {
        usual: most.usual.max(one.usual),
        at_jumps: most.at_jumps.max(one.at_jumps),
        jump: most.jump.min(one.jump),
    })
}

/// A candidate on a part of the drive.
#[derive(Clone, Copy)]
struct Trial<'a> {
    model: Model,
    theta: &'a Theta,
    drive: &'a Drive<'a>,
    /// Change of the whole drive beyond which it jumps, V.
    jump: f64,
    accuracy: f64,
    stop: Stop<'a>,
}

impl Trial<'_> {
    /// The sub-steps that make it accurate, and the displacement with them.
    fn steps(&self, order: Order, most: usize) -> Option<(Substeps, Vec<f64>)> {
        let &Self { model, theta, drive, jump, accuracy, stop } = self;
        let [mass, damping, stiffness, ..] = theta.parameters();
        let first = first_substeps(&Mechanics { mass, damping, stiffness }, drive.dt);
        let run = |substeps| {
            let stepping = Stepping { order, substeps };
            let [x, _] = motion(model, History::Virgin, theta, drive, stepping, stop)?;
            Some(x)
        };
        // Those of the few intervals with a jump first: they may need far more than all others.
        let jumping = |usual, at_jumps| Substeps { usual, at_jumps, jump };
        let at_jumps = if jump.is_finite() {
            steps_for(first, accuracy, most, |count| run(jumping(first, count)))?.0
        } else {
            first
        };
        let several = |usual| {
            if usual < at_jumps { jumping(usual, at_jumps) } else { Substeps::even(usual) }
        };
        let (usual, x) = steps_for(first, accuracy, most, |usual| run(several(usual)))?;
        Some((several(usual), x))
    }
}

/// The candidates that have to be accurate: where the force has kinks, or the record shows no mode,
/// the middle of the box.
fn representatives(problem: &Problem) -> Vec<Theta> {
    let all = corners(problem);
    // Without a mode too: at the least lag beside a soft spring, where no stage is, the hysteresis
    // is stiffer than what holds it, and asks for hundreds of steps.
    let held = problem.slow || problem.mass_if_shown.is_some();
    let middle = problem.model.is_nonsmooth() || held;
    if middle { all.last().copied().into_iter().collect() } else { all }
}

/// The corners of the box of free parameters, and its middle.
pub(in crate::identify) fn corners(problem: &Problem) -> Vec<Theta> {
    let count = problem.free().count();
    // What a record has of its own does not move the stage.
    let moving = problem.free().filter(|&parameter| parameter < DELAY).count();
    let corner = |bits: usize| {
        let end = |d: usize| if d < moving { f64::from(u8::from(bits >> d & 1 == 1)) } else { 0.5 };
        (0..count).map(end).collect()
    };
    let mut places: Vec<Vec<f64>> = (0..1_usize << moving).map(corner).collect();
    places.push(vec![0.5; count]);
    // Ties may leave corners without a stage, never the middle.
    let all = places.iter().map(|place| problem.theta(place));
    all.filter(|theta| theta.parameters().iter().all(|value| !value.is_nan())).collect()
}

/// Parts of a long drive that ask most of the integrator: its beginning, and its steepest part.
fn excerpts<'a>(drive: &Drive<'a>) -> Vec<Drive<'a>> {
    const LENGTH: usize = 2048;
    if drive.u.len() <= 2 * LENGTH {
        return vec![*drive];
    }
    let steepest = drive
        .u
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .enumerate()
        .fold((0, 0.0), |most, now| if now.1 > most.1 { now } else { most })
        .0;
    let start = steepest.saturating_sub(LENGTH / 2).min(drive.u.len() - LENGTH);
    [0, start].map(|from| Drive { u: &drive.u[from..from + LENGTH], ..*drive }).to_vec()
}
