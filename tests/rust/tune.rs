//! Loops in lanes against loops simulated one by one.
#![allow(missing_docs, clippy::unwrap_used)]

use piezotrack_control::{Controller, Filter, Limits, Pid, Repetitive, Smoothing};
use piezotrack_core::models::Model;
use piezotrack_core::signal::NEVER;
use piezotrack_core::simulate::{Law, ReferenceSamples, Timing, VirtualStage, track};
use piezotrack_core::tune::{Figures, Judged, Task};

const DT: f64 = 0.02;

fn reference(samples: u32) -> Vec<f64> {
    let at = |k: u32| 50e-6 * (1.0 - libm::cos(std::f64::consts::TAU * 0.2 * DT * f64::from(k)));
    (0..samples).map(at).collect()
}

fn controllers(count: u32) -> Vec<Controller<Law>> {
    let limits = Limits::new(0.0, 75.0).unwrap();
    (0..count)
        .map(|i| {
            let kp = 0.02e6 + 0.01e6 * f64::from(i);
            let pid = Pid::new(kp, 0.02, 0.01, None).unwrap().at(DT).unwrap();
            let mut one = Controller::new(limits, Law::Pid(pid));
            if i % 3 == 1 {
                one.filters[0] = Some(Filter::low_pass(10.0, DT).unwrap());
            }
            if i % 3 == 2 {
                let part = Repetitive::new(5.0, Smoothing::ZeroPhase { order: 2 }, 0.2).unwrap();
                one.repetitive = Some(part.at(DT).unwrap());
            }
            one
        })
        .collect()
}

fn task<'a>(stage: &'a VirtualStage, samples: ReferenceSamples<'a>, delay: f64) -> Task<'a> {
    let timing =
        Timing { interval: DT, samples: samples.reference.len(), delay, jitter: 0.0, substeps: 1 };
    Task { stage, visited: &[], timing, samples, from: 250, judged: Judged::Measured }
}

/// Largest and rms error of a loop that is simulated by itself, in fine steps.
fn alone(task: &Task<'_>, controller: &Controller<Law>) -> (f64, f64) {
    let start = task.stage.start_after(task.visited);
    let apparatus = task.stage.apparatus();
    let run = track(&apparatus, start, &task.timing, controller, task.samples, NEVER);
    let run = run.unwrap().unwrap();
    let pairs = run.motion.measured.iter().zip(task.samples.reference);
    let errors = pairs.skip(task.from).map(|(y, r)| (r - y).abs());
    let rms =
        libm::sqrt(errors.clone().map(|e| e * e).sum::<f64>() / errors.clone().count() as f64);
    (errors.fold(0.0, f64::max), rms)
}

fn agrees(stage: &VirtualStage, delay: f64, tolerance: f64) {
    let reference = reference(750);
    let feedforward = vec![0.0; 750];
    let samples = ReferenceSamples { reference: &reference, feedforward: &feedforward };
    let task = task(stage, samples, delay);
    let all = controllers(11);
    let found = task.figures(&all, NEVER).unwrap();
    for (i, (controller, figures)) in all.iter().zip(&found).enumerate() {
        let (largest, rms) = alone(&task, controller);
        let near = |a: f64, b: f64| (a - b).abs() < tolerance * b;
        let Figures { rms: in_lanes, largest: widest, .. } = *figures;
        assert!(near(in_lanes, rms), "{i}: {in_lanes:e} in lanes, {rms:e} alone");
        assert!(near(widest, largest), "{i}: {widest:e} in lanes, {largest:e} alone");
    }
}

#[test]
fn loops_on_the_published_stage_are_those_simulated_one_by_one() {
    agrees(&VirtualStage::xu_li_2010(1), 0.0, 0.02);
    agrees(&VirtualStage::xu_li_2010(1), 0.7e-3, 0.02);
}

#[test]
fn loops_of_every_model_are_those_simulated_one_by_one() {
    for model in [Model::Dahl, Model::BoucWen] {
        let stage = model.build(&(model.info().published[0].1)()).unwrap();
        let mut stage = VirtualStage::bare(stage, 5e-5);
        stage.sensor.noise = 20e-9;
        agrees(&stage, 0.0, 0.02);
        agrees(&stage, 31e-3, 0.02);
    }
}

#[test]
fn the_bits_do_not_depend_on_the_threads_or_the_neighbours() {
    let stage = VirtualStage::xu_li_2010(3);
    let reference = reference(300);
    let feedforward = vec![0.0; 300];
    let samples = ReferenceSamples { reference: &reference, feedforward: &feedforward };
    let task = Task { from: 10, ..task(&stage, samples, 1e-3) };
    let all = controllers(19);
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let one = pool(1).install(|| task.figures(&all, NEVER)).unwrap();
    let three = pool(3).install(|| task.figures(&all, NEVER)).unwrap();
    assert_eq!(one, three);
    let single = task.figures(&all[7..8], NEVER).unwrap();
    assert_eq!(single[0], one[7]);
}
