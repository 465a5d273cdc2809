//! Latency of one step of one stage: what a simulation costs per sub-step.
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use piezotrack_core::integrate::{Drive, Hold, NEVER, simulate_fixed};
use piezotrack_core::march::{Order, Stepping};
use piezotrack_core::stage::{DahlStage, StageState};

fn latency(criterion: &mut Criterion) {
    let turn = core::f64::consts::TAU * 0.25 / 5000.0;
    let u: Vec<f64> = (0..5001).map(|k| 37.5 * (1.0 - (turn * f64::from(k)).cos())).collect();
    let drive = Drive::new(&u, 2e-4, Hold::First).unwrap();
    let stage = DahlStage::xu_li_2010();
    let mut group = criterion.benchmark_group("step_latency");
    group.throughput(Throughput::Elements(5000));
    for order in [Order::Second, Order::Fourth] {
        let stepping = Stepping { order, substeps: 1 };
        group.bench_function(format!("one lane, {order:?} order"), |bencher| {
            bencher.iter(|| {
                simulate_fixed(black_box(&stage), &drive, StageState::default(), stepping, NEVER)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, latency);
criterion_main!(benches);
