//! The best of many runs: what the machine can do when nothing disturbs it.
//!
//! Criterion's means have in them whatever else runs, most with two threads on two cores. Prints
//! multiply-adds a ns, and ns a particle-sample of the paper's search with one thread and two.
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;
use std::time::Instant;

use piezotrack_core::identify::{Evaluator, Guess, Problem, Record, Spec};
use piezotrack_core::integrate::{Drive, Hold, Method, NEVER, simulate};
use piezotrack_core::stage::{DahlStage, StageState};
use pulp::{Arch, Simd, WithSimd};

const RUNS: usize = 100;
const ROUNDS: u32 = 10_000;
const CHAINS: u32 = 12;
const PARTICLES: u32 = 96;
const SAMPLES: u32 = 20_001;
/// Operations of a step of second order in each vector: 15 multiply-adds and 13 others.
const OPERATIONS: f64 = 28.0;

/// Independent chains of multiply-adds.
struct Peak(f64);

impl WithSimd for Peak {
    type Output = (f64, usize);
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> (f64, usize) {
        let (factor, term) = (simd.splat_f64s(self.0), simd.splat_f64s(1.0));
        let mut chains = [simd.splat_f64s(0.0); CHAINS as usize];
        for _ in 0..ROUNDS {
            for chain in &mut chains {
                *chain = simd.mul_add_f64s(*chain, factor, term);
            }
        }
        let sum = chains.into_iter().fold(simd.splat_f64s(0.0), |a, b| simd.add_f64s(a, b));
        (simd.reduce_sum_f64s(sum), S::F64_LANES)
    }
}

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

fn main() {
    let turn = core::f64::consts::TAU * 0.25 / 5000.0;
    let u: Vec<f64> = (0..SAMPLES).map(|k| 37.5 * (1.0 - (turn * f64::from(k)).cos())).collect();
    let drive = Drive::new(&u, 2e-4, Hold::First).unwrap();
    let (stage, rest) = (DahlStage::xu_li_2010(), StageState::default());
    let run = simulate(&stage, &drive, rest, Method::Exponential, 1e-10, NEVER).unwrap().unwrap();
    let record = Record::new(&u, &run.x, 2e-4, Hold::First, 0).unwrap();
    let held = [("a1", stage.a1), ("a2", stage.a2), ("b1", stage.b1)];
    let bounds = [
        ("mass", (0.1, 0.2)),
        ("damping", (1e3, 5e3)),
        ("stiffness", (1e4, 5e4)),
        ("piezo_coefficient", (0.01, 0.1)),
    ];
    let spec = Spec {
        fixed: held.map(|(name, value)| (name.into(), value)).to_vec(),
        bounds: bounds.map(|(name, pair)| (name.into(), pair)).to_vec(),
        ..Spec::default()
    };
    let problem = Problem::new(&record, &spec).unwrap();
    let evaluator = Evaluator::new(&record, &problem, NEVER);
    let guesses: Vec<Guess> = (0..PARTICLES)
        .map(|i| problem.theta(&[f64::from(i) / f64::from(PARTICLES); 4]))
        .map(|theta| Guess { theta, limit: f64::INFINITY })
        .collect();

    let arch = Arch::new();
    let lanes = arch.dispatch(Peak(0.5)).1;
    let peak = f64::from(ROUNDS * CHAINS)
        / best(|| {
            black_box(arch.dispatch(Peak(black_box(0.5))));
        });
    println!("{lanes} lanes, {peak:.2} vector multiply-adds a ns");
    let mut alone = f64::NAN;
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let time = pool.install(|| {
            best(|| {
                black_box(evaluator.costs(black_box(&guesses), NEVER));
            })
        });
        let each = time / f64::from(PARTICLES) / f64::from(SAMPLES);
        alone = if threads == 1 { each } else { alone };
        println!(
            "{threads} threads: {each:.3} ns a particle-sample, {:.2} times one",
            alone / each
        );
    }
    let lanes = f64::from(u32::try_from(lanes).unwrap());
    let share = OPERATIONS / peak / lanes / alone;
    println!("{:.0} % of the multiply-add peak for {OPERATIONS} operations", 100.0 * share);
}
