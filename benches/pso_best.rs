//! The best of many runs: what the machine can do when nothing disturbs it.
//!
//! Criterion's means have in them whatever else runs, most with two threads on two cores. Prints
//! multiply-adds a ns, and ns a particle-sample of the paper's search with one thread and two.
#![allow(missing_docs, clippy::unwrap_used)]

mod paper;

use std::hint::black_box;
use std::time::Instant;

use paper::{Peak, RATE, SAMPLES, Width, candidates, drive, paper_spec};
use piezotrack_core::identify::{Evaluator, Problem, Record};
use piezotrack_core::models::{DahlStage, Experiment, StageModel};
use piezotrack_core::signal::{Drive, Hold, NEVER};
use pulp::Arch;

const RUNS: usize = 100;
const PARTICLES: u32 = 96;
/// Operations of a step of second order in each vector: 15 multiply-adds and 13 others.
const OPERATIONS: f64 = 28.0;

/// Shortest time of a job, ns.
fn best(mut job: impl FnMut()) -> f64 {
    let mut shortest = f64::INFINITY;
    for _ in 0..RUNS {
        let start = Instant::now();
        job();
        shortest = shortest.min(start.elapsed().as_secs_f64());
    }
    1e9 * shortest
}

fn whole(count: u64) -> f64 {
    f64::from(u32::try_from(count).unwrap())
}

fn main() {
    let u = drive();
    let held = Drive::new(&u, 1.0 / RATE, Hold::First).unwrap();
    let stage = DahlStage::xu_li_2010();
    let run = stage.simulate(&Experiment::of(&held, NEVER)).unwrap().unwrap();
    let record = Record::new(&u, &run.x, 1.0 / RATE, Hold::First, 0).unwrap();
    let problem = Problem::new(&record, &paper_spec(), NEVER).unwrap();
    let evaluator = Evaluator::new(&record, &problem, NEVER);
    let candidates = candidates(&problem, PARTICLES);

    let arch = Arch::new();
    let lanes = arch.dispatch(Width);
    let chains = best(|| {
        black_box(arch.dispatch(Peak(black_box(0.5))));
    });
    let peak = whole(Peak::COUNT) / chains;
    println!("{lanes} lanes, {peak:.2} vector multiply-adds a ns");
    let mut alone = f64::NAN;
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let time = pool.install(|| {
            best(|| {
                black_box(evaluator.costs(black_box(&candidates), NEVER));
            })
        });
        let each = time / f64::from(PARTICLES) / f64::from(SAMPLES);
        alone = if threads == 1 { each } else { alone };
        println!(
            "{threads} threads: {each:.3} ns a particle-sample, {:.2} times one",
            alone / each
        );
    }
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        let ten = paper::candidates(&problem, 10);
        let four = Evaluator::new(&record, &problem, NEVER).on(Arch::V3(simd));
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let time = pool.install(|| {
                best(|| {
                    black_box(four.costs(black_box(&ten), NEVER));
                })
            });
            let step = time / f64::from(SAMPLES);
            println!("AVX2, 10 particles, {threads} threads: {step:.1} ns a step of all");
        }
    }
    let share = OPERATIONS / peak / whole(lanes) / alone;
    println!("{:.0} % of the multiply-add peak for {OPERATIONS} operations", 100.0 * share);
}
