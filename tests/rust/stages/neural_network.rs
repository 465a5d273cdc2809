//! The network as an inverse: against a direct transcription, finite, and with the memory of plays.
#![allow(missing_docs, clippy::unwrap_used, clippy::float_cmp)]

use piezotrack_control::Inverse;
use piezotrack_control::inverse::{NetworkNumbers, NeuralNetworkInverse};
use proptest::prelude::*;

const RISES: NetworkNumbers<'_> = NetworkNumbers {
    centre: 5e-6,
    scales: [5e-6, 1e-3, 1.0],
    thresholds: &[0.5],
    hidden: &[0.4, 0.3, -0.2, 0.1, -0.5, 0.2, 0.1, 0.7],
    biases: &[0.1, -0.2],
    outputs: &[2.0, -1.0],
    direct: &[3.0, 0.5, 0.25, 1.5],
    offset: 20.0,
};

#[test]
fn a_path_beside_its_equations() {
    let network = NeuralNetworkInverse::new(&RISES).unwrap();
    let mut state = network.rest();
    let mut play = -1.0_f64;
    for (x, v, a) in [(0.0, 0.0, 0.0), (8e-6, 2e-3, 0.5), (10e-6, 0.0, -3.0), (4e-6, -1e-3, 1.0)] {
        let i = [(x - 5e-6) / 5e-6, v / 1e-3, a];
        play = play.clamp(i[0] - 0.5, i[0] + 0.5);
        let one = (0.4 * i[0] + 0.3 * i[1] - 0.2 * i[2] + 0.1 * play + 0.1).tanh();
        let two = (-0.5 * i[0] + 0.2 * i[1] + 0.1 * i[2] + 0.7 * play - 0.2).tanh();
        let linear = 3.0 * i[0] + 0.5 * i[1] + 0.25 * i[2] + 1.5 * play;
        let expected = 20.0 + linear + 2.0 * one - two;
        assert!((network.step(&mut state, x, v, a) - expected).abs() < 1e-12);
    }
}

#[test]
fn where_an_input_is_no_number_nothing_is_remembered() {
    let network = NeuralNetworkInverse::new(&RISES).unwrap();
    let mut state = network.rest();
    network.step(&mut state, 8e-6, 0.0, 0.0);
    let before = state;
    for (x, v, a) in [(f64::NAN, 0.0, 0.0), (0.0, f64::INFINITY, 0.0), (0.0, 0.0, f64::NAN)] {
        assert!(network.step(&mut state, x, v, a).is_nan());
        assert_eq!(state, before);
    }
}

#[test]
fn numbers_that_do_not_belong_together_are_refused_by_name() {
    let name = |numbers: NetworkNumbers<'_>| NeuralNetworkInverse::new(&numbers).unwrap_err().name;
    assert_eq!(name(NetworkNumbers { thresholds: &[0.1; 9], ..RISES }), "thresholds");
    assert_eq!(name(NetworkNumbers { thresholds: &[-0.1], ..RISES }), "thresholds");
    assert_eq!(name(NetworkNumbers { biases: &[0.0; 17], ..RISES }), "biases");
    assert_eq!(name(NetworkNumbers { outputs: &[1.0], ..RISES }), "outputs");
    assert_eq!(name(NetworkNumbers { hidden: &[1.0; 7], ..RISES }), "hidden");
    assert_eq!(name(NetworkNumbers { direct: &[1.0; 3], ..RISES }), "direct");
    assert_eq!(name(NetworkNumbers { direct: &[f64::NAN; 4], ..RISES }), "direct");
    assert_eq!(name(NetworkNumbers { scales: [1.0, 0.0, 1.0], ..RISES }), "scales");
    assert_eq!(name(NetworkNumbers { centre: f64::NAN, ..RISES }), "centre");
    assert_eq!(name(NetworkNumbers { offset: f64::INFINITY, ..RISES }), "offset");
}

proptest! {
    #[test]
    fn finite_inputs_have_a_finite_drive(
        path in prop::collection::vec((-1e300..1e300_f64, -1e300..1e300_f64), 1..40),
        weight in -1e9..1e9_f64,
    ) {
        let hidden = [weight; 8];
        let network =
            NeuralNetworkInverse::new(&NetworkNumbers { hidden: &hidden, ..RISES }).unwrap();
        let mut state = network.rest();
        for (x, v) in path {
            prop_assert!(network.step(&mut state, x, v, -v).is_finite());
        }
    }
}
