//! The same bits from one lane and many, from any number of threads and instruction set.
#![allow(missing_docs, clippy::unwrap_used)]

use piezotrack_core::identify::{
    Candidate, Delay, Evaluator, Monitor, Outcome, Problem, Progress, Record, Records, Spec,
    SwarmSettings, search,
};
use piezotrack_core::integrator::{Order, Stepping, Substeps};
use piezotrack_core::models::{BoucWenStage, DahlStage, Experiment, Model, StageModel};
use piezotrack_core::signal::{Drive, Hold, NEVER};
use pulp::Arch;

const DT: f64 = 1e-3;

fn log() -> (Vec<f64>, Vec<f64>) {
    let u: Vec<f64> = (0..4000).map(|k| 30.0 * (1.0 - (0.02 * f64::from(k)).cos())).collect();
    let drive = Drive::new(&u, DT, Hold::First).unwrap();
    let stage = DahlStage::xu_li_2010();
    let run = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap();
    (u, run.x)
}

fn spec() -> Spec {
    Spec {
        bounds: vec![("damping".into(), (1e3, 5e3)), ("a1".into(), (10.0, 1e3))],
        fixed: vec![("stiffness".into(), 26065.0)],
        offset: true,
        ..Spec::of(Model::Dahl)
    }
}

fn candidates(problem: &Problem) -> Vec<Candidate> {
    let count = problem.free().count();
    (0..23_u32)
        .map(|i| {
            let place: Vec<f64> = (0..count)
                .map(|d| f64::from((7 * i + 5 * u32::try_from(d).unwrap()) % 23) / 23.0)
                .collect();
            Candidate::of(problem.theta(&place))
        })
        .collect()
}

fn bits(evaluator: &Evaluator<'_>, candidates: &[Candidate]) -> Vec<(u64, u64, [u64; 3])> {
    let costs = evaluator.costs(candidates, NEVER);
    let bits = costs
        .iter()
        .map(|c| (c.rms.to_bits(), c.offset.to_bits(), c.creep_weights.map(f64::to_bits)));
    bits.collect()
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
    for spec in [spec(), related()] {
        on_every_instruction_set(&spec);
    }
}

/// However many candidates share a bundle, and bundles a thread.
#[test]
fn every_number_of_candidates_on_any_number_of_threads() {
    let (u, y) = log();
    let record = Record::new(&u[..1500], &y[..1500], DT, Hold::First, 100).unwrap();
    let problem = Problem::new(&record, &spec(), NEVER).unwrap();
    let asked = candidates(&problem);
    let evaluator = |arch| Evaluator::new(&record, &problem, NEVER).on(arch);
    let alone = evaluator(Arch::new());
    let expected: Vec<_> = asked.iter().flat_map(|one| bits(&alone, &[*one])).collect();
    for arch in instruction_sets() {
        let evaluator = evaluator(arch);
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            for count in [3, 5, 9, 10, 13, 23] {
                let found = pool.install(|| bits(&evaluator, &asked[..count]));
                assert_eq!(found, expected[..count], "{arch:?}, {threads} threads, {count}");
            }
        }
    }
}

fn on_every_instruction_set(spec: &Spec) {
    let (u, y) = log();
    let record = Record::new(&u, &y, DT, Hold::First, 100).unwrap();
    let problem = Problem::new(&record, spec, NEVER).unwrap();
    let asked = candidates(&problem);
    for order in [Order::Second, Order::Fourth] {
        let evaluator = |arch| {
            let mut evaluator = Evaluator::new(&record, &problem, NEVER).on(arch);
            evaluator.stepping = Stepping { order, substeps: Substeps::even(2) };
            evaluator
        };
        let expected = bits(&evaluator(Arch::new()), &asked);
        assert!(expected.iter().any(|c| f64::from_bits(c.0).is_finite()));
        for arch in instruction_sets() {
            let evaluator = evaluator(arch);
            assert_eq!(bits(&evaluator, &asked), expected, "{arch:?} {order:?}");
            let alone: Vec<_> = asked.iter().flat_map(|one| bits(&evaluator, &[*one])).collect();
            assert_eq!(alone, expected, "{arch:?} {order:?}, one by one");
        }
    }
}

/// Sticking, reversals inside the step and delays of their own in every lane.
#[test]
fn one_lane_and_many_with_friction_and_delay() {
    let (u, y) = log();
    let record = Record::new(&u, &y, DT, Hold::First, 100).unwrap();
    let mut spec = spec();
    spec.free = vec!["mass".into()];
    spec.bounds.push(("b0".into(), (-100.0, 400.0)));
    spec.delay = Delay::Between(0.0, 0.02);
    let problem = Problem::new(&record, &spec, NEVER).unwrap();
    let asked = candidates(&problem);
    let expected = bits(&Evaluator::new(&record, &problem, NEVER), &asked);
    assert!(expected.iter().filter(|c| f64::from_bits(c.0).is_finite()).count() > 10);
    for arch in instruction_sets() {
        let evaluator = Evaluator::new(&record, &problem, NEVER).on(arch);
        assert_eq!(bits(&evaluator, &asked), expected, "{arch:?}");
        let alone: Vec<_> = asked.iter().flat_map(|one| bits(&evaluator, &[*one])).collect();
        assert_eq!(alone, expected, "{arch:?}, one by one");
    }
}

/// Reversals and zeros of the hysteresis inside the step, jumps, and another exponent.
#[test]
fn one_lane_and_many_of_models_with_an_exponent() {
    let (u, y) = log();
    let cases = [(Hold::First, 1.0), (Hold::Zero, 1.0), (Hold::First, 1.5)];
    let models = [
        Model::BoucWen,
        Model::AsymmetricBoucWen,
        Model::FirstOrderDahl,
        Model::ParallelDahl,
        Model::LuGre,
        Model::BoucWenOscillator,
    ];
    for (model, (hold, exponent)) in models.into_iter().flat_map(|m| cases.map(|case| (m, case))) {
        let has_exponent = model.info().parameters.iter().any(|one| one.name == "exponent");
        let record = Record::new(&u, &y, DT, hold, 100).unwrap();
        let mut fixed = vec![("stiffness".into(), 19567.0)];
        if has_exponent {
            fixed.push(("exponent".into(), exponent));
        }
        let spec = Spec {
            model,
            fixed,
            offset: true,
            delay: Delay::Between(0.0, 0.02),
            ..Spec::of(Model::Dahl)
        };
        let problem = Problem::new(&record, &spec, NEVER).unwrap();
        let asked = candidates(&problem);
        let expected = bits(&Evaluator::new(&record, &problem, NEVER), &asked);
        assert!(expected.iter().filter(|c| f64::from_bits(c.0).is_finite()).count() > 10);
        for arch in instruction_sets() {
            let evaluator = Evaluator::new(&record, &problem, NEVER).on(arch);
            assert_eq!(bits(&evaluator, &asked), expected, "{model:?} {arch:?} {exponent}");
            let alone: Vec<_> = asked.iter().flat_map(|one| bits(&evaluator, &[*one])).collect();
            assert_eq!(alone, expected, "{model:?} {arch:?} {exponent}, one by one");
        }
    }
}

/// A limit of the friction that does not depend on the speed, which takes a shorter way where all
/// lanes have one, beside lanes whose limit does.
#[test]
fn one_lane_and_many_with_a_limit_that_falls_in_some() {
    let (u, y) = log();
    let record = Record::new(&u, &y, DT, Hold::First, 100).unwrap();
    let spec = Spec {
        model: Model::LuGre,
        bounds: vec![("static_ratio".into(), (1.0, 1.5))],
        fixed: vec![("mass".into(), 0.3), ("stiffness".into(), 19567.0)],
        offset: true,
        ..Spec::of(Model::Dahl)
    };
    let problem = Problem::new(&record, &spec, NEVER).unwrap();
    let infos = Model::LuGre.info().parameters;
    let ratio = problem.free().position(|i| infos.get(i).is_some_and(|p| p.name == "static_ratio"));
    let count = problem.free().count();
    // The first eight are alike, then they alternate.
    let place = |i: u32| -> Vec<f64> {
        let part = |d: usize| f64::from((7 * i + 5 * u32::try_from(d).unwrap()) % 23) / 23.0;
        let mut place: Vec<f64> = (0..count).map(part).collect();
        if i < 8 || i.is_multiple_of(2) {
            place[ratio.unwrap()] = 0.0;
        }
        place
    };
    let at = |i| Candidate::of(problem.theta(&place(i)));
    let asked: Vec<Candidate> = (0..23).map(at).collect();
    let expected = bits(&Evaluator::new(&record, &problem, NEVER), &asked);
    assert!(expected.iter().filter(|c| f64::from_bits(c.0).is_finite()).count() > 15);
    for arch in instruction_sets() {
        let evaluator = Evaluator::new(&record, &problem, NEVER).on(arch);
        assert_eq!(bits(&evaluator, &asked), expected, "{arch:?}");
        let alone: Vec<_> = asked.iter().flat_map(|one| bits(&evaluator, &[*one])).collect();
        assert_eq!(alone, expected, "{arch:?}, one by one");
    }
}

/// Weights of the creep within the cost, with and without a delay.
#[test]
fn one_lane_and_many_with_creep() {
    let (u, y) = log();
    let record = Record::new(&u, &y, DT, Hold::First, 100).unwrap();
    for delay in [Delay::default(), Delay::Between(0.0, 0.02)] {
        let problem = Problem::new(&record, &Spec { delay, ..creeping() }, NEVER).unwrap();
        let asked = candidates(&problem);
        let expected = bits(&Evaluator::new(&record, &problem, NEVER), &asked);
        assert!(expected.iter().any(|c| c.2 != [0; 3]), "no candidate has a share");
        for arch in instruction_sets() {
            let evaluator = Evaluator::new(&record, &problem, NEVER).on(arch);
            assert_eq!(bits(&evaluator, &asked), expected, "{arch:?}");
            let alone: Vec<_> = asked.iter().flat_map(|one| bits(&evaluator, &[*one])).collect();
            assert_eq!(alone, expected, "{arch:?}, one by one");
        }
    }
}

fn creeping() -> Spec {
    Spec { creep_times: vec![0.02, 0.2, 1.5], ..spec() }
}

/// A candidate that is given up has a cost beyond its limit, also with the best weights.
#[test]
fn a_bound_of_the_cost_is_never_above_it() {
    let (u, mut y) = log();
    // Displacement that is wrong at first, and right later.
    for (k, y) in y.iter_mut().enumerate() {
        *y += if k < 700 { 3e-6 } else { 0.0 };
    }
    let record = Record::new(&u, &y, DT, Hold::First, 100).unwrap();
    for offset in [true, false] {
        let problem = Problem::new(&record, &Spec { offset, ..creeping() }, NEVER).unwrap();
        let evaluator = Evaluator::new(&record, &problem, NEVER);
        let asked = candidates(&problem);
        for (one, cost) in asked.iter().zip(evaluator.costs(&asked, NEVER)) {
            for part in [0.2, 0.5, 0.8, 0.95, 0.999] {
                let limited = Candidate { limit: part * cost.rms, ..*one };
                let bound = evaluator.costs(&[limited], NEVER)[0];
                assert!(bound.rms <= cost.rms, "{} above {}", bound.rms, cost.rms);
                assert!(bound.rms >= limited.limit, "{} below its limit", bound.rms);
            }
        }
    }
}

/// Ties, inequalities and priors, of which the last make some candidates cost a third more.
fn related() -> Spec {
    Spec {
        ties: vec![("mass".into(), "1e-5 * stiffness * sqrt(a1 / a1)".into())],
        constraints: vec!["a1 < damping".into()],
        priors: vec![("damping".into(), (2e3, 50.0)), ("a1".into(), (500.0, 20.0))],
        scales: vec![("a1".into(), "linear".into())],
        ..spec()
    }
}

#[test]
fn abandoning_a_guess_changes_no_result() {
    for spec in [spec(), creeping(), related()] {
        abandoning(&spec);
    }
}

/// The accuracy that a search asks for, with few steps where the drive does not jump.
#[test]
fn a_jump_of_the_drive_asks_for_steps_of_its_own_interval_only() {
    let u: Vec<f64> = (0..1500)
        .map(|k| if k == 0 { -40.0 } else { 20.0 + 35.0 * (0.01 * f64::from(k)).cos() })
        .collect();
    let stage = BoucWenStage::xu_li_2010_corrected();
    let drive = Drive::new(&u, DT, Hold::First).unwrap();
    let y = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().x;
    let record = Record::new(&u, &y, DT, Hold::First, 2).unwrap();
    let spec = Spec { fixed: vec![("exponent".into(), 1.7)], ..Spec::of(Model::BoucWen) };
    let problem = Problem::new(&record, &spec, NEVER).unwrap();
    let evaluator = Evaluator::new(&record, &problem, NEVER);
    let Substeps { usual, at_jumps, .. } = evaluator.stepping.substeps;
    assert!(at_jumps >= 4 * usual, "{usual}, {at_jumps}");
    let mut fine = Evaluator::new(&record, &problem, NEVER);
    fine.stepping.substeps = Substeps::even(2 * at_jumps);
    let middle = vec![0.5; problem.free().count()];
    let candidates = [Candidate::of(problem.theta(&middle))];
    let [few, many] = [&evaluator, &fine].map(|one| one.costs(&candidates, NEVER)[0].rms);
    assert!((few - many).abs() < 4e-10, "{few} m, {many} m");
}

#[test]
fn priors_multiply_the_cost() {
    let (u, y) = log();
    let record = Record::new(&u, &y, DT, Hold::First, 100).unwrap();
    let problem = Problem::new(&record, &related(), NEVER).unwrap();
    let plain = Problem::new(&record, &Spec { priors: vec![], ..related() }, NEVER).unwrap();
    let stepping = Stepping { order: Order::Fourth, substeps: Substeps::even(2) };
    let costs = |problem: &Problem| {
        let mut evaluator = Evaluator::new(&record, problem, NEVER);
        evaluator.stepping = stepping;
        evaluator.costs(&candidates(problem), NEVER)
    };
    let names: Vec<&str> = Model::Dahl.scalars().iter().map(|info| info.name).collect();
    let place = |name| names.iter().position(|other| *other == name).unwrap();
    let mut most: f64 = 1.0;
    for ((with, without), one) in
        costs(&problem).iter().zip(costs(&plain)).zip(candidates(&problem))
    {
        let distance = |name, mean: f64, width: f64| (one.theta.0[place(name)] - mean) / width;
        let (a, b) = (distance("damping", 2e3, 50.0), distance("a1", 500.0, 20.0));
        let factor = (0.5 * (a * a + b * b) / 3900.0).exp();
        assert!((with.rms / (without.rms * factor) - 1.0).abs() < 1e-12 || !with.rms.is_finite());
        most = most.max(factor);
    }
    assert!(most > 1.2, "{most}");
}

fn abandoning(spec: &Spec) {
    let (u, y) = log();
    let record = Record::new(&u, &y, DT, Hold::First, 100).unwrap();
    let problem = Problem::new(&record, spec, NEVER).unwrap();
    let evaluator = Evaluator::new(&record, &problem, NEVER);
    let asked = candidates(&problem);
    let whole = evaluator.costs(&asked, NEVER);
    let limit = 2e-6;
    let limited: Vec<Candidate> =
        asked.iter().map(|candidate| Candidate { limit, ..*candidate }).collect();
    let (mut kept, mut abandoned) = (0, 0);
    for (cut, whole) in evaluator.costs(&limited, NEVER).iter().zip(&whole) {
        if whole.rms <= limit {
            assert_eq!(cut.rms.to_bits(), whole.rms.to_bits());
            kept += 1;
        } else {
            assert!(limit < cut.rms && cut.rms <= whole.rms, "{cut:?} {whole:?}");
            abandoned += usize::from(cut.rms < whole.rms);
        }
    }
    assert!(kept > 0 && abandoned > 0, "{kept} {abandoned}");
}

fn outcomes(threads: usize, seed: u64, runs: usize) -> Vec<Outcome> {
    searched(&SwarmSettings::xu_li_2010(), threads, seed, runs)
}

fn searched(settings: &SwarmSettings, threads: usize, seed: u64, runs: usize) -> Vec<Outcome> {
    let (u, y) = log();
    let record = Record::new(&u, &y, DT, Hold::First, 100).unwrap();
    let problem = Problem::new(&record, &spec(), NEVER).unwrap();
    let settings = SwarmSettings { iterations: 30, ..settings.clone() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let evaluator = Evaluator::new(&record, &problem, NEVER);
        let mut quiet = |_: &Progress| core::ops::ControlFlow::Continue(());
        let monitor: &mut dyn Monitor = &mut quiet;
        search(&Records::one(evaluator), &settings, seed, runs, monitor, NEVER).unwrap()
    })
}

fn assert_same(one: &Outcome, other: &Outcome) {
    assert_eq!(one.theta.0.map(f64::to_bits), other.theta.0.map(f64::to_bits));
    assert_eq!(one.history, other.history);
    assert_eq!(one.failures, other.failures);
    assert_eq!(one.evaluations, other.evaluations);
}

#[test]
fn any_number_of_threads() {
    let one = outcomes(1, 3, 1);
    for threads in [2, 7] {
        assert_same(&one[0], &outcomes(threads, 3, 1)[0]);
    }
    assert_ne!(one[0].history, outcomes(1, 4, 1)[0].history, "another seed, another search");
    let standard = |threads| searched(&SwarmSettings::spso_2011(), threads, 3, 2);
    let one = standard(1);
    for threads in [2, 7] {
        let others = standard(threads);
        one.iter().zip(&others).for_each(|(one, other)| assert_same(one, other));
    }
}

#[test]
fn a_run_does_not_depend_on_the_others() {
    let alone = outcomes(2, 3, 1);
    let three = outcomes(2, 3, 3);
    assert_same(&alone[0], &three[0]);
    assert_ne!(three[0].history, three[1].history);
}
