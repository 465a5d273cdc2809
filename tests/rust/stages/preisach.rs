//! The Preisach stage: its operator and its inverse.
#![allow(
    missing_docs,
    clippy::unwrap_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::cast_precision_loss
)]

use piezotrack_control::hysteresis::Operator;
use piezotrack_control::{OperatorInverse, Snapshot};
use piezotrack_core::identify::{
    CreepKind, DynamicsKind, History, NodesKind, WeightsRecord, WeightsSettings, identify_weights,
};
use piezotrack_core::models::{
    Dynamics, Experiment, InputOperator, Invertible, MOST_REVERSALS, Model, Plant, PlayHysteresis,
    PreisachInverse, PreisachOperator, PreisachStage, Relaxation, Remembering, StageModel,
};
use piezotrack_core::signal::{Drive, Hold, NEVER};

const LINEAR: f64 = 0.3e-6;
const LEVELS: [f64; 6] = [-32.0, -12.0, 0.0, 16.0, 40.0, 48.0];
/// Of 15 cells, um; some have none.
const MASSES: [f64; 15] =
    [3.0, 1.5, 2.0, 0.0, 4.0, 2.5, 0.7, 0.3, 1.1, 5.0, 2.2, 0.0, 0.9, 1.3, 1.7];
/// Relays to a side of a cell.
const RELAYS: usize = 8;

fn preisach() -> PreisachOperator {
    PreisachOperator::new(LINEAR, &LEVELS, &MASSES.map(|mass| 1e-6 * mass)).unwrap()
}

/// The definition: many relays, each of which switches up at a and down at b.
struct Relays(Vec<Relay>);

struct Relay {
    up_at: f64,
    down_at: f64,
    mass: f64,
    on: f64,
}

impl Relays {
    /// Those of all cells: in the middles of a fine grid, on the diagonal where a cell is cut by
    /// it; those below the line a + b = 0 are on, and half of those on it.
    fn new(levels: &[f64], masses: &[f64]) -> Self {
        let middle = |i: usize, k: usize| {
            let share = (k as f64 + 0.5) / RELAYS as f64;
            levels[i] + share * (levels[i + 1] - levels[i])
        };
        let mut relays = vec![];
        let mut masses = masses.iter();
        let mut add = |up_at: f64, down_at: f64, mass: f64| {
            let sum = up_at + down_at;
            let on = if sum < -1e-9 { 1.0 } else { f64::from(u8::from(sum < 1e-9)) * 0.5 };
            relays.push(Relay { up_at, down_at, mass, on });
        };
        for i in 0..levels.len() - 1 {
            for j in 0..=i {
                let mass = masses.next().unwrap() / RELAYS as f64;
                for k in 0..RELAYS {
                    if i == j {
                        add(middle(i, k), middle(i, k), mass);
                        continue;
                    }
                    for l in 0..RELAYS {
                        add(middle(i, k), middle(j, l), mass / RELAYS as f64);
                    }
                }
            }
        }
        Self(relays)
    }

    fn follow(&mut self, volts: f64) -> f64 {
        for relay in &mut self.0 {
            if volts >= relay.up_at {
                relay.on = 1.0;
            } else if volts <= relay.down_at {
                relay.on = 0.0;
            }
        }
        self.0.iter().map(|relay| relay.on * relay.mass).sum()
    }
}

/// A path that turns at places which do not repeat, beyond the levels too.
fn path(count: u32) -> Vec<f64> {
    let wave = |t: f64| 30.0 * libm::sin(t) + 14.0 * libm::sin(2.7 * t) + 5.0 * libm::sin(17.3 * t);
    (0..count).map(|k| 6.0 + wave(0.01 * f64::from(k))).collect()
}

/// The nearest voltage on the edges of the fine grid of relays.
fn on_the_grid(volts: f64) -> f64 {
    let cell = LEVELS.windows(2).find(|pair| volts <= pair[1]);
    let Some([low, high]) = cell else { return volts };
    let edge = (high - low) / RELAYS as f64;
    if volts < *low { volts } else { low + edge * libm::round((volts - low) / edge) }
}

/// The output after each voltage of a path, each stretch in `pieces` steps.
fn followed(preisach: &PreisachOperator, turns: &[f64], pieces: u32) -> Vec<f64> {
    let mut state = preisach.rest();
    let mut from = 0.0;
    let mut way = |to: f64| {
        for k in 1..pieces {
            preisach.follow(&mut state, from + (to - from) * f64::from(k) / f64::from(pieces));
        }
        from = to;
        preisach.follow(&mut state, to)
    };
    turns.iter().map(|to| way(*to)).collect()
}

fn last(preisach: &PreisachOperator, turns: &[f64]) -> f64 {
    *followed(preisach, turns, 1).last().unwrap()
}

#[test]
fn it_is_a_plane_of_relays() {
    let mut relays = Relays::new(&LEVELS, &MASSES);
    let (preisach, mut falling) = (preisach(), MASSES.map(|mass| -1e-6 * mass));
    falling[3] = 0.0;
    let falling = PreisachOperator::new(-LINEAR, &LEVELS, &falling).unwrap();
    let (mut state, mut other) = (preisach.rest(), falling.rest());
    for volts in [60.0].into_iter().chain(path(4000).into_iter().map(on_the_grid)) {
        let expected = 1e-6 * relays.follow(volts) + LINEAR * volts;
        let found = preisach.follow(&mut state, volts);
        assert!((found - expected).abs() < 1e-18, "{volts}: {found} {expected}");
        assert!((falling.follow(&mut other, volts) + found).abs() < 1e-19);
    }
}

#[test]
fn a_first_rise_or_fall_switches_what_lies_beyond_the_line_of_equal_size() {
    let even = [-30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0];
    let masses: Vec<f64> = (0..21).map(|k| f64::from(k * k % 7)).collect();
    let in_metres: Vec<f64> = masses.iter().map(|mass| 1e-6 * mass).collect();
    let preisach = PreisachOperator::new(LINEAR, &even, &in_metres).unwrap();
    for side in [1.0, -1.0] {
        let (mut relays, mut state) = (Relays::new(&even, &masses), preisach.rest());
        let start = relays.follow(0.0);
        let zero = preisach.follow(&mut state, 0.0);
        for volts in [10.0, 20.0, 30.0].map(|volts| side * volts) {
            let expected = 1e-6 * (relays.follow(volts) - start) + LINEAR * volts;
            let found = preisach.follow(&mut state, volts) - zero;
            assert!((found - expected).abs() < 1e-18, "{volts}: {found} {expected}");
        }
    }
}

#[test]
fn where_the_levels_are_on_one_side_of_0_the_relays_are_on_the_other() {
    let masses = [1e-6, 2e-6, 3e-6];
    for (levels, on) in [([0.0, 10.0, 20.0], 0.0), ([-20.0, -10.0, 0.0], 6e-6)] {
        let preisach = PreisachOperator::new(LINEAR, &levels, &masses).unwrap();
        assert!((preisach.follow(&mut preisach.rest(), 0.0) - on).abs() < 1e-20);
        let away = if on > 0.0 { -20.0 } else { 20.0 };
        let found = preisach.follow(&mut preisach.rest(), away) - on;
        let expected = LINEAR * away + 6e-6 * away / 20.0;
        assert!((found - expected).abs() < 1e-18, "{found} {expected}");
    }
}

#[test]
fn time_does_not_enter() {
    let turns = [30.0, -10.0, 22.0, 3.0, 17.0, -35.0, 70.0, -1.0, 1.0];
    let (coarse, fine) = (followed(&preisach(), &turns, 1), followed(&preisach(), &turns, 997));
    for (coarse, fine) in coarse.iter().zip(&fine) {
        assert!((coarse - fine).abs() < 1e-19);
    }
}

#[test]
fn inner_loops_close_and_are_wiped_out() {
    let preisach = preisach();
    let once = last(&preisach, &[35.0, -25.0, 20.0]);
    assert_eq!(once, last(&preisach, &[35.0, -25.0, 35.0, -25.0, 20.0]));
    assert_eq!(once, last(&preisach, &[35.0, -25.0, 20.0, -5.0, 20.0]));
    assert_eq!(once, last(&preisach, &[35.0, -25.0, 10.0, -5.0, 4.0, -1.0, 20.0]));
    // The virgin curve is another one.
    let height = |before: &[f64]| {
        last(&preisach, &[before, &[10.0]].concat()) - last(&preisach, &[before, &[0.0]].concat())
    };
    assert!((height(&[]) - height(&[35.0, 0.0])).abs() > 1e-6);
}

#[test]
fn loops_between_two_voltages_are_congruent() {
    let preisach = preisach();
    let heights = |before: &[f64]| {
        let at = |volts: f64| last(&preisach, &[before, &[18.0, -6.0, 18.0, volts]].concat());
        [10.0, 2.0, -6.0].map(|volts| at(18.0) - at(volts))
    };
    let (one, other) = (heights(&[48.0]), heights(&[48.0, -32.0]));
    for (one, other) in one.into_iter().zip(other) {
        assert!((one - other).abs() < 1e-19);
    }
}

#[test]
fn outside_its_levels_only_the_gain_without_memory_acts() {
    let preisach = preisach();
    for (end, beyond) in [(48.0, 70.0), (-32.0, -90.0)] {
        let (at, after) = (last(&preisach, &[end]), last(&preisach, &[beyond]));
        assert!((after - at - LINEAR * (beyond - end)).abs() < 1e-19);
        assert_eq!(last(&preisach, &[beyond, 5.0]), last(&preisach, &[end, 5.0]));
    }
}

#[test]
fn equal_masses_of_a_diagonal_are_a_play() {
    // Levels every 8 V from -48 V: diagonal k has the play of threshold 4 k V.
    let levels: Vec<f64> = (0..13).map(|i| -48.0 + 8.0 * f64::from(i)).collect();
    for steps in [0, 1, 2, 4, 5] {
        let weight = 0.25e-6;
        let cells = (0..12).flat_map(|i| (0..=i).map(move |j| i - j));
        let masses: Vec<f64> = cells.map(|k| if k == steps { weight * 8.0 } else { 0.0 }).collect();
        let preisach = PreisachOperator::new(LINEAR, &levels, &masses).unwrap();
        let threshold = 4.0 * f64::from(steps);
        let play = PlayHysteresis::new(LINEAR, &[threshold], &[weight], &[], &[]).unwrap().plays;
        let (mut state, mut other) = (preisach.rest(), play.rest());
        let zero = preisach.follow(&mut state, 0.0);
        let turns = [24.0, -8.0, 16.0, 0.0, -32.0, 40.0, -40.0, 8.0, -24.0, 16.0, 48.0, 0.0];
        let mut from = 0.0;
        for (k, to) in turns.into_iter().enumerate() {
            for part in 1..=16_u8 {
                let volts = from + (to - from) * f64::from(part) / 16.0;
                let found = preisach.follow(&mut state, volts) - zero;
                let expected = play.follow(&mut other, volts);
                // The first rise is drawn in steps, which are exact at levels.
                if k > 0 || steps % 2 == 0 || volts % 8.0 == 0.0 {
                    assert!((found - expected).abs() < 1e-19, "{steps} {volts}");
                }
            }
            from = to;
        }
    }
}

/// Returns the largest error of the output and of the input, relative to the largest.
fn round_trip(operator: &PreisachOperator, u: &[f64]) -> (f64, f64) {
    let inverse = PreisachInverse(*operator);
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
    let nested = [30.0, -30.0, 25.0, -20.0, 18.0, -8.0, 9.0, 1.0, 4.0, 3.0, 4.0, 90.0, -70.0, 0.0];
    let falling = MASSES.map(|mass| -1e-6 * mass);
    let falling = PreisachOperator::new(-LINEAR, &LEVELS, &falling).unwrap();
    for u in [&nested[..], &path(20_000)] {
        for operator in [preisach(), falling] {
            let (output, volts) = round_trip(&operator, u);
            assert!(output < 1e-14 && volts < 1e-13, "{output:e} {volts:e}");
        }
    }
}

#[test]
fn what_is_no_output_leaves_no_trace() {
    let inverse = PreisachInverse(preisach());
    let mut state = inverse.rest();
    assert!(inverse.follow(&mut state, 30e-6).is_finite());
    let before = state;
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e200, -1e200] {
        assert!(inverse.follow(&mut state, bad).is_nan(), "{bad}");
        assert_eq!(state, before);
    }
    // It keeps still with its output.
    let held = inverse.follow(&mut state, 30e-6);
    assert_eq!(state, before);
    assert!((last(&preisach(), &[held]) - 30e-6).abs() < 1e-19);
}

#[test]
fn beyond_the_reversals_that_are_remembered_the_innermost_loop_has_no_width() {
    let preisach = preisach();
    // Ever smaller loops; those beyond memory are within the last one in it.
    let turns: Vec<f64> = (0..200_i32)
        .map(|k| 10.0 + if k % 2 == 0 { 20.0 } else { -20.0 } * libm::pow(0.97, f64::from(k)))
        .collect();
    let mut state = preisach.rest();
    for &volts in [48.0, -32.0].iter().chain(&turns) {
        assert!(preisach.follow(&mut state, volts).is_finite());
    }
    assert_eq!(state.turns().len(), MOST_REVERSALS);
    let kept = state.turns()[MOST_REVERSALS - 2..].to_vec();
    // Within the last loop the way is the same to and fro.
    let (low, high) = (kept[0].min(kept[1]), kept[0].max(kept[1]));
    let places = (0..=10).map(|k| low + (high - low) * f64::from(k) / 11.0);
    let mut way = |volts: f64| preisach.follow(&mut state, volts);
    let up: Vec<f64> = places.clone().map(&mut way).collect();
    let down: Vec<f64> = places.rev().map(&mut way).collect();
    assert!(up.iter().eq(down.iter().rev()));
    // Out of all of them, nothing is left of them.
    preisach.follow(&mut state, 48.0);
    assert_eq!(preisach.follow(&mut state, 5.0), last(&preisach, &[48.0, 5.0]));
    // And the inverse has them all the same.
    let (output, volts) = round_trip(&preisach, &turns);
    assert!(output < 1e-14 && volts < 1e-12, "{output:e} {volts:e}");
}

#[test]
fn slopes_are_those_of_the_branch() {
    let preisach = preisach();
    let mut state = preisach.rest();
    for pair in path(3000).windows(2) {
        let (from, to) = (pair[0], pair[1]);
        preisach.follow(&mut state, from);
        preisach.follow(&mut state, to);
        let slope = preisach.output(&state).1;
        let back = 1e-6 * (to - from).signum();
        let mut near = preisach.rest();
        for &volts in state.turns().iter().chain([&(to - back)]) {
            preisach.follow(&mut near, volts);
        }
        let (before, after) = (preisach.output(&near).0, preisach.follow(&mut near, to));
        assert!((slope - (after - before) / back).abs() < 1e-12, "{from} {to}");
    }
}

#[test]
fn a_snapshot_brings_the_state_back() {
    let inverse = PreisachInverse(preisach());
    let mut state = inverse.rest();
    for volts in path(300) {
        inverse.follow(&mut state, 1e-6 * volts);
    }
    let mut numbers = vec![];
    state.save(&mut |number| numbers.push(number));
    let mut restored = inverse.rest();
    let mut left = numbers.iter().copied();
    restored.load(&mut || left.next()).unwrap();
    assert_eq!(restored, state);
    // A count of reversals that cannot be is refused.
    for bad in [0.0, 65.0, 1.5] {
        let mut changed = numbers.clone();
        changed[1 + MOST_REVERSALS] = bad;
        let mut left = changed.into_iter();
        assert_eq!(inverse.rest().load(&mut || left.next()), None);
    }
}

fn stage(dynamics: Dynamics) -> PreisachStage {
    let relaxation = Relaxation::new(&[0.01], &[0.3], dynamics).unwrap();
    PreisachStage { operator: preisach(), relaxation }
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
        // The creep before the mode is taken as straight over a part of an interval.
        assert!((x - slow.x[50 * k]).abs() < 1e-10, "{k}");
    }
    assert_eq!(run.error_estimate, 0.0);
    let flow = stage.flow(0.01);
    let mut state = Plant::rest(&stage);
    for k in 1..u.len() {
        stage.advance(&flow, &mut state, u[k - 1], u[k]);
        assert!((stage.displacement(&state) - run.x[k]).abs() < 1e-10, "{k}");
    }
}

#[test]
fn a_simulation_and_the_inverse_go_on_from_any_state() {
    let (stage, dt) = (stage(Dynamics::None), 0.01);
    let u = path(3000);
    let whole = Drive::new(&u, dt, Hold::First).unwrap();
    let whole = stage.simulate(&Experiment::of(&whole, NEVER)).unwrap().unwrap();
    for at in [1, 17, 1111] {
        let drive = Drive::new(&u[..=at], dt, Hold::First).unwrap();
        let middle = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().last;
        let after = &u[at..];
        let drive = Drive::new(after, dt, Hold::First).unwrap();
        let experiment = Experiment { initial: Some(&middle), ..Experiment::of(&drive, NEVER) };
        let run = stage.simulate(&experiment).unwrap().unwrap();
        let (inverse, mut state) = stage.inverse(dt, Some(&middle)).unwrap();
        for (k, (&x, &volts)) in run.x.iter().zip(after).enumerate() {
            assert!((x - whole.x[at + k]).abs() < 1e-18);
            let found = inverse.step(&mut state, x, 0.0, 0.0);
            // The inverse of the creep takes the output as straight from sample to sample.
            assert!((found - volts).abs() < 1e-4, "{found} for {volts}");
        }
    }
}

#[test]
fn a_memory_that_is_none_is_refused() {
    let operator = preisach();
    let mut state = InputOperator::rest(&operator);
    for bad in [&[50.0][..], &[-33.0], &[20.0, 25.0], &[20.0, 0.0, 30.0], &[f64::NAN], &[1.0; 64]] {
        let expected = operator.recall(&mut state, 0.0, bad).unwrap_err();
        assert!(expected.contains("-32 V to 48 V"), "{expected}");
    }
    operator.recall(&mut state, 0.0, &[20.0, -5.0, 10.0]).unwrap();
    assert_eq!(operator.memory(&state), [20.0, -5.0, 10.0]);
    let found = InputOperator::follow(&operator, &mut state, 0.0);
    assert_eq!(found, last(&operator, &[-32.0, 20.0, -5.0, 10.0, 0.0]));
}

#[test]
fn a_fit_finds_what_the_record_was_made_with() {
    let u = path(3000);
    let relaxation = Relaxation::new(&[], &[], Dynamics::None).unwrap();
    for sign in [1.0, -1.0] {
        let masses = MASSES.map(|mass| sign * 1e-6 * mass);
        let operator = PreisachOperator::new(sign * LINEAR, &LEVELS, &masses).unwrap();
        let made = PreisachStage { operator, relaxation };
        let drive = Drive::new(&u, 0.01, Hold::First).unwrap();
        let y = made.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().x;
        let record =
            WeightsRecord { history: Some(History::Virgin), ..WeightsRecord::of(drive, &y, 0) };
        let settings = WeightsSettings {
            nodes: NodesKind::Given(LEVELS.to_vec()),
            zones: 0,
            creep: CreepKind::Times(vec![]),
            dynamics: DynamicsKind::None,
            start: None,
        };
        let fit = identify_weights(Model::Preisach, &[record], &settings, NEVER).unwrap().unwrap();
        // Neighbours are drawn together by a trace.
        assert!(fit.rms < 1e-10, "{:e}", fit.rms);
        // The path leaves the levels, and so tells the gain without memory from the diagonal.
        assert!((sign * fit.values.number("linear") / LINEAR - 1.0).abs() < 1e-3);
        for (found, made) in fit.values.list("masses").iter().zip(masses) {
            assert!((found - made).abs() < 1e-9, "{found} {made}");
        }
    }
}

#[test]
fn a_fit_moves_outside_its_levels_as_within_them() {
    // The drive stays within the levels: what the whole diagonal has in common is put there too.
    let u: Vec<f64> = path(3000).iter().map(|volts| 0.5 * volts).collect();
    let (lowest, highest) = (-20.0, 25.0);
    let levels: Vec<f64> = (0..=5).map(|k| lowest + 9.0 * f64::from(k)).collect();
    let masses = MASSES.map(|mass| 1e-6 * (mass + 1.0));
    let operator = PreisachOperator::new(LINEAR, &levels, &masses).unwrap();
    let relaxation = Relaxation::new(&[], &[], Dynamics::None).unwrap();
    let made = PreisachStage { operator, relaxation };
    let u: Vec<f64> = u.iter().map(|volts| volts.clamp(lowest, highest)).collect();
    let drive = Drive::new(&u, 0.01, Hold::First).unwrap();
    let y = made.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().x;
    let record =
        WeightsRecord { history: Some(History::Virgin), ..WeightsRecord::of(drive, &y, 0) };
    let settings = WeightsSettings {
        nodes: NodesKind::Given(levels),
        zones: 0,
        creep: CreepKind::Times(vec![]),
        dynamics: DynamicsKind::None,
        start: None,
    };
    let fit = identify_weights(Model::Preisach, &[record], &settings, NEVER).unwrap().unwrap();
    assert!(fit.rms < 1e-10, "{:e}", fit.rms);
    // The least slope of the diagonal cells, 1.7, 3, 3.5, 2.8 and 2.7 um on 9 V, on top.
    let expected = LINEAR + 2.7e-6 / 9.0;
    assert!((fit.values.number("linear") / expected - 1.0).abs() < 0.01);
}

#[test]
fn parameters_out_of_range_are_named() {
    let refused = |linear: f64, levels: &[f64], masses: &[f64]| {
        PreisachOperator::new(linear, levels, masses).unwrap_err().to_string()
    };
    let levels = [0.0, 1.0, 2.0];
    assert!(refused(0.0, &levels, &[1.0; 3]).starts_with("linear is 0 m/V"));
    assert!(refused(1.0, &[0.0], &[]).starts_with("levels has 1 entries"));
    assert!(refused(1.0, &[0.0; 18], &[]).starts_with("levels has 18 entries"));
    assert!(refused(1.0, &levels, &[1.0; 4]).contains("expected 3, the cells between 3 levels"));
    assert!(refused(1.0, &[0.0, 2.0, 2.0], &[1.0; 3]).contains("levels[2] is 2 V"));
    assert!(refused(1.0, &[0.0, f64::NAN, 2.0], &[1.0; 3]).contains("levels[1] is NaN V"));
    assert!(refused(1.0, &levels, &[1.0, -1.0, 1.0]).contains("masses[1] is -1 m"));
    assert!(refused(-1.0, &levels, &[-1.0, -1.0, 1.0]).contains("masses[2] is 1 m"));
}
