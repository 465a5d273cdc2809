//! Play operators: what every rate-independent hysteresis of this kind must do.
#![allow(missing_docs, clippy::panic, clippy::unwrap_used, clippy::float_cmp)]

use piezotrack_control::hysteresis::{Operator, Play};
use piezotrack_core::models::{Plays, Stage};
use piezotrack_core::simulate::VirtualStage;

type Single = Play<f64, 1, 0>;

const ONE: Single = Single {
    linear: 0.0,
    thresholds: [3.0],
    weights: [1.0],
    dead_zone_thresholds: [],
    dead_zone_weights: [],
};

/// Those of the published stage, V to um.
fn stage_play() -> Plays {
    let Stage::PrandtlIshlinskii(stage) = VirtualStage::xu_li_2010(1).stage else { panic!() };
    let mut plays = stage.operator.plays;
    plays.linear *= 1e6;
    plays.weights.iter_mut().for_each(|weight| *weight *= 1e6);
    plays.dead_zone_thresholds.iter_mut().for_each(|threshold| *threshold *= 1e6);
    plays
}

/// Output after a path through `turns`, each stretch in `pieces` steps.
fn led(play: &Plays, turns: &[f64], pieces: u32) -> f64 {
    let mut state = play.rest();
    let mut output = 0.0;
    let mut from = 0.0;
    for &to in turns {
        for k in 1..pieces {
            play.follow(&mut state, from + (to - from) * f64::from(k) / f64::from(pieces));
        }
        output = play.follow(&mut state, to);
        from = to;
    }
    output
}

#[test]
fn a_play_moves_when_its_backlash_is_used_up() {
    let mut state = ONE.rest();
    for (input, output) in
        [(2.0, 0.0), (3.0, 0.0), (10.0, 7.0), (5.0, 7.0), (4.0, 7.0), (3.0, 6.0), (8.0, 6.0)]
    {
        assert_eq!(ONE.follow(&mut state, input), output, "{input}");
    }
}

#[test]
fn time_does_not_enter() {
    let path = [75.0, 10.0, 50.0, 30.0, 60.0, 0.0];
    let play = stage_play();
    let coarse = led(&play, &path, 1);
    assert!((coarse - led(&play, &path, 997)).abs() < 1e-12);
}

#[test]
fn loops_close_after_the_first_cycle() {
    let play = stage_play();
    let once = led(&play, &[75.0, 0.0, 40.0], 1);
    let often = led(&play, &[75.0, 0.0, 75.0, 0.0, 75.0, 0.0, 40.0], 1);
    assert_eq!(once, often);
    // The virgin curve lies elsewhere.
    assert!((once - led(&play, &[40.0], 1)).abs() > 1.0);
}

#[test]
fn an_inner_loop_returns_to_where_it_left_and_is_wiped_out() {
    let play = stage_play();
    let left = led(&play, &[75.0, 0.0, 60.0], 1);
    let back = led(&play, &[75.0, 0.0, 60.0, 25.0, 60.0], 1);
    assert!((left - back).abs() < 1e-12);
    let beyond = led(&play, &[75.0, 0.0, 60.0, 25.0, 45.0, 33.0, 70.0, 20.0], 1);
    assert!((beyond - led(&play, &[75.0, 0.0, 70.0, 20.0], 1)).abs() < 1e-12);
}

#[test]
fn the_slope_is_the_derivative_along_the_way() {
    let play = stage_play();
    for path in [&[30.0][..], &[75.0, 40.0], &[75.0, 0.0, 62.0], &[75.0, 10.0, 20.0, 15.0]] {
        let last = path[path.len() - 1];
        let before = if path.len() > 1 { path[path.len() - 2] } else { 0.0 };
        let direction = f64::signum(last - before);
        let mut state = play.rest();
        for &volts in path {
            play.follow(&mut state, volts);
        }
        let (value, slope) = play.output(&state);
        let nudge = direction * 1e-6;
        let (next, _) = play.output(&play.along(&play.branch(&state, direction), nudge));
        assert!(((next - value) / nudge - slope).abs() < 1e-6, "{path:?}");
    }
}

/// Rising at `u` above the bottom, and falling at `u` below the top, of the settled loop.
fn ends(play: &Plays, u: f64) -> (f64, f64) {
    let bottom = led(play, &[75.0, 0.0], 1);
    let top = led(play, &[75.0], 1);
    (led(play, &[75.0, 0.0, u], 1) - bottom, top - led(play, &[75.0, 75.0 - u], 1))
}

#[test]
fn dead_zones_alone_break_the_symmetry() {
    let mut play = stage_play();
    let (rising, falling) = ends(&play, 25.0);
    assert!((rising - falling).abs() > 0.5, "{rising} {falling}");
    play.dead_zone_weights.fill(0.0);
    let (rising, falling) = ends(&play, 25.0);
    assert!((rising - falling).abs() < 1e-12);
}

#[test]
fn the_curve_never_turns_back() {
    let play = stage_play();
    let mut state = play.rest();
    let mut before = play.follow(&mut state, -1.0);
    for k in 0..800 {
        let now = play.follow(&mut state, 0.1 * f64::from(k));
        assert!(now > before);
        before = now;
    }
}
