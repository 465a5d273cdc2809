//! Closed loops a second, of 1000 samples each, as a search for gains simulates them.
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use piezotrack_control::{Controller, Limits, Pid, Repetitive, Smoothing};
use piezotrack_core::models::Model;
use piezotrack_core::parts::Law;
use piezotrack_core::signal::NEVER;
use piezotrack_core::simulate::{ReferenceSamples, Timing, VirtualStage};
use piezotrack_core::tune::{ErrorSignal, Task};

const SAMPLES: u32 = 1000;
const LOOPS: u32 = 512;

fn controllers(dt: f64, repeats: bool) -> Vec<Controller<Law>> {
    let limits = Limits::new(0.0, 75.0).unwrap();
    (0..LOOPS)
        .map(|i| {
            let kp = 0.02e6 + 50.0 * f64::from(i);
            let pid = Pid::new(kp, dt, 0.5 * dt, None).and_then(|pid| pid.at(dt));
            let mut one = Controller::new(limits, Law::Pid(pid.unwrap()));
            if repeats {
                let smoothing = Smoothing::ZeroPhase { order: 2 };
                let part = Repetitive::new(250.0 * dt, smoothing, 0.2);
                one.repetitive = Some(part.and_then(|part| part.at(dt)).unwrap());
            }
            one
        })
        .collect()
}

fn loops(c: &mut Criterion) {
    let published = VirtualStage::xu_li_2010(1);
    let dahl = Model::Dahl.build(&(Model::Dahl.info().published[0].1)()).unwrap();
    let mut dahl = VirtualStage::bare(dahl, 5e-5);
    dahl.sensor.noise = 20e-9;
    let mut group = c.benchmark_group("tuning loops");
    group.throughput(Throughput::Elements(u64::from(LOOPS)));
    let stages = [
        ("plays, amplifier", &published, 0.02),
        ("Dahl", &dahl, 0.02),
        ("Dahl, 1 kHz", &dahl, 1e-3),
    ];
    for (name, stage, dt) in stages {
        for repeats in [false, true] {
            let turn = std::f64::consts::TAU / 250.0;
            let reference: Vec<f64> =
                (0..SAMPLES).map(|k| 40e-6 * (1.0 - (turn * f64::from(k)).cos())).collect();
            let feedforward = vec![0.0; reference.len()];
            let samples = ReferenceSamples { reference: &reference, feedforward: &feedforward };
            let timing = Timing {
                interval: dt,
                samples: reference.len(),
                delay: 0.0,
                jitter: 0.0,
                substeps: 1,
            };
            let error = ErrorSignal::Measured;
            let task = Task {
                stage,
                voltages_before: &[],
                timing,
                samples,
                beside: &[],
                shown_at: 0.0,
                from: 250,
                error,
            };
            let task = task.ready().unwrap();
            let all = controllers(dt, repeats);
            let law = if repeats { "PID + repetitive" } else { "PID" };
            group.bench_function(format!("{name}, {law}"), |b| {
                b.iter(|| task.figures(black_box(&all), NEVER).unwrap());
            });
        }
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).measurement_time(Duration::from_secs(4));
    targets = loops
}
criterion_main!(benches);
