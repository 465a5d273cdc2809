//! Throughput of a swarm's evaluation: particle-samples per second.
//!
//! The signal is the paper's, 4 s of 0.25 Hz at 5 kHz, and the box that of its section 3.3.
//! Everything that a ratio is made of runs here, in one process.
#![allow(missing_docs, clippy::unwrap_used)]

mod paper;

use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use paper::{Peak, RATE, SAMPLES, Width, candidates, drive, paper_spec};
use piezotrack_core::identify::{
    Candidate, Evaluator, Problem, Progress, Record, Records, SwarmSettings, search,
};
use piezotrack_core::integrator::{Order, Stepping, Substeps};
use piezotrack_core::models::{DahlStage, Experiment, StageModel};
use piezotrack_core::signal::{Drive, Hold, NEVER};
use pulp::Arch;

fn instruction_sets() -> Vec<(&'static str, Arch)> {
    let mut sets = vec![("scalar", Arch::Scalar)];
    #[cfg(target_arch = "x86_64")]
    {
        sets.extend(pulp::x86::V3::try_new().map(|v| ("AVX2", Arch::V3(v))));
        sets.extend(pulp::x86::V4::try_new().map(|v| ("AVX-512", Arch::V4(v))));
    }
    sets
}

fn costs(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    evaluator: &Evaluator<'_>,
    candidates: &[Candidate],
    threads: usize,
) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let samples = candidates.len() as u64 * u64::from(SAMPLES);
    group.throughput(Throughput::Elements(samples));
    group.bench_function(name, |bencher| {
        bencher.iter(|| pool.install(|| evaluator.costs(black_box(candidates), NEVER)));
    });
}

fn throughput(criterion: &mut Criterion) {
    let u = drive();
    let held = Drive::new(&u, 1.0 / RATE, Hold::First).unwrap();
    let stage = DahlStage::xu_li_2010();
    let y = stage.simulate(&Experiment::of(&held, NEVER)).unwrap().unwrap().x;
    let record = Record::new(&u, &y, 1.0 / RATE, Hold::First, 0).unwrap();
    let problem = Problem::new(&record, &paper_spec(), NEVER).unwrap();
    let evaluator = || Evaluator::new(&record, &problem, NEVER);
    assert_eq!(
        evaluator().stepping,
        Stepping { order: Order::Second, substeps: Substeps::even(1) }
    );

    let mut group = criterion.benchmark_group("particles and threads");
    for particles in [1, 8, 10, 64, 96] {
        for threads in [1, 2] {
            let name = format!("{particles} particles, {threads} threads");
            costs(&mut group, &name, &evaluator(), &candidates(&problem, particles), threads);
        }
    }
    group.finish();

    // A step of all particles together: the time is that of 20 001 steps.
    let mut group = criterion.benchmark_group("10 particles, instruction sets and threads");
    for (name, arch) in instruction_sets().into_iter().skip(1) {
        for threads in [1, 2] {
            let ten = candidates(&problem, 10);
            costs(
                &mut group,
                &format!("{name}, {threads} threads"),
                &evaluator().on(arch),
                &ten,
                threads,
            );
        }
    }
    group.finish();

    let mut group = criterion.benchmark_group("instruction sets, one thread");
    for (name, arch) in instruction_sets() {
        let second = evaluator().on(arch);
        let mut fourth = evaluator().on(arch);
        fourth.stepping.order = Order::Fourth;
        let full = candidates(&problem, 96);
        costs(&mut group, &format!("{name}, second order"), &second, &full, 1);
        costs(&mut group, &format!("{name}, fourth order"), &fourth, &full, 1);
        group.throughput(Throughput::Elements(Peak::COUNT * arch.dispatch(Width)));
        group.bench_function(format!("{name}, multiply-adds, peak"), |bencher| {
            bencher.iter(|| arch.dispatch(Peak(black_box(0.5))));
        });
    }
    group.throughput(Throughput::Elements(u64::from(SAMPLES)));
    group.bench_function("plain RK4, 4 steps a sample", |bencher| {
        bencher.iter(|| plain_rk4(black_box(&stage), &u, 1.0 / RATE));
    });
    group.finish();

    let mut group = criterion.benchmark_group("whole searches of 2000 iterations");
    group.sample_size(10);
    let settings = SwarmSettings { stall_iterations: 100_000, ..SwarmSettings::xu_li_2010() };
    for runs in [1, 32] {
        group.bench_function(format!("the paper's, {runs} at once, 2 threads"), |bencher| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
            bencher.iter(|| {
                let mut quiet = |_: &Progress| core::ops::ControlFlow::Continue(());
                pool.install(|| {
                    search(&Records::one(evaluator()), &settings, 1, runs, &mut quiet, NEVER)
                })
            });
        });
    }
    group.finish();
}

/// RK4 on x, x', q1, q2 as one would write it, with the four steps that the box needs.
fn plain_rk4(stage: &DahlStage, u: &[f64], dt: f64) -> f64 {
    let m = stage.mechanics;
    let slope = |s: [f64; 4], u: f64| {
        let [x, v, q1, q2] = s;
        let force = stage.piezo_coefficient * u - stage.b1 * q1 - m.damping * v - m.stiffness * x;
        let bend = stage.up - stage.a2 * q1 - v.signum() * stage.a1 * q2;
        [v, force / m.mass, q2 * v, bend * v]
    };
    let add = |s: [f64; 4], k: [f64; 4], h: f64| core::array::from_fn(|i| s[i] + h * k[i]);
    let h = dt / 4.0;
    let (mut s, mut squares) = ([0.0; 4], 0.0);
    for pair in u.windows(2) {
        for j in 0..4 {
            let at = |c: f64| pair[0] + (pair[1] - pair[0]) * (f64::from(j) + c) / 4.0;
            let k1 = slope(s, at(0.0));
            let k2 = slope(add(s, k1, h / 2.0), at(0.5));
            let k3 = slope(add(s, k2, h / 2.0), at(0.5));
            let k4 = slope(add(s, k3, h), at(1.0));
            s = core::array::from_fn(|i| {
                s[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
            });
        }
        squares += s[0] * s[0];
    }
    squares
}

criterion_group!(benches, throughput);
criterion_main!(benches);
