//! One stage from several records: their costs add up, and no state goes from one to the next.
#![allow(missing_docs, clippy::unwrap_used)]

use core::ops::ControlFlow;

use piezotrack_core::Error;
use piezotrack_core::identify::{
    Candidate, Coordinate, DELAY, Delay, DescentSettings, Evaluator, Identification, Method, Plan,
    Problem, Progress, Record, Spec, identify, identify_together,
};
use piezotrack_core::models::{
    Creeping, DahlStage, Experiment, FirstOrderDahlStage, Model, StageModel,
};
use piezotrack_core::signal::{Drive, Hold, NEVER};

const DT: f64 = 4e-3;

/// Drive and displacement of the published stage: slow and large, or quick and small.
fn log(size: f64, rate: f64, samples: i32) -> (Vec<f64>, Vec<f64>) {
    let angle = |k: i32| rate * DT * f64::from(k);
    let u: Vec<f64> = (0..samples).map(|k| size * (1.0 - libm::cos(angle(k)))).collect();
    let drive = Drive::new(&u, DT, Hold::First).unwrap();
    let y = DahlStage::xu_li_2010().simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().x;
    (u, y)
}

fn spec() -> Spec {
    let mass = DahlStage::xu_li_2010().mechanics.mass;
    let fixed = vec![("mass".into(), mass), ("stiffness".into(), 26065.0)];
    Spec { fixed, offset: true, ..Spec::of(Model::Dahl) }
}

fn plan() -> Plan {
    let settings = DescentSettings { samples: 12, starts: 6, ..DescentSettings::default() };
    Plan { method: Method::Descents(settings), seed: 1, runs: 1, start: None }
}

fn together(asked: &[(&Record<'_>, &Spec)]) -> Identification {
    let mut quiet = |_: &Progress| ControlFlow::Continue(());
    identify_together(asked, &plan(), &mut quiet, NEVER).unwrap()
}

#[test]
fn one_record_has_the_same_bits_either_way() {
    let (u, y) = log(30.0, 6.0, 800);
    let record = Record::new(&u, &y, DT, Hold::First, 100).unwrap();
    let weighty = record.clone().among("record 1", 3.0).unwrap();
    let mut quiet = |_: &Progress| ControlFlow::Continue(());
    let alone = identify(&record, &spec(), &plan(), &mut quiet, NEVER).unwrap();
    let listed = together(&[(&weighty, &spec())]);
    for (one, other) in alone.runs.iter().zip(&listed.runs) {
        assert_eq!(one.theta.0.map(f64::to_bits), other.theta.0.map(f64::to_bits));
        assert_eq!(one.evaluations, other.evaluations);
    }
    assert_eq!(alone.at_bound, listed.at_bound);
}

#[test]
fn the_cost_is_the_weighted_rms_of_the_costs_of_each() {
    let (slow, quick) = (log(30.0, 6.0, 800), log(5.0, 60.0, 500));
    let moved: Vec<f64> = quick.1.iter().map(|y| 1.02 * y + 3e-6).collect();
    let a = Record::new(&slow.0, &slow.1, DT, Hold::First, 100).unwrap();
    let b = Record::new(&quick.0, &moved, DT, Hold::First, 0).unwrap();
    let b = b.among("record 2", 2.5).unwrap();
    let spec = spec();
    let found = together(&[(&a, &spec), (&b, &spec)]);
    let best = &found.runs[found.best.unwrap()];
    let counts = [700.0, 2.5 * 500.0];
    let squares = found.records.iter().zip(counts).map(|(one, n)| n * one.costs.rms.powi(2));
    let expected = libm::sqrt(squares.sum::<f64>() / counts.iter().sum::<f64>());
    assert!((best.costs.rms / expected - 1.0).abs() < 1e-9, "{} {expected}", best.costs.rms);
    // Each cost is that of the record alone, with the same bits: nothing of the other is in it.
    for (one, record) in found.records.iter().zip([&a, &b]) {
        let evaluator = Evaluator::new(record, &one.problem, NEVER);
        let alone = evaluator.costs(&[Candidate::of(one.theta)], NEVER);
        assert_eq!(alone[0].rms.to_bits(), one.costs.rms.to_bits());
        assert_eq!(alone[0].offset.to_bits(), one.costs.offset.to_bits());
    }
    assert!((found.records[1].costs.offset - 3e-6).abs() < 1e-6);
}

#[test]
fn the_bounds_of_each_record_are_inside_those_of_all() {
    let (slow, quick) = (log(30.0, 6.0, 800), log(5.0, 60.0, 500));
    let a = Record::new(&slow.0, &slow.1, DT, Hold::First, 0).unwrap();
    let b = Record::new(&quick.0, &quick.1, DT, Hold::First, 0).unwrap();
    let (first, second) = (spec(), Spec { delay: Delay::Fitted, ..spec() });
    let all = Problem::of_records(&[(&a, &first), (&b, &second)], NEVER).unwrap();
    let alone = [(&a, &first), (&b, &second)].map(|(r, s)| Problem::new(r, s, NEVER).unwrap());
    let bounds = |coordinate: Coordinate| match coordinate {
        Coordinate::Free { low, high, .. } => Some((low, high)),
        _ => None,
    };
    for place in all[0].free() {
        assert_eq!(all[0].coordinates[place], all[1].coordinates[place]);
        let (low, high) = bounds(all[0].coordinates[place]).unwrap();
        for one in &alone {
            let (least, most) = bounds(one.coordinates[place]).unwrap();
            assert!(low <= least && most <= high, "{place}: {low} {least} {most} {high}");
        }
    }
    // The delay is the second one's own.
    assert_eq!(all[0].coordinates[DELAY], Coordinate::Fixed(0.0));
    assert_eq!(all[1].coordinates[DELAY], alone[1].coordinates[DELAY]);
}

#[test]
fn what_cannot_be_used_is_refused_by_its_record() {
    let (u, y) = log(30.0, 6.0, 800);
    let record = || Record::new(&u, &y, DT, Hold::First, 0).unwrap();
    for weight in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = record().among("record 2", weight).unwrap_err();
        assert!(refused.to_string().starts_with("record 2: weight is "), "{refused}");
    }
    let second = record().among("record 2", 1.0).unwrap();
    let late = Spec { delay: Delay::Fixed(-1.0), ..spec() };
    let refused = Problem::of_records(&[(&record(), &spec()), (&second, &late)], NEVER);
    assert!(refused.unwrap_err().to_string().starts_with("record 2: delay is -1 s: expected"));
    assert!(matches!(Problem::of_records(&[], NEVER), Err(Error::Parameter { .. })));
}

/// Drive and displacement of a first-order Dahl stage that creeps, from rest at 0 V.
fn creeping_log(size: f64, rate: f64, samples: i32, offset: f64) -> (Vec<f64>, Vec<f64>) {
    let (u, _) = log(size, rate, samples);
    let drive = Drive::new(&u, DT, Hold::First).unwrap();
    let dahl = FirstOrderDahlStage::new(&[0.1828, 500.0, 26065.0, 0.0468, 9e3, 0.15, 1.0]).unwrap();
    let stage = Creeping::new(dahl, &WEIGHTS, &TIMES).unwrap();
    let x = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().x;
    (u, x.iter().map(|x| x + offset).collect())
}

const WEIGHTS: [f64; 2] = [0.02, 0.03];
const TIMES: [f64; 2] = [0.3, 4.0];

fn creeping() -> Spec {
    Spec {
        model: Model::FirstOrderDahl,
        fixed: vec![("mass".into(), 0.1828), ("stiffness".into(), 26065.0)],
        creep_times: TIMES.to_vec(),
        ..spec()
    }
}

#[test]
fn creep_has_the_same_weights_in_all_records() {
    let (slow, quick) = (creeping_log(30.0, 1.5, 2000, 3e-6), creeping_log(5.0, 40.0, 900, 0.0));
    let a = Record::new(&slow.0, &slow.1, DT, Hold::First, 0).unwrap();
    let b = Record::new(&quick.0, &quick.1, DT, Hold::First, 0).unwrap();
    let b = b.among("record 2", 2.0).unwrap();
    let spec = creeping();
    let found = together(&[(&a, &spec), (&b, &spec)]);
    let best = &found.runs[found.best.unwrap()];
    assert!(best.costs.rms < 1e-9, "{:e}", best.costs.rms);
    for (weight, known) in best.costs.creep_weights.iter().zip(WEIGHTS) {
        assert!((weight / known - 1.0).abs() < 1e-3, "{:?}", best.costs.creep_weights);
    }
    assert!((found.records[0].costs.offset - 3e-6).abs() < 1e-9);
    assert!(found.records[1].costs.offset.abs() < 1e-9);
    // Each record has these weights, not those that suit it best alone.
    for one in &found.records {
        assert_eq!(
            one.costs.creep_weights.map(f64::to_bits),
            best.costs.creep_weights.map(f64::to_bits)
        );
    }
}

#[test]
fn a_record_given_twice_is_as_one() {
    let (u, y) = creeping_log(30.0, 1.5, 1200, 3e-6);
    // Wrong by a slow wave, so that the weights are a compromise.
    let y: Vec<f64> =
        y.iter().zip(0..).map(|(y, k)| y + 1e-7 * libm::sin(1e-2 * f64::from(k))).collect();
    let once = Record::new(&u, &y, DT, Hold::First, 0).unwrap();
    let again = once.clone().among("record 2", 1.0).unwrap();
    let spec = creeping();
    let (alone, both) = (together(&[(&once, &spec)]), together(&[(&once, &spec), (&again, &spec)]));
    let of = |found: &Identification| found.runs[found.best.unwrap()].clone();
    let (alone, twice) = (of(&alone), of(&both));
    assert!((twice.costs.rms / alone.costs.rms - 1.0).abs() < 1e-6);
    for (one, other) in alone.theta.0.iter().zip(twice.theta.0) {
        assert!((one - other).abs() <= 1e-3 * one.abs(), "{one} {other}");
    }
    for (one, other) in alone.costs.creep_weights.iter().zip(twice.costs.creep_weights) {
        assert!((one - other).abs() < 1e-4, "{one} {other}");
    }
}
