//! Step responses against the closed form of a mode, and where signals turn.
#![allow(missing_docs, clippy::unwrap_used)]

use std::f64::consts::TAU;

use piezotrack_core::Error;
use piezotrack_core::identify::{StepReadings, read_step, separate};
use piezotrack_core::signal::{Hold, turns};

const RATE: f64 = 5000.0;
const STEADY: f64 = 117.7622e-6;

/// A step of a mode at its 100th sample: drive and displacement.
fn step(frequency: f64, zeta: f64, samples: u32) -> (Vec<f64>, Vec<f64>) {
    let wn = TAU * frequency;
    let wd = wn * (1.0 - zeta * zeta).sqrt();
    (0..samples)
        .map(|k| {
            let t = (f64::from(k) - 100.0).max(0.0) / RATE;
            let turn = (wd * t).cos() + zeta * wn / wd * (wd * t).sin();
            let x = STEADY * (1.0 - (-zeta * wn * t).exp() * turn);
            (if k >= 100 { 75.0 } else { 0.0 }, x)
        })
        .unzip()
}

fn published() -> StepReadings {
    StepReadings {
        voltage: 75.0,
        steady_state: STEADY,
        peaks: vec![192.5302e-6, 170.2524e-6],
        period: 0.0058,
        frequency: 160.0,
        static_gain: 1.5759e-6,
        resonance_gain: 12.0806e-6,
        initial_slope: 0.0,
    }
}

#[test]
fn a_step_gives_the_mode_back() {
    for (frequency, zeta) in [(160.0, 0.065), (40.0, 0.02), (400.0, 0.1)] {
        let (u, x) = step(frequency, zeta, 10_000);
        let found = read_step(&u, &x, 1.0 / RATE, Hold::Zero).unwrap();
        let mode = found.readings.conventional().unwrap();
        assert!((mode.damping_by_decrement / zeta - 1.0).abs() < 0.01, "{mode:?}");
        assert!((mode.damping_ratio / zeta - 1.0).abs() < 0.02, "{mode:?}");
        let resonance = frequency * (1.0 - 2.0 * zeta * zeta).sqrt();
        assert!((found.readings.frequency / resonance - 1.0).abs() < 2e-3);
        assert!((found.readings.steady_state / STEADY - 1.0).abs() < 1e-3);
        assert_eq!(found.before, 99);
    }
}

#[test]
fn the_published_readings_give_the_published_parameters() {
    let found = published().conventional().unwrap();
    for (value, expected) in [(found.a1, 121.9874), (found.a2, 1.1773e6), (found.b1, 1.8485e6)] {
        assert!((value / expected - 1.0).abs() < 1e-4, "{value} {expected}");
    }
}

#[test]
fn the_first_force_solves_the_operators_equation() {
    // q1'' + a1 q1' + a2 q1 = up from rest, by small steps along the displacement.
    let found = published().conventional().unwrap();
    let (mut q1, mut q2, steps) = (0.0, 0.0, 200_000);
    let dx = 100e-6 / f64::from(steps);
    for _ in 0..steps {
        let middle = q2 + 0.5 * dx * (30.0 - found.a2 * q1 - found.a1 * q2);
        q1 += dx * middle;
        q2 += dx * (30.0 - found.a2 * q1 - found.a1 * middle);
    }
    assert!((found.first_force(100e-6) / (found.b1 * q1) - 1.0).abs() < 1e-4);
    assert_eq!(found.first_force(100e-6).to_bits(), found.first_force(-100e-6).to_bits());
}

#[test]
fn two_levels_separate_stiffness_and_piezo_coefficient() {
    let found = published().conventional().unwrap();
    let (stiffness, coefficient) = (26065.0, 0.0468);
    let drive = |x: f64| (stiffness * x + found.first_force(x)) / coefficient;
    let levels = [60e-6, 110e-6].map(|x| (drive(x), x));
    let (k, t) = separate(&found, levels[0], levels[1]).unwrap();
    assert!((k / stiffness - 1.0).abs() < 1e-6);
    assert!((t / coefficient - 1.0).abs() < 1e-6);
    let error = separate(&found, levels[0], levels[0]).unwrap_err();
    assert!(matches!(error, Error::Data(_)));
}

#[test]
fn no_record_makes_it_panic() {
    let wild = [0.0, 75.0, f64::MAX, -1e-300, 3.0];
    for n in 0..60 {
        for shift in 0..wild.len() {
            let u: Vec<f64> = (0..n).map(|k| if k > n / 3 { wild[shift] } else { 0.0 }).collect();
            let y: Vec<f64> = (0..n).map(|k| wild[(k * k + shift) % wild.len()]).collect();
            let _ = read_step(&u, &y, 1e-3, Hold::First);
            let _ = read_step(&y, &u, 1e-3, Hold::Zero);
            let _ = read_step(&u, &u, 1e-3, Hold::Zero);
        }
    }
}

#[test]
fn turns_are_where_a_signal_turns() {
    assert_eq!(turns(&[], 0.1), Vec::<usize>::new());
    assert_eq!(turns(&[1.0; 5], 0.0), Vec::<usize>::new());
    assert_eq!(turns(&[0.0, 1.0, 0.95, 2.0, 3.0], 0.1), Vec::<usize>::new());
    assert_eq!(turns(&[3.0, 1.0, 2.0, 0.0, 0.05, 4.0, 1.0], 0.1), [1, 2, 3, 5]);
    let sine: Vec<f64> = (0..1000).map(|k| (TAU * f64::from(k) / 400.0).sin()).collect();
    assert_eq!(turns(&sine, 0.1), [100, 300, 500, 700, 900]);
}
