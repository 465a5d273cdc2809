//! The observer of the hysteresis: its estimate converges, and compensates the hysteresis.
#![allow(missing_docs, clippy::unwrap_used)]

use core::f64::consts::TAU;

use piezotrack_control::hysteresis::{BoucWen, Dahl, DahlState, Operator};
use piezotrack_control::{
    Controller, Feedback, FeedbackSample, HysteresisObserver, Limits, Observable, Pid, Snapshot,
};
use piezotrack_core::design::LinearFeedback;

const DT: f64 = 1e-3;
/// T/K of Table 1 of Xu and Li 2010, m/V, and D/K, s.
const GAIN: f64 = 0.0468 / 26065.0;
const TIME: f64 = 2597.3 / 26065.0;

/// The hysteresis of that table in volts.
fn dahl() -> Dahl<f64> {
    Dahl { a1: 121.9874, a2: 1.1773e6, gain: 1.8485e6 * 30.0 / 0.0468 }
}

/// A stage of first order, `T x' + x = g (u - w(x))`, in explicit steps of a hundredth of a sample.
struct Stage {
    x: f64,
    hysteresis: DahlState<f64>,
}

impl Stage {
    fn begin() -> Self {
        Self { x: 0.0, hysteresis: dahl().rest() }
    }

    fn follow(&mut self, volts: f64) {
        for _ in 0..100 {
            let way = 0.01 * DT / TIME * (GAIN * (volts - self.hysteresis.force) - self.x);
            let branch = dahl().branch(&self.hysteresis, way.signum());
            self.hysteresis = dahl().along(&branch, way);
            self.x += way;
        }
    }
}

/// Largest error of the estimate (V) in the last of eight periods, begun with a wrong state.
fn late_error(correction: f64) -> f64 {
    let observer = HysteresisObserver::new(dahl(), GAIN, TIME, correction, 100e-6).unwrap();
    let law = observer.around((), DT).unwrap();
    let (mut stage, mut state) = (Stage::begin(), law.rest());
    let mut volts = 0.0;
    for _ in 0..1000 {
        stage.follow(60.0);
    }
    let mut worst: f64 = 0.0;
    for k in 0..8000_u32 {
        let sample = FeedbackSample {
            measured: stage.x,
            applied: if k == 0 { 60.0 } else { volts },
            ..FeedbackSample::new(0.0)
        };
        law.step(&mut state, &sample);
        if k == 0 {
            // Wrong at first, by 3 V.
            let mut numbers = Vec::new();
            state.save(&mut |number| numbers.push(number));
            numbers[0] += 3.0;
            let mut read = numbers.into_iter();
            state.load(&mut || read.next()).unwrap();
            assert!((law.estimate(&state) - stage.hysteresis.force).abs() > 2.5);
        } else if k >= 7000 {
            worst = worst.max((law.estimate(&state) - stage.hysteresis.force).abs());
        }
        volts = 30.0 + 30.0 * (TAU * f64::from(k) * DT).cos();
        stage.follow(volts);
    }
    worst
}

#[test]
fn the_estimate_converges_to_the_hysteresis_from_a_wrong_state() {
    let (corrected, weakly) = (late_error(0.3), late_error(0.02));
    // Without noise: what remains is that the voltage is held and the way taken at its end.
    assert!(corrected < 0.1, "{corrected} V");
    assert!(weakly < 0.5, "{weakly} V");
    // The operator alone does not forget within these 8 s.
    assert!(late_error(0.0) > 1.0);
}

#[test]
fn tracking_with_it_is_better_than_with_the_pid_alone() {
    let pid = Pid::new(0.3e6, 0.1, 0.0, None).unwrap().at(DT).unwrap();
    let observer = HysteresisObserver::new(dahl(), GAIN, TIME, 0.05, 100e-6).unwrap();
    // Wide, so that nothing saturates where the lag is driven back.
    let limits = Limits::new(-20.0, 100.0).unwrap();
    let (alone, observed) = (
        rms(&Controller::new(limits, pid)),
        rms(&Controller::new(limits, observer.around(pid, DT).unwrap())),
    );
    assert!(observed < 0.5 * alone, "{observed} m, alone {alone} m");
}

/// Rms of the error (m) in the second of two periods of a sine, with a linear feedforward.
fn rms<F: Feedback>(controller: &Controller<F>) -> f64 {
    let (mut stage, mut state) = (Stage::begin(), controller.rest([]).unwrap());
    let mut sum = 0.0;
    for k in 0..2000_u32 {
        let angle = TAU * f64::from(k) * DT;
        let reference = 40e-6 * (1.0 - angle.cos());
        let rate = 40e-6 * TAU * angle.sin();
        let linear = (reference + TIME * rate) / GAIN;
        let command = controller.step(&mut state, reference, stage.x, linear);
        stage.follow(command.volts);
        sum += if k < 1000 { 0.0 } else { command.error * command.error };
    }
    (sum / 1000.0).sqrt()
}

/// The law and its transfer function driven by the same small errors about rest.
fn runs_as_linearised<O: Observable<Running: PartialEq>>(operator: O, time: f64) {
    let observer = HysteresisObserver::new(operator, GAIN, time, 0.2, 100e-6).unwrap();
    let law =
        observer.around(Pid::new(0.1e6, 0.1, 0.0, None).unwrap().at(DT).unwrap(), DT).unwrap();
    let [above, below] = law.transfer_function();
    let mut state = law.rest();
    let order = below.len() - 1;
    let (mut volts, mut last) = (0.0, Vec::new());
    // The recursion of the transfer function, by its powers of z - 1 as differences.
    let (above, below) = (in_powers_of_z(&above), in_powers_of_z(&below));
    let mut errors: Vec<f64> = vec![0.0; order + 1];
    let mut outputs: Vec<f64> = vec![0.0; order + 1];
    for k in 0..60_u32 {
        // Rising, so that neither path nor slope turns.
        let error = -1e-9 * f64::from(k * k);
        let sample =
            FeedbackSample { measured: -error, applied: volts, ..FeedbackSample::new(error) };
        volts = law.step(&mut state, &sample);
        errors.push(error);
        let at = errors.len() - 1;
        let mut expected = 0.0;
        for i in 0..=order {
            expected += above.get(order - i).copied().unwrap_or(0.0) * errors[at - i];
            if i > 0 {
                expected -= below[order - i] * outputs[at - i];
            }
        }
        outputs.push(expected);
        last.push((volts - expected).abs());
    }
    let worst = last.iter().fold(0.0, |a: f64, b| a.max(*b));
    assert!(worst < 1e-3 * outputs.iter().fold(0.0, |a: f64, b| a.max(b.abs())), "{worst} V");
}

fn in_powers_of_z(of_difference: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; of_difference.len()];
    for number in of_difference.iter().rev() {
        // Horner: times (z - 1), plus the next.
        for i in (0..out.len()).rev() {
            out[i] = if i > 0 { out[i - 1] } else { 0.0 } - out[i];
        }
        out[0] += number;
    }
    out
}

#[test]
fn the_transfer_function_is_the_law_that_runs() {
    for time in [0.0, 0.02] {
        // Straight operators, whose slope is the largest everywhere.
        runs_as_linearised(BoucWen { rise: 0.3, beta: 0.0, gamma: 0.0, exponent: 1.0 }, time);
        runs_as_linearised(dahl_at_origin(), time);
    }
}

/// No hysteresis: a Dahl operator without curvature has the slope 0.
fn dahl_at_origin() -> Dahl<f64> {
    Dahl { a1: 0.0, a2: 0.0, gain: 0.0 }
}

#[test]
fn what_is_out_of_range_is_refused_by_name() {
    let new = |gain, time, correction, stroke| {
        HysteresisObserver::new(dahl(), gain, time, correction, stroke).unwrap_err().name
    };
    assert_eq!(new(0.0, 0.0, 0.1, 1e-4), "plant_gain");
    assert_eq!(new(GAIN, -1.0, 0.1, 1e-4), "plant_time");
    assert_eq!(new(GAIN, 0.0, 1.1, 1e-4), "correction");
    assert_eq!(new(GAIN, 0.0, 0.1, 0.0), "stroke");
}
