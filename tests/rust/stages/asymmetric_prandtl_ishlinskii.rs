//! The asymmetric Prandtl-Ishlinskii stage: its operator, its inverse, and what a fit finds.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, clippy::float_cmp)]

use piezotrack_control::OperatorInverse;
use piezotrack_control::hysteresis::Bend;
use piezotrack_control::{AsymmetricPlayInverse, Snapshot};
use piezotrack_core::identify::{
    CreepKind, DynamicsKind, History, NodesKind, WeightsRecord, WeightsSettings, identify_weights,
};
use piezotrack_core::models::{
    AsymmetricPlays, AsymmetricPrandtlIshlinskiiStage, Dynamics, Experiment, Invertible, Model,
    Plant, PlayHysteresis, PrandtlIshlinskiiStage, Relaxation, Remembering, StageModel,
    asymmetric_plays,
};
use piezotrack_core::signal::{Drive, Hold, NEVER};

const RANGE: (f64, f64) = (-25.0, 30.0);
const THRESHOLDS: [f64; 3] = [4.0, 10.0, 20.0];
const PLAIN: [f64; 3] = [0.2e-6, 0.0, 0.15e-6];
const CONCAVE: [f64; 3] = [0.05e-6, 0.1e-6, 0.02e-6];
const CONVEX: [f64; 3] = [0.0, 0.03e-6, 0.06e-6];

fn plays(sign: f64) -> AsymmetricPlays {
    let [plain, concave, convex] = [PLAIN, CONCAVE, CONVEX].map(|of| of.map(|each| sign * each));
    let families = [&plain, &concave, &convex].map(|weights| (&THRESHOLDS[..], &weights[..]));
    asymmetric_plays(sign * 1e-6, RANGE, families).unwrap()
}

fn stage(dynamics: Dynamics) -> AsymmetricPrandtlIshlinskiiStage {
    let relaxation = Relaxation::new(&[0.01], &[0.3], dynamics).unwrap();
    AsymmetricPrandtlIshlinskiiStage { operator: plays(1.0), relaxation }
}

/// A path that turns at places which do not repeat, and leaves the range.
fn path(count: u32) -> Vec<f64> {
    let wave = |t: f64| 20.0 * libm::sin(t) + 12.0 * libm::sin(2.7 * t) + 3.0 * libm::sin(17.3 * t);
    (0..count).map(|k| wave(0.01 * f64::from(k))).collect()
}

/// f and g from their definition, straight beyond the range.
fn bent(volts: f64) -> [f64; 2] {
    let (low, high) = RANGE;
    let length = high - low;
    let f = |u: f64| {
        let s = (u - low) / length;
        match s {
            s if s < 0.0 => length * 3.0 * s,
            s if s > 1.0 => length,
            s => length * (1.0 - (1.0 - s).powi(3)),
        }
    };
    // The convex function is the concave one turned by half a turn.
    let g = |u: f64| length - f(low + high - u);
    [f(volts) - f(0.0), g(volts) - g(0.0)]
}

#[test]
fn it_follows_its_equations() {
    let (operator, falling) = (plays(1.0), plays(-1.0));
    let (mut state, mut other) = (operator.at_rest(), falling.at_rest());
    let mut z = [[0.0; 3]; 3];
    for volts in path(3000) {
        let [f, g] = bent(volts);
        let mut expected = 1e-6 * volts;
        let families = [volts, f, g].into_iter().zip([PLAIN, CONCAVE, CONVEX]);
        for ((edge, weights), z) in families.zip(&mut z) {
            for (z, (r, w)) in z.iter_mut().zip(THRESHOLDS.into_iter().zip(weights)) {
                *z = f64::max(edge - r, f64::min(edge + r, *z));
                expected += w * *z;
            }
        }
        let found = operator.follow(&mut state, volts);
        assert!((found - expected).abs() < 1e-18, "{found} {expected}");
        for (found, z) in operator.memory(&state).iter().zip(z.as_flattened()) {
            assert!((found - z).abs() < 1e-12, "{found} {z}");
        }
        assert_eq!(falling.follow(&mut other, volts), -found);
    }
}

#[test]
fn its_functions_have_their_slopes_and_are_undone() {
    for bend in Bend::ALL {
        assert_eq!(bend.at(0.0, RANGE).0, 0.0);
        for volts in path(2000) {
            let (value, slope) = bend.at(volts, RANGE);
            let near = [-1e-5, 1e-5].map(|step| bend.at(volts + step, RANGE).0);
            assert!(((near[1] - near[0]) / 2e-5 - slope).abs() < 1e-5, "{bend:?} {volts}");
            let back = bend.reaches(value, RANGE);
            // Where it is level, or nearly, no voltage is the only one.
            let level = slope < 1e-3;
            assert!(level || (back - volts).abs() < 1e-9, "{bend:?} {volts}: {back}");
        }
    }
    // Steep at one end, level at the other.
    assert_eq!(Bend::Concave.at(RANGE.0, RANGE).1, 3.0);
    assert_eq!(Bend::Concave.at(RANGE.1, RANGE).1, 0.0);
    assert_eq!(Bend::Convex.at(RANGE.0, RANGE).1, 0.0);
    assert_eq!(Bend::Convex.at(RANGE.1, RANGE).1, 3.0);
}

#[test]
fn without_bent_plays_it_is_the_operator_of_prandtl_and_ishlinskii() {
    let relaxation = Relaxation::new(&[0.02], &[0.5], Dynamics::First { time: 0.02 }).unwrap();
    let zeros = [0.0; 3];
    let made = |families| {
        let operator = asymmetric_plays(1e-6, RANGE, families).unwrap();
        AsymmetricPrandtlIshlinskiiStage { operator, relaxation }
    };
    let none = (&[][..], &[][..]);
    let unweighted = (&THRESHOLDS[..], &zeros[..]);
    let plain = (&THRESHOLDS[..], &PLAIN[..]);
    let operator = PlayHysteresis::new(1e-6, &THRESHOLDS, &PLAIN, &[], &[]).unwrap();
    let other = PrandtlIshlinskiiStage { operator, relaxation };
    let u = path(2000);
    let drive = Drive::new(&u, 0.01, Hold::First).unwrap();
    let experiment = Experiment::of(&drive, NEVER);
    let expected = other.simulate(&experiment).unwrap().unwrap().x;
    for one in [made([plain, none, none]), made([plain, unweighted, unweighted])] {
        let found = one.simulate(&experiment).unwrap().unwrap().x;
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-17, "{found} {expected}");
        }
    }
}

/// Width of the settled loop (m) at a voltage, where the drive goes all along the range.
fn width(operator: &AsymmetricPlays, volts: f64) -> f64 {
    let mut state = operator.at_rest();
    let mut at = |volts| operator.follow(&mut state, volts);
    for volts in [RANGE.1, RANGE.0, RANGE.1] {
        at(volts);
    }
    let falling = at(volts);
    at(RANGE.0);
    falling - at(volts)
}

#[test]
fn a_play_of_the_concave_function_is_wider_where_that_is_steep() {
    // A backlash of 2 r in f is one of 2 r/f' in the drive; one play makes a loop as high as
    // f(high) - f(u) - 2 r lets it: analytically, on the fall z = min(f + r, top - r) and on the
    // rise z = max(f - r, bottom + r).
    let (r, w) = (6.0, 0.2e-6);
    let none = (&[][..], &[][..]);
    let operator = asymmetric_plays(1e-6, RANGE, [none, (&[r], &[w]), none]).unwrap();
    let other = asymmetric_plays(1e-6, RANGE, [none, none, (&[r], &[w])]).unwrap();
    let (low, high) = RANGE;
    let (bottom, top) = (bent(low)[0] + r, bent(high)[0] - r);
    for volts in [-24.0, -20.0, -10.0, 0.0, 10.0, 20.0, 29.0] {
        let f = bent(volts)[0];
        let expected = w * (f64::min(f + r, top) - f64::max(f - r, bottom));
        let found = width(&operator, volts);
        assert!((found - expected).abs() < 1e-18, "{volts}: {found} {expected}");
        // The convex one has the loop of the concave one turned by half a turn.
        let turned = width(&other, low + high - volts);
        assert!((turned - found).abs() < 1e-18, "{volts}: {turned} {found}");
    }
    // A play of the drive alone has a loop as wide on both sides.
    let plain = asymmetric_plays(1e-6, RANGE, [(&[r], &[w]), none, none]).unwrap();
    let [below, above] = [-21.0, 26.0].map(|volts| width(&plain, volts));
    assert!((below - above).abs() < 1e-18, "{below} {above}");
    let [below, above] = [-21.0, 26.0].map(|volts| width(&operator, volts));
    assert!(below > 10.0 * above.max(0.0), "{below} {above}");
}

#[test]
fn inner_loops_close_and_are_wiped_out() {
    let last = |turns: &[f64]| {
        let mut state = plays(1.0).at_rest();
        let outputs: Vec<f64> =
            turns.iter().map(|volts| plays(1.0).follow(&mut state, *volts)).collect();
        *outputs.last().unwrap()
    };
    let once = last(&[35.0, -35.0, 20.0]);
    assert_eq!(once, last(&[35.0, -35.0, 35.0, -35.0, 20.0]));
    assert_eq!(once, last(&[35.0, -35.0, 10.0, -5.0, 4.0, -1.0, 20.0]));
}

#[test]
fn the_inverse_undoes_the_operator() {
    let nested = [30.0, -30.0, 25.0, -20.0, 18.0, -8.0, 9.0, 1.0, 4.0, 3.0, 4.0, 90.0, -70.0, 0.0];
    for operator in [plays(1.0), plays(-1.0)] {
        let inverse = AsymmetricPlayInverse(operator);
        for u in [&nested[..], &path(20_000)] {
            let (mut there, mut back, mut again) =
                (operator.at_rest(), inverse.rest(), operator.at_rest());
            for &volts in u {
                let output = operator.follow(&mut there, volts);
                let found = inverse.follow(&mut back, output);
                let reached = operator.follow(&mut again, found);
                // 1e-9 of the stroke is 1e-13 m; this is rounding.
                assert!((reached - output).abs() < 1e-18, "{volts}: {reached} {output}");
                assert!((found - volts).abs() < 1e-11, "{volts}: {found}");
            }
        }
    }
}

#[test]
fn the_inverse_of_thirty_two_plays_in_each_family_is_exact_too() {
    // Thresholds so near to each other that a step crosses many corners.
    let thresholds: Vec<f64> = (1..=32).map(|i| 0.8 * f64::from(i)).collect();
    let weights: Vec<f64> = (1..=32).map(|i| 1e-7 * f64::from(1 + 7 * i % 5)).collect();
    let family = (&thresholds[..], &weights[..]);
    // Next to nothing without memory: the slope just after a reversal is a thousandth of the rest.
    let operator = asymmetric_plays(1e-8, RANGE, [family; 3]).unwrap();
    let inverse = AsymmetricPlayInverse(operator);
    let (mut there, mut back) = (operator.at_rest(), inverse.rest());
    for (k, wave) in path(40_000).iter().enumerate().filter(|(k, _)| k % 7 == 0) {
        let volts = if k % 3 == 0 { 2.5 * wave } else { *wave };
        let output = operator.follow(&mut there, volts);
        let found = inverse.follow(&mut back, output);
        assert!((found - volts).abs() < 1e-8, "{volts}: {found}");
    }
}

#[test]
fn what_is_no_output_leaves_no_trace() {
    let inverse = AsymmetricPlayInverse(plays(1.0));
    let mut state = inverse.rest();
    assert!(inverse.follow(&mut state, 10e-6).is_finite());
    let before = state;
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e200, -1e200] {
        assert!(inverse.follow(&mut state, bad).is_nan(), "{bad}");
        assert_eq!(state, before);
    }
    // A running inverse is kept as numbers.
    let (mut kept, mut other) = (Vec::new(), inverse.rest());
    state.save(&mut |number| kept.push(number));
    let mut numbers = kept.into_iter();
    other.load(&mut || numbers.next()).unwrap();
    assert_eq!(other, state);
}

#[test]
fn the_stage_moves_as_under_a_drive_in_many_more_steps() {
    let stage = stage(Dynamics::Second { frequency: 30.0, damping_ratio: 0.1 });
    let u = path(600);
    let run = |u: &[f64], dt| {
        let drive = Drive::new(u, dt, Hold::First).unwrap();
        stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap()
    };
    let whole = run(&u, 0.01);
    let fine: Vec<f64> = u
        .windows(2)
        .flat_map(|pair| (0..50).map(|k| pair[0] + (pair[1] - pair[0]) * f64::from(k) / 50.0))
        .collect();
    let slow = run(&fine, 0.0002);
    for (one, other) in whole.x.iter().zip(slow.x.iter().step_by(50)) {
        assert!((one - other).abs() < 1e-9, "{one} {other}");
    }
}

#[test]
fn a_closed_loop_moves_the_stage_as_an_open_one() {
    let stage = stage(Dynamics::First { time: 0.02 });
    let (u, dt) = (path(2000), 0.01);
    let drive = Drive::new(&u, dt, Hold::First).unwrap();
    let run = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap();
    let (flow, mut state) = (stage.flow(dt), Plant::rest(&stage));
    for (k, pair) in u.windows(2).enumerate() {
        stage.advance(&flow, &mut state, pair[0], pair[1]);
        let found = stage.displacement(&state);
        assert!((found - run.x[k + 1]).abs() < 1e-9, "{k}: {found} {}", run.x[k + 1]);
    }
    assert!(stage.inverse(dt, None).is_ok());
    let [least, mean, most] = stage.loop_plants(-25.0, 30.0).unwrap().map(|one| one.static_gain());
    // Just after a reversal nothing but `linear` moves.
    assert!((least / 1e-6 - 1.0).abs() < 1e-9, "{least:e}");
    assert!(least < mean && mean < most, "{least:e} {mean:e} {most:e}");
}

#[test]
fn a_record_gives_back_the_stage_that_made_it() {
    let u: Vec<f64> = path(6000).iter().map(|volts| volts.clamp(RANGE.0, RANGE.1)).collect();
    // The fit takes its range from the drive.
    assert_eq!(u.iter().copied().fold(f64::INFINITY, f64::min), RANGE.0);
    assert_eq!(u.iter().copied().fold(-f64::INFINITY, f64::max), RANGE.1);
    for sign in [1.0, -1.0] {
        let relaxation = Relaxation::new(&[], &[], Dynamics::None).unwrap();
        let made = AsymmetricPrandtlIshlinskiiStage { operator: plays(sign), relaxation };
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
        let model = Model::AsymmetricPrandtlIshlinskii;
        let fit = identify_weights(model, &[record], &settings, NEVER).unwrap().unwrap();
        assert!(fit.rms < 1e-14, "{:e}", fit.rms);
        let expected =
            [("weights", PLAIN), ("concave_weights", CONCAVE), ("convex_weights", CONVEX)];
        for (name, weights) in expected {
            for (found, made) in fit.values.list(name).iter().zip(weights) {
                assert!((sign * found - made).abs() < 1e-13, "{name}: {found} {made}");
            }
        }
        assert_eq!((fit.values.number("low"), fit.values.number("high")), RANGE);
    }
}

#[test]
fn parameters_out_of_range_are_named() {
    let none = (&[][..], &[][..]);
    let refused = |linear, range, families| {
        asymmetric_plays(linear, range, families).unwrap_err().to_string()
    };
    assert!(refused(f64::NAN, RANGE, [none; 3]).starts_with("linear is NaN m/V"));
    assert!(refused(0.0, RANGE, [none; 3]).starts_with("linear is 0 m/V"));
    assert!(refused(1e-6, (3.0, 3.0), [none; 3]).starts_with("high is 3 V"));
    assert!(refused(1e-6, (f64::NAN, 3.0), [none; 3]).starts_with("low is NaN V"));
    let one = |thresholds, weights| [none, (thresholds, weights), none];
    assert!(refused(1e-6, RANGE, one(&[1.0], &[-1e-6])).starts_with("concave_weights[0]"));
    assert!(refused(1e-6, RANGE, one(&[1.0], &[])).starts_with("concave_weights"));
    assert!(refused(1e-6, RANGE, one(&[-1.0], &[0.0])).starts_with("concave_thresholds[0]"));
    let many = [1.0; 33];
    assert!(refused(1e-6, RANGE, [none, none, (&many, &many)]).starts_with("convex_weights"));
}

#[test]
fn beyond_the_range_a_way_of_any_length_is_one_straight_line() {
    let operator = plays(1.0);
    for side in [1.0, -1.0] {
        let mut state = operator.at_rest();
        operator.follow(&mut state, side * 1e3);
        assert_eq!(operator.straight(&state, side * 1e9, 1e-15), side * 1e9);
    }
}
