//! The polynomial Prandtl-Ishlinskii stage: its operator, its inverse, and what a fit finds.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, clippy::float_cmp)]

use piezotrack_control::OperatorInverse;
use piezotrack_core::identify::{
    CreepKind, DynamicsKind, History, NodesKind, WeightsRecord, WeightsSettings, identify_weights,
};
use piezotrack_core::models::{
    Dynamics, Experiment, Invertible, Model, Plant, PlayHysteresis, PolynomialPlays,
    PolynomialPlaysInverse, PolynomialPrandtlIshlinskiiStage, PrandtlIshlinskiiStage, Relaxation,
    Remembering, StageModel,
};
use piezotrack_core::signal::{Drive, Hold, NEVER};

const POLYNOMIAL: [f64; 3] = [1e-6, 6e-9, -1.2e-10];
const RANGE: (f64, f64) = (-25.0, 30.0);
const THRESHOLDS: [f64; 3] = [4.0, 10.0, 20.0];
const WEIGHTS: [f64; 3] = [0.2e-6, 0.0, 0.15e-6];

fn plays() -> PolynomialPlays {
    PolynomialPlays::new(POLYNOMIAL, RANGE, &THRESHOLDS, &WEIGHTS).unwrap()
}

fn falling() -> PolynomialPlays {
    let minus = |each: f64| -each;
    PolynomialPlays::new(POLYNOMIAL.map(minus), RANGE, &THRESHOLDS, &WEIGHTS.map(minus)).unwrap()
}

fn stage(dynamics: Dynamics) -> PolynomialPrandtlIshlinskiiStage {
    let relaxation = Relaxation::new(&[0.01], &[0.3], dynamics).unwrap();
    PolynomialPrandtlIshlinskiiStage { operator: plays(), relaxation }
}

/// A path that turns at places which do not repeat, and leaves the range.
fn path(count: u32) -> Vec<f64> {
    let wave = |t: f64| 20.0 * libm::sin(t) + 12.0 * libm::sin(2.7 * t) + 3.0 * libm::sin(17.3 * t);
    (0..count).map(|k| wave(0.01 * f64::from(k))).collect()
}

#[test]
fn it_follows_its_equations() {
    let (mut z, operator) = ([0.0; 3], plays());
    let (mut state, mut other) = (operator.rest(), falling().rest());
    for volts in path(3000) {
        let inside = volts.clamp(RANGE.0, RANGE.1);
        let [a1, a2, a3] = POLYNOMIAL;
        let along = a1 + 2.0 * a2 * inside + 3.0 * a3 * inside.powi(2);
        let mut expected =
            a1 * inside + a2 * inside.powi(2) + a3 * inside.powi(3) + along * (volts - inside);
        for (z, (r, w)) in z.iter_mut().zip(THRESHOLDS.into_iter().zip(WEIGHTS)) {
            *z = f64::max(volts - r, f64::min(volts + r, *z));
            expected += w * *z;
        }
        let found = operator.follow(&mut state, volts);
        assert!((found - expected).abs() < 1e-19, "{found} {expected}");
        assert_eq!(operator.memory(&state), z);
        assert_eq!(falling().follow(&mut other, volts), -found);
    }
}

#[test]
fn with_a_straight_polynomial_it_is_the_operator_of_prandtl_and_ishlinskii() {
    let relaxation = Relaxation::new(&[0.02], &[0.5], Dynamics::First { time: 0.02 }).unwrap();
    let (polynomial, range) = ([1e-6, 0.0, 0.0], (-50.0, 50.0));
    let operator = PolynomialPlays::new(polynomial, range, &THRESHOLDS, &WEIGHTS).unwrap();
    let one = PolynomialPrandtlIshlinskiiStage { operator, relaxation };
    let operator = PlayHysteresis::new(1e-6, &THRESHOLDS, &WEIGHTS, &[], &[]).unwrap();
    let other = PrandtlIshlinskiiStage { operator, relaxation };
    let u = path(2000);
    let drive = Drive::new(&u, 0.01, Hold::First).unwrap();
    let experiment = Experiment::of(&drive, NEVER);
    let [one, other] =
        [one.simulate(&experiment), other.simulate(&experiment)].map(|run| run.unwrap().unwrap().x);
    for (one, other) in one.iter().zip(&other) {
        assert!((one - other).abs() < 1e-17, "{one} {other}");
    }
}

#[test]
fn inner_loops_close_and_are_wiped_out() {
    let last = |turns: &[f64]| {
        let mut state = plays().rest();
        let outputs: Vec<f64> =
            turns.iter().map(|volts| plays().follow(&mut state, *volts)).collect();
        *outputs.last().unwrap()
    };
    let once = last(&[35.0, -35.0, 20.0]);
    assert_eq!(once, last(&[35.0, -35.0, 35.0, -35.0, 20.0]));
    assert_eq!(once, last(&[35.0, -35.0, 10.0, -5.0, 4.0, -1.0, 20.0]));
}

#[test]
fn the_inverse_undoes_the_operator() {
    let nested = [30.0, -30.0, 25.0, -20.0, 18.0, -8.0, 9.0, 1.0, 4.0, 3.0, 4.0, 90.0, -70.0, 0.0];
    for operator in [plays(), falling()] {
        let inverse = PolynomialPlaysInverse(operator);
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
    let inverse = PolynomialPlaysInverse(plays());
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
    let stage = stage(Dynamics::Second { frequency: 30.0, damping_ratio: 0.1 });
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
    let flow = stage.flow(0.01);
    let mut state = Plant::rest(&stage);
    for k in 1..u.len() {
        stage.advance(&flow, &mut state, u[k - 1], u[k]);
        assert!((stage.displacement(&state) - run.x[k]).abs() < 1e-10, "{k}");
    }
}

#[test]
fn the_inverse_goes_on_from_any_state() {
    let (stage, dt) = (stage(Dynamics::None), 0.01);
    let u = path(3000);
    let (before, after) = u.split_at(1111);
    let drive = Drive::new(before, dt, Hold::First).unwrap();
    let middle = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().last;
    let drive = Drive::new(after, dt, Hold::First).unwrap();
    let experiment = Experiment { initial: Some(&middle), ..Experiment::of(&drive, NEVER) };
    let run = stage.simulate(&experiment).unwrap().unwrap();
    let (inverse, mut state) = stage.inverse(dt, Some(&middle)).unwrap();
    for (&x, &volts) in run.x.iter().zip(after) {
        let found = inverse.step(&mut state, x, 0.0, 0.0);
        assert!((found - volts).abs() < 1e-4, "{found} for {volts}");
    }
}

#[test]
fn a_fit_finds_what_the_record_was_made_with() {
    let u: Vec<f64> = path(1500).iter().map(|volts| 0.65 * volts).collect();
    let span = u.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), volts| {
        (f64::min(low, *volts), f64::max(high, *volts))
    });
    let relaxation = Relaxation::new(&[], &[], Dynamics::None).unwrap();
    for operator in [plays(), falling()] {
        let made = PolynomialPrandtlIshlinskiiStage { operator, relaxation };
        let drive = Drive::new(&u, 0.01, Hold::First).unwrap();
        let y = made.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().x;
        let record =
            WeightsRecord { history: Some(History::Virgin), ..WeightsRecord::of(drive, &y, 0) };
        let settings = WeightsSettings {
            nodes: NodesKind::Given(THRESHOLDS.to_vec()),
            zones: 0,
            creep: CreepKind::Times(vec![]),
            dynamics: DynamicsKind::None,
            start: None,
        };
        let model = Model::PolynomialPrandtlIshlinskii;
        let fit = identify_weights(model, &[record], &settings, NEVER).unwrap().unwrap();
        assert!(fit.rms < 1e-14, "{:e}", fit.rms);
        let sign = y[200].signum() * u[200].signum();
        for (name, value) in ["a1", "a2", "a3"].into_iter().zip(POLYNOMIAL) {
            let found = sign * fit.values.number(name);
            assert!((found / value - 1.0).abs() < 1e-6, "{name}: {found:e}");
        }
        for (found, made) in fit.values.list("weights").iter().zip(WEIGHTS) {
            assert!((sign * found - made).abs() < 1e-14, "{found} {made}");
        }
        assert_eq!((fit.values.number("low"), fit.values.number("high")), span);
    }
}

#[test]
fn parameters_out_of_range_are_named() {
    let refused = |polynomial: [f64; 3], range: (f64, f64), thresholds: &[f64], weights: &[f64]| {
        PolynomialPlays::new(polynomial, range, thresholds, weights).unwrap_err().to_string()
    };
    let bad = |polynomial| refused(polynomial, RANGE, &[], &[]);
    assert!(bad([f64::NAN, 0.0, 0.0]).starts_with("a1 is NaN m/V"));
    assert!(bad([1e-6, f64::NAN, 0.0]).starts_with("a2 is NaN m/V^2"));
    assert!(bad([1e-6, 0.0, f64::NAN]).starts_with("a3 is NaN m/V^3"));
    // It would turn back within the range.
    assert!(bad([1e-6, 3e-8, 0.0]).contains("a polynomial that rises all along"));
    assert!(bad([0.0; 3]).contains("a polynomial that rises all along"));
    assert!(refused(POLYNOMIAL, (3.0, 3.0), &[], &[]).starts_with("high is 3 V"));
    assert!(refused(POLYNOMIAL, RANGE, &[1.0], &[-1e-6]).starts_with("weights[0]"));
    assert!(refused(POLYNOMIAL, RANGE, &[1.0], &[]).starts_with("weights"));
}
