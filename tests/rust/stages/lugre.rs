//! LuGre friction: along paths, over steps, in its limits, and its inverse.
#![allow(missing_docs, clippy::unwrap_used)]

use piezotrack_control::hysteresis::{FirstOrderDahl, LuGre, Operator};
use piezotrack_core::models::{
    Experiment, FirstOrderDahlStage, LuGreStage, Model, Plant, StageModel, Values,
};
use piezotrack_core::signal::{Drive, Hold, NEVER};

const FRICTION: LuGre<f64> = LuGre {
    rest_stiffness: 2e4,
    micro_damping: 20.0,
    coulomb_force: 0.1,
    static_force: 0.2,
    stribeck_velocity: 2e-4,
};
const VALUES: [f64; 10] = [0.1828, 50.0, 26065.0, 0.0468, 2e4, 20.0, 0.1, 2.0, 2e-4, 5.0];

fn limit(v: f64) -> f64 {
    0.1 + 0.1 * libm::exp(-(v / 2e-4) * (v / 2e-4))
}

/// z' = v - sigma0 |v| z/g(v) by Runge-Kutta steps of fourth order.
fn deflection(mut z: f64, velocity: impl Fn(f64) -> f64, steps: u32) -> f64 {
    let h = 1.0 / f64::from(steps);
    let rate = |s: f64, z: f64| {
        let v = velocity(s);
        v - 2e4 * v.abs() * z / limit(v)
    };
    for k in 0..steps {
        let s = f64::from(k) * h;
        let k1 = rate(s, z);
        let k2 = rate(s + 0.5 * h, z + 0.5 * h * k1);
        let k3 = rate(s + 0.5 * h, z + 0.5 * h * k2);
        let k4 = rate(s + h, z + h * k3);
        z += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
    }
    z
}

/// Speeding up from v0 to v1 evenly in a second: the square of the speed is linear in the path.
#[test]
fn a_way_under_constant_acceleration() {
    for (z, v0, v1) in [(0.0, 0.0, 1e-4), (-5e-6, 1e-5, 3e-5), (9e-6, 2e-4, 1.8e-4)] {
        let expected = deflection(z, |s| v0 + s * (v1 - v0), 20_000);
        let mut found = z;
        let pieces = 64;
        for k in 0..pieces {
            let at = |j: f64| v0 + (f64::from(k) + j) / f64::from(pieces) * (v1 - v0);
            let length = 0.5 * (at(0.0) + at(1.0)) / f64::from(pieces);
            let (start, end) = (at(0.0) * at(0.0), at(1.0) * at(1.0));
            found = FRICTION.along(found, length, [start, 0.5 * (start + end), end]);
        }
        assert!((found - expected).abs() < 1e-7 * 1e-5, "{found} {expected}");
    }
}

#[test]
fn the_rate_of_the_force_is_its_derivative() {
    for (z, v) in [(3e-6, 1e-4), (-4e-6, 1e-4), (5e-6, -3e-4), (8e-6, -1e-5)] {
        let (acceleration, h) = (0.02, 1e-7);
        let rate = v - 2e4 * f64::abs(v) * z / limit(v);
        let force = |t: f64| FRICTION.force(z + rate * t, v + acceleration * t);
        let expected = (force(h) - force(-h)) / (2.0 * h);
        let [_, found] = FRICTION.force_and_rate(z, v, acceleration);
        assert!((found - expected).abs() < 1e-6 * expected.abs(), "{found} {expected}");
    }
}

#[test]
fn at_one_force_it_is_first_order_dahl_friction() {
    let same = LuGre { static_force: 0.1, micro_damping: 0.0, ..FRICTION };
    let dahl = FirstOrderDahl { rest_stiffness: 2e4, coulomb_force: 0.1, exponent: 1.0 };
    for length in [1e-9, 1e-6, 4e-6, 1e-4] {
        let there = dahl.along(&dahl.branch(&dahl.rest(), 1.0), length);
        let found = 2e4 * same.along(0.0, length, [0.0, 1e-8, 4e-8]);
        assert!((found - there.value).abs() < 1e-15, "{found} {there:?}");
    }
}

fn drive(samples: u32) -> Vec<f64> {
    (0..samples)
        .map(|k| {
            let t = 2e-3 * f64::from(k);
            37.5 * (1.0 - libm::cos(12.0 * t)) + 12.0 * libm::sin(90.0 * t)
        })
        .collect()
}

/// The stage with the limit of the friction at the same damping.
#[test]
fn the_stage_at_one_force_is_the_one_with_first_order_dahl_friction() {
    let mut values = VALUES;
    (values[5], values[7]) = (0.0, 1.0);
    let stage = LuGreStage::new(&values).unwrap();
    let other = FirstOrderDahlStage::new(&[0.1828, 55.0, 26065.0, 0.0468, 2e4, 0.1, 1.0]).unwrap();
    let u = drive(400);
    for hold in [Hold::First, Hold::Zero] {
        let drive = Drive::new(&u, 2e-3, hold).unwrap();
        let experiment = Experiment { accuracy: 1e-12, ..Experiment::of(&drive, NEVER) };
        let found = stage.simulate(&experiment).unwrap().unwrap();
        let expected = other.simulate(&experiment).unwrap().unwrap();
        for (a, b) in found.x.iter().zip(&expected.x) {
            assert!((a - b).abs() < 3e-12, "{a} {b}");
        }
        for (a, b) in found.hysteresis.iter().zip(&expected.hysteresis) {
            // That of the viscous friction counts to the force here, and to the mechanics there.
            assert!((a - b).abs() < 5.0 * 0.05, "{a} {b}");
        }
    }
}

/// Displacements under a drive without a reversal, in steps of 2 ms halved so often.
fn reached(stage: &LuGreStage, halvings: i32) -> Vec<f64> {
    let parts = 1 << halvings;
    let flow = stage.flow(2e-3 / f64::from(parts));
    let u: Vec<f64> = (0..60).map(|k| 0.02 * f64::from(k) * f64::from(k)).collect();
    let mut state = stage.rest();
    let sample = |pair: &[f64]| {
        let volts = |k: i32| pair[0] + f64::from(k) / f64::from(parts) * (pair[1] - pair[0]);
        for k in 0..parts {
            stage.advance(&flow, &mut state, volts(k), volts(k + 1));
        }
        stage.displacement(&state)
    };
    u.windows(2).map(sample).collect()
}

#[test]
fn the_scheme_is_of_fourth_order_and_of_third_with_micro_damping() {
    for (micro_damping, order) in [(0.0, 4), (20.0, 3)] {
        let mut values = VALUES;
        values[5] = micro_damping;
        let stage = LuGreStage::new(&values).unwrap();
        let [coarse, middle, fine] = [2, 3, 4].map(|halvings| reached(&stage, halvings));
        let apart =
            |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let factor = apart(&coarse, &middle) / apart(&middle, &fine);
        let expected = libm::ldexp(1.0, order);
        assert!((factor / expected - 1.0).abs() < 0.15, "{factor} for {micro_damping} N s/m");
    }
}

#[test]
fn what_is_out_of_its_range_is_named() {
    let refused = |place: usize, value: f64| {
        let mut values = VALUES;
        values[place] = value;
        LuGreStage::new(&values).unwrap_err().to_string()
    };
    assert!(refused(4, 0.0).starts_with("rest_stiffness is 0 N/m"));
    assert!(refused(5, -1.0).starts_with("micro_damping is -1 N s/m"));
    assert!(refused(5, 1e9).starts_with("micro_damping is 1000000000 N s/m: expected"));
    assert!(refused(7, f64::NAN).starts_with("static_ratio"));
    assert!(refused(8, 0.0).starts_with("stribeck_velocity is 0 m/s"));
    let values = Values::scalars(Model::LuGre.info().parameters, &VALUES);
    assert!(Model::LuGre.build(&values).is_ok());
}
