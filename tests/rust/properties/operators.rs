//! Hysteresis operators: rate independence, memory, order, bounds, and the exact inverse.

use piezotrack_control::PlayInverse;
use piezotrack_control::hysteresis::{BoucWen, FirstOrderDahl, Operator, Play, PlayState};
use proptest::prelude::*;

use crate::{around, cases};

const PLAYS: usize = 4;
const ZONES: usize = 2;
type Plays = Play<f64, PLAYS, ZONES>;
type State = PlayState<f64, PLAYS>;

prop_compose! {
    /// An operator that can be inverted.
    fn plays()(
        linear in 0.05..2.0_f64,
        gaps in prop::array::uniform4(0.0..20.0_f64),
        weights in prop::array::uniform4(0.0..1.0_f64),
        (corner, further) in (0.0..60.0_f64, 0.0..60.0_f64),
        (bend, next) in (-0.5..0.5_f64, -0.4..0.5_f64),
    ) -> Plays {
        let mut sum = 0.0;
        let thresholds = gaps.map(|gap| { sum += gap; sum });
        Play {
            linear,
            thresholds,
            weights,
            dead_zone_thresholds: [corner, corner + further],
            dead_zone_weights: [bend, next],
        }
    }
}

fn path() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(around(100.0), 0..20)
}

fn after(play: &Plays, path: &[f64]) -> State {
    let mut state = play.rest();
    for &input in path {
        play.follow(&mut state, input);
    }
    state
}

proptest! {
    #![proptest_config(cases(1))]

    #[test]
    fn a_play_stays_within_its_threshold(play in plays(), path in path()) {
        let state = after(&play, &path);
        for (z, r) in state.plays.iter().zip(play.thresholds) {
            prop_assert!(state.input - r <= *z && *z <= state.input + r, "{state:?}");
        }
    }

    #[test]
    fn a_higher_input_gives_no_lower_output(
        play in plays(), path in path(), (a, b) in (around(100.0), around(100.0)),
    ) {
        let state = after(&play, &path);
        let at = |input: f64| play.follow(&mut state.clone(), input);
        let (low, high) = (at(a.min(b)), at(a.max(b)));
        prop_assert!(low <= high + 1e-12 * (1.0 + high.abs()), "{low} {high}");
    }

    #[test]
    fn a_loop_leaves_no_trace(
        play in plays(), path in path(), ends in (around(100.0), around(100.0)), part in 0.0..=1.0_f64,
    ) {
        // From one turn to the next, back by any part of the way, and there again.
        let mut state = after(&play, &path);
        play.follow(&mut state, ends.0);
        play.follow(&mut state, ends.1);
        let before = state.plays;
        play.follow(&mut state, ends.1 + part * (ends.0 - ends.1));
        play.follow(&mut state, ends.1);
        prop_assert_eq!(state.plays, before);
    }

    #[test]
    fn steps_on_the_way_change_nothing(
        play in plays(), path in path(), to in around(100.0), pieces in 1..20_u32,
    ) {
        let mut state = after(&play, &path);
        let mut whole = state;
        let output = play.follow(&mut whole, to);
        let from = state.input;
        for k in 1..pieces {
            play.follow(&mut state, from + (to - from) * f64::from(k) / f64::from(pieces));
        }
        prop_assert_eq!(play.follow(&mut state, to), output);
        prop_assert_eq!(state.plays, whole.plays);
    }

    #[test]
    fn the_inverse_gives_the_input_back(play in plays(), path in path()) {
        let inverse = PlayInverse::new(&play).unwrap();
        let (mut there, mut back) = (play.rest(), inverse.rest());
        for input in path {
            let output = play.follow(&mut there, input);
            let again = inverse.follow(&mut back, output);
            prop_assert!((again - input).abs() < 1e-9, "{input} V came back as {again} V");
        }
    }

    #[test]
    fn friction_stays_below_its_force(
        rest_stiffness in 1e2..1e6_f64,
        coulomb_force in 1e-3..10.0_f64,
        exponent in prop::sample::select(vec![1.0, 1.5, 2.0]),
        path in prop::collection::vec(around(1e-3), 0..20),
    ) {
        let friction = FirstOrderDahl { rest_stiffness, coulomb_force, exponent };
        for force in outputs(&friction, &path) {
            prop_assert!(force.abs() <= coulomb_force * (1.0 + 1e-9), "{force} N");
        }
    }

    #[test]
    fn bouc_wen_stays_below_its_limit(
        (rise, beta, gamma) in (0.01..10.0_f64, 0.01..1.0_f64, -1.0..1.0_f64),
        exponent in prop::sample::select(vec![1.0, 1.5, 2.0]),
        path in prop::collection::vec(around(100.0), 0..20),
    ) {
        // The limit for |gamma| <= beta: rise = (beta + gamma) |h|^n.
        let gamma = 0.9 * gamma * beta;
        let operator = BoucWen { rise, beta, gamma, exponent };
        let limit = (rise / (beta + gamma)).powf(1.0 / exponent);
        for h in outputs(&operator, &path) {
            prop_assert!(h.abs() <= limit * (1.0 + 1e-6), "{h} above {limit}");
        }
    }
}

/// Outputs at the ends of monotone sections.
fn outputs<O: Operator<f64>>(operator: &O, path: &[f64]) -> Vec<f64> {
    let (mut state, mut from) = (operator.rest(), 0.0);
    let section = |&to: &f64| {
        let distance: f64 = to - from;
        let branch = operator.branch(&state, 1_f64.copysign(distance));
        (state, from) = (operator.along(&branch, distance), to);
        operator.output(&state).0
    };
    path.iter().map(section).collect()
}
