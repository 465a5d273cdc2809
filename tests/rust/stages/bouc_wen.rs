//! The Bouc-Wen operator with other exponents than 1 against closed forms.

use piezotrack_control::hysteresis::{BoucWen, BoucWenState, Operator};

/// Outputs along a path, counted positive in its direction.
fn along(of: &BoucWen<f64>, from: f64, length: f64) -> f64 {
    let state = BoucWenState { value: from, slope: 0.0 };
    of.along(&of.branch(&state, 1.0), length).value
}

/// The exponent 2: hyperbolic functions towards the limit, a tangent on the other side of 0.
#[test]
fn a_quadratic_branch_is_a_hyperbolic_tangent() {
    let (rise, beta, gamma) = (2.0_f64, 0.9, -0.3);
    let of = BoucWen { rise, beta, gamma, exponent: 2.0 };
    let limit = |kappa: f64| (rise / kappa).sqrt();
    let (above, below) = (limit(beta + gamma), limit(beta - gamma));
    for start in [-2.5, -0.9, -0.3, -1e-3, 0.0, 1e-9, 0.2, 0.7, 0.999, 1.3, 8.0] {
        let from = start * if start < 0.0 { below } else { above };
        for length in [1e-6, 0.01, 0.3, 1.7, 40.0] {
            // To 0 with the tangent, and from there on with what is left.
            let to_zero = if from < 0.0 { -(from / below).atan() * below / rise } else { 0.0 };
            let expected = if length < to_zero {
                below * ((from / below).atan() + length * rise / below).tan()
            } else {
                let path = (length - to_zero) * rise / above;
                let share = from.max(0.0) / above;
                let tanh = path.tanh();
                above * (share + tanh) / (1.0 + share * tanh)
            };
            let found = along(&of, from, length);
            let change = (expected - from).abs().max(1e-300);
            assert!(
                (found - expected).abs() < 1e-9 * change + 1e-15 * from.abs().max(1.0),
                "{start} {length} {found} {expected}"
            );
        }
    }
}

/// Two pieces of a path are one, and an exponent that is hardly above 1 is that of 1.
#[test]
fn a_path_may_be_cut_anywhere() {
    for exponent in [1.02, 1.3, 1.6, 3.0, 6.0, 20.0] {
        let of = BoucWen { rise: 1.0, beta: 0.7, gamma: 0.3, exponent };
        for from in [-2.0, -0.8, -0.1, 0.0, 0.1, 0.6, 1.5] {
            let whole = along(&of, from, 0.7);
            let mut parts = from;
            for _ in 0..700 {
                parts = along(&of, parts, 1e-3);
            }
            assert!((whole - parts).abs() < 3e-10, "{exponent} {from} {whole} {parts}");
        }
    }
    for from in [-0.8, -0.1, 0.0, 0.1, 0.6, 1.5] {
        let of = |exponent| BoucWen { rise: 1.0, beta: 0.7, gamma: 0.3, exponent };
        let (one, near) = (along(&of(1.0), from, 0.9), along(&of(1.0 + 1e-9), from, 0.9));
        assert!((one - near).abs() < 5e-9, "{from} {one} {near}");
    }
}
