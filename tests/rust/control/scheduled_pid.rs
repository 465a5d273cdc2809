//! Scheduled PID gains: which gains a sine gets, what lies between them, and no bump at a change.
#![allow(missing_docs, clippy::unwrap_used)]

use core::f64::consts::TAU;

use piezotrack_control::{Feedback, FeedbackSample, Pid, ScheduledPid};

const DT: f64 = 1e-3;
const AMPLITUDES: [f64; 2] = [5e-6, 20e-6];
const RATES: [f64; 2] = [1.0, 4.0];

/// Gains that tell the four places of the grid apart, V/m.
fn gains() -> [Pid; 4] {
    [0.1e6, 0.2e6, 0.4e6, 0.8e6].map(|kp| Pid::new(kp, 0.02, 0.0, None).unwrap())
}

fn schedule(first: (f64, f64)) -> ScheduledPid {
    ScheduledPid::new(&AMPLITUDES, &RATES, &gains(), first, DT).unwrap()
}

/// What the law does with a change of the error by `probe` (m) after `turns` turning points and an
/// eighth of a period more of a sine: its proportional and integral weight, V/m.
fn found(law: &ScheduledPid, (amplitude, rate): (f64, f64), turns: f64) -> f64 {
    let mut state = law.rest();
    let end = (turns / 2.0 + 0.125) / rate;
    let mut t = 0.0;
    let at = |t: f64| amplitude * (TAU * rate * t).sin();
    while t < end {
        let sample = FeedbackSample { reference: at(t), ..FeedbackSample::new(0.0) };
        law.step(&mut state, &sample);
        t += DT;
    }
    let probe = 1e-9;
    let mut other = state;
    let quiet = FeedbackSample { reference: at(t), ..FeedbackSample::new(0.0) };
    let loud = FeedbackSample { error: probe, ..quiet };
    (law.step(&mut state, &loud) - law.step(&mut other, &quiet)) / probe
}

/// Kp + Kp dt/Ti of a gain.
fn weight(kp: f64) -> f64 {
    kp * (1.0 + DT / 0.02)
}

#[test]
fn after_two_turns_a_sine_has_the_gains_of_its_amplitude_and_rate() {
    let law = schedule((5e-6, 1.0));
    for (i, amplitude) in AMPLITUDES.into_iter().enumerate() {
        for (j, rate) in RATES.into_iter().enumerate() {
            let expected = weight(gains()[2 * i + j].kp());
            // A half wave is known to a sample, a turning point to the distance between two.
            let got = found(&law, (amplitude, rate), 2.0);
            assert!((got / expected - 1.0).abs() < 0.02, "{got} in place of {expected}");
            let later = found(&law, (amplitude, rate), 9.0);
            assert!((later / expected - 1.0).abs() < 0.02, "{later} in place of {expected}");
        }
    }
}

#[test]
fn before_the_second_turn_the_gains_are_the_first_ones() {
    let law = schedule((20e-6, 4.0));
    for turns in [0.0, 1.0] {
        let got = found(&law, (5e-6, 1.0), turns);
        assert!((got / weight(0.8e6) - 1.0).abs() < 1e-6, "{got} after {turns}");
    }
}

#[test]
fn between_the_grades_the_gains_are_linear_in_the_logarithms() {
    let law = schedule((5e-6, 1.0));
    let kp = |amplitude, rate| law.at(amplitude, rate).weights()[0];
    let near = |got: f64, expected: f64| {
        assert!((got / expected - 1.0).abs() < 1e-12, "{got} in place of {expected}");
    };
    // The geometric means, 10 um and 2 Hz, are the middles.
    near(kp(10e-6, 1.0), 0.25e6);
    near(kp(5e-6, 2.0), 0.15e6);
    near(kp(10e-6, 2.0), 0.375e6);
    // Outside of the grid its nearest end.
    near(kp(1e-9, 100.0), 0.2e6);
    near(kp(1e-3, 1e-3), 0.4e6);
    // And as a sine finds them, with the middle known to a sample in 250.
    let got = found(&law, (10e-6, 2.0), 3.0);
    assert!((got / weight(0.375e6) - 1.0).abs() < 0.02, "{got}");
}

#[test]
fn a_change_of_gains_makes_no_bump() {
    // From 5 um at 1 Hz to 20 um at 4 Hz, eight times the gain, with a large integral kept.
    let law = schedule((5e-6, 1.0));
    let mut state = law.start(30.0);
    let (mut volts, mut before): (f64, f64) = (30.0, 0.0);
    let mut largest: f64 = 0.0;
    for k in 0..8000_u32 {
        let t = DT * f64::from(k);
        let (amplitude, rate) = if k < 4000 { (5e-6, 1.0) } else { (20e-6, 4.0) };
        let error = 2e-6 * (TAU * 0.7 * t).cos();
        let reference = amplitude * (TAU * rate * t).sin();
        let sample = FeedbackSample { reference, ..FeedbackSample::new(error) };
        let next = law.step(&mut state, &sample);
        // No more than the largest gain makes of this change of the error and of the error.
        let rise = if k == 0 { 0.0 } else { (error - before).abs() };
        let explained = 0.8e6 * (rise + DT / 0.02 * error.abs());
        assert!((next - volts).abs() <= explained * (1.0 + 1e-9) + 1e-12, "at {t} s");
        largest = largest.max((next - volts).abs());
        (volts, before) = (next, error);
    }
    // It did get the larger gains: the smallest cannot move the voltage as far in a sample.
    assert!(largest > 4.0 * 0.1e6 * DT / 0.02 * 2e-6, "{largest}");
    assert!((volts - 30.0).abs() < 15.0);
}
