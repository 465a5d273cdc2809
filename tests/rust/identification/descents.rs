//! The search by descents: it finds what made a record, and the same bits however it is run.
#![allow(missing_docs, clippy::unwrap_used)]

use core::ops::ControlFlow;

use piezotrack_core::Error;
use piezotrack_core::identify::{
    DescentSettings, Identification, Method, Plan, Progress, Record, Spec, StopReason, identify,
};
use piezotrack_core::models::{DahlStage, Experiment, Model, StageModel};
use piezotrack_core::signal::{Drive, Hold, NEVER};

const DT: f64 = 4e-3;

fn log() -> (Vec<f64>, Vec<f64>) {
    let u: Vec<f64> = (0..1000).map(|k| 30.0 * (1.0 - libm::cos(0.025 * f64::from(k)))).collect();
    let drive = Drive::new(&u, DT, Hold::First).unwrap();
    let y = DahlStage::xu_li_2010().simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().x;
    (u, y)
}

fn spec() -> Spec {
    let mass = DahlStage::xu_li_2010().mechanics.mass;
    let fixed = vec![("mass".into(), mass), ("stiffness".into(), 26065.0)];
    Spec { fixed, offset: true, ..Spec::of(Model::Dahl) }
}

fn found(settings: &DescentSettings, seed: u64, runs: usize, threads: usize) -> Identification {
    let plan = Plan { method: Method::Descents(settings.clone()), seed, runs, start: None };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| by(&plan).unwrap())
}

fn by(plan: &Plan) -> piezotrack_core::Result<Identification> {
    let (u, y) = log();
    let record = Record::new(&u, &y, DT, Hold::First, 0).unwrap();
    identify(&record, &spec(), plan, &mut |_: &Progress| ControlFlow::Continue(()), NEVER)
}

fn bits(found: &Identification) -> Vec<Vec<u64>> {
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect();
    found.runs.iter().flat_map(|run| [bits(&run.history), bits(&run.theta.0)]).collect()
}

#[test]
fn what_made_the_record_is_found_and_descents_agree() {
    let settings = DescentSettings::default();
    let one = found(&settings, 1, 1, 2);
    let best = &one.runs[one.best.unwrap()];
    assert!(best.costs.rms < 1e-11, "{} m of 45 um", best.costs.rms);
    assert_eq!(best.reason, StopReason::Agreed);
    assert!(one.agreeing >= settings.agreeing);
    assert!(one.runs.len() <= settings.starts * settings.rounds);
    assert!(one.runs.iter().all(|run| run.costs.rms >= best.costs.rms));
}

#[test]
fn any_number_of_threads_finds_the_same() {
    let settings = DescentSettings { samples: 12, starts: 4, ..DescentSettings::default() };
    let one = bits(&found(&settings, 3, 2, 1));
    for threads in [2, 5] {
        assert_eq!(bits(&found(&settings, 3, 2, threads)), one);
    }
    assert_ne!(bits(&found(&settings, 4, 2, 1)), one, "another seed, another search");
}

#[test]
fn rounds_go_on_until_as_many_agree_as_were_asked_for() {
    let few = DescentSettings { samples: 4, starts: 2, agreeing: 2, rounds: 50 };
    let many = DescentSettings { agreeing: 6, ..few };
    let (few, many) = (found(&few, 1, 1, 2), found(&many, 1, 1, 2));
    assert!(many.agreeing >= 6 && many.runs.len() > few.runs.len());
    let short = DescentSettings { samples: 4, starts: 2, agreeing: 100, rounds: 50 };
    let short = found(&DescentSettings { rounds: 50, ..short }, 1, 1, 2);
    let best = &short.runs[short.best.unwrap()];
    assert_eq!((best.reason, short.runs.len() <= 100), (StopReason::Iterations, true));
}

#[test]
fn a_descent_starts_at_the_place_that_is_given() {
    let best = found(&DescentSettings::default(), 1, 1, 2);
    let best = &best.runs[best.best.unwrap()];
    let settings = DescentSettings { samples: 1, starts: 1, agreeing: 2, rounds: 2 };
    let plan = |start: &[f64]| Plan {
        method: Method::Descents(settings.clone()),
        seed: 1,
        runs: 1,
        start: Some(start.to_vec()),
    };
    let again = by(&plan(&best.place)).unwrap();
    // In the first round only, in which there is room for no other.
    assert!(again.runs[0].history[0] <= 1.001 * best.costs.rms.max(1e-13));
    assert!(again.runs.len() == 1 || again.runs[1].history[0] > 1e3 * again.runs[0].history[0]);
    let outside = vec![2.0; best.place.len()];
    for place in [&best.place[1..], &[][..], &outside] {
        assert!(matches!(by(&plan(place)), Err(Error::Parameter { .. })), "{place:?}");
    }
}

#[test]
fn settings_that_cannot_be_used_are_named() {
    let fine = DescentSettings::default();
    let refused = [
        ("samples", DescentSettings { samples: 31, ..fine.clone() }),
        ("starts", DescentSettings { starts: 0, ..fine.clone() }),
        ("agreeing", DescentSettings { agreeing: 1, ..fine.clone() }),
        ("rounds", DescentSettings { rounds: 0, ..fine.clone() }),
    ];
    for (name, settings) in refused {
        let sentence = settings.validate().unwrap_err().to_string();
        assert!(sentence.starts_with(name), "{sentence}");
    }
    assert_eq!(fine.validate(), Ok(()));
}

#[test]
fn a_search_that_is_stopped_keeps_its_best() {
    let (u, y) = log();
    let record = Record::new(&u, &y, DT, Hold::First, 0).unwrap();
    let spec = spec();
    let method = Method::Descents(DescentSettings::default());
    let plan = Plan { method, seed: 1, runs: 1, start: None };
    let mut last = f64::INFINITY;
    let mut third = |progress: &Progress| {
        last = progress.cost;
        if progress.iteration == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let stopped = identify(&record, &spec, &plan, &mut third, NEVER).unwrap();
    let best = &stopped.runs[stopped.best.unwrap()];
    assert_eq!(best.reason, StopReason::Interrupted);
    assert_eq!(best.costs.rms.to_bits(), last.to_bits());
}
