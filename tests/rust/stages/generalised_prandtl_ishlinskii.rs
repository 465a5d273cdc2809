//! The generalised Prandtl-Ishlinskii stage: its operator, its inverse, and what a fit finds.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, clippy::float_cmp)]

use piezotrack_control::{OperatorInverse, PlayInverse};
use piezotrack_core::identify::{
    CreepKind, DynamicsKind, History, NodesKind, WeightsRecord, WeightsSettings, identify_weights,
};
use piezotrack_core::models::{
    Dynamics, Experiment, GeneralisedPlays, GeneralisedPlaysInverse,
    GeneralisedPrandtlIshlinskiiStage, InputOperator, Invertible, Model, Plant, PlayHysteresis,
    PrandtlIshlinskiiStage, Relaxation, Remembering, StageModel, TanhEnvelope, Values,
};
use piezotrack_core::signal::{Drive, Hold, NEVER};

const LINEAR: f64 = 1e-6;
const THRESHOLDS: [f64; 3] = [4.0, 10.0, 20.0];
const WEIGHTS: [f64; 3] = [0.2e-6, 0.0, 0.15e-6];
/// Steepest above the middle of the paths.
const RISING: TanhEnvelope = TanhEnvelope { scale: 60.0, slope: 0.02, shift: -0.2, level: 5.0 };
/// Above the other one from -40 V to 40 V.
const FALLING: TanhEnvelope = TanhEnvelope { scale: 55.0, slope: 0.019, shift: 0.05, level: 6.0 };

fn plays(falling: TanhEnvelope) -> GeneralisedPlays {
    GeneralisedPlays::new(LINEAR, &THRESHOLDS, &WEIGHTS, RISING, falling).unwrap()
}

fn stage(falling: TanhEnvelope, dynamics: Dynamics) -> GeneralisedPrandtlIshlinskiiStage {
    let relaxation = Relaxation::new(&[0.01], &[0.3], dynamics).unwrap();
    GeneralisedPrandtlIshlinskiiStage { operator: plays(falling), relaxation }
}

/// A path that turns at places which do not repeat.
fn path(count: u32) -> Vec<f64> {
    let wave = |t: f64| 20.0 * libm::sin(t) + 12.0 * libm::sin(2.7 * t) + 3.0 * libm::sin(17.3 * t);
    (0..count).map(|k| wave(0.01 * f64::from(k))).collect()
}

/// The output after each voltage of a path, each stretch in `pieces` steps.
fn followed(plays: &GeneralisedPlays, turns: &[f64], pieces: u32) -> Vec<f64> {
    let mut state = plays.rest();
    let mut from = 0.0;
    let mut way = |to: f64| {
        for k in 1..pieces {
            plays.follow(&mut state, from + (to - from) * f64::from(k) / f64::from(pieces));
        }
        from = to;
        plays.follow(&mut state, to)
    };
    turns.iter().map(|to| way(*to)).collect()
}

fn last(plays: &GeneralisedPlays, turns: &[f64]) -> f64 {
    *followed(plays, turns, 1).last().unwrap()
}

#[test]
fn the_plays_follow_their_equations() {
    for falling in [RISING, FALLING] {
        let mut z = [0.0; 4];
        let (mut state, operator) = (plays(falling).rest(), plays(falling));
        for volts in [0.0].into_iter().chain(path(3000)) {
            let gamma =
                |of: TanhEnvelope| of.scale * libm::tanh(of.slope * volts + of.shift) + of.level;
            let (up, down) = (gamma(RISING), gamma(falling));
            let mut expected = 0.0;
            let weights = [LINEAR, WEIGHTS[0], WEIGHTS[1], WEIGHTS[2]];
            for (i, r) in [0.0, 4.0, 10.0, 20.0].into_iter().enumerate() {
                z[i] = f64::max(up - r, f64::min(down + r, z[i]));
                expected += weights[i] * z[i];
            }
            let found = operator.follow(&mut state, volts);
            assert!((found - expected).abs() < 1e-19, "{found} {expected}");
            assert_eq!(operator.memory(&state), z);
        }
    }
}

#[test]
fn time_does_not_enter() {
    for falling in [RISING, FALLING] {
        let turns = [30.0, -10.0, 22.0, 3.0, 17.0, -35.0];
        let (coarse, fine) =
            (followed(&plays(falling), &turns, 1), followed(&plays(falling), &turns, 997));
        for (coarse, fine) in coarse.iter().zip(&fine) {
            assert!((coarse - fine).abs() < 1e-18);
        }
    }
}

#[test]
fn inner_loops_close_and_are_wiped_out() {
    for falling in [RISING, FALLING] {
        let plays = plays(falling);
        let once = last(&plays, &[35.0, -35.0, 20.0]);
        assert_eq!(once, last(&plays, &[35.0, -35.0, 35.0, -35.0, 20.0]));
        assert_eq!(once, last(&plays, &[35.0, -35.0, 20.0, -5.0, 20.0]));
        assert_eq!(once, last(&plays, &[35.0, -35.0, 10.0, -5.0, 4.0, -1.0, 20.0]));
        // The virgin curve lies elsewhere.
        assert!((last(&plays, &[35.0, -35.0, 5.0]) - last(&plays, &[5.0])).abs() > 1e-6);
    }
}

#[test]
fn inner_loops_of_one_envelope_are_congruent_in_it() {
    // Loops between two voltages have one shape, however they were reached, ...
    let plays = plays(RISING);
    let height = |before: &[f64]| {
        let at = |volts: f64| last(&plays, &[before, &[18.0, -6.0, 18.0, volts]].concat());
        [10.0, 2.0, -6.0].map(|volts| at(18.0) - at(volts))
    };
    let (one, other) = (height(&[35.0]), height(&[35.0, -35.0]));
    for (one, other) in one.into_iter().zip(other) {
        assert!((one - other).abs() < 1e-18);
    }
    // ... and a loop of the same width elsewhere has another.
    let at = |middle: f64| last(&plays, &[middle + 12.0]) - last(&plays, &[middle - 12.0]);
    assert!((at(5.0) / at(-20.0) - 1.0).abs() > 0.01);
}

/// Returns the largest error of the displacement and of the drive, relative to the largest.
fn round_trip(falling: TanhEnvelope, u: &[f64]) -> (f64, f64) {
    let operator = plays(falling);
    let inverse = GeneralisedPlaysInverse(operator);
    let (mut there, mut back, mut again) = (operator.rest(), inverse.rest(), operator.rest());
    let largest = |of: &[f64]| of.iter().fold(0.0, |most, value| f64::max(most, value.abs()));
    let (mut volts_off, mut output_off, mut outputs) = (0.0, 0.0, vec![]);
    for &volts in u {
        let output = operator.follow(&mut there, volts);
        let found = inverse.follow(&mut back, output);
        volts_off = f64::max(volts_off, (found - volts).abs());
        output_off = f64::max(output_off, (operator.follow(&mut again, found) - output).abs());
        outputs.push(output);
    }
    (output_off / largest(&outputs), volts_off / largest(u))
}

#[test]
fn the_inverse_undoes_the_operator() {
    let nested = [30.0, -30.0, 25.0, -20.0, 18.0, -8.0, 9.0, 1.0, 4.0, 3.0, 4.0, 40.0, -40.0, 0.0];
    for u in [&nested[..], &path(20_000)] {
        let (output, volts) = round_trip(RISING, u);
        assert!(output < 1e-14 && volts < 1e-12, "{output:e} {volts:e}");
        // Between two envelopes many voltages have one output, and one of them is found.
        let (output, volts) = round_trip(FALLING, u);
        assert!(output < 1e-14, "{output:e} {volts:e}");
    }
}

#[test]
fn between_two_envelopes_the_inverse_keeps_still_with_its_reference() {
    let operator = plays(FALLING);
    let inverse = GeneralisedPlaysInverse(operator);
    let mut state = inverse.rest();
    let top = inverse.follow(&mut state, 20e-6);
    let back = inverse.follow(&mut state, 15e-6);
    // It jumped over where only the drive moves.
    let mut there = operator.rest();
    operator.follow(&mut there, top);
    let still = operator.follow(&mut there, top - 2.0);
    assert_eq!(still, last(&operator, &[top]));
    let held: Vec<f64> = (0..5).map(|_| inverse.follow(&mut state, 15e-6)).collect();
    assert_eq!(held, [back; 5]);
}

#[test]
fn with_one_envelope_it_is_the_inverse_of_the_plays_and_of_the_envelope() {
    let operator = plays(RISING);
    let inverse = GeneralisedPlaysInverse(operator);
    let plain = PlayHysteresis::new(LINEAR, &THRESHOLDS, &WEIGHTS, &[], &[]).unwrap().plays;
    let other = PlayInverse::new(&plain).unwrap();
    // Both begin where the envelope has 0 V.
    let mut there = piezotrack_control::hysteresis::Operator::rest(&plain);
    plain.follow(&mut there, RISING.at(0.0));
    let (mut one, mut two) = (inverse.rest(), other.memory(&plain, &there));
    for output in path(5000).into_iter().map(|volts| 1e-6 * volts) {
        let (found, expected) = (
            inverse.follow(&mut one, output),
            RISING.inverse(OperatorInverse::follow(&other, &mut two, output)),
        );
        assert!((found - expected).abs() < 1e-12 * 40.0, "{found} {expected}");
    }
}

#[test]
fn what_the_envelopes_do_not_reach_leaves_no_trace() {
    let operator = plays(FALLING);
    let inverse = GeneralisedPlaysInverse(operator);
    let mut state = inverse.rest();
    assert!(inverse.follow(&mut state, 30e-6).is_finite());
    let before = state;
    // 1.35e-6 (65 V - r) at most, and as much below.
    // From 70e-6 on the envelopes have crossed.
    for bad in [f64::NAN, f64::INFINITY, 1e-3, -1e-3, 1e200, 85e-6, 75e-6] {
        assert!(inverse.follow(&mut state, bad).is_nan(), "{bad}");
        assert_eq!(state, before);
    }
    // Nor in the inverse of the stage.
    let (inverse, mut state) = stage(FALLING, Dynamics::None).inverse(1e-3, None).unwrap();
    assert!(inverse.step(&mut state, 10e-6, 0.0, 0.0).is_finite());
    let before = state;
    assert!(inverse.step(&mut state, 1e-3, 0.0, 0.0).is_nan());
    assert_eq!(state, before);
}

#[test]
fn the_inverse_of_the_stage_goes_on_from_any_state() {
    let (stage, dt) = (stage(RISING, Dynamics::None), 0.01);
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
        // The inverse of the creep takes the output as straight from sample to sample.
        assert!((found - volts).abs() < 1e-5, "{found} for {volts}");
    }
}

#[test]
fn a_stage_shows_nothing_at_rest_and_moves_in_a_loop_as_in_a_simulation() {
    for dynamics in [Dynamics::None, Dynamics::Second { frequency: 30.0, damping_ratio: 0.1 }] {
        let stage = stage(FALLING, dynamics);
        let u = path(2000);
        let drive = Drive::new(&u, 0.01, Hold::First).unwrap();
        let run = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap();
        assert_eq!(run.x[0], 0.0);
        let flow = stage.flow(0.01);
        let mut state = Plant::rest(&stage);
        for k in 1..u.len() {
            stage.advance(&flow, &mut state, u[k - 1], u[k]);
            assert!((stage.displacement(&state) - run.x[k]).abs() < 1e-19, "{k}");
        }
    }
}

#[test]
fn an_envelope_that_hardly_bends_is_none() {
    let straight = TanhEnvelope::fitted(&[1.0, 1e-6], (-40.0, 40.0));
    let operator =
        GeneralisedPlays::new(LINEAR, &THRESHOLDS, &WEIGHTS, straight, straight).unwrap();
    let plain = PlayHysteresis::new(LINEAR, &THRESHOLDS, &WEIGHTS, &[], &[]).unwrap();
    let relaxation = Relaxation::new(&[], &[], Dynamics::None).unwrap();
    let one = GeneralisedPrandtlIshlinskiiStage { operator, relaxation };
    let other = PrandtlIshlinskiiStage { operator: plain, relaxation };
    let u = path(2000);
    let drive = Drive::new(&u, 0.01, Hold::First).unwrap();
    let experiment = Experiment::of(&drive, NEVER);
    let [one, other] =
        [one.simulate(&experiment), other.simulate(&experiment)].map(|run| run.unwrap().unwrap().x);
    for (one, other) in one.iter().zip(&other) {
        assert!((one - other).abs() < 1e-14);
    }
}

#[test]
fn an_envelope_has_the_ratio_of_slopes_that_was_asked_for() {
    for (ratio, bend) in [(0.25, 0.005), (0.8, 0.3), (1.0, 1.6), (4.0, 0.1)] {
        let of = TanhEnvelope::fitted(&[ratio, bend], (-10.0, 90.0));
        assert!((of.with_slope(90.0).1 / of.with_slope(-10.0).1 / ratio - 1.0).abs() < 1e-11);
        assert!((of.at(90.0) - of.at(-10.0) - 100.0).abs() < 1e-10);
        assert!(of.at(0.0).abs() < 1e-10);
        assert!((of.inverse(of.at(77.0)) - 77.0).abs() < 1e-9);
    }
}

fn settings() -> WeightsSettings {
    WeightsSettings {
        nodes: NodesKind::Given(THRESHOLDS.to_vec()),
        zones: 0,
        creep: CreepKind::Times(vec![]),
        dynamics: DynamicsKind::None,
        start: None,
    }
}

#[test]
fn a_fit_finds_what_the_record_was_made_with() {
    let u = path(1500);
    let span = u
        .iter()
        .fold((0.0, 0.0), |(low, high), volts| (f64::min(low, *volts), f64::max(high, *volts)));
    for shape in [[0.6, 0.7], [1.5, 0.09]] {
        let made = TanhEnvelope::fitted(&shape, span);
        let stage = GeneralisedPrandtlIshlinskiiStage {
            operator: GeneralisedPlays::new(LINEAR, &THRESHOLDS, &WEIGHTS, made, made).unwrap(),
            relaxation: Relaxation::new(&[], &[], Dynamics::None).unwrap(),
        };
        let drive = Drive::new(&u, 0.01, Hold::First).unwrap();
        let y = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().x;
        let record =
            WeightsRecord { history: Some(History::Virgin), ..WeightsRecord::of(drive, &y, 0) };
        let model = Model::GeneralisedPrandtlIshlinskii;
        let fit = identify_weights(model, &[record], &settings(), NEVER).unwrap().unwrap();
        for (found, made) in fit.values.list("weights").iter().zip(WEIGHTS) {
            assert!((found - made).abs() < 2e-9, "{found} {made}");
        }
        assert!(fit.rms < 5e-9, "{shape:?}: {} after {}", fit.rms, fit.evaluations);
        assert_eq!(fit.values.list("falling_slope"), [0.0; 0]);
    }
}

#[test]
fn a_fit_has_no_dead_zones() {
    let u = path(1500);
    let drive = Drive::new(&u, 0.01, Hold::First).unwrap();
    let record =
        WeightsRecord { history: Some(History::Virgin), ..WeightsRecord::of(drive, &u, 0) };
    let settings = WeightsSettings { zones: 2, ..settings() };
    let refused =
        identify_weights(Model::GeneralisedPrandtlIshlinskii, &[record], &settings, NEVER);
    assert!(refused.unwrap_err().to_string().contains("no dead zones"));
}

fn values(change: &str, to: &[f64]) -> piezotrack_core::Result<Values> {
    let given = [
        ("linear", &[1e-6][..]),
        ("thresholds", &[10.0]),
        ("weights", &[0.2e-6]),
        ("scale", &[100.0]),
        ("slope", &[0.01]),
        ("shift", &[0.0]),
        ("level", &[0.0]),
        ("falling_scale", &[]),
        ("falling_slope", &[]),
        ("falling_shift", &[]),
        ("falling_level", &[]),
        ("creep_weights", &[]),
        ("creep_times", &[]),
        ("time_constant", &[]),
        ("frequency", &[]),
        ("damping_ratio", &[]),
        ("mode_weights", &[]),
        ("mode_frequencies", &[]),
        ("mode_damping_ratios", &[]),
    ];
    let entry = |(name, numbers): (&str, &[f64])| {
        (name.to_string(), if name == change { to } else { numbers }.to_vec())
    };
    Values::named(GeneralisedPrandtlIshlinskiiStage::INFO.parameters, given.map(entry))
}

#[test]
fn parameters_out_of_range_are_named() {
    let build = |change, to: f64| {
        GeneralisedPrandtlIshlinskiiStage::build(&values(change, &[to]).unwrap())
            .map(|stage| stage.operator)
    };
    for (name, bad) in [
        ("linear", 0.0),
        ("scale", -1.0),
        ("slope", 0.0),
        ("shift", f64::NAN),
        ("level", f64::INFINITY),
        ("falling_scale", 0.0),
        ("falling_slope", -0.01),
        ("falling_shift", f64::NAN),
        ("thresholds", -1.0),
        ("weights", -1e-6),
    ] {
        assert!(build(name, bad).unwrap_err().to_string().contains(name), "{name}");
    }
    // What is left out is as for a rising input.
    assert_eq!(build("falling_scale", 100.0), build("", 0.0));
    assert_ne!(build("falling_scale", 101.0), build("", 0.0));
}

#[test]
fn its_gains_are_those_of_its_settled_loop() {
    for falling in [RISING, FALLING] {
        let stage = stage(falling, Dynamics::First { time: 1e-3 });
        let [least, middle, most] =
            stage.loop_plants(-30.0, 30.0).unwrap().map(|plant| plant.static_gain());
        // Along the loop in steps of 0.01 V.
        let up = (-2999..=3000).map(|k| 0.01 * f64::from(k));
        let down = (-3000..3000).rev().map(|k| 0.01 * f64::from(k));
        let turns: Vec<f64> = [30.0, -30.0].into_iter().chain(up).chain(down).collect();
        let run = followed(&stage.operator, &turns, 1);
        let slopes = run[1..].windows(2).map(|pair| (pair[1] - pair[0]).abs() / 0.01);
        let range = slopes.fold((f64::INFINITY, 0.0), |(low, high), slope| {
            (f64::min(low, slope), f64::max(high, slope))
        });
        let mean = (run[6001] - run[1]) / 60.0;
        assert!((least - range.0).abs() < 1e-3 * most, "{least} {range:?}");
        assert!((most - range.1).abs() < 1e-2 * most, "{most} {range:?}");
        assert!((middle - mean).abs() < 1e-12, "{middle} {mean}");
    }
}
