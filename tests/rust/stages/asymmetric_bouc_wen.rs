//! The asymmetric Bouc-Wen operator: its equation, its symmetric limit, its bounds and its inverse.
#![allow(missing_docs, clippy::unwrap_used, clippy::float_cmp)]

use piezotrack_control::AsymmetricBoucWenInverse;
use piezotrack_control::hysteresis::{AsymmetricBoucWen, BoucWen, BoucWenState, Operator};

const HYSTERESIS: AsymmetricBoucWen<f64> = AsymmetricBoucWen {
    rise: 0.6,
    beta: 0.05,
    gamma: 0.02,
    asymmetry: 0.012,
    sign_asymmetry: -0.015,
};

fn to<O: Operator<f64, State = BoucWenState<f64>>>(
    operator: &O,
    state: &BoucWenState<f64>,
    way: f64,
) -> BoucWenState<f64> {
    operator.along(&operator.branch(state, way.signum()), way)
}

/// A path that turns at places which do not repeat, as moves.
fn moves() -> impl Iterator<Item = f64> {
    (0..60).map(|k| {
        let k = f64::from(k);
        30.0 * libm::sin(0.7 * k) + 18.0 * libm::sin(1.9 * k) + 4.0
    })
}

/// dh/du from the shape function as it is written.
fn slope(of: &AsymmetricBoucWen<f64>, h: f64, direction: f64) -> f64 {
    let sign = |value: f64| if value == 0.0 { 0.0 } else { value.signum() };
    let psi = of.beta * sign(direction * h)
        + of.gamma
        + of.asymmetry * sign(h)
        + of.sign_asymmetry * sign(direction);
    of.rise - h.abs() * psi
}

#[test]
fn it_follows_the_equation_as_written() {
    let mut state = HYSTERESIS.rest();
    let mut h = 0.0;
    for way in moves().filter(|way| way.abs() > 1e-9) {
        state = to(&HYSTERESIS, &state, way);
        let (steps, direction) = (20_000, way.signum());
        let step = way / f64::from(steps);
        for _ in 0..steps {
            let first = slope(&HYSTERESIS, h, direction);
            let second = slope(&HYSTERESIS, h + 0.5 * step * first, direction);
            h += step * second;
        }
        // A step across h = 0 is of first order.
        assert!((state.value - h).abs() < 1e-6, "{} {h}", state.value);
        assert!((state.slope - slope(&HYSTERESIS, state.value, direction)).abs() < 1e-12);
    }
}

#[test]
fn without_asymmetries_it_is_the_symmetric_operator_to_the_last_bit() {
    let none = AsymmetricBoucWen { asymmetry: 0.0, sign_asymmetry: 0.0, ..HYSTERESIS };
    let AsymmetricBoucWen { rise, beta, gamma, .. } = none;
    let plain = BoucWen { rise, beta, gamma, exponent: 1.0 };
    let (mut one, mut other) = (none.rest(), plain.rest());
    for way in moves() {
        (one, other) = (to(&none, &one, way), to(&plain, &other, way));
        assert_eq!(one, other);
    }
}

#[test]
fn pieces_of_a_way_do_not_matter() {
    let (mut once, mut often) = (HYSTERESIS.rest(), HYSTERESIS.rest());
    for way in moves() {
        once = to(&HYSTERESIS, &once, way);
        for _ in 0..7 {
            often = to(&HYSTERESIS, &often, way / 7.0);
        }
        assert!((once.value - often.value).abs() < 1e-12);
    }
}

/// A mirrored path through the operator with opposite asymmetries is the mirrored output.
#[test]
fn the_asymmetries_change_sign_in_the_mirror() {
    let AsymmetricBoucWen { asymmetry, sign_asymmetry, .. } = HYSTERESIS;
    let mirrored =
        AsymmetricBoucWen { asymmetry: -asymmetry, sign_asymmetry: -sign_asymmetry, ..HYSTERESIS };
    let (mut one, mut other) = (HYSTERESIS.rest(), mirrored.rest());
    for way in moves() {
        (one, other) = (to(&HYSTERESIS, &one, way), to(&mirrored, &other, -way));
        assert_eq!(one.value, -other.value);
    }
}

#[test]
fn it_saturates_at_the_rates_of_the_two_ways_from_zero() {
    let AsymmetricBoucWen { rise, beta, gamma, .. } = HYSTERESIS;
    let uneven = HYSTERESIS.asymmetry + HYSTERESIS.sign_asymmetry;
    let up = to(&HYSTERESIS, &HYSTERESIS.rest(), 1000.0).value;
    let down = to(&HYSTERESIS, &HYSTERESIS.rest(), -1000.0).value;
    assert!((up - rise / (beta + gamma + uneven)).abs() < 1e-12);
    assert!((down + rise / (beta + gamma - uneven)).abs() < 1e-12);
}

#[test]
fn the_inverse_takes_the_output_back_to_the_input() {
    let (gain, alpha) = (2e-6, 0.3);
    let of = AsymmetricBoucWen { rise: alpha * gain, ..HYSTERESIS };
    let rates = [of.beta, of.gamma, of.asymmetry, of.sign_asymmetry];
    let quick = [0.0, 0.0, 1.0, gain];
    let inverse = AsymmetricBoucWenInverse::asymmetric(quick, alpha, rates).unwrap();
    let (mut state, mut back, mut u) = (of.rest(), inverse.rest(), 0.0);
    for way in moves() {
        u += way;
        state = to(&of, &state, way);
        let found = inverse.step(&mut back, gain * u - state.value, 0.0, 0.0);
        assert!((found - u).abs() < 1e-9, "{found} {u}");
    }
}

#[test]
fn an_inverse_that_is_not_unique_is_refused_by_name() {
    let quick = [0.0, 0.0, 1.0, 2e-6];
    let refused = |alpha: f64, rates: [f64; 4]| {
        AsymmetricBoucWenInverse::asymmetric(quick, alpha, rates).unwrap_err().name
    };
    assert_eq!(refused(0.3, [0.05, 0.02, 0.0, 0.06]), "sign_asymmetry");
    assert_eq!(refused(0.3, [0.05, 0.02, 0.08, 0.0]), "sign_asymmetry");
    assert_eq!(refused(0.95, [0.05, 0.02, 0.01, 0.0]), "alpha");
    assert_eq!(refused(0.3, [0.05, f64::NAN, 0.01, 0.0]), "gamma");
}
