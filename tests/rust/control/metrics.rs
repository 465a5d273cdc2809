//! Metrics of tracking on signals whose figures are known on paper.
#![allow(missing_docs, clippy::unwrap_used, clippy::cast_precision_loss)]

use core::f64::consts::{PI, TAU};

use piezotrack_core::signal::metrics::{
    each_period, fundamental, phase_lag, residual, tracking, widest_loop,
};

const DT: f64 = 0.02;

fn wave(samples: usize, frequency: f64, amplitude: f64, lag: f64) -> Vec<f64> {
    (0..samples).map(|k| 55.0 + amplitude * (TAU * frequency * DT * k as f64 - lag).cos()).collect()
}

#[test]
fn figures_of_a_constant_and_of_a_sine() {
    let desired = wave(1000, 0.2, 55.0, PI);
    let actual: Vec<f64> = desired.iter().map(|d| d - 2.0).collect();
    let all = tracking(&desired, &actual, DT, None).unwrap();
    assert!((all.max_error - 2.0).abs() < 1e-9 && (all.rms_error - 2.0).abs() < 1e-9);
    assert!((all.mean_error - 2.0).abs() < 1e-9 && all.error_sd < 1e-9);
    assert!(all.error_peak_to_peak < 1e-9 && all.phase_lag.is_none());

    // A quarter of a period apart, the error is a sine of root two times the amplitude.
    let actual: Vec<f64> = wave(1000, 0.2, 55.0, PI + 0.5 * PI).iter().map(|a| a + 1.0).collect();
    let all = tracking(&desired, &actual, DT, Some(0.2)).unwrap();
    let peak = 55.0 * 2.0_f64.sqrt();
    assert!((all.mean_error + 1.0).abs() < 1e-9);
    assert!((all.error_sd - peak / 2.0_f64.sqrt()).abs() < 1e-9);
    assert!((all.rms_error.powi(2) - all.error_sd.powi(2) - 1.0).abs() < 1e-9);
    assert!((all.error_peak_to_peak - 2.0 * peak).abs() < 0.1);
    assert!((all.max_error - peak - 1.0).abs() < 0.1);
    assert!((all.phase_lag.unwrap() - 0.5 * PI).abs() < 1e-12);
}

#[test]
fn phase_lag_is_found_beside_an_offset_and_at_odd_lengths() {
    // 937 samples are 3.7 periods: least squares needs no whole number of them.
    for lag in [0.063, -0.4, 2.0, 3.0, -3.0] {
        let desired = wave(937, 0.2, 55.0, 1.0);
        let actual = wave(937, 0.2, 41.0, 1.0 + lag);
        assert!((phase_lag(&desired, &actual, DT, 0.2).unwrap() - lag).abs() < 1e-12);
    }
    let fit = fundamental(&wave(937, 0.2, 55.0, 1.0), DT, 0.2).unwrap();
    assert!((fit.mean - 55.0).abs() < 1e-9 && (fit.amplitude - 55.0).abs() < 1e-9);
    assert!((fit.phase + 1.0).abs() < 1e-12);
}

#[test]
fn the_loop_of_an_ellipse_is_as_wide_as_the_sine_of_its_lag() {
    // Rising and falling at one desired place differ by 2 A sin(angle) sin(lag), A each way.
    for lag in [0.063, 0.3] {
        let desired = wave(2000, 0.2, 55.0, 0.3);
        let actual = wave(2000, 0.2, 55.0, 0.3 + lag);
        let width = widest_loop(&desired, &actual).unwrap().unwrap();
        assert!((width - f64::sin(lag)).abs() < 2e-4, "{width}");
    }
}

#[test]
fn the_loop_of_straight_branches_is_exact() {
    // A triangle whose falling branch lies 3 above the rising one, but at the turning points.
    let desired = [0.0, 10.0, 20.0, 30.0, 25.0, 15.0, 5.0, 0.0];
    let actual = [0.0, 10.0, 20.0, 30.0, 28.0, 18.0, 8.0, 0.0];
    let width = widest_loop(&desired, &actual).unwrap().unwrap();
    assert!((width - 3.0 / 30.0).abs() < 1e-15);
    assert_eq!(widest_loop(&desired[..4], &actual[..4]).unwrap(), None);
    // Standing still is no turn, and the settled value counts.
    let width = widest_loop(&[0.0, 1.0, 1.0, 2.0, 1.0], &[0.0, 0.2, 1.0, 2.0, 1.5]).unwrap();
    assert!((width.unwrap() - 0.25).abs() < 1e-15);
    assert_eq!(widest_loop(&[1.0; 5], &[0.0; 5]).unwrap(), None);
}

#[test]
fn periods_show_learning() {
    // The error halves from period to period; 1/0.3 s are 166.67 samples.
    let frequency = 0.3;
    let desired = wave(835, frequency, 55.0, 0.0);
    let error = |k: usize| 0.5_f64.powf((frequency * DT * k as f64).floor());
    let actual: Vec<f64> = desired.iter().enumerate().map(|(k, d)| d - error(k)).collect();
    let periods = each_period(&desired, &actual, DT, 1.0 / frequency).unwrap();
    assert_eq!(periods.len(), 5);
    for (period, expected) in periods.iter().zip([1.0, 0.5, 0.25, 0.125, 0.0625]) {
        // The first sample of a period may belong to the one before.
        assert!((period.mean_error / expected - 1.0).abs() < 0.01);
    }
}

#[test]
fn any_period_from_four_samples_on_can_be_scored() {
    for tenths in 40..80 {
        let period = 0.1 * f64::from(tenths) * DT;
        let desired = wave(500, 1.0 / period, 1.0, 0.0);
        let actual = wave(500, 1.0 / period, 1.0, 0.2);
        for scored in each_period(&desired, &actual, DT, period).unwrap() {
            assert!((scored.phase_lag.unwrap() - 0.2).abs() < 1e-9);
        }
    }
}

#[test]
fn bad_records_are_refused() {
    let good = wave(500, 0.2, 1.0, 0.0);
    let message = |run: piezotrack_core::Result<()>| run.unwrap_err().to_string();
    let tracked = |a: &[f64], b: &[f64]| message(tracking(a, b, DT, None).map(|_| ()));
    assert!(tracked(&good, &good[1..]).contains("499 samples: expected 500"));
    assert!(tracked(&[], &[]).contains("0 samples"));
    assert!(tracked(&[1.0, f64::NAN], &[1.0, 2.0]).contains("desired is NaN at sample 1"));
    let lag = |frequency| message(phase_lag(&good, &good, DT, frequency).map(|_| ()));
    assert!(lag(25.0).contains("below half the sampling rate"));
    assert!(lag(0.01).contains("less than a period"));
    assert!(lag(f64::NAN).contains("frequency is NaN Hz"));
    let nothing = message(phase_lag(&[1.0; 500], &good, DT, 0.2).map(|_| ()));
    assert!(nothing.contains("nothing at 0.2 Hz"));
    // Figures of a run that has no such line are figures all the same.
    let standing = tracking(&[1.0; 500], &good, DT, Some(0.2)).unwrap();
    assert_eq!(standing.phase_lag, None);
    let periods = |period| message(each_period(&good, &good, DT, period).map(|_| ()));
    assert!(periods(11.0).contains("less than a period"));
    assert!(periods(0.03).contains("4 samples or more"));
}

#[test]
fn information_criteria_prefer_what_pays_for_its_parameters() {
    // A sine of amplitude a has the mean square a^2/2 and, at w dt apart, the correlation cos(w
    // dt).
    let errors: Vec<f64> = (0..1000).map(|k| (TAU * f64::from(k) / 50.0).sin()).collect();
    let seven = residual(&errors, 7).unwrap();
    assert!((seven.rms - 0.5_f64.sqrt()).abs() < 1e-12 && (seven.max - 1.0).abs() < 2e-3);
    assert!((seven.autocorrelation - (TAU / 50.0).cos()).abs() < 1e-3);
    assert!((seven.aic - (1000.0 * 0.5_f64.ln() + 16.0)).abs() < 1e-9);
    assert!((seven.bic - (1000.0 * 0.5_f64.ln() + 8.0 * 1000.0_f64.ln())).abs() < 1e-9);
    // A factor in the errors is a constant in both, so the unit does not matter.
    let scaled: Vec<f64> = errors.iter().map(|e| 1e-6 * e).collect();
    let shift = residual(&scaled, 7).unwrap().aic - seven.aic;
    assert!(
        (residual(&scaled, 15).unwrap().aic - residual(&errors, 15).unwrap().aic - shift).abs()
            < 1e-6
    );
    // An exact fit is infinitely good; nothing to fit is an error.
    assert!(residual(&[0.0; 10], 1).unwrap().aic < -1e300);
    assert!(residual(&[], 1).is_err() && residual(&[f64::NAN], 1).is_err());
}
