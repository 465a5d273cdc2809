//! The Maxwell-slip stage: its elements, the plays that they are, and its inverse.
#![allow(missing_docs, clippy::unwrap_used)]

use piezotrack_core::models::{
    Dynamics, FittedWeights, InputOperator, InputStage, Invertible, MaxwellSlip, MaxwellSlipStage,
    Relaxation, StageModel, Superposition,
};

const GAIN: f64 = 0.9e-6;
const RATIOS: [f64; 3] = [0.3, 0.0, 0.45];
const SLIPS: [f64; 3] = [2e-6, 5e-6, 14e-6];

fn none() -> Relaxation {
    Relaxation::new(&[], &[], Dynamics::None).unwrap()
}

/// Voltages that turn at places which do not repeat.
fn path() -> impl Iterator<Item = f64> {
    (0..4000).map(|k| {
        let t = 0.01 * f64::from(k);
        25.0 * libm::sin(t) + 12.0 * libm::sin(2.7 * t) + 4.0 * libm::sin(17.3 * t)
    })
}

/// The voltage that takes the elements from a displacement to another, and their strains there.
fn volts(strains: &mut [f64; 3], from: f64, to: f64) -> f64 {
    let mut sum = to;
    for i in 0..3 {
        strains[i] = (strains[i] + to - from).clamp(-SLIPS[i], SLIPS[i]);
        sum += RATIOS[i] * strains[i];
    }
    sum / GAIN
}

#[test]
fn displacement_and_forces_are_in_equilibrium_with_the_drive() {
    let operator = MaxwellSlip::new(GAIN, &RATIOS, &SLIPS).unwrap();
    let (mut state, mut strains, mut x) = (operator.rest(), [0.0; 3], 0.0);
    for drive in path() {
        let there = operator.follow(&mut state, drive);
        let needed = volts(&mut strains, x, there);
        assert!((needed - drive).abs() < 1e-11, "{needed} {drive}");
        x = there;
    }
}

#[test]
fn the_inverse_is_the_sum_of_stops() {
    for gain in [GAIN, -GAIN] {
        let operator = MaxwellSlip::new(gain, &RATIOS, &SLIPS).unwrap();
        let stage = InputStage { operator, relaxation: none() };
        let (inverse, mut state) = stage.inverse(1e-3, None).unwrap();
        let (mut strains, mut before) = ([0.0; 3], 0.0);
        for drive in path() {
            let x = 1e-6 * drive;
            let expected = volts(&mut strains, before, x) * GAIN / gain;
            let found = inverse.step(&mut state, x, 0.0, 0.0);
            assert!((found - expected).abs() < 1e-11, "{found} {expected}");
            before = x;
        }
    }
}

#[test]
fn plays_and_elements_are_converted_into_each_other() {
    for gain in [GAIN, -GAIN] {
        let stage = InputStage {
            operator: MaxwellSlip::new(gain, &RATIOS, &SLIPS).unwrap(),
            relaxation: none(),
        };
        let plays = stage.operator.plays.plays;
        let fitted = FittedWeights {
            linear: plays.linear,
            nodes: plays.thresholds[..3].to_vec(),
            weights: plays.weights[..3].to_vec(),
            dead_zone_thresholds: vec![],
            dead_zone_weights: vec![],
            shape: vec![],
            drive: (0.0, 1.0),
            relaxation: stage.relaxation,
        };
        let values = MaxwellSlipStage::values(&fitted);
        let near = |found: &[f64], expected: &[f64]| {
            let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
            let most = expected.iter().fold(0.0, |most: f64, b| most.max(b.abs()));
            assert!(found.len() == expected.len() && off.fold(0.0, f64::max) < 1e-14 * most);
        };
        near(values.list("piezo_coefficient"), &[gain]);
        near(values.list("stiffness_ratios"), &RATIOS);
        near(values.list("slip_displacements"), &SLIPS);
        assert!(MaxwellSlipStage::build(&values).is_ok());
    }
}

#[test]
fn refusals_name_the_element() {
    let refused = |gain: f64, ratios: &[f64], slips: &[f64]| {
        MaxwellSlip::new(gain, ratios, slips).unwrap_err().to_string()
    };
    assert!(refused(0.0, &[], &[]).starts_with("piezo_coefficient is 0 m/V"));
    assert!(refused(1.0, &[0.1, -0.1], &[1.0, 2.0]).starts_with("stiffness_ratios[1] is -0.1"));
    let found = refused(1.0, &[0.1, 0.1], &[2.0, 1.0]);
    assert!(found.starts_with("slip_displacements[1] is 1 m: expected 2 m or above"), "{found}");
    assert!(refused(1.0, &[0.1], &[]).starts_with("stiffness_ratios has 1 entries"));
}
