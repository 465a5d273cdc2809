//! Modal terms of several axes that are fitted to responses.
#![allow(clippy::unwrap_used)]

use std::f64::consts::PI;

use piezotrack_core::identify::{Descent, ModalFit, ModalTerms};
use piezotrack_core::signal::NEVER;
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};

const LINES: u32 = 300;
const SIZES: [usize; 2] = [2, 3];

fn angles() -> Vec<f64> {
    (1..=LINES).map(|k| 0.9 * PI * f64::from(k) / f64::from(LINES)).collect()
}

/// Three modes of two drives and three sensors.
fn truth() -> ModalTerms {
    let poles = [(0.02, 0.4), (0.03, 1.1), (0.015, 1.9)].map(|(decay, angle): (f64, f64)| {
        let size = (-decay).exp();
        [size * angle.cos(), size * angle.sin()]
    });
    let inputs = [[1.0, 0.0], [0.3, 0.1], [-0.2, 0.4], [0.9, 0.0], [0.7, 0.0], [-0.6, -0.3]];
    let outputs = [
        [0.02, 0.1],
        [0.03, -0.08],
        [-0.01, 0.05],
        [0.05, 0.02],
        [-0.04, 0.06],
        [0.01, 0.03],
        [0.02, -0.04],
        [0.05, 0.01],
        [-0.03, 0.02],
    ];
    let direct = [0.1, -0.2, 0.05, 0.3, 0.0, 0.1];
    ModalTerms::new(SIZES, &poles, &inputs, &outputs, &direct).unwrap()
}

/// The response of terms, by its definition.
fn response(terms: &ModalTerms) -> Vec<[f64; 2]> {
    let [drives, sensors] = SIZES;
    let times = |a: [f64; 2], b: [f64; 2]| [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
    let mut found = Vec::new();
    for angle in angles() {
        for i in 0..sensors {
            for j in 0..drives {
                let mut sum = [terms.direct()[i * drives + j], 0.0];
                for (mode, [x, y]) in terms.poles().into_iter().enumerate() {
                    let residue = times(
                        terms.outputs()[mode * sensors + i],
                        terms.inputs()[mode * drives + j],
                    );
                    for sign in [1.0, -1.0] {
                        let (a, b) = (angle.cos() - x, angle.sin() - sign * y);
                        let size = a * a + b * b;
                        let part = times([residue[0], sign * residue[1]], [a / size, -b / size]);
                        sum = [sum[0] + part[0], sum[1] + part[1]];
                    }
                }
                found.push(sum);
            }
        }
    }
    found
}

fn noisy(deviation: f64, seed: u8) -> Vec<[f64; 2]> {
    let mut random = TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]);
    // Sums of twelve even numbers are normal enough.
    let mut draw = || {
        let sum: f64 = (0..12).map(|_| f64::from(random.next_u32()) / f64::from(u32::MAX)).sum();
        deviation * (sum - 6.0)
    };
    response(&truth()).into_iter().map(|[x, y]| [x + draw(), y + draw()]).collect()
}

fn weights() -> Vec<f64> {
    vec![1.0; angles().len()]
}

#[test]
fn a_response_without_noise_gives_its_modes_back() {
    let fit = ModalFit::new(SIZES, &angles(), &response(&truth()), &weights()).unwrap();
    assert!(fit.misfit(&truth()).unwrap() < 1e-24);
    let found = fit.pursue(1e-6, 3, true, NEVER).unwrap();
    for (own, old) in found.poles().iter().zip(truth().poles()) {
        for (own, old) in own.iter().zip(old) {
            assert!((own - old).abs() < 1e-6, "{own} {old}");
        }
    }
}

#[test]
fn modes_are_as_many_as_the_noise_lets_see() {
    let deviation = 0.05;
    let fit = ModalFit::new(SIZES, &angles(), &noisy(deviation, 1), &weights()).unwrap();
    let expected = 12.0 * deviation * deviation * f64::from(LINES);
    let found = fit.pursue(expected, 8, false, NEVER).unwrap();
    assert_eq!(found.poles().len(), 3);
    let left = fit.misfit(&found).unwrap() / expected;
    assert!((0.9..1.0).contains(&left), "{left}");
}

#[test]
fn poles_scatter_as_their_deviations_say() {
    let deviation = 0.05;
    let variance = vec![2.0 * deviation * deviation; 6 * angles().len()];
    let mut squares = Vec::new();
    for seed in 0..20 {
        let fit = ModalFit::new(SIZES, &angles(), &noisy(deviation, seed), &weights()).unwrap();
        let found = fit.refine(&truth(), Descent::last(0.0).unwrap(), NEVER).unwrap();
        let [_, turns] = fit.pole_deviations(&found, &variance).unwrap();
        for ((own, old), sd) in found.poles().iter().zip(truth().poles()).zip(turns) {
            squares.push(((own[1].atan2(own[0]) - old[1].atan2(old[0])) / sd).powi(2));
        }
    }
    let mean = squares.iter().sum::<f64>() / f64::from(u32::try_from(squares.len()).unwrap());
    assert!((0.6..1.5).contains(&mean), "{mean}");
}

#[test]
fn a_departure_that_costs_much_is_not_made() {
    let fit = ModalFit::new(SIZES, &angles(), &noisy(0.05, 3), &weights()).unwrap();
    let moved = |held: f64| {
        let found = fit.refine(&truth(), Descent::last(held).unwrap(), NEVER).unwrap();
        let pairs = found.poles().into_iter().zip(truth().poles());
        pairs.map(|(own, old)| (own[0] - old[0]).hypot(own[1] - old[1])).fold(0.0, f64::max)
    };
    assert!(moved(1e9) < 1e-3 * moved(0.0));
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    let (angles, value) = (angles(), response(&truth()));
    let refusal = |sizes, angles: &[f64], value: &[[f64; 2]], weights: &[f64]| {
        ModalFit::new(sizes, angles, value, weights).unwrap_err().to_string()
    };
    assert!(refusal(SIZES, &angles[..1], &value, &weights()).contains("two lines or more"));
    assert!(refusal(SIZES, &angles, &value[1..], &weights()).contains("value"));
    assert!(refusal(SIZES, &angles, &value, &weights()[1..]).contains("weights"));
    let falling: Vec<f64> = angles.iter().rev().copied().collect();
    assert!(refusal(SIZES, &falling, &value, &weights()).contains("rising"));
    assert!(refusal(SIZES, &angles, &value, &vec![-1.0; angles.len()]).contains("weights"));
    let fit = ModalFit::new(SIZES, &angles, &value, &weights()).unwrap();
    assert!(fit.pursue(0.0, 3, true, NEVER).is_err());
    assert!(fit.pursue(1.0, 0, true, NEVER).is_err());
    assert!(fit.pole_deviations(&truth(), &[1.0]).is_err());
    assert!(Descent::last(-1.0).is_err());
    let constant = vec![[1.0, 0.0]; value.len()];
    let fit = ModalFit::new(SIZES, &angles, &constant, &weights()).unwrap();
    assert!(fit.pursue(1.0, 3, true, NEVER).unwrap_err().to_string().contains("show no mode"));
    let other = ModalTerms::new([1, 1], &[[0.5, 0.0]], &[[1.0, 0.0]], &[[1.0, 0.0]], &[0.0]);
    assert!(fit.misfit(&other.unwrap()).is_err());
}

#[test]
fn a_search_that_is_stopped_ends_with_what_it_has() {
    let fit = ModalFit::new(SIZES, &angles(), &response(&truth()), &weights()).unwrap();
    assert!(fit.pursue(1e-6, 3, true, &|| true).unwrap().poles().is_empty());
}
