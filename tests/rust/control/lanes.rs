//! Loops whose controllers go in lanes beside loops whose controllers are stepped by themselves.
#![allow(missing_docs, clippy::unwrap_used)]

use super::tune;
use piezotrack_control::{Controller, Filter, Limits, Pid, Repetitive, Smoothing, Span};
use piezotrack_core::models::Model;
use piezotrack_core::parts::Law;
use piezotrack_core::signal::NEVER;
use piezotrack_core::simulate::{ReferenceSamples, Timing, VirtualStage};
use piezotrack_core::tune::{ErrorSignal, ReadyTask, RunMetrics, Task};

const SAMPLES: u32 = 400;
const PERIOD: f64 = 60.0;

/// The stages of the bench, with their sampling intervals, and one whose sensor rounds and whose
/// range is short.
fn stages() -> Vec<(VirtualStage, f64)> {
    let dahl = || Model::Dahl.build(&(Model::Dahl.info().published[0].1)()).unwrap();
    let mut noisy = VirtualStage::bare(dahl(), 5e-5);
    noisy.sensor.noise = 20e-9;
    let mut coarse = VirtualStage::bare(dahl(), 5e-5);
    (coarse.sensor.resolution, coarse.sensor.range) = (50e-9, 70e-6);
    let published = VirtualStage::xu_li_2010(1);
    vec![(published, 0.02), (noisy, 0.02), (noisy, 1e-3), (coarse, 1e-3)]
}

/// Gains from weak to unstable; without back-calculation where that is left out.
fn gains(i: u32, dt: f64, unwinds: bool) -> Controller<Law> {
    let kp = 0.02e6 * 1.3_f64.powf(f64::from(i));
    let tt = if unwinds { None } else { Some(f64::INFINITY) };
    let pid = Pid::new(kp, 1.5 * dt, if i.is_multiple_of(2) { 0.5 * dt } else { 0.0 }, tt).unwrap();
    Controller::new(Limits::new(0.0, 75.0).unwrap(), Law::Pid(pid.at(dt).unwrap()))
}

fn learner(dt: f64, order: u32, kq: f64) -> Repetitive {
    Repetitive::new(PERIOD * dt, Smoothing::ZeroPhase { order }, kq).unwrap()
}

/// Controllers of several kinds, by name; each list fills more than a bundle.
fn lists(dt: f64) -> Vec<(&'static str, Vec<Controller<Law>>)> {
    let all = |change: &dyn Fn(u32, &mut Controller<Law>)| -> Vec<Controller<Law>> {
        let one = |i| {
            let mut one = gains(i, dt, i % 5 > 0);
            change(i, &mut one);
            one
        };
        (0..19).map(one).collect()
    };
    let low_pass = Filter::low_pass(0.1 / dt, dt).unwrap();
    let notch = Filter::notch(0.2 / dt, 0.5, 0.1, dt).unwrap();
    let kq = |i: u32| 0.1 + 0.05 * f64::from(i);
    vec![
        ("PID", all(&|_, _| ())),
        ("clipped", all(&|_, one| one.limits = Limits::new(5.0, 35.0).unwrap())),
        (
            "limits of each",
            all(&|i, one| one.limits = Limits::new(0.0, 30.0 + f64::from(i)).unwrap()),
        ),
        ("filters", all(&|_, one| one.filters = [Some(low_pass), Some(notch)])),
        (
            "some filters",
            all(&|i, one| {
                one.filters =
                    [i.is_multiple_of(3).then_some(notch), i.is_multiple_of(2).then_some(low_pass)];
            }),
        ),
        ("readings refused", all(&|_, one| one.span = Span::new(-5e-6, 60e-6).unwrap())),
        (
            "jumps refused",
            all(&|i, one| {
                if i == 3 {
                    one.span = one.span.with_max_jump(2e-6).unwrap();
                }
            }),
        ),
        ("repetitive", all(&|i, one| one.repetitive = learner(dt, 2, kq(i)).at(dt).ok())),
        (
            "repetitive, clipped",
            all(&|i, one| {
                one.limits = Limits::new(0.0, 52.0 - f64::from(i)).unwrap();
                one.repetitive = learner(dt, 2, kq(i)).at(dt).ok();
            }),
        ),
        (
            "repetitive without pause, clipped",
            all(&|i, one| {
                one.limits = Limits::new(0.0, 45.0).unwrap();
                let part = Repetitive { pause: false, lead: 1, ..learner(dt, 1, kq(i)) };
                one.repetitive = part.at(dt).ok();
            }),
        ),
        (
            "lag",
            all(&|i, one| {
                let smoothing = Smoothing::Lag { tq: 3.3 * dt, compensated: true };
                let part = Repetitive::new((PERIOD + 0.3) * dt, smoothing, kq(i)).unwrap();
                one.repetitive = part.at(dt).ok();
            }),
        ),
        (
            "repetitive, several shapes",
            all(&|i, one| {
                let part = Repetitive { lead: i % 3, ..learner(dt, 1 + i % 4, kq(i)) };
                one.repetitive = (i % 5 > 0).then(|| part.at(dt).unwrap());
                one.filters[0] = Some(low_pass);
            }),
        ),
    ]
}

fn bits(figures: &RunMetrics) -> [u64; 5] {
    let RunMetrics { rms, largest, effort, slew, clipped } = *figures;
    [rms, largest, effort, slew, clipped].map(f64::to_bits)
}

/// Figures of a controller that is stepped by itself: in a bundle with one that has no lanes.
fn stepped_alone(task: &ReadyTask<'_>, controller: &Controller<Law>) -> RunMetrics {
    let other = Controller::new(controller.limits, Law::None);
    task.figures(&[*controller, other], NEVER).unwrap()[0]
}

/// Largest share of clipped samples among the figures.
fn agree(task: &Task<'_>, all: &[Controller<Law>], place: &str) -> f64 {
    let task = task.ready().unwrap();
    let found = task.figures(all, NEVER).unwrap();
    for (i, (controller, figures)) in all.iter().zip(&found).enumerate() {
        let expected = stepped_alone(&task, controller);
        assert_eq!(bits(figures), bits(&expected), "{place}, {i}: {figures:?} {expected:?}");
        let single = task.figures(&all[i..=i], NEVER).unwrap()[0];
        assert_eq!(bits(&single), bits(&expected), "{place}, {i} alone: {single:?}");
    }
    found.iter().fold(0.0, |most, figures| figures.clipped.max(most))
}

fn task<'a>(stage: &'a VirtualStage, dt: f64, samples: ReferenceSamples<'a>) -> Task<'a> {
    let plain = tune::task(stage, samples, 0.0);
    Task { timing: Timing { interval: dt, ..plain.timing }, from: 50, ..plain }
}

fn wave() -> Vec<f64> {
    let turn = std::f64::consts::TAU / PERIOD;
    (0..SAMPLES).map(|k| 30e-6 * (1.0 - libm::cos(turn * f64::from(k)))).collect()
}

#[test]
fn every_kind_of_controller_has_the_same_bits_in_lanes_and_by_itself() {
    let (reference, feedforward) = (wave(), vec![0.0; SAMPLES as usize]);
    let samples = ReferenceSamples { reference: &reference, feedforward: &feedforward };
    let mut clipped = 0.0_f64;
    for (i, (stage, dt)) in stages().iter().enumerate() {
        for (name, all) in lists(*dt) {
            let share = agree(&task(stage, *dt, samples), &all, &format!("{name}, stage {i}"));
            if name.ends_with("clipped") {
                assert!(share > 0.1, "{name}, stage {i}: {share}");
            }
            clipped = clipped.max(share);
        }
    }
    assert!(clipped > 0.5, "{clipped}");
}

#[test]
fn every_kind_of_task_gives_the_same_bits_in_lanes_and_by_itself() {
    let (reference, feedforward) = (wave(), vec![0.0; SAMPLES as usize]);
    let beside: Vec<f64> = reference.iter().map(|x| 0.02 * x).collect();
    let samples = ReferenceSamples { reference: &reference, feedforward: &feedforward };
    for (i, (stage, dt)) in stages().iter().enumerate() {
        let plain = task(stage, *dt, samples);
        let later = |delay: f64| Timing { delay: delay * dt, ..plain.timing };
        let tasks = [
            ("true error", Task { error: ErrorSignal::True, ..plain }),
            ("delay between samples", Task { timing: later(0.4), ..plain }),
            ("delay of more than a sample", Task { timing: later(1.3), ..plain }),
            ("shown between samples", Task { shown_at: 0.3, ..plain }),
            ("beside another axis", Task { beside: &beside, shown_at: 0.6, ..plain }),
            ("after a voltage", Task { voltages_before: &[40.0], ..plain }),
        ];
        for (name, task) in tasks {
            for (kind, all) in lists(*dt) {
                if ["PID", "some filters", "repetitive, clipped"].contains(&kind) {
                    agree(&task, &all, &format!("{name}, {kind}, stage {i}"));
                }
            }
        }
    }
}

/// References and feedforward that no controller accepts, or only some.
#[test]
fn what_no_controller_accepts_gives_the_same_bits_in_lanes_and_by_itself() {
    let (mut reference, mut feedforward) = (wave(), vec![0.0; SAMPLES as usize]);
    (reference[90], reference[91], reference[170]) = (f64::NAN, f64::INFINITY, 5e-3);
    (feedforward[120], feedforward[121], feedforward[200]) = (f64::NAN, 1e99, 120.0);
    let samples = ReferenceSamples { reference: &reference, feedforward: &feedforward };
    for (i, (stage, dt)) in stages().iter().enumerate() {
        // What counts comes after the samples whose error is no number.
        let task = Task { from: 230, ..task(stage, *dt, samples) };
        for (name, all) in lists(*dt) {
            agree(&task, &all, &format!("{name}, stage {i}"));
        }
    }
}
