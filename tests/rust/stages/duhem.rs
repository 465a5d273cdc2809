//! The Duhem stage of Coleman and Hodgdon: its operator, its inverse, and what a fit finds.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, clippy::float_cmp)]

use piezotrack_control::OperatorInverse;
use piezotrack_control::hysteresis::Operator;
use piezotrack_core::identify::{
    CreepKind, DynamicsKind, History, NodesKind, WeightsRecord, WeightsSettings, identify_weights,
};
use piezotrack_core::models::{
    DuhemInverse, DuhemOperator, DuhemParameters, DuhemStage, Dynamics, Experiment, Invertible,
    Model, Plant, Relaxation, StageModel,
};
use piezotrack_core::signal::{Drive, Hold, NEVER};

/// Loops that are asymmetric, on a range that the paths leave.
const BENT: DuhemParameters = DuhemParameters {
    alpha: 0.06,
    f: [1e-6, 2e-9, -2e-11],
    g: [0.7e-6, 1e-9, -1e-11],
    low: -20.0,
    high: 30.0,
};

/// With a straight f and a constant g.
const STRAIGHT: DuhemParameters =
    DuhemParameters { alpha: 0.05, f: [1e-6, 0.0, 0.0], g: [0.7e-6, 0.0, 0.0], ..BENT };

/// A displacement that falls as the drive rises.
fn falling() -> DuhemParameters {
    DuhemParameters { f: BENT.f.map(|each| -each), g: BENT.g.map(|each| -each), ..BENT }
}

fn duhem(parameters: DuhemParameters) -> DuhemOperator {
    DuhemOperator::new(parameters).unwrap()
}

fn stage(parameters: DuhemParameters, dynamics: Dynamics) -> DuhemStage {
    let relaxation = Relaxation::new(&[0.01], &[0.3], dynamics).unwrap();
    DuhemStage { operator: duhem(parameters), relaxation }
}

/// A path that turns at places which do not repeat.
fn path(count: u32) -> Vec<f64> {
    let wave = |t: f64| 20.0 * libm::sin(t) + 12.0 * libm::sin(2.7 * t) + 3.0 * libm::sin(17.3 * t);
    (0..count).map(|k| wave(0.01 * f64::from(k))).collect()
}

/// The differential equation: dh/du on a rise or a fall, f and g straight on beyond the range.
fn slope(of: &DuhemParameters, volts: f64, h: f64, side: f64) -> f64 {
    let inside = volts.clamp(of.low, of.high);
    let [f1, f2, f3] = of.f;
    let [g0, g1, g2] = of.g;
    let f = f1 * inside + f2 * inside.powi(2) + f3 * inside.powi(3);
    let along = f1 + 2.0 * f2 * inside + 3.0 * f3 * inside.powi(2);
    let g = g0 + g1 * inside + g2 * inside.powi(2);
    side * of.alpha * (f + along * (volts - inside) - h) + g
}

#[test]
fn it_follows_its_differential_equation() {
    for of in [BENT, STRAIGHT, falling()] {
        let operator = duhem(of);
        let (mut state, mut h, mut from) = (operator.rest(), 0.0, 0.0);
        for to in path(1500) {
            // Runge and Kutta's method in 64 steps.
            let step = (to - from) / 64.0;
            let side = if to < from { -1.0 } else { 1.0 };
            for k in 0..64 {
                let u = from + step * f64::from(k);
                let one = slope(&of, u, h, side);
                let two = slope(&of, u + 0.5 * step, h + 0.5 * step * one, side);
                let three = slope(&of, u + 0.5 * step, h + 0.5 * step * two, side);
                let four = slope(&of, u + step, h + step * three, side);
                h += step / 6.0 * (one + 2.0 * two + 2.0 * three + four);
            }
            from = to;
            let found = operator.follow(&mut state, to);
            // The method takes no notice of an end of the range within a step.
            assert!((found - h).abs() < 1e-13, "{to}: {found} {h}");
        }
    }
}

#[test]
fn its_settled_loop_is_as_wide_as_the_closed_form_says() {
    // With e = h - f: e' = -alpha e - (f1 - g0) on a rise and the opposite on a fall, which
    // repeats between -A and A with e = -+ (f1 - g0)/alpha tanh(alpha A) at the ends.
    let operator = duhem(STRAIGHT);
    let most = 18.0;
    let mut state = operator.rest();
    for _ in 0..60 {
        operator.follow(&mut state, most);
        operator.follow(&mut state, -most);
    }
    let end = 0.3e-6 / 0.05 * libm::tanh(0.05 * most);
    assert!((state.output - (-1e-6 * most + end)).abs() < 1e-18);
}

#[test]
fn time_does_not_enter() {
    let turns = [30.0, -10.0, 22.0, 3.0, 17.0, -35.0, 60.0];
    for of in [BENT, falling()] {
        let operator = duhem(of);
        let (mut coarse, mut fine, mut from) = (operator.rest(), operator.rest(), 0.0);
        for to in turns {
            operator.follow(&mut coarse, to);
            for k in 1..=997 {
                operator.follow(&mut fine, from + (to - from) * f64::from(k) / 997.0);
            }
            from = to;
            assert!((coarse.output - fine.output).abs() < 1e-18);
        }
    }
}

#[test]
fn every_branch_rises_where_the_parameters_are_accepted() {
    // On the edge of the condition: f' = 2 g nearly, and |g'| near alpha f'.
    let steep = DuhemParameters { f: [1.399e-6, 0.0, 0.0], ..STRAIGHT };
    let bent = DuhemParameters {
        f: [1e-6, 1.19e-8, 0.0],
        g: [1e-6, 2.38e-8, 0.0],
        low: 0.0,
        high: 50.0,
        ..STRAIGHT
    };
    for (of, sign) in [(BENT, 1.0), (falling(), -1.0), (steep, 1.0), (bent, 1.0)] {
        let operator = duhem(of);
        let mut state = operator.rest();
        for volts in path(4000) {
            let before = state;
            operator.follow(&mut state, volts);
            let rise = (state.output - before.output) * (state.input - before.input) * sign;
            assert!(rise > 0.0 || state.input == before.input, "{volts}");
            assert!(sign * operator.output(&state).1 > 0.0);
        }
    }
}

#[test]
fn parameters_with_branches_that_turn_back_are_refused() {
    let refused = |of: DuhemParameters| DuhemOperator::new(of).unwrap_err().to_string();
    assert!(refused(DuhemParameters { f: [1.5e-6, 0.0, 0.0], ..STRAIGHT }).starts_with("g0"));
    assert!(refused(DuhemParameters { f: [-1e-6, 0.0, 0.0], ..STRAIGHT }).starts_with("f1"));
    assert!(refused(DuhemParameters { g: [0.7e-6, 1e-7, 0.0], ..STRAIGHT }).contains("|g'|/alpha"));
    // After a long rise with f' above twice g the way back would rise at first.
    let (f1, g0, alpha) = (1.5e-6, 0.7e-6, 0.05);
    let behind = (g0 - f1) / alpha;
    assert!(alpha * behind + g0 < 0.0);
    for (name, of) in [
        ("alpha", DuhemParameters { alpha: 0.0, ..STRAIGHT }),
        ("f2", DuhemParameters { f: [1e-6, f64::NAN, 0.0], ..STRAIGHT }),
        ("g2", DuhemParameters { g: [1e-6, 0.0, f64::INFINITY], ..STRAIGHT }),
        ("low", DuhemParameters { low: f64::NAN, ..STRAIGHT }),
        ("high", DuhemParameters { high: -20.0, ..STRAIGHT }),
    ] {
        assert!(refused(of).starts_with(name), "{name}");
    }
}

#[test]
fn the_inverse_undoes_the_operator() {
    let nested = [30.0, -30.0, 25.0, -20.0, 18.0, -8.0, 9.0, 1.0, 4.0, 3.0, 4.0, 90.0, -70.0, 0.0];
    for of in [BENT, STRAIGHT, falling()] {
        let operator = duhem(of);
        let inverse = DuhemInverse(operator);
        for u in [&nested[..], &path(20_000)] {
            let (mut there, mut back, mut again) =
                (operator.rest(), inverse.rest(), operator.rest());
            for &volts in u {
                let output = operator.follow(&mut there, volts);
                let found = inverse.follow(&mut back, output);
                let reached = operator.follow(&mut again, found);
                assert!((reached - output).abs() < 1e-19, "{volts}: {reached} {output}");
                assert!((found - volts).abs() < 1e-12, "{volts}: {found}");
            }
        }
    }
}

#[test]
fn what_is_no_output_leaves_no_trace() {
    let inverse = DuhemInverse(duhem(BENT));
    let mut state = inverse.rest();
    assert!(inverse.follow(&mut state, 10e-6).is_finite());
    let before = state;
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e200, -1e200] {
        assert!(inverse.follow(&mut state, bad).is_nan(), "{bad}");
        assert_eq!(state, before);
    }
    inverse.follow(&mut state, 10e-6);
    assert_eq!(state, before);
}

#[test]
fn the_stage_moves_as_under_a_drive_in_many_more_steps() {
    let stage = stage(BENT, Dynamics::Second { frequency: 30.0, damping_ratio: 0.1 });
    let u = path(600);
    let run = stage
        .simulate(&Experiment::of(&Drive::new(&u, 0.01, Hold::First).unwrap(), NEVER))
        .unwrap()
        .unwrap();
    let fine: Vec<f64> = u
        .windows(2)
        .flat_map(|pair| (0..50).map(|k| pair[0] + (pair[1] - pair[0]) * f64::from(k) / 50.0))
        .collect();
    let slow = stage
        .simulate(&Experiment::of(&Drive::new(&fine, 0.0002, Hold::First).unwrap(), NEVER))
        .unwrap()
        .unwrap();
    for (k, x) in run.x.iter().take(u.len() - 1).enumerate() {
        assert!((x - slow.x[50 * k]).abs() < 1e-10, "{k}");
    }
    assert!(run.error_estimate <= 1e-10);
    // And in a closed loop.
    let flow = stage.flow(0.01);
    let mut state = Plant::rest(&stage);
    for k in 1..u.len() {
        stage.advance(&flow, &mut state, u[k - 1], u[k]);
        assert!((stage.displacement(&state) - run.x[k]).abs() < 1e-10, "{k}");
    }
}

#[test]
fn a_simulation_and_the_inverse_go_on_from_any_state() {
    let (stage, dt) = (stage(BENT, Dynamics::None), 0.01);
    let u = path(3000);
    let (before, after) = u.split_at(1111);
    let whole = Drive::new(&u, dt, Hold::First).unwrap();
    let whole = stage.simulate(&Experiment::of(&whole, NEVER)).unwrap().unwrap();
    let drive = Drive::new(&u[..1112], dt, Hold::First).unwrap();
    let middle = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().last;
    let drive = Drive::new(after, dt, Hold::First).unwrap();
    let experiment = Experiment { initial: Some(&middle), ..Experiment::of(&drive, NEVER) };
    let run = stage.simulate(&experiment).unwrap().unwrap();
    let (inverse, mut state) = stage.inverse(dt, Some(&middle)).unwrap();
    for (k, (&x, &volts)) in run.x.iter().zip(after).enumerate() {
        assert!((x - whole.x[before.len() + k]).abs() < 1e-18);
        let found = inverse.step(&mut state, x, 0.0, 0.0);
        // The inverse of the creep takes the output as straight from sample to sample.
        assert!((found - volts).abs() < 1e-4, "{found} for {volts}");
    }
}

#[test]
fn a_fit_finds_what_the_record_was_made_with() {
    let u: Vec<f64> = path(1500).iter().map(|volts| 0.7 * volts + 5.0).collect();
    let span = u.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), volts| {
        (f64::min(low, *volts), f64::max(high, *volts))
    });
    for of in [BENT, falling()] {
        let of = DuhemParameters { low: span.0, high: span.1, ..of };
        let relaxation = Relaxation::new(&[], &[], Dynamics::None).unwrap();
        let made = DuhemStage { operator: duhem(of), relaxation };
        let drive = Drive::new(&u, 0.01, Hold::First).unwrap();
        let y = made.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().x;
        let record =
            WeightsRecord { history: Some(History::Virgin), ..WeightsRecord::of(drive, &y, 0) };
        let settings = WeightsSettings {
            nodes: NodesKind::Auto,
            zones: 0,
            creep: CreepKind::Times(vec![]),
            dynamics: DynamicsKind::None,
            start: None,
        };
        let fit = identify_weights(Model::Duhem, &[record], &settings, NEVER).unwrap().unwrap();
        assert!(fit.rms < 1e-9, "{:e}", fit.rms);
        let found = |name: &str| fit.values.number(name);
        assert!((found("alpha") / of.alpha - 1.0).abs() < 0.01, "{}", found("alpha"));
        assert!((found("f1") / of.f[0] - 1.0).abs() < 0.01, "{:e}", found("f1"));
        assert!((found("g0") / of.g[0] - 1.0).abs() < 0.01, "{:e}", found("g0"));
        assert_eq!((found("low"), found("high")), span);
        let stage = DuhemStage::build(&fit.values).unwrap();
        let start =
            Experiment { initial: Some(&fit.records[0].start), ..Experiment::of(&drive, NEVER) };
        let again = stage.simulate(&start).unwrap().unwrap().x;
        for (x, y) in again.iter().zip(&y) {
            assert!((x + fit.records[0].offset - y).abs() < 5e-9);
        }
    }
}

#[test]
fn its_gains_are_those_of_its_settled_loop() {
    let stage = stage(BENT, Dynamics::First { time: 1e-3 });
    let [least, middle, most] =
        stage.loop_plants(-15.0, 25.0).unwrap().map(|plant| plant.static_gain());
    let operator = stage.operator;
    let mut state = operator.rest();
    for _ in 0..60 {
        operator.follow(&mut state, 25.0);
        operator.follow(&mut state, -15.0);
    }
    let bottom = state.output;
    let mut range = (f64::INFINITY, 0.0_f64);
    let way = (1..=4000).chain((0..4000).rev()).map(|k| -15.0 + 0.01 * f64::from(k));
    for volts in way {
        let before = state;
        operator.follow(&mut state, volts);
        let slope = (state.output - before.output) / (state.input - before.input);
        range = (range.0.min(slope), range.1.max(slope));
        if volts == 25.0 {
            assert!((middle - (state.output - bottom) / 40.0).abs() < 1e-12);
        }
    }
    assert!((least - range.0).abs() < 1e-3 * most, "{least} {range:?}");
    assert!((most - range.1).abs() < 1e-2 * most, "{most} {range:?}");
}
