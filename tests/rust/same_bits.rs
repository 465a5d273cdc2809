//! The same bits from one lane and many, from any number of threads and instruction set.
#![allow(missing_docs, clippy::unwrap_used)]

use piezotrack_core::identify::{
    Evaluator, Monitor, Outcome, Problem, Progress, Record, Spec, SwarmSettings, Theta, search,
};
use piezotrack_core::integrate::{Drive, Hold, NEVER, simulate};
use piezotrack_core::stage::{DahlStage, StageState};
use pulp::Arch;

const DT: f64 = 1e-3;

fn log() -> (Vec<f64>, Vec<f64>) {
    let u: Vec<f64> = (0..1500)
        .map(|k| 30.0 * (1.0 - (0.02 * f64::from(k)).cos()))
        .collect();
    let drive = Drive::new(&u, DT, Hold::First).unwrap();
    let stage = DahlStage::xu_li_2010();
    let run = simulate(&stage, &drive, StageState::default(), 1e-10, NEVER)
        .unwrap()
        .unwrap();
    (u, run.x)
}

fn spec() -> Spec {
    Spec {
        bounds: vec![("damping".into(), (1e3, 5e3)), ("a1".into(), (10.0, 1e3))],
        stiffness: Some(26065.0),
        offset: true,
        ..Spec::default()
    }
}

fn guesses(problem: &Problem) -> Vec<Theta> {
    let count = problem.free().count();
    (0..23_u32)
        .map(|i| {
            let place: Vec<f64> = (0..count)
                .map(|d| f64::from((7 * i + 5 * u32::try_from(d).unwrap()) % 23) / 23.0)
                .collect();
            problem.theta(&place)
        })
        .collect()
}

fn bits(evaluator: &Evaluator<'_>, thetas: &[Theta]) -> Vec<(u64, u64)> {
    let costs = evaluator.costs(thetas, NEVER);
    costs
        .iter()
        .map(|c| (c.rms.to_bits(), c.offset.to_bits()))
        .collect()
}

fn instruction_sets() -> Vec<Arch> {
    let mut sets = vec![Arch::Scalar];
    #[cfg(target_arch = "x86_64")]
    {
        sets.extend(pulp::x86::V3::try_new().map(Arch::V3));
        sets.extend(pulp::x86::V4::try_new().map(Arch::V4));
    }
    sets
}

#[test]
fn one_lane_and_many_on_every_instruction_set() {
    let (u, y) = log();
    let record = Record::new(&u, &y, DT, Hold::First, 100).unwrap();
    let problem = Problem::new(&record, &spec()).unwrap();
    let thetas = guesses(&problem);
    let expected = bits(&Evaluator::new(&record, &problem, NEVER), &thetas);
    assert!(expected.iter().any(|c| f64::from_bits(c.0).is_finite()));
    for arch in instruction_sets() {
        let evaluator = Evaluator::new(&record, &problem, NEVER).on(arch);
        assert_eq!(bits(&evaluator, &thetas), expected, "{arch:?}");
        let one_by_one: Vec<_> = thetas
            .iter()
            .flat_map(|theta| bits(&evaluator, &[*theta]))
            .collect();
        assert_eq!(one_by_one, expected, "{arch:?}, one by one");
    }
}

fn outcome(threads: usize, seed: u64) -> Outcome {
    let (u, y) = log();
    let record = Record::new(&u, &y, DT, Hold::First, 100).unwrap();
    let problem = Problem::new(&record, &spec()).unwrap();
    let settings = SwarmSettings {
        iterations: 30,
        ..SwarmSettings::xu_li_2010()
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        let evaluator = Evaluator::new(&record, &problem, NEVER);
        let mut quiet = |_: &Progress| core::ops::ControlFlow::Continue(());
        let monitor: &mut dyn Monitor = &mut quiet;
        search(&evaluator, &problem, &settings, seed, monitor, NEVER).unwrap()
    })
}

#[test]
fn any_number_of_threads() {
    let one = outcome(1, 3);
    for threads in [2, 7] {
        let many = outcome(threads, 3);
        assert_eq!(one.theta.map(f64::to_bits), many.theta.map(f64::to_bits));
        assert_eq!(one.history, many.history);
    }
    assert_ne!(
        one.history,
        outcome(1, 4).history,
        "another seed, another search"
    );
}
