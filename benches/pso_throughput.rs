//! Throughput of a swarm's evaluation: time for one particle over one sample.
//!
//! The signal is the paper's, 4 s of 0.25 Hz at 5 kHz, and the box that of its section 3.3.
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use piezotrack_core::identify::{Evaluator, Guess, Problem, Record, Spec};
use piezotrack_core::integrate::{Drive, Hold, Method, NEVER, simulate};
use piezotrack_core::stage::{DahlStage, StageState};

const RATE: f64 = 5000.0;

fn drive(samples: u32) -> Vec<f64> {
    let turn = core::f64::consts::TAU * 0.25 / RATE;
    (0..samples).map(|k| 37.5 * (1.0 - (turn * f64::from(k)).cos())).collect()
}

fn paper_spec() -> Spec {
    let named = |pairs: &[(&str, f64)]| pairs.iter().map(|&(n, v)| (n.into(), v)).collect();
    Spec {
        fixed: named(&[("a1", 121.9874), ("a2", 1.1773e6), ("b1", 1.8485e6)]),
        bounds: vec![
            ("mass".into(), (0.1, 0.2)),
            ("damping".into(), (1e3, 5e3)),
            ("stiffness".into(), (1e4, 5e4)),
            ("piezo_coefficient".into(), (0.01, 0.1)),
        ],
        ..Spec::default()
    }
}

fn throughput(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("pso_throughput");
    for samples in [2_001_u32, 20_001] {
        let u = drive(samples);
        let held = Drive::new(&u, 1.0 / RATE, Hold::First).unwrap();
        let stage = DahlStage::xu_li_2010();
        let y = simulate(&stage, &held, StageState::default(), Method::Exponential, 1e-10, NEVER)
            .unwrap()
            .unwrap()
            .x;
        let record = Record::new(&u, &y, 1.0 / RATE, Hold::First, 0).unwrap();
        let problem = Problem::new(&record, &paper_spec()).unwrap();
        let evaluator = Evaluator::new(&record, &problem, NEVER);
        for particles in [1_u32, 8, 10, 64, 96] {
            let guesses: Vec<_> = (0..particles)
                .map(|i| problem.theta(&[f64::from(i) / f64::from(particles); 4]))
                .map(|theta| Guess { theta, limit: f64::INFINITY })
                .collect();
            group.throughput(Throughput::Elements(u64::from(particles) * u64::from(samples)));
            for threads in [1_usize, 2] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let name = format!("{particles} particles, {threads} threads");
                group.bench_function(BenchmarkId::new(name, samples), |bencher| {
                    bencher.iter(|| pool.install(|| evaluator.costs(black_box(&guesses), NEVER)));
                });
            }
        }
    }
    group.finish();
}

criterion_group!(benches, throughput);
criterion_main!(benches);
