//! The online inverse of the Dahl stage, against the stage and against its equations.
#![allow(missing_docs, clippy::unwrap_used)]

use core::f64::consts::TAU;

use piezotrack_control::{DahlInverse, SampledDahlInverse};
use piezotrack_core::models::{DahlStage, Experiment, StageModel};
use piezotrack_core::signal::{Drive, Hold, NEVER};

/// Displacement, velocity and acceleration of two sines, 0 at rest at t = 0.
fn reference(t: f64) -> [f64; 3] {
    let (a, w) = (40e-6, TAU * 0.37);
    let (b, p) = (12e-6, TAU * 1.71);
    [
        a * (1.0 - (w * t).cos()) + b * (1.0 - (p * t).cos()),
        a * w * (w * t).sin() + b * p * (p * t).sin(),
        a * w * w * (w * t).cos() + b * p * p * (p * t).cos(),
    ]
}

fn voltages(inverse: &SampledDahlInverse, dt: f64, n: u32) -> Vec<f64> {
    let mut state = inverse.rest();
    (0..n)
        .map(|k| {
            let [x, v, a] = reference(dt * f64::from(k));
            inverse.step(&mut state, x, v, a)
        })
        .collect()
}

#[test]
fn stage_driven_by_its_inverse_tracks_within_a_tenth_of_a_nanometre() {
    let dt = 2e-4;
    let inverse = DahlInverse::xu_li_2010().at(dt).unwrap();
    let u = voltages(&inverse, dt, 40_000);
    let drive = Drive::new(&u, dt, Hold::First).unwrap();
    let stage = DahlStage::xu_li_2010();
    let run = stage
        .simulate(&Experiment { accuracy: 1e-13, ..Experiment::of(&drive, NEVER) })
        .unwrap()
        .unwrap();
    // M/D is 70 us: after 5 ms the jump of the reference's acceleration is over.
    for (k, x) in (0_u32..).zip(&run.x).skip(25) {
        let error = x - reference(dt * f64::from(k))[0];
        assert!(error.abs() < 1e-10, "{error} m at sample {k}");
    }
}

#[test]
fn turning_points_between_samples_are_followed() {
    // A strongly path-dependent stage, sampled coarsely and 400 times as finely.
    let inverse = DahlInverse::new(0.0, 0.0, 1e4, 0.05, 2e4, 1e8, 1e6, 0.0, 30.0).unwrap();
    let coarse = voltages(&inverse.at(0.01).unwrap(), 0.01, 400);
    let fine = voltages(&inverse.at(0.000_025).unwrap(), 0.000_025, 160_000);
    let path: Vec<f64> = (0..400).map(|k| reference(0.01 * f64::from(k))[0]).collect();
    let turns = path.windows(3).filter(|w| (w[1] - w[0]) * (w[2] - w[1]) < 0.0).count();
    assert!(turns > 8, "{turns}");
    let linear = |k: usize| 1e4 / 0.05 * path[k];
    let most = (0..400).fold(0.0, |most, k| f64::max(most, (coarse[k] - linear(k)).abs()));
    let (mut worst, mut straight) = (0.0, 0.0);
    let mut state = inverse.at(0.01).unwrap().rest();
    for k in 0..400 {
        let error = (coarse[k] - fine[400 * k]).abs();
        worst = f64::max(worst, error);
        // With no velocities given, the path is monotone from sample to sample.
        let volts = inverse.at(0.01).unwrap().step(&mut state, path[k], 0.0, 0.0);
        straight = f64::max(straight, (volts - fine[400 * k]).abs());
    }
    assert!(worst < 1e-6 * most, "{worst} V of {most} V");
    assert!(straight > 100.0 * worst, "{straight} V beside {worst} V");
}

#[test]
fn both_turning_points_in_one_interval_are_followed() {
    // x goes up, back and up again between two samples: 10 s - 24 s^2 + 16 s^3, in um.
    let inverse = DahlInverse::new(0.0, 0.0, 0.0, 1.0, 2e5, 1e10, 1e6, 0.0, 1.0).unwrap();
    let at = |s: f64| 1e-6 * (1.0 + s * (10.0 + s * (-24.0 + s * 16.0)));
    let slope = |s: f64| 1e-6 * (10.0 + s * (-48.0 + s * 48.0));
    let coarse = inverse.at(1.0).unwrap();
    let mut state = coarse.rest();
    coarse.step(&mut state, at(0.0), slope(0.0), 0.0);
    let once = coarse.step(&mut state, at(1.0), slope(1.0), 0.0);
    let fine = inverse.at(1e-4).unwrap();
    let mut state = fine.rest();
    let mut volts = 0.0;
    for k in 0..=10_000 {
        let s = 1e-4 * f64::from(k);
        volts = fine.step(&mut state, at(s), slope(s), 0.0);
    }
    assert!((once - volts).abs() < 1e-9 * volts.abs(), "{once} V and {volts} V");
}

#[test]
fn long_moves_follow_the_closed_form() {
    // V = V* + exp(Ah x)(V - V*): q1 = up/a2 (1 - e^(-a1 x/2)(cos w x + a1/(2 w) sin w x))
    let (a1, a2, up) = (121.9874, 1.1773e6_f64, 30.0);
    let inverse = DahlInverse::new(0.0, 0.0, 0.0, 1.0, a1, a2, 1e6, 0.0, up).unwrap();
    let inverse = inverse.at(0.02).unwrap();
    let w = (a2 - a1 * a1 / 4.0).sqrt();
    for x in [1e-6, 1e-4, 1e-3, 5e-3] {
        let mut state = inverse.rest();
        let volts = inverse.step(&mut state, x, 0.0, 0.0);
        let decay = (-a1 * x / 2.0).exp();
        let q1 = up / a2 * (1.0 - decay * ((w * x).cos() + a1 / (2.0 * w) * (w * x).sin()));
        // Over the stroke, 120 um; further out what is left of the power series adds up.
        let within = if x < 2e-4 { 1e-8 } else { 1e-7 };
        assert!((volts - 1e6 * q1).abs() < within * (1e6 * q1).abs(), "{volts} V at {x} m");
    }
}

#[test]
fn friction_term_follows_the_equations() {
    // q1' = q2 x', q2' = (up - a2 q1 - sgn(x') a1 q2) x', by RK4 in time with 50 fine steps a
    // sample; Fh = b1 q1 + sgn(x') b0 q2.
    let (mass, damping, stiffness, t) = (0.2, 300.0, 2e4, 0.05);
    let (a1, a2, b1, b0, up) = (3e3, 1e7, 2e6, 4e3, 30.0);
    let inverse = DahlInverse::new(mass, damping, stiffness, t, a1, a2, b1, b0, up).unwrap();
    let dt = 1e-3;
    let u = voltages(&inverse.at(dt).unwrap(), dt, 2000);
    let rate = |time: f64, q: [f64; 2]| {
        let v = reference(time)[1];
        [q[1] * v, (up - a2 * q[0] - v.signum() * a1 * q[1]) * v]
    };
    let mut q = [0.0, 0.0];
    let h = dt / 50.0;
    let mut friction = 0.0;
    for (k, volts) in (0_u32..).zip(&u) {
        let [x, v, a] = reference(dt * f64::from(k));
        let sign = if k == 0 { 0.0 } else { v.signum() };
        let hysteresis = b1 * q[0] + sign * b0 * q[1];
        friction = f64::max(friction, (b0 * q[1] / t).abs());
        let expected = (mass * a + damping * v + stiffness * x + hysteresis) / t;
        assert!((volts - expected).abs() < 1e-5, "{volts} V, {expected} V at sample {k}");
        for j in 0..50 {
            let time = dt * f64::from(k) + h * f64::from(j);
            let step = |q: [f64; 2], k: [f64; 2], h: f64| [q[0] + h * k[0], q[1] + h * k[1]];
            let k1 = rate(time, q);
            let k2 = rate(time + h / 2.0, step(q, k1, h / 2.0));
            let k3 = rate(time + h / 2.0, step(q, k2, h / 2.0));
            let k4 = rate(time + h, step(q, k3, h));
            for i in 0..2 {
                q[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
        }
    }
    assert!(friction > 1.0, "the term must matter: {friction} V");
}

#[test]
fn friction_is_zero_at_rest() {
    let sampled = |b0| {
        DahlInverse::new(0.1, 0.0, 1e4, 0.05, 0.0, 0.0, 0.0, b0, 30.0).unwrap().at(1e-3).unwrap()
    };
    let volts = |b0: f64, v: f64| {
        let inverse = sampled(b0);
        let mut state = inverse.rest();
        inverse.step(&mut state, 1e-5, 1e-3, 0.0);
        inverse.step(&mut state, 2e-5, v, 0.0)
    };
    // q2 = up x with a1 = a2 = 0
    assert!((volts(1e3, 0.0) - volts(0.0, 0.0)).abs() < 1e-12);
    assert!((volts(1e3, 1e-3) - volts(0.0, 1e-3) - 1e3 * 30.0 * 2e-5 / 0.05).abs() < 1e-9);
}

#[test]
fn bad_samples_leave_the_state_alone() {
    let inverse = DahlInverse::xu_li_2010().at(0.02).unwrap();
    let (mut state, mut same) = (inverse.rest(), inverse.rest());
    inverse.step(&mut state, 1e-5, 1e-4, 0.0);
    inverse.step(&mut same, 1e-5, 1e-4, 0.0);
    for bad in [f64::NAN, f64::INFINITY, 1e300, -3.0] {
        assert!(inverse.step(&mut state, bad, 0.0, 0.0).is_nan());
    }
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        assert!(inverse.step(&mut state, 1e-5, bad, 0.0).is_nan());
    }
    assert!(inverse.step(&mut state, 1e-5, 0.0, f64::NAN).is_nan());
    let first = inverse.step(&mut state, 2e-5, 1e-4, 0.0);
    assert_eq!(first.to_bits(), inverse.step(&mut same, 2e-5, 1e-4, 0.0).to_bits());
}
