//! Distortion of modes: pairs of a mode and an input that made a residual are found again.
#![allow(clippy::unwrap_used, clippy::cast_precision_loss)]

use std::f64::consts::PI;

use piezotrack_core::identify::{DistortionRecord, ModalTerms, choose_distortion};
use piezotrack_core::signal::NEVER;
use piezotrack_core::simulate::{Regressor, Regressors};
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};

const LINES: usize = 300;
const SENSORS: usize = 2;
const INPUTS: usize = 6;
const REALISATIONS: usize = 4;

type C = [f64; 2];

fn times(a: C, b: C) -> C {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

fn numbers(generator: &mut TestRng, count: usize) -> Vec<C> {
    // Sums of uniform numbers, near to normal ones.
    let mut one =
        || (0..12).map(|_| f64::from(generator.next_u32()) / 4_294_967_296.0).sum::<f64>() - 6.0;
    (0..count).map(|_| [one(), one()]).collect()
}

fn terms() -> ModalTerms {
    let poles = [(0.02, 0.4), (0.03, 1.1), (0.015, 1.9)].map(|(decay, angle): (f64, f64)| {
        let size = (-decay).exp();
        [size * angle.cos(), size * angle.sin()]
    });
    let inputs = [[1.0, 0.0], [0.3, 0.1], [-0.2, 0.4]];
    let outputs =
        [[0.02, 0.1], [0.03, -0.08], [-0.01, 0.05], [0.05, 0.02], [-0.04, 0.06], [0.01, 0.03]];
    ModalTerms::new([1, SENSORS], &poles, &inputs, &outputs, &[0.1, -0.2]).unwrap()
}

#[test]
fn pairs_that_made_a_residual_are_found_with_their_forces() {
    let mut generator = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let terms = terms();
    let angles: Vec<f64> = (1..=LINES).map(|k| 0.9 * PI * k as f64 / LINES as f64).collect();
    let inputs = numbers(&mut generator, LINES * INPUTS * REALISATIONS);
    // Of the drive, which is not chosen, and of two pairs.
    let made = [(0, 0, [0.3, -0.2]), (1, 3, [0.2, 0.1]), (2, 5, [-0.05, 0.15])];
    let noise = numbers(&mut generator, LINES * SENSORS * REALISATIONS);
    let mut residual = Vec::new();
    for (line, angle) in angles.iter().enumerate() {
        for sensor in 0..SENSORS {
            for realisation in 0..REALISATIONS {
                let own = noise[(line * SENSORS + sensor) * REALISATIONS + realisation];
                let mut sum = own.map(|part| 0.01 * part);
                for (mode, input, force) in made {
                    let c = times(terms.outputs()[mode * SENSORS + sensor], force);
                    let n = inputs[(line * INPUTS + input) * REALISATIONS + realisation];
                    let [x, y] = terms.poles()[mode];
                    for sign in [1.0, -1.0] {
                        let (a, b) = (angle.cos() - x, angle.sin() - sign * y);
                        let size = a * a + b * b;
                        let part = times(times([c[0], sign * c[1]], [a / size, -b / size]), n);
                        sum = [sum[0] + part[0], sum[1] + part[1]];
                    }
                }
                residual.push(sum);
            }
        }
    }
    let weights = vec![1.0; LINES * SENSORS];
    // The second level is 3 times the first, and its residual shows e of power 1 grown by it.
    let levels = [[1.0, 1.0, 1.0], [1.0, 3.0, 9.0]];
    let grown: Vec<C> =
        inputs
            .iter()
            .enumerate()
            .map(|(k, n)| {
                if (k / REALISATIONS).is_multiple_of(INPUTS) {
                    *n
                } else {
                    n.map(|part| part / 3.0)
                }
            })
            .collect();
    let first = DistortionRecord {
        terms: &terms,
        angles: &angles,
        inputs: &inputs,
        residual: &residual,
        weights: &weights,
        powers: &levels[0],
    };
    let second = DistortionRecord { inputs: &grown, powers: &levels[1], ..first };
    let found = choose_distortion(&[first, second], 1, 9, NEVER).unwrap();
    let mut pairs: Vec<_> = found.forces.iter().map(|one| [one.mode, one.input]).collect();
    pairs.sort_unstable();
    assert_eq!(pairs, [[1, 3], [2, 5]]);
    let apart = |e: C, force: C| (e[0] - force[0]).hypot(e[1] - force[1]);
    for (mode, input, force) in &made[1..] {
        let one = found.forces.iter().find(|one| [one.mode, one.input] == [*mode, *input]).unwrap();
        // A thousandth of ridge, and the noise.
        assert_eq!(one.power, 1);
        assert!(apart(one.force, *force) < 0.01, "{:?} for {force:?}", one.force);
    }
    for linear in &found.linear {
        assert!(apart(linear[0], made[0].2) < 0.01, "{linear:?}");
    }
    assert_eq!(choose_distortion(&[first, second], 1, 1, NEVER).unwrap().forces.len(), 1);
    // What is left is the noise: twice 0.01^2 for each complex number.
    let power: f64 = residual.iter().flatten().map(|part| part * part).sum();
    let left = found.left[0] * power / (residual.len() as f64 * 2e-4);
    assert!((0.9..1.1).contains(&left), "{left}");
}

#[test]
fn noise_alone_gives_no_pair() {
    let mut generator = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let terms = terms();
    let angles: Vec<f64> = (1..=LINES).map(|k| 0.9 * PI * k as f64 / LINES as f64).collect();
    let inputs = numbers(&mut generator, LINES * INPUTS * REALISATIONS);
    let residual = numbers(&mut generator, LINES * SENSORS * REALISATIONS);
    let weights = vec![1.0; LINES * SENSORS];
    let record = DistortionRecord {
        terms: &terms,
        angles: &angles,
        inputs: &inputs,
        residual: &residual,
        weights: &weights,
        powers: &[1.0],
    };
    assert!(choose_distortion(&[record], 1, 9, NEVER).unwrap().forces.is_empty());
    let short = DistortionRecord { weights: &weights[1..], ..record };
    assert!(choose_distortion(&[short], 1, 9, NEVER).is_err());
    assert!(choose_distortion(&[record], INPUTS + 1, 9, NEVER).is_err());
    let fewer = DistortionRecord { powers: &[], ..record };
    assert!(choose_distortion(&[record, fewer], 1, 9, NEVER).is_err());
    let none = vec![f64::NAN; weights.len()];
    let lost = DistortionRecord { weights: &none, ..record };
    assert!(choose_distortion(&[lost], 1, 9, NEVER).is_err());
    assert!(Regressors::new([1, 0], &[1.0], vec![]).is_err());
    assert!(Regressors::new([1, 1], &[1.0; 3], vec![]).is_err());
    assert!(Regressors::new([1, 1], &[1.0; 2], vec![Regressor::Product(vec![1])]).is_err());
}
