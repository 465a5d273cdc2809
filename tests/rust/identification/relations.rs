//! Ties and inequalities: every place of the unit box is a candidate that keeps them.
#![allow(missing_docs, clippy::unwrap_used, clippy::float_cmp)]

use piezotrack_core::Error;
use piezotrack_core::identify::{Coordinate, Problem, Record, Spec};
use piezotrack_core::models::{DahlStage, Experiment, Model, StageModel};
use piezotrack_core::signal::{Drive, Hold, NEVER};

const DT: f64 = 1e-3;

/// Of a slow drive under which no mass shows.
fn problem(spec: &Spec) -> Result<Problem, Error> {
    let u: Vec<f64> = (0..2000).map(|k| 30.0 * (1.0 - (0.01 * f64::from(k)).cos())).collect();
    let drive = Drive::new(&u, DT, Hold::First).unwrap();
    let stage = DahlStage::xu_li_2010();
    let run = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap();
    let record = Record::new(&u, &run.x, DT, Hold::First, 0).unwrap();
    Problem::new(&record, spec, NEVER)
}

fn spec() -> Spec {
    let bounds = [("damping", 1.0, 1e5), ("a1", 10.0, 1e4), ("a2", 1e3, 1e7), ("b1", 5e2, 2e6)];
    Spec {
        fixed: vec![("stiffness".into(), 26065.0)],
        bounds: bounds.map(|(name, low, high)| (name.to_owned(), (low, high))).to_vec(),
        ..Spec::of(Model::Dahl)
    }
}

fn place(name: &str) -> usize {
    Model::Dahl.scalars().iter().position(|info| info.name == name).unwrap()
}

/// Places of the unit box, corners and faces among them.
fn places(count: usize) -> impl Iterator<Item = Vec<f64>> {
    let steps = [0.0, 0.37, 0.5, 0.9995, 1.0];
    let total = 5_usize.pow(u32::try_from(count).unwrap());
    (0..total).map(move |mut i| {
        let digit = |_| {
            let z = steps[i % 5];
            i /= 5;
            z
        };
        (0..count).map(digit).collect()
    })
}

#[test]
fn every_place_keeps_a_chain_of_inequalities_and_its_bounds() {
    let constraints = ["a1 < damping", "damping <= a2", "b1 >= a2", "a1 < b1"].map(String::from);
    let problem = problem(&Spec { constraints: constraints.to_vec(), ..spec() }).unwrap();
    let [a1, damping, a2, b1] = ["a1", "damping", "a2", "b1"].map(place);
    let mut equal = 0;
    for at in places(problem.free().count()) {
        let theta = problem.theta(&at).0;
        assert!(theta[a1] <= theta[damping] && theta[damping] <= theta[a2], "{at:?}");
        assert!(theta[a2] <= theta[b1] && theta[a1] <= theta[b1], "{at:?}");
        for (name, (low, high)) in &spec().bounds {
            assert!((*low..=*high).contains(&theta[place(name)]), "{name} {at:?}");
        }
        equal += usize::from(theta[a1] == theta[damping]);
    }
    assert!(equal > 0, "the face on which two are equal is a face of the box");
}

#[test]
fn every_place_has_tied_parameters_in_their_order_or_no_stage() {
    let ties = [("b1", "2 * a2 - up / 3"), ("a2", "sqrt(damping - 100) * a1 ** 2")];
    let ties = ties.map(|(name, text)| (name.to_owned(), text.to_owned())).to_vec();
    let bounds = spec().bounds[..2].to_vec();
    let problem = problem(&Spec { ties, bounds, ..spec() }).unwrap();
    let [a1, damping, a2, b1, up] = ["a1", "damping", "a2", "b1", "up"].map(place);
    assert_eq!(problem.coordinates[a2], Coordinate::Tied);
    let mut failed = 0;
    for at in places(problem.free().count()) {
        let theta = problem.theta(&at).0;
        if theta[damping].is_nan() {
            failed += 1;
            continue;
        }
        let expected = (theta[damping] - 100.0).sqrt() * theta[a1] * theta[a1];
        assert!((theta[a2] / expected - 1.0).abs() < 1e-12);
        assert!((theta[b1] / (2.0 * expected - theta[up] / 3.0) - 1.0).abs() < 1e-12);
    }
    assert!(failed > 0, "no stage has a damping below 100 with this tie");
}

#[test]
fn a_tie_that_no_stage_has_in_the_middle_is_refused_with_its_value() {
    let ties = vec![("damping".to_owned(), "0 - stiffness".to_owned())];
    let bounds = spec().bounds[1..].to_vec();
    let error = problem(&Spec { ties, bounds, ..spec() }).unwrap_err().to_string();
    assert!(error.starts_with("tie of damping is '0 - stiffness', -26065 N s/m"), "{error}");
}
