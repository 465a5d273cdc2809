//! Controllers in single precision beside the same in double.
//!
//! The bounds are those of rounding: each operation in `f32` is off by at most [`U`] of its result,
//! and each number that is rounded to `f32` by [`U`] of itself. What one sample adds to the
//! difference of two voltages is counted from the operations of the law; how long it stays there
//! follows from the law's equation.
#![allow(missing_docs, clippy::unwrap_used)]

use core::f64::consts::TAU;

use piezotrack_control::hysteresis::{BoucWen, Dahl};
use piezotrack_control::{
    Cast, Command, Controller, ControllerState, DisturbanceObserver, Feedback, FeedbackSample,
    Filter, HysteresisObserver, IntegralResonantControl, LeadLag, Limits, Pid, Real, Repetitive,
    SampledPid, ScheduledPid, SlidingMode, Smoothing, Snapshot, Span, StateSpace,
};

const DT: f64 = 1e-3;
/// Static gain of the plant, m/V.
const GAIN: f64 = 1.3e-6;
/// Largest relative error of a rounding to `f32`.
const U: f64 = 0.5 * f32::EPSILON as f64;

fn single(value: f64) -> f32 {
    f32::of(value)
}

fn pid() -> SampledPid {
    Pid::new(0.05e6, 0.01, 0.0004, None).unwrap().at(DT).unwrap()
}

fn controller() -> Controller<SampledPid> {
    let mut one = Controller::new(Limits::new(0.0, 75.0).unwrap(), pid());
    one.span = Span::new(-1e-5, 1.5e-4).unwrap();
    one
}

/// A plant of first order.
fn moved(x: f64, volts: f64) -> f64 {
    x + 0.3 * (GAIN * volts - x)
}

fn reference(k: u32, height: f64) -> f64 {
    0.5 * height * (1.0 - (TAU * f64::from(k) / 250.0).cos())
}

/// Reference, reading and feedforward of each sample of a loop in double precision.
fn record(one: &Controller<SampledPid>, height: f64, samples: u32) -> Vec<[f64; 3]> {
    let mut state = one.rest([]).unwrap();
    let (mut x, mut out) = (0.0, Vec::new());
    for k in 0..samples {
        let wanted = reference(k, height);
        let row = [wanted, x, 0.7 * wanted / GAIN];
        x = moved(x, one.step(&mut state, row[0], row[1], row[2]).volts);
        out.push(row);
    }
    out
}

/// The commands where every sample is given, whatever the command before.
fn replay<F: Feedback<T>, T: Real>(
    one: &Controller<F, T>,
    rows: &[[f64; 3]],
    cast: fn(f64) -> T,
) -> Vec<Command<T>> {
    let mut state = one.rest(Vec::new()).unwrap();
    let step = |row: &[f64; 3]| {
        let [reference, measured, feedforward] = row.map(cast);
        one.step(&mut state, reference, measured, feedforward)
    };
    rows.iter().map(step).collect()
}

/// Largest magnitude.
fn most(values: impl Iterator<Item = f64>) -> f64 {
    values.map(f64::abs).fold(0.0, f64::max)
}

/// Largest part of the PID's output that the roundings of a sample make, V.
///
/// The error is off by that of reference and reading and of their difference; a first difference
/// takes it twice, a second four times, with as much again for its own three roundings. Each
/// product is rounded with its factor and in three sums, and the output in one.
fn added(one: &SampledPid, rows: &[[f64; 3]], commands: &[Command]) -> f64 {
    let usual = |row: &&[f64; 3]| row.iter().all(|one| one.is_finite() && one.abs() < 1e3);
    let error = most(commands.iter().map(|one| one.error));
    let input = |i: usize| most(rows.iter().filter(usual).map(|row| row[i]));
    let off = U * (input(0) + input(1) + error);
    let [kp, ki, kd] = one.weights();
    let errors: Vec<f64> = commands.iter().map(|one| one.error).collect();
    let rise = most(errors.windows(2).map(|two| two[1] - two[0]));
    let excess = most(commands.iter().map(|one| one.volts - one.unclipped));
    let sum = most(commands.iter().map(|one| one.unclipped)).max(75.0);
    let volts = most(commands.iter().map(|one| one.feedback));
    let products = kp * rise + ki * error + 2.0 * kd * rise + one.tracking() * excess;
    let inputs = (3.0 * kp + ki + 8.0 * kd) * off;
    inputs + U * (6.0 * products + volts + 4.0 * one.tracking() * sum)
}

/// Sum of the roundings of an incremental law, V: each sample rounds the output that it
/// changes, by up to `U` of it, evenly to either side, so that the variance is a third of the
/// square. Four standard deviations of their sum, and a rounding of what is asked for; what an error
/// was rounded by cancels in the next difference.
fn walked(commands: &[Command]) -> f64 {
    let square = |one: &Command| (U * one.feedback).powi(2) / 3.0;
    let asked = most(commands.iter().map(|one| one.unclipped));
    4.0 * commands.iter().map(square).sum::<f64>().sqrt() + U * asked
}

/// Largest difference of the voltages asked for.
fn apart(double: &[Command], single: &[Command<f32>]) -> f64 {
    let pairs = double.iter().zip(single);
    most(pairs.map(|(one, other)| one.unclipped - f64::from(other.unclipped)))
}

/// An incremental PID keeps what a sample added, and back-calculation, whose map from one output to
/// the next does not expand differences, takes some of it away.
#[test]
fn a_pid_differs_by_the_roundings_of_its_samples() {
    let one = controller();
    let mut rows = record(&one, 90e-6, 3000);
    // The reference asks for more than the limits give, too.
    rows.extend(record(&one, 130e-6, 2000));
    let double = replay(&one, &rows, |value| value);
    let single = replay(&one.cast::<f32>().unwrap(), &rows, single);
    let clipped = double.iter().filter(|one| one.saturated).count();
    assert!(clipped > 100, "{clipped}");
    let bound = walked(&double);
    let found = apart(&double, &single);
    assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
}

#[test]
fn what_is_no_measurement_is_refused_in_single_precision_too() {
    let mut one = controller();
    one.span = one.span.with_max_jump(8e-6).unwrap();
    let mut rows = record(&controller(), 60e-6, 1500);
    for (k, row) in rows.iter_mut().enumerate() {
        match k % 97 {
            31 => row[1] = f64::NAN,
            50 => row[1] = 9.91e37,
            // Beyond the largest f32.
            60 => row[1] = 1e300,
            75 => row[1] += 20e-6,
            80 => row[0] = f64::INFINITY,
            90 => row[2] = f64::NAN,
            _ => {}
        }
    }
    let double = replay(&one, &rows, |value| value);
    let single = replay(&one.cast::<f32>().unwrap(), &rows, single);
    for (one, other) in double.iter().zip(&single) {
        assert_eq!(one.measurement_ok, other.measurement_ok);
        assert_eq!(one.reference_ok, other.reference_ok);
        assert!(other.volts >= 0.0 && other.volts <= 75.0);
    }
    assert!(double.iter().filter(|one| !one.measurement_ok).count() >= 60);
    let bound = walked(&double);
    let found = apart(&double, &single);
    assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
}

/// The voltages of a loop around the plant, and what the controller asked for.
fn closed<F: Feedback<T>, T: Real>(one: &Controller<F, T>, cast: fn(f64) -> T) -> Vec<f64> {
    let mut state = one.rest(Vec::new()).unwrap();
    let (mut x, mut out) = (0.0, Vec::new());
    for k in 0..2500 {
        let wanted = reference(k, 70e-6);
        let command = one.step(&mut state, cast(wanted), cast(x), cast(0.7 * wanted / GAIN));
        x = moved(x, command.volts.into());
        out.push(command.unclipped.into());
    }
    out
}

/// In a loop each sample's roundings decay, as a voltage that the controller starts with does.
#[test]
fn a_loop_forgets_what_was_rounded() {
    let one = controller();
    let wide = Controller::new(Limits::new(-1e3, 1e3).unwrap(), one.feedback);
    let mut state = wide.start(1.0, []).unwrap();
    let (mut x, mut response) = (0.0, 0.0);
    for _ in 0..2500 {
        let volts = wide.step(&mut state, 0.0, x, 0.0).volts;
        response += volts.abs();
        x = moved(x, volts);
    }
    let rows = record(&one, 70e-6, 2500);
    let double = replay(&one, &rows, |value| value);
    // In the sum of its parts two roundings more.
    let sample = added(&one.feedback, &rows, &double) + 3.0 * U * 75.0;
    let bound = response * sample;
    let (double, single) = (closed(&one, |value| value), closed(&one.cast().unwrap(), single));
    let found = most(double.iter().zip(&single).map(|(one, other)| one - other));
    assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
    assert!(bound < 5e-3, "{bound}");
}

/// A filter's roundings pass its poles only.
#[test]
fn a_filter_differs_by_the_answer_of_its_poles() {
    for filter in [
        Filter::low_pass(30.0, DT).unwrap(),
        Filter::notch(120.0, 0.3, 0.1, DT).unwrap(),
        Filter::notch(7.0, 0.02, 0.0, DT).unwrap(),
    ] {
        let ([b0, b1, b2], [a1, a2]) = filter.coefficients();
        let (mut y, mut response) = ([1.0, 0.0], 0.0);
        for _ in 0..20_000 {
            response += f64::abs(y[0]);
            y = [-a1 * y[0] - a2 * y[1], y[0]];
        }
        let (mut one, mut other) = (None, None);
        let rounded = filter.cast::<f32>().unwrap();
        let (mut found, mut largest) = (0.0_f64, 0.0_f64);
        for k in 0..5000 {
            let input = reference(k, 80e-6);
            let output = filter.step(&mut one, input);
            largest = largest.max(output.abs()).max(input.abs());
            let single = rounded.step(&mut other, single(input));
            found = found.max((output - f64::from(single)).abs());
        }
        // Five products, each of two rounded factors and rounded itself, and in four sums.
        let weights = [b0, b1, b2, a1, a2].iter().map(|one| one.abs()).sum::<f64>();
        let bound = response * 7.0 * U * weights * largest;
        assert!(found > 0.0 && found < bound, "{found} m of {bound} m");
    }
}

/// The state of a stable law of first order forgets roundings by its pole.
#[test]
fn a_lead_lag_differs_by_the_answer_of_its_pole() {
    let law: StateSpace<1> = LeadLag::new(1e5, 0.01, 0.1).unwrap().at(DT).unwrap();
    let (a, b, c, d) = law.matrices();
    let single = law.cast::<f32>().unwrap();
    let (mut one, mut other) = (law.rest(), single.rest());
    let (mut found, mut states) = (0.0_f64, 0.0);
    let mut x = 0.0;
    for k in 0..5000 {
        let error = reference(k, 1e-6);
        let sample = FeedbackSample::new(error);
        let volts = law.step(&mut one, &sample);
        let rounded = single.step(&mut other, &FeedbackSample::new(f32::of(error)));
        found = found.max((volts - f64::from(rounded)).abs());
        x = a[0][0] * x + b[0] * error;
        states = f64::max(states, f64::abs(x));
    }
    let state = 5.0 * U * (states + b[0].abs() * 1e-6) / (1.0 - a[0][0].abs());
    let bound = c[0].abs() * state + 5.0 * U * (c[0].abs() * states + d.abs() * 1e-6);
    assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
}

/// Each period repeats the one before, with the roundings of one pass through the taps added.
#[test]
fn a_learnt_voltage_differs_by_the_roundings_of_its_periods() {
    for smoothing in [Smoothing::ZeroPhase { order: 3 }, Smoothing::None] {
        let part = Repetitive::new(50.3 * DT, smoothing, 0.4).unwrap().at(DT).unwrap();
        let rounded = part.cast::<f32>().unwrap();
        let mut one = part.rest(vec![0.0; part.length()]).unwrap();
        let mut other = rounded.rest(vec![0.0; rounded.length()]).unwrap();
        let (mut found, mut largest, samples) = (0.0_f64, 0.0_f64, 1000);
        for k in 0..samples {
            let error = 1e-6 * (TAU * f64::from(k) / 50.3).sin() + 2e-7;
            let before = piezotrack_control::Outcome { error, excess: 0.0 };
            let volts = part.step(&mut one, before, 75.0);
            largest = largest.max(volts.abs());
            let before = piezotrack_control::Outcome { error: single(error), excess: 0.0 };
            let single = rounded.step(&mut other, before, 75.0);
            found = found.max((volts - f64::from(single)).abs());
        }
        let recursion = part.recursion();
        let weights: f64 = recursion.taps.iter().map(|one| one.abs()).sum();
        let roundings = f64::from(u32::try_from(recursion.taps.len()).unwrap()) + 3.0;
        let once = U * roundings * weights * (largest + 3.0 * recursion.gain * 1.2e-6);
        // As often as the memory was read; overshoots of the cubic are in the weights.
        let shortest = f64::from(u32::try_from(recursion.nearest).unwrap());
        let passes = (f64::from(samples) / shortest).ceil();
        let bound = passes * weights.powf(passes).max(1.0) * once;
        assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
        assert!(bound < 1e-3 * largest, "{bound} V of {largest} V");
    }
}

/// Clipped samples are not learnt; which ones are clipped by a hair may differ, what is left of the
/// error does not.
#[test]
fn a_saturated_loop_learns_again_in_single_precision() {
    fn errors<T: Real>(one: &Controller<SampledPid<T>, T>, cast: fn(f64) -> T) -> [f64; 2] {
        let length = one.repetitive.map_or(0, |part| part.length());
        let mut state = one.rest(vec![T::ZERO; length]).unwrap();
        let (mut x, mut clipped, mut last) = (0.0, 0.0, 0.0);
        for k in 0..250 * 60 {
            let height = if (2500..5000).contains(&k) { 130e-6 } else { 80e-6 };
            let wanted = reference(k, height);
            let command = one.step(&mut state, cast(wanted), cast(x), T::ZERO);
            clipped += f64::from(u8::from(command.saturated));
            if k >= 250 * 59 {
                last = f64::max(last, (wanted - x).abs());
            }
            x = moved(x, command.volts.into());
        }
        [clipped, last]
    }
    let mut one = controller();
    let smoothing = Smoothing::ZeroPhase { order: 2 };
    one.repetitive = Some(Repetitive::new(0.25, smoothing, 0.1).unwrap().at(DT).unwrap());
    let double = errors(&one, |value| value);
    let single = errors(&one.cast::<f32>().unwrap(), single);
    one.repetitive = None;
    let unlearnt = errors(&one, |value| value);
    assert!(double[0] > 100.0 && single[0] > 100.0);
    assert!(double[1] < 0.2 * unlearnt[1], "{double:?} {unlearnt:?}");
    assert!(single[1] < 0.2 * unlearnt[1], "{single:?} {unlearnt:?}");
}

/// Gains between those of the grid: linear in logarithms, of which a rounding is [`U`] of their
/// size.
#[test]
fn scheduled_gains_are_interpolated_in_single_precision() {
    let gains = [0.2e6, 0.1e6, 0.15e6, 0.05e6].map(|kp| Pid::new(kp, 0.02, 0.0, None).unwrap());
    let (amplitudes, rates) = ([1e-6, 30e-6], [1.0, 20.0]);
    let schedule = ScheduledPid::new(&amplitudes, &rates, &gains, (1e-6, 1.0), DT).unwrap();
    let rounded = schedule.cast::<f32>().unwrap();
    for (amplitude, rate) in [(1e-6, 1.0), (7e-6, 3.0), (29e-6, 19.0), (1e-3, 0.1)] {
        let double = schedule.at(amplitude, rate).weights();
        let single = rounded.at(single(amplitude), single(rate)).weights();
        for (one, other) in double.iter().zip(single) {
            // Two logarithms below 14 (each off by its own rounding and the argument's) over a
            // distance of 3 or more, on either axis, of a change below the largest gain.
            let (share, largest) = (2.0 * 2.0 * 4.0 * 14.0 / 3.0 * U, 0.2e6_f64);
            let bound = largest * (share + 10.0 * U);
            assert!((one - f64::from(other)).abs() <= bound, "{one} {other} {bound}");
        }
    }
}

/// Every law runs in a loop in single precision, and follows as well as in double.
#[test]
fn every_law_follows_in_single_precision() {
    fn worst<F: Feedback<T>, T: Real>(feedback: F, cast: fn(f64) -> T) -> f64 {
        let limits = Limits::new(0.0, 75.0).unwrap().cast::<T>().unwrap();
        let one = Controller::new(limits, feedback);
        let mut state: ControllerState<_, [T; 0], T> = one.rest([]).unwrap();
        let (mut x, mut worst) = (0.0, 0.0);
        for k in 0..2500 {
            let wanted = reference(k, 70e-6);
            let command = one.step(&mut state, cast(wanted), cast(x), cast(wanted / 1.4e-6));
            worst = f64::max(worst, (wanted - x).abs());
            x = moved(x, command.volts.into());
        }
        worst
    }
    fn both<F>(law: F)
    where
        F: Feedback + Cast,
        F::In<f32>: Feedback<f32>,
    {
        let other = worst(law.cast::<f32>().unwrap(), single);
        let one = worst(law, |value| value);
        assert!(one < 10e-6, "{one}");
        // A rounding of what is asked for moves the stage by as little.
        assert!((one - other).abs() < 1e3 * U * 70e-6, "{one} {other}");
    }
    let observer = DisturbanceObserver::new(GAIN, 2e-3, 20.0).unwrap();
    let resonant = IntegralResonantControl::new(1e8, 2e-5).unwrap();
    both(pid());
    both(observer.around((), DT).unwrap());
    both(resonant.around(pid(), DT).unwrap());
    let friction = Dahl { a1: 1e3, a2: 1e6, gain: 2e9 };
    let observer = HysteresisObserver::new(friction, GAIN, 2e-3, 0.1, 100e-6).unwrap();
    both(observer.around(pid(), DT).unwrap());
    let drive = BoucWen { rise: 0.1, beta: 0.04, gamma: 0.03, exponent: 1.0 };
    let observer = HysteresisObserver::new(drive, GAIN, 2e-3, 0.1, 100e-6).unwrap();
    both(observer.around(pid(), DT).unwrap());
    both(SlidingMode::new(5.0, 20e-6, 0.02, 0.0, 0.0).unwrap().at(DT).unwrap());
    both::<StateSpace<2>>(LeadLag::new(2e5, 0.001, 0.002).unwrap().at(DT).unwrap());
}

#[test]
fn a_running_controller_in_single_precision_is_kept_as_numbers() {
    let one = controller().cast::<f32>().unwrap();
    let mut running = one.rest([]).unwrap();
    one.step(&mut running, 1e-5, 2e-6, 0.3);
    let mut kept = Vec::new();
    running.save(&mut |number| kept.push(number));
    let mut numbers = kept.iter().copied();
    let mut restored = one.rest([]).unwrap();
    assert!(restored.load(&mut || numbers.next()).is_some());
    assert_eq!(restored, running);
    // A voltage with more digits is of a controller in double precision.
    let first = kept.iter_mut().find(|number| number.fract() > 0.0).unwrap();
    *first += 1e-12 * *first;
    let mut numbers = kept.iter().copied();
    assert!(restored.load(&mut || numbers.next()).is_none());
}

#[test]
fn what_overflows_in_single_precision_is_refused_by_name() {
    let large = Pid::new(1e39, 0.01, 0.0, None).unwrap().at(DT).unwrap();
    assert_eq!(large.cast::<f32>().unwrap_err().name, "kp");
    let limits = Limits::new(-1e50, 1e50).unwrap();
    assert_eq!(limits.cast::<f32>().unwrap_err().name, "low");
    let narrow = Limits::new(1.0, 1.0 + 1e-9).unwrap();
    assert_eq!(narrow.cast::<f32>().unwrap_err().name, "high");
    let span = Span::new(1e-4, 1e-4 + 1e-15).unwrap();
    assert_eq!(span.cast::<f32>().unwrap_err().name, "span");
    assert!(controller().cast::<f64>().unwrap().feedback == pid());
}
