//! The exact step of the linear part and the operator's flow against the matrix exponential.
#![allow(missing_docs, clippy::unwrap_used)]

use nalgebra::{Matrix3, Matrix6};
use piezotrack_control::hysteresis::{Dahl, DahlState, Operator};
use piezotrack_core::integrator::{Mechanics, Propagator, halvings};

fn exponential(m: &Mechanics, h: f64) -> Matrix6<f64> {
    // [x, w = h v] under the force f0 + f1 s + c2 s^2 + c3 s^3 as the states of a longer system in
    // s.
    let mut a = Matrix6::zeros();
    a[(0, 1)] = 1.0;
    a[(1, 0)] = -h * h * m.stiffness / m.mass;
    a[(1, 1)] = -h * m.damping / m.mass;
    a[(1, 2)] = h * h / m.mass;
    a[(2, 3)] = 1.0;
    a[(3, 4)] = 2.0;
    a[(4, 5)] = 3.0;
    a.exp()
}

fn close(found: f64, expected: f64, scale: f64) {
    assert!((found - expected).abs() <= 1e-12 * scale, "{found} {expected}");
}

#[test]
fn propagator_is_the_matrix_exponential() {
    for (mass, damping, stiffness) in
        [(0.1828, 2597.3, 26065.0), (0.1, 5000.0, 1e4), (0.2, 1000.0, 5e4), (0.1828, 1.2, 1.85e5)]
    {
        let m = Mechanics::new(mass, damping, stiffness).unwrap();
        for h in [2e-5, 2e-4, 1e-3, 2e-2] {
            let (inverse, d, k) = (1.0 / mass, damping / mass, stiffness / mass);
            let p = Propagator::new(inverse, d, k, h, halvings(m.rate(), h));
            let e = exponential(&m, h);
            // Displacement by force is measured against 1/K, velocity against displacement/h.
            let gain = (1.0 / stiffness).max(h * h / mass);
            close(p.position.x, e[(0, 0)], 1.0);
            close(p.position.w, e[(1, 0)], 1.0 + h * h * k);
            close(p.velocity.x, e[(0, 1)], 1.0);
            close(p.velocity.w, e[(1, 1)], 1.0);
            close(p.constant.x, e[(0, 2)], gain);
            close(p.constant.w, e[(1, 2)], gain * (1.0 + h * d));
            close(p.ramp.x, e[(0, 3)], gain);
            close(p.excess.x, 3.0 * e[(0, 4)] - 2.0 * e[(0, 5)], gain);
            close(p.bend.x, e[(0, 5)] - e[(0, 4)], gain);
            close(p.bend.w, e[(1, 5)] - e[(1, 4)], gain * (1.0 + h * d));
        }
    }
}

#[test]
fn static_gain_is_one_over_stiffness() {
    let m = Mechanics::new(0.1828, 2597.3, 26065.0).unwrap();
    let p = Propagator::new(
        1.0 / m.mass,
        m.damping / m.mass,
        m.stiffness / m.mass,
        0.02,
        halvings(m.rate(), 0.02),
    );
    // A constant force at its own rest: x = f/K, w = 0 comes back to itself.
    let x = 1.0 / m.stiffness;
    close(p.position.x * x + p.constant.x, x, x);
    close(p.position.w * x + p.constant.w, 0.0, x);
}

#[test]
fn dahl_flow_is_the_matrix_exponential() {
    let dahl: Dahl<f64> = Dahl { a1: 121.9874, a2: 1.1773e6, gain: 1.8485e6 * 30.0 };
    for start in [(0.0, 0.0), (0.3, 4e3), (0.3, -4e3)] {
        for distance in [1e-8, 1e-6, 1e-5, -1e-6, -1e-5] {
            let state = DahlState { force: start.0, slope: start.1 };
            let sign = f64::signum(distance);
            let end = dahl.along(&dahl.branch(&state, sign), distance);
            // d/dx [force, slope, 1]
            let a =
                Matrix3::new(0.0, 1.0, 0.0, -dahl.a2, -sign * dahl.a1, dahl.gain, 0.0, 0.0, 0.0)
                    * distance;
            let e = a.exp();
            let force = e[(0, 0)] * start.0 + e[(0, 1)] * start.1 + e[(0, 2)];
            let slope = e[(1, 0)] * start.0 + e[(1, 1)] * start.1 + e[(1, 2)];
            assert!((end.force - force).abs() < 1e-13 * (1.0 + force.abs()), "{distance}");
            assert!((end.slope - slope).abs() < 1e-12 * (1.0 + slope.abs()), "{distance}");
        }
    }
}

#[test]
fn dahl_steps_compose() {
    // Two moves in one direction are one: the operator knows the path, not the steps.
    let dahl: Dahl<f64> = Dahl { a1: 121.9874, a2: 1.1773e6, gain: 1.8485e6 * 30.0 };
    let rest = dahl.rest();
    let whole = dahl.along(&dahl.branch(&rest, 1.0), 2e-6);
    let half = dahl.along(&dahl.branch(&rest, 1.0), 1e-6);
    let twice = dahl.along(&dahl.branch(&half, 1.0), 1e-6);
    assert!((whole.force - twice.force).abs() < 1e-15 * (1.0 + whole.force.abs()));
}
