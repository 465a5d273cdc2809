//! Long computations ask whether to stop, however few samples they have; sizes beyond memory.
#![allow(missing_docs, clippy::unwrap_used, clippy::float_cmp)]

use core::sync::atomic::{AtomicUsize, Ordering};

use piezotrack_core::Error;
use piezotrack_core::identify::{self, Plan, SwarmSettings};
use piezotrack_core::math::{available, room, zeros};
use piezotrack_core::models::{DahlStage, Experiment, Method, Model, Plant, Values};
use piezotrack_core::signal::{Drive, Hold, NEVER, delayed};
use piezotrack_core::simulate::{
    MissedTicks, Sensor, Timing, TwoAxes, VirtualStage, closed_loop, open_loops,
};

fn stage() -> VirtualStage {
    VirtualStage { preconditioning: None, sensor: Sensor::IDEAL, ..VirtualStage::xu_li_2010(1) }
}

/// Calls a computation that is to stop at the third question; how often it was asked.
fn asked<T>(computation: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> Option<T>) -> usize {
    let questions = AtomicUsize::new(0);
    let stop = || questions.fetch_add(1, Ordering::Relaxed) >= 2;
    assert!(computation(&stop).is_none());
    questions.into_inner()
}

/// A million steps from sample to sample.
#[test]
fn a_long_sample_of_the_virtual_stage_is_left_in_the_middle() {
    let stage = stage();
    let drive = Drive::new(&[0.0, 10.0], 20.0, Hold::First).unwrap();
    assert_eq!(asked(|stop| stage.simulate(&drive, stop).unwrap()), 3);
    let axes = TwoAxes {
        x: stage.apparatus(),
        y: stage.apparatus(),
        cross_talk: [0.0; 2],
        lag: 0.0,
        missed: MissedTicks::NONE,
    };
    let start = || (stage.start(), stage.start());
    let run = |stop: &(dyn Fn() -> bool + Sync)| {
        open_loops(&axes, start(), [&drive, &drive], stop).unwrap()
    };
    assert_eq!(asked(run), 3);
}

/// The first question is asked before the interval.
#[test]
fn a_long_control_interval_is_left_in_the_middle() {
    let stage = stage();
    for (interval, substeps) in [(20.0, 1), (20.0, 1000), (2e-3, 1000)] {
        let timing = Timing { interval, samples: 2, delay: 0.0, jitter: 0.0, substeps };
        let apparatus = stage.apparatus();
        let run = |stop: &(dyn Fn() -> bool + Sync)| {
            closed_loop(&apparatus, stage.start(), &timing, |_, _| 10.0, stop).unwrap()
        };
        assert_eq!(asked(run), 3, "{interval} s in {substeps}");
    }
}

/// Classical methods take many steps in an interval too.
#[test]
fn a_long_sample_of_a_classical_method_is_left_after_it() {
    let stage = Model::named("dahl").unwrap();
    let values = Values::scalars(stage.info().parameters, &DahlStage::xu_li_2010().values());
    let stage = stage.build(&values).unwrap();
    let u: Vec<f64> = [0.0, 30.0].repeat(20);
    let drive = Drive::new(&u, 1.0, Hold::First).unwrap();
    for method in [Method::Rk4, Method::Rk45] {
        let run = |stop: &(dyn Fn() -> bool + Sync)| {
            let experiment = Experiment { method, ..Experiment::of(&drive, stop) };
            stage.simulate(&experiment).unwrap()
        };
        // After the third, whether that was a stop.
        assert!(asked(run) <= 4, "{method:?}");
    }
}

/// Steps are taken in blocks between two questions, and nothing shows where these end.
#[test]
fn a_stretch_has_the_same_bits_in_blocks() {
    let stage = stage();
    let end = |u: &[f64], dt: f64| {
        let drive = Drive::new(u, dt, Hold::Zero).unwrap();
        let run = stage.simulate(&drive, NEVER).unwrap().unwrap();
        (run.displacement[u.len() - 1], run.last)
    };
    // 50 000 steps of 20 us, at once and in ten samples.
    let (whole, at_once) = end(&[30.0; 2], 1.0);
    let (parts, in_ten) = end(&[30.0; 11], 0.1);
    assert_eq!((whole, at_once.applied), (parts, in_ten.applied));
    assert_eq!(stage.stage.displacement(&at_once.plant), stage.stage.displacement(&in_ten.plant));
    assert_eq!(at_once.command, 30.0);
}

/// From block to block a ramp goes on where it was.
#[test]
fn a_ramp_in_blocks_is_the_ramp_in_samples() {
    let stage = stage();
    let end = |u: &[f64], dt: f64| {
        let drive = Drive::new(u, dt, Hold::First).unwrap();
        stage.simulate(&drive, NEVER).unwrap().unwrap().displacement[u.len() - 1]
    };
    let samples: Vec<f64> = (0..=10).map(f64::from).collect();
    assert!((end(&[0.0, 10.0], 1.0) - end(&samples, 0.1)).abs() < 1e-15);
}

#[test]
fn memory_that_cannot_be_had_is_an_error_with_its_size() {
    let huge = usize::MAX / 16;
    let sentence = "the motion: 9223372036855 MB of memory cannot be allocated";
    assert_eq!(room::<f64>("the motion", huge).unwrap_err().to_string(), sentence);
    assert_eq!(zeros("the motion", huge).unwrap_err().to_string(), sentence);
    assert_eq!(available("the motion", huge, 8).unwrap_err().to_string(), sentence);
    assert!(available("the motion", usize::MAX, usize::MAX).is_err());
    assert_eq!(zeros("the motion", 3).unwrap(), [0.0; 3]);
}

#[test]
fn particles_of_all_runs_together_are_bounded() {
    let plan = |particles, runs| {
        let settings = SwarmSettings { particles, ..SwarmSettings::xu_li_2010() };
        Plan { method: identify::Method::Swarm(settings), seed: 1, runs, start: None }.validate()
    };
    assert_eq!(plan(100_000, 1), Ok(()));
    assert_eq!(plan(100, 10_000), Ok(()));
    let refused = plan(100_000, 11);
    assert!(matches!(refused, Err(Error::Parameter { ref name, .. }) if name == "runs"));
}

#[test]
fn a_delay_longer_than_a_record_shows_the_start() {
    let (x, v) = ([1.0, 2.0, 3.0], [0.0; 3]);
    for delay in [4.0, 1e9, 1e300, f64::INFINITY] {
        assert_eq!(delayed(&x, &v, 1.0, delay).unwrap(), [1.0; 3], "{delay}");
    }
}
