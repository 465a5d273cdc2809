//! Delays, turning points, error measures and drives beside their definitions.

use core::f64::consts::{PI, TAU};

use piezotrack_core::models::{DahlStage, Experiment, StageModel};
use piezotrack_core::signal::metrics::{fundamental, tracking};
use piezotrack_core::signal::{Drive, Hold, NEVER, delayed, turns};
use proptest::prelude::*;

use crate::{any_number, around, cases, decades};

fn signal(longest: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(around(1.0), 1..longest)
}

/// The cubic through values and slopes, by Hermite's four polynomials.
fn hermite([x0, v0]: [f64; 2], [x1, v1]: [f64; 2], dt: f64, s: f64) -> f64 {
    let (s2, s3) = (s * s, s * s * s);
    (2.0 * s3 - 3.0 * s2 + 1.0) * x0
        + (s3 - 2.0 * s2 + s) * dt * v0
        + (3.0 * s2 - 2.0 * s3) * x1
        + (s3 - s2) * dt * v1
}

proptest! {
    #![proptest_config(cases(1))]

    #[test]
    fn a_delay_reads_the_motion_earlier(
        motion in prop::collection::vec((around(1.0), around(1.0)), 1..40),
        (whole, part) in (0..50_u32, 0.0..1.0_f64),
        dt in decades(0.01, 3.0),
    ) {
        let (x, v): (Vec<f64>, Vec<f64>) = motion.into_iter().unzip();
        let samples = f64::from(whole) + part;
        let late = delayed(&x, &v, dt, samples * dt).unwrap();
        prop_assert_eq!(late.len(), x.len());
        // Before the first sample the stage is where it starts.
        let at = |k: i64| usize::try_from(k).map_or([x[0], 0.0], |k| [x[k], v[k]]);
        for (k, late) in (0..).zip(&late) {
            let from = k - i64::from(whole) - 1;
            let expected = hermite(at(from), at(from + 1), dt, 1.0 - part);
            let scale = 1.0 + dt;
            prop_assert!((late - expected).abs() < 1e-9 * scale, "{late} {expected} at {k}");
        }
    }

    #[test]
    fn turns_alternate_and_are_as_large_as_asked(signal in signal(60), least in 0.0..1.0_f64) {
        let found = turns(&signal, least);
        prop_assert!(found.windows(2).all(|pair| pair[0] < pair[1]));
        let values: Vec<f64> = found.iter().map(|&k| signal[k]).collect();
        for pair in values.windows(2) {
            prop_assert!((pair[1] - pair[0]).abs() > least, "{values:?}");
        }
        for three in values.windows(3) {
            prop_assert!((three[1] - three[0]) * (three[2] - three[1]) < 0.0, "{values:?}");
        }
    }

    #[test]
    fn figures_of_an_error_agree_with_each_other(
        pairs in prop::collection::vec((around(1.0), around(1.0)), 1..60),
    ) {
        let (desired, actual): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
        let found = tracking(&desired, &actual, 0.02, None).unwrap();
        let square = found.mean_error.powi(2) + found.error_sd.powi(2);
        prop_assert!((found.rms_error.powi(2) - square).abs() < 1e-12);
        prop_assert!(found.rms_error <= found.max_error * (1.0 + 1e-12));
        prop_assert!(found.error_peak_to_peak <= 2.0 * found.max_error * (1.0 + 1e-12));
        prop_assert!(found.widest_loop.is_none_or(|share| share >= 0.0 && share.is_finite()));
        let itself = tracking(&desired, &desired, 0.02, None).unwrap();
        prop_assert_eq!((itself.max_error, itself.rms_error), (0.0, 0.0));
        prop_assert!(itself.widest_loop.is_none_or(|share| share < 1e-12));
    }

    #[test]
    fn the_fundamental_of_a_sine_is_the_sine(
        (amplitude, mean, phase) in (0.01..10.0_f64, around(10.0), -PI..PI),
        (turns_a_sample, periods) in (0.01..0.45_f64, 1.0..5.0_f64),
    ) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small")]
        let samples = (periods / turns_a_sample).ceil() as u32;
        let samples = samples.max(4);
        let wave = |k| mean + amplitude * (TAU * turns_a_sample * f64::from(k) + phase).cos();
        let signal: Vec<f64> = (0..samples).map(wave).collect();
        let found = fundamental(&signal, 0.01, turns_a_sample / 0.01).unwrap();
        prop_assert!((found.amplitude - amplitude).abs() < 1e-6 * amplitude, "{found:?}");
        prop_assert!((found.mean - mean).abs() < 1e-6 * (1.0 + mean.abs()), "{found:?}");
        let turn = (found.phase - phase).rem_euclid(TAU);
        prop_assert!(turn.min(TAU - turn) < 1e-6, "{found:?}");
    }

    #[test]
    fn any_drive_is_refused_or_followed_to_finite_displacements(
        u in prop::collection::vec(prop_oneof![around(100.0), any_number()], 0..12),
        dt in prop_oneof![decades(1e-3, 2.0), any_number()],
        first in any::<bool>(),
    ) {
        let hold = if first { Hold::First } else { Hold::Zero };
        let Ok(drive) = Drive::new(&u, dt, hold) else {
            prop_assert!(u.is_empty() || !(1e-12..=1e9).contains(&dt));
            return Ok(());
        };
        // A drive of 1e300 V, or a second from sample to sample, takes its steps.
        let tame = dt < 1.0 && u.iter().all(|u| !u.is_finite() || u.abs() < 1e4);
        if !tame {
            return Ok(());
        }
        if let Ok(Some(run)) = DahlStage::xu_li_2010().simulate(&Experiment::of(&drive, NEVER)) {
            prop_assert!(run.x.iter().all(|x| x.is_finite()));
        }
    }
}
