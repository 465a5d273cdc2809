//! Latency of one step: of a stage, which is what a simulation costs per sub-step, and of a
//! controller, which is what it costs per sample.
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use piezotrack_control::hysteresis::{BoucWen, Dahl};
use piezotrack_control::{
    Controller, DahlInverse, DisturbanceObserver, Feedback, HysteresisObserver,
    IntegralResonantControl, IterativeLearning, LeadLag, Limits, Pid, PositivePositionFeedback,
    PositiveVelocityPositionFeedback, Repetitive, ScheduledPid, SlidingMode, Smoothing, StateSpace,
};
use piezotrack_core::integrator::{FEW_TERMS, Substeps, TERMS};
use piezotrack_core::models::DahlStage;
use piezotrack_core::models::dahl::SmoothKernel;
use piezotrack_core::signal::{Drive, Hold, NEVER};

/// One step in each sampling interval.
const EACH: Substeps = Substeps::even(1);

fn latency(criterion: &mut Criterion) {
    let turn = core::f64::consts::TAU * 0.25 / 5000.0;
    let u: Vec<f64> = (0..5001).map(|k| 37.5 * (1.0 - (turn * f64::from(k)).cos())).collect();
    let drive = Drive::new(&u, 2e-4, Hold::First).unwrap();
    let stage = DahlStage::xu_li_2010();
    let mut group = criterion.benchmark_group("step_latency");
    group.throughput(Throughput::Elements(5000));
    let second = stage.lumped(SmoothKernel::<FEW_TERMS, false>);
    group.bench_function("one lane, Second order", |bencher| {
        bencher.iter(|| black_box(&second).simulate_fixed(&drive, second.rest(), EACH, NEVER));
    });
    let fourth = stage.lumped(SmoothKernel::<TERMS, true>);
    group.bench_function("one lane, Fourth order", |bencher| {
        bencher.iter(|| black_box(&fourth).simulate_fixed(&drive, fourth.rest(), EACH, NEVER));
    });
    group.finish();
}

/// Feedforward, PID with antiwindup and repetitive control with N = 250, 5000 samples a turn.
///
/// The measurement of a sample follows from the command before, as in a loop, so that steps
/// cannot overlap more than they could there.
fn controller(criterion: &mut Criterion) {
    let dt = 0.02;
    let turn = core::f64::consts::TAU * 0.2;
    let path: Vec<[f64; 3]> = (0..5000)
        .map(|k| {
            let (sin, cos) = (turn * dt * f64::from(k)).sin_cos();
            [55e-6 * (1.0 - cos), 55e-6 * turn * sin, 55e-6 * turn * turn * cos]
        })
        .collect();
    let inverse = DahlInverse::xu_li_2010().at(dt).unwrap();
    let mut controller =
        Controller::new(Limits::new(0.0, 75.0).unwrap(), Pid::xu_li_2010().at(dt).unwrap());
    let mut group = criterion.benchmark_group("step_latency");
    group.throughput(Throughput::Elements(5000));
    let settings = [
        ("lag", Smoothing::Lag { tq: 0.2, compensated: true }, 5.0),
        ("zero phase, fractional period", Smoothing::ZeroPhase { order: 4 }, 5.007),
    ];
    for (name, smoothing, period) in settings {
        let learner = Repetitive::new(period, smoothing, 1.0).unwrap().at(dt).unwrap();
        controller.repetitive = Some(learner);
        group.bench_function(format!("controller, {name}"), |bencher| {
            let mut forward = inverse.rest();
            let mut state = controller.rest([0.0; Repetitive::room(251)]).unwrap();
            let mut y = 0.0;
            bencher.iter(|| {
                for [x, v, a] in black_box(&path) {
                    let feedforward = inverse.step(&mut forward, *x, *v, *a);
                    y = 1.1e-6 * controller.step(&mut state, *x, y, feedforward).volts;
                }
                y
            });
        });
    }
    group.bench_function("inverse alone", |bencher| {
        let mut forward = inverse.rest();
        bencher.iter(|| {
            black_box(&path)
                .iter()
                .fold(0.0, |sum, [x, v, a]| sum + inverse.step(&mut forward, *x, *v, *a))
        });
    });
    group.finish();
}

/// The update of a table of 5000 samples between two periods: what a sample of it takes.
fn learning(criterion: &mut Criterion) {
    let taps = [1.0 / 65.0; 65];
    let gains = [1e4; 65];
    let limits = Limits::new(0.0, 75.0).unwrap();
    let rule = IterativeLearning::new(&gains, &taps, limits).unwrap();
    let error: Vec<f64> = (0..5000).map(|k| 1e-6 * f64::from(k % 7)).collect();
    let feedforward = vec![20.0; 5000];
    let mut table = feedforward.clone();
    let mut group = criterion.benchmark_group("step_latency");
    group.throughput(Throughput::Elements(5000));
    group.bench_function("iterative learning, 65 taps each", |bencher| {
        bencher.iter(|| rule.update(black_box(&mut table), &feedforward, &error).unwrap());
    });
    group.finish();
}

/// The whole step of a controller with one law, without inverse and repetitive part.
fn laws(criterion: &mut Criterion) {
    let dt = 0.02;
    let pid = Pid::xu_li_2010().at(dt).unwrap();
    let sliding = SlidingMode::new(5.0, 20e-6, 0.05, 0.01, 0.03).unwrap().at(dt).unwrap();
    let observer = DisturbanceObserver::new(1.1e-6, 0.05, 0.5).unwrap();
    let lead_lag: StateSpace<1> = LeadLag::new(1e5, 0.01, 0.1).unwrap().at(dt).unwrap();
    law(criterion, "PID", pid);
    law(criterion, "lead-lag", lead_lag);
    law(criterion, "sliding mode", sliding);
    law(criterion, "disturbance observer around a PID", observer.around(pid, dt).unwrap());
    law(criterion, "perturbation estimation", observer.around(sliding, dt).unwrap());
    let gains = [Pid::xu_li_2010(); 4];
    let scheduled = ScheduledPid::new(&[5e-6, 50e-6], &[0.1, 1.0], &gains, (20e-6, 0.3), dt);
    law(criterion, "scheduled PID", scheduled.unwrap());
    let dahl: Dahl<f64> = Dahl { a1: 122.0, a2: 1.18e6, gain: 1.2e9 };
    let observer = HysteresisObserver::new(dahl, 1.1e-6, 0.05, 0.1, 100e-6).unwrap();
    law(criterion, "observer of a Dahl hysteresis", observer.around(pid, dt).unwrap());
    let bouc_wen = BoucWen { rise: 0.36, beta: 0.036, gamma: 0.027, exponent: 1.0 };
    let observer = HysteresisObserver::new(bouc_wen, 1.1e-6, 0.05, 0.1, 100e-6).unwrap();
    law(criterion, "observer of a Bouc-Wen hysteresis", observer.around(pid, dt).unwrap());
    let resonant = IntegralResonantControl::new(1e7, 3e-6).unwrap();
    law(criterion, "integral resonant control", resonant.around(pid, dt).unwrap());
    let position = PositivePositionFeedback::new(0.2e6, 7.0, 0.6).unwrap();
    law(criterion, "positive position feedback", position.around(pid, dt).unwrap());
    let both = PositiveVelocityPositionFeedback::new(-0.1e6, 0.2e6, 9.0, 0.6).unwrap();
    law(criterion, "positive velocity and position feedback", both.around(pid, dt).unwrap());
}

fn law<F: Feedback>(criterion: &mut Criterion, name: &str, feedback: F) {
    let controller = Controller::new(Limits::new(0.0, 75.0).unwrap(), feedback);
    let path: Vec<f64> = (0..5000).map(|k| 30e-6 * (1.0 - (f64::from(k) * 0.025).cos())).collect();
    let mut group = criterion.benchmark_group("step_latency");
    group.throughput(Throughput::Elements(5000));
    group.bench_function(format!("law, {name}"), |bencher| {
        let mut state = controller.rest([]).unwrap();
        let mut y = 0.0;
        bencher.iter(|| {
            for x in black_box(&path) {
                y = 1.1e-6 * controller.step(&mut state, *x, y, *x / 1.2e-6).volts;
            }
            y
        });
    });
    group.finish();
}

criterion_group!(benches, latency, controller, learning, laws);
criterion_main!(benches);
