//! The Prandtl-Ishlinskii stage: its inverse, its memory, and what a fit finds.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, clippy::float_cmp)]

use nalgebra::{DMatrix, DVector};
use piezotrack_control::PlayInverse;
use piezotrack_control::hysteresis::{Operator, Play};
use piezotrack_core::identify::{
    CreepKind, DynamicsKind, History, NodesKind, WeightsRecord, WeightsSettings, identify_weights,
};
use piezotrack_core::math::{NOT_NEGATIVE, Rows, bounded};
use piezotrack_core::models::{
    Dynamics, Experiment, Mode, Model, Plant, PlayHysteresis, PrandtlIshlinskiiStage, Relaxation,
    StageModel,
};
use piezotrack_core::signal::{Drive, Hold, NEVER};

const PLAY: Play<f64, 4, 2> = Play {
    linear: 0.6,
    thresholds: [1.0, 2.5, 6.0, 12.0],
    weights: [0.2, 0.1, 0.0, 0.25],
    dead_zone_thresholds: [-5.0, 8.0],
    dead_zone_weights: [0.15, -0.2],
};

fn stage(dynamics: Dynamics) -> PrandtlIshlinskiiStage {
    let weights = [0.2e-6, 0.1e-6, 0.15e-6];
    PrandtlIshlinskiiStage {
        operator: PlayHysteresis::new(1e-6, &[4.0, 10.0, 20.0], &weights, &[30e-6], &[0.1])
            .unwrap(),
        relaxation: Relaxation::new(&[0.01], &[0.3], dynamics).unwrap(),
    }
}

/// A path that turns at places which do not repeat.
fn path(count: u32) -> Vec<f64> {
    let wave = |t: f64| 20.0 * libm::sin(t) + 12.0 * libm::sin(2.7 * t) + 3.0 * libm::sin(17.3 * t);
    (0..count).map(|k| wave(0.01 * f64::from(k))).collect()
}

#[test]
fn the_inverse_undoes_the_operator() {
    let inverse = PlayInverse::new(&PLAY).unwrap();
    let (mut there, mut back) = (PLAY.rest(), inverse.rest());
    // What the dead zones make of 0 stands for 0 in the inverse too.
    for input in path(20_000) {
        let output = PLAY.follow(&mut there, input);
        let found = inverse.follow(&mut back, output);
        assert!((found - input).abs() < 1e-12, "{found} for {input}");
    }
}

#[test]
fn the_inverse_of_a_falling_operator_undoes_it() {
    let falling = Play { linear: -PLAY.linear, weights: PLAY.weights.map(|w| -w), ..PLAY };
    let inverse = PlayInverse::new(&falling).unwrap();
    let (mut there, mut back) = (falling.rest(), inverse.rest());
    let (mut rising, mut mirrored) = (PLAY.rest(), 0.0);
    for (k, input) in path(20_000).into_iter().enumerate() {
        let output = falling.follow(&mut there, input);
        mirrored = PLAY.follow(&mut rising, -input);
        assert_eq!(output, mirrored);
        if k == 777 {
            back = inverse.memory(&falling, &there);
        }
        let found = inverse.follow(&mut back, output);
        assert!((found - input).abs() < 1e-12, "{found} for {input}");
    }
    assert!(mirrored.abs() > 0.1);
}

#[test]
fn a_stage_can_begin_in_equilibrium() {
    let further = [Mode { weight: 0.3, frequency: 70.0, damping_ratio: 0.05 }];
    for dynamics in [
        Dynamics::None,
        Dynamics::First { time: 0.02 },
        Dynamics::Second { frequency: 30.0, damping_ratio: 0.1 },
        Dynamics::modes(30.0, 0.1, &further).unwrap(),
    ] {
        let stage = stage(dynamics);
        assert_eq!(stage.settled_at(&[]), stage.at_rest());
        let mut state = stage.settled_at(&[40.0, -10.0, 25.0]);
        let values = stage.equilibrium(&[40.0, -10.0, 25.0]).unwrap();
        assert_eq!(stage.state(Some(&values)).unwrap().relaxation, state.relaxation);
        // The same, slowly, as a simulation has it.
        let slowly = Drive::new(&[0.0, 40.0, -10.0, 25.0, 25.0], 1e3, Hold::First).unwrap();
        let run = stage.simulate(&Experiment::of(&slowly, NEVER)).unwrap().unwrap();
        assert!((stage.displacement(&state) - run.x[4]).abs() < 1e-14);
        assert!((stage.displacement(&state) - 1.01 * run.hysteresis[4]).abs() < 1e-17);
        // And it stays.
        let (flow, before) = (stage.flow(1e-3), stage.displacement(&state));
        for _ in 0..100 {
            stage.advance(&flow, &mut state, 25.0, 25.0);
            assert!((stage.displacement(&state) - before).abs() < 1e-19);
        }
    }
}

#[test]
fn a_plants_step_is_exact_however_long() {
    // A closed loop moves the voltage far in one step: no further off than in many.
    let dynamics = Dynamics::Second { frequency: 160.0, damping_ratio: 0.065 };
    let relaxation = Relaxation::new(&[], &[], dynamics).unwrap();
    let stage = PrandtlIshlinskiiStage { relaxation, ..stage(dynamics) };
    let (long, short) = (stage.flow(5e-3), stage.flow(5e-3 / 64.0));
    let (mut one, mut many) = (Plant::rest(&stage), Plant::rest(&stage));
    for (from, to) in [(0.0, 60.0), (60.0, 3.0), (3.0, 50.0), (10.0, 11.0), (11.0, -40.0)] {
        stage.advance(&long, &mut one, from, to);
        for k in 0..64 {
            let at = |k: i32| from + (to - from) * f64::from(k) / 64.0;
            stage.advance(&short, &mut many, at(k), at(k + 1));
        }
        let off = stage.displacement(&one) - stage.displacement(&many);
        assert!(off.abs() < 1e-15, "{off}");
    }
}

#[test]
fn the_inverse_can_begin_anywhere() {
    let inverse = PlayInverse::new(&PLAY).unwrap();
    let mut there = PLAY.rest();
    for input in path(777) {
        PLAY.follow(&mut there, input);
    }
    let mut back = inverse.memory(&PLAY, &there);
    for input in [10.0, -3.0, 4.0, 3.5, 30.0, -30.0, 0.0] {
        let output = PLAY.follow(&mut there, input);
        assert!((inverse.follow(&mut back, output) - input).abs() < 1e-12);
    }
}

#[test]
fn what_is_not_finite_leaves_no_trace() {
    let inverse = PlayInverse::new(&PLAY).unwrap();
    let mut state = inverse.rest();
    inverse.follow(&mut state, 5.0);
    let before = state;
    for bad in [f64::NAN, f64::INFINITY, -1e200] {
        assert!(inverse.follow(&mut state, bad).is_nan());
        assert_eq!(state, before);
    }
}

#[test]
fn operators_without_an_inverse_are_refused() {
    let refused = |play: Play<f64, 4, 2>| PlayInverse::new(&play).unwrap_err().name;
    assert_eq!(refused(Play { linear: 0.0, ..PLAY }), "linear");
    assert_eq!(refused(Play { linear: -0.6, ..PLAY }), "weights");
    assert_eq!(refused(Play { weights: [0.1, -0.1, 0.0, 0.0], ..PLAY }), "weights");
    assert_eq!(refused(Play { thresholds: [2.0, 1.0, 3.0, 4.0], ..PLAY }), "thresholds");
    assert_eq!(refused(Play { dead_zone_thresholds: [1.0, 0.0], ..PLAY }), "dead_zone_thresholds");
    assert_eq!(refused(Play { dead_zone_weights: [-0.6, -0.6], ..PLAY }), "dead_zone_weights");
    assert_eq!(refused(Play { dead_zone_weights: [f64::NAN, 0.0], ..PLAY }), "dead_zone_weights");
}

#[test]
fn a_plant_moves_as_the_simulation_does() {
    let modes = Dynamics::Second { frequency: 30.0, damping_ratio: 0.1 };
    for dynamics in [Dynamics::None, Dynamics::First { time: 0.02 }, modes] {
        let stage = stage(dynamics);
        let u = path(2000);
        let drive = Drive::new(&u, 0.01, Hold::First).unwrap();
        let run = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap();
        let flow = stage.flow(0.01);
        let mut state = Plant::rest(&stage);
        for k in 1..u.len() {
            stage.advance(&flow, &mut state, u[k - 1], u[k]);
            assert!((stage.displacement(&state) - run.x[k]).abs() < 1e-19, "{k}");
        }
    }
}

#[test]
fn a_fit_finds_what_the_record_was_made_with() {
    let stage = PrandtlIshlinskiiStage {
        relaxation: Relaxation::new(&[], &[], Dynamics::First { time: 0.015 }).unwrap(),
        operator: PlayHysteresis::new(1e-6, &[4.0, 10.0, 20.0], &[0.2e-6, 0.0, 0.15e-6], &[], &[])
            .unwrap(),
    };
    let u = path(6000);
    for hold in [Hold::First, Hold::Zero] {
        let drive = Drive::new(&u, 0.01, hold).unwrap();
        let y = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().x;
        let settings = WeightsSettings {
            nodes: NodesKind::Given(vec![4.0, 10.0, 20.0]),
            zones: 0,
            creep: CreepKind::Times(vec![]),
            dynamics: DynamicsKind::First,
            start: None,
        };
        let record =
            WeightsRecord { history: Some(History::Virgin), ..WeightsRecord::of(drive, &y, 500) };
        let fit = identify_weights(Model::PrandtlIshlinskii, &[record], &settings, NEVER)
            .unwrap()
            .unwrap();
        let time = fit.values.number("time_constant");
        assert!((time - 0.015).abs() < 1e-6, "{time}");
        let made = [0.2e-6, 0.0, 0.15e-6];
        for (found, made) in fit.values.list("weights").iter().zip(made) {
            assert!((found - made).abs() < 1e-10, "{found} {made}");
        }
        assert!(fit.rms < 1e-9);
        assert_eq!(
            identify_weights(Model::PrandtlIshlinskii, &[record], &settings, &|| true).unwrap(),
            None
        );
    }
}

#[test]
fn the_solution_satisfies_kuhn_and_tucker() {
    let a = DMatrix::from_fn(40, 6, |i, j| {
        let place = f64::from(u32::try_from(7 * i + 13 * j).unwrap());
        libm::sin(place) + libm::cos(0.3 * place)
    });
    let b =
        DVector::from_fn(40, |i, _| a[(i, 0)] + libm::cos(f64::from(u32::try_from(i).unwrap())));
    let x = bounded(a.clone(), &b, &[]);
    let pull = a.tr_mul(&(&b - &a * &x));
    assert!(x.iter().any(|value| *value > 0.0));
    for (value, pull) in x.iter().zip(pull.iter()) {
        assert!(*value >= 0.0);
        assert!(if *value > 0.0 { pull.abs() < 1e-12 } else { *pull < 1e-12 });
    }
    // The same, its rows compressed as they come.
    let mut rows = Rows::new(6);
    for _ in 0..20 {
        for i in 0..40 {
            let row: Vec<f64> = a.row(i).iter().copied().collect();
            rows.push(&row, b[i]);
        }
    }
    // Also from wherever it begins.
    let near: Vec<f64> = x.iter().map(|value| 1.1 * value).collect();
    for beginning in [&[][..], &near, &[1e3; 6], &[-1.0, 1.0, 0.0, 2.0, -1e9, 1e9]] {
        for (one, other) in rows.solve_near(&[NOT_NEGATIVE; 6], beginning).iter().zip(x.iter()) {
            assert!((one - other).abs() < 1e-12);
        }
    }
}
