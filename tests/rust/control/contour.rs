//! Distances from paths that are known on paper.
#![allow(missing_docs, clippy::unwrap_used, clippy::float_cmp, clippy::cast_precision_loss)]

use core::f64::consts::TAU;

use piezotrack_core::signal::contour_error::{Polyline, radial_errors};

fn circle(points: u32, radius: f64) -> (Vec<f64>, Vec<f64>) {
    let angle = |k: u32| TAU * f64::from(k) / f64::from(points);
    (0..=points).map(|k| (radius * angle(k).cos(), radius * angle(k).sin())).unzip()
}

#[test]
fn on_a_fine_circle_the_signed_distance_is_the_radial_error() {
    let (x, y) = circle(20_000, 3.0);
    let path = Polyline::new(&x, &y).unwrap();
    let (mut px, mut py) = (Vec::new(), Vec::new());
    for k in 0..500 {
        // Inside and outside, all around, and in no order.
        let (angle, radius) = (2.3 * f64::from(k), 2.0 + 0.004 * f64::from(k));
        px.push(radius * angle.cos());
        py.push(radius * angle.sin());
    }
    let found = path.signed_distances(&px, &py).unwrap();
    let expected = radial_errors(&px, &py, [0.0, 0.0], 3.0).unwrap();
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found - expected).abs() < 1e-7, "{found} {expected}");
    }
    // The other way round, the other side is left.
    let (x, y): (Vec<_>, Vec<_>) = (x.into_iter().rev().collect(), y.into_iter().rev().collect());
    let turned = Polyline::new(&x, &y).unwrap().signed_distances(&px, &py).unwrap();
    assert!(turned.iter().zip(&found).all(|(a, b)| (a + b).abs() < 1e-12));
}

#[test]
fn it_is_what_a_search_through_all_segments_finds() {
    // A tangle that crosses itself, with points that repeat.
    let mut x: Vec<f64> =
        (0..700).map(|k| (0.11 * f64::from(k)).sin() + 0.3 * (0.7 * f64::from(k)).cos()).collect();
    let mut y: Vec<f64> =
        (0..700).map(|k| (0.13 * f64::from(k)).cos() + 0.2 * (0.5 * f64::from(k)).sin()).collect();
    for k in (5..700).step_by(50) {
        (x[k], y[k]) = (x[k - 1], y[k - 1]);
    }
    let (px, py): (Vec<f64>, Vec<f64>) = (0..400)
        .map(|k| (1.5 * (1.7 * f64::from(k)).sin(), 1.5 * (2.9 * f64::from(k)).cos()))
        .unzip();
    let all = |p: f64, q: f64| {
        (1..x.len())
            .map(|k| {
                let (ux, uy) = (x[k] - x[k - 1], y[k] - y[k - 1]);
                let length = ux * ux + uy * uy;
                let along = (p - x[k - 1]) * ux + (q - y[k - 1]) * uy;
                let part = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
                (p - x[k - 1] - part * ux).hypot(q - y[k - 1] - part * uy)
            })
            .fold(f64::INFINITY, f64::min)
    };
    // Every length of path, so every shape of the tree.
    for points in [2, 3, 9, 10, 17, 64, 65, 700] {
        let path = Polyline::new(&x[..points], &y[..points]).unwrap();
        let found = path.signed_distances(&px, &py).unwrap();
        if points == 700 {
            for k in 0..px.len() {
                assert!((found[k].abs() - all(px[k], py[k])).abs() < 1e-12, "{k}");
            }
        }
        assert!(found.iter().all(|distance| distance.is_finite()));
    }
}

#[test]
fn at_a_corner_the_side_is_that_of_both_its_edges() {
    // An arrow to the right: beyond its tip, the nearest place is the tip itself.
    let path = Polyline::new(&[0.0, 1.0, 0.0], &[0.0, 1.0, 2.0]).unwrap();
    let found = path.signed_distances(&[0.0, 2.0, 1.5], &[1.0, 1.0, 1.1]).unwrap();
    assert!(found[0] > 0.0 && found[1] < 0.0 && found[2] < 0.0);
    assert!((found[0] - 0.5_f64.sqrt()).abs() < 1e-12);
    assert!((found[1] + 1.0).abs() < 1e-12);
}

#[test]
fn an_ellipse_has_the_radial_errors_of_its_axes() {
    let (x, y) = circle(4000, 1.0);
    let x: Vec<f64> = x.iter().map(|x| 1.1 * x).collect();
    let errors = radial_errors(&x, &y, [0.0, 0.0], 1.0).unwrap();
    let highest = errors.iter().fold(f64::NEG_INFINITY, |most, &e| most.max(e));
    let lowest = errors.iter().fold(f64::INFINITY, |least, &e| least.min(e));
    assert!(highest.abs() < 1e-12 && (lowest + 0.1).abs() < 1e-12);
}

#[test]
fn what_cannot_be_used_is_refused() {
    let told = |x: &[f64], y: &[f64]| Polyline::new(x, y).unwrap_err().to_string();
    assert!(told(&[0.0], &[0.0]).contains("2 at least"));
    assert!(
        told(&[0.0, 1.0], &[0.0]).contains("as many")
            || told(&[0.0, 1.0], &[0.0]).contains("1 samples")
    );
    assert!(told(&[0.0, f64::NAN], &[0.0, 1.0]).contains("x of the path is NaN at sample 1"));
    assert!(
        radial_errors(&[1.0], &[1.0], [0.0, 0.0], 0.0).unwrap_err().to_string().contains("radius")
    );
}
