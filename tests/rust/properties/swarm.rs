//! The swarm: inside its box whatever the costs, and the same from any number of threads.

use core::ops::ControlFlow;

use piezotrack_core::identify::{
    Boundary, Evaluator, Monitor, Problem, Progress, Record, Records, Spec, Swarm, SwarmSettings,
    Topology, Update, search,
};
use piezotrack_core::models::{DahlStage, Experiment, Model, StageModel};
use piezotrack_core::signal::{Drive, Hold, NEVER};
use proptest::prelude::*;
use proptest::sample::select;

use crate::{any_number, cases};

prop_compose! {
    fn settings()(
        (particles, iterations) in (1..12_usize, 1..12_usize),
        update in select(vec![Update::Classic, Update::Hypersphere, Update::HypersphereRadial]),
        topology in select(vec![Topology::Global, Topology::Ring, Topology::Random]),
        boundary in select(vec![
            Boundary::Absorb, Boundary::Rebound, Boundary::Reflect, Boundary::Invisible,
        ]),
        inertia in (0.0..1.0_f64, 0.0..1.0_f64),
        (cognitive, social) in (0.0..3.0_f64, 0.0..3.0_f64),
        velocity_limit in 0.01..1.0_f64,
    ) -> SwarmSettings {
        SwarmSettings {
            particles, iterations, update, topology, boundary, inertia, cognitive, social,
            velocity_limit, ..SwarmSettings::xu_li_2010()
        }
    }
}

proptest! {
    #![proptest_config(cases(1))]

    #[test]
    fn every_place_asked_for_is_in_the_box(
        settings in settings(), coordinates in 1..6_usize, seed in any::<u64>(),
        costs in prop::collection::vec(prop_oneof![any_number(), 0.0..1.0_f64], 12..200),
    ) {
        // A setting that is refused is another test's.
        let Ok(mut swarm) = Swarm::new(settings, coordinates, seed, 0) else { return Ok(()) };
        let mut best = f64::INFINITY;
        for told in costs.chunks(12) {
            for place in swarm.ask().flatten() {
                prop_assert_eq!(place.len(), coordinates);
                prop_assert!(place.iter().all(|x| (0.0..=1.0).contains(x)), "{place:?}");
            }
            swarm.tell(told);
            let (place, cost) = swarm.best();
            prop_assert!(cost <= best, "{cost} after {best}");
            prop_assert!(place.iter().all(|x| x.is_finite()), "{place:?}");
            best = cost;
        }
    }
}

proptest! {
    #![proptest_config(cases(16))]

    #[test]
    fn any_number_of_threads_finds_the_same(
        settings in settings(), seed in any::<u64>(), runs in 1..4_usize, threads in 2..6_usize,
    ) {
        if Swarm::new(settings.clone(), 1, 0, 0).is_err() {
            return Ok(());
        }
        prop_assert_eq!(found(&settings, seed, runs, 1), found(&settings, seed, runs, threads));
    }
}

/// The result of each run, to the last bit.
fn found(
    settings: &SwarmSettings,
    seed: u64,
    runs: usize,
    threads: usize,
) -> Vec<(Vec<u64>, Vec<u64>, usize)> {
    let dt = 0.01;
    let u: Vec<f64> = (0..60).map(|k| 30.0 * (1.0 - (0.2 * f64::from(k)).cos())).collect();
    let drive = Drive::new(&u, dt, Hold::First).unwrap();
    let stage = DahlStage::xu_li_2010();
    let y = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().x;
    let record = Record::new(&u, &y, dt, Hold::First, 0).unwrap();
    let spec = Spec {
        bounds: vec![("damping".into(), (1e3, 5e3)), ("a1".into(), (10.0, 1e3))],
        fixed: vec![("stiffness".into(), 26065.0)],
        offset: true,
        ..Spec::of(Model::Dahl)
    };
    let problem = Problem::new(&record, &spec, NEVER).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let outcomes = pool.install(|| {
        let evaluator = Evaluator::new(&record, &problem, NEVER);
        let mut quiet = |_: &Progress| ControlFlow::Continue(());
        let monitor: &mut dyn Monitor = &mut quiet;
        search(&Records::one(evaluator), settings, seed, runs, monitor, NEVER).unwrap()
    });
    outcomes
        .into_iter()
        .map(|run| {
            let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect();
            (bits(&run.theta.0), bits(&run.history), run.evaluations)
        })
        .collect()
}
