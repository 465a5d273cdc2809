//! Filters, state space and refusals of the controller's parts.
#![allow(missing_docs, clippy::unwrap_used)]

use core::f64::consts::TAU;

use piezotrack_control::{
    Command, Controller, DahlInverse, Feedback, FeedbackSample, Filter, Limits, Pid, StateSpace,
};

/// Gain and phase of a filter at `frequency`, from its response to a sine.
fn response(filter: Filter, frequency: f64, dt: f64) -> (f64, f64) {
    let angle = |k: u32| TAU * frequency * dt * f64::from(k);
    let mut state = None;
    let (mut re, mut im, mut weight) = (0.0, 0.0, 0.0);
    for k in 0..400_000 {
        let y = filter.step(&mut state, angle(k).cos());
        if k >= 100_000 {
            re += y * angle(k).cos();
            im -= y * angle(k).sin();
            weight += angle(k).cos() * angle(k).cos();
        }
    }
    ((re / weight).hypot(im / weight), im.atan2(re))
}

#[test]
fn low_pass_is_the_continuous_one() {
    let (cutoff, dt) = (5.0, 1e-3);
    let filter = Filter::low_pass(cutoff, dt).unwrap();
    for frequency in [0.5, 5.0, 20.0] {
        let ratio: f64 = frequency / cutoff;
        let (gain, phase) = response(filter, frequency, dt);
        assert!((gain - 1.0 / (1.0 + ratio * ratio).sqrt()).abs() < 1e-3, "{gain}");
        assert!((phase + ratio.atan()).abs() < 1e-3, "{phase}");
    }
}

#[test]
fn low_pass_follows_a_ramp_exactly() {
    // Response of 1/(1 + s T) to the ramp t: t - T (1 - e^(-t/T)), at every sample.
    let (cutoff, dt) = (3.0, 0.02);
    let time = 1.0 / (TAU * cutoff);
    let filter = Filter::low_pass(cutoff, dt).unwrap();
    let mut state = None;
    for k in 0..100 {
        let t = dt * f64::from(k);
        let y = filter.step(&mut state, t);
        assert!((y - (t - time * (1.0 - (-t / time).exp()))).abs() < 1e-14);
    }
}

#[test]
fn notch_stops_its_frequency_alone() {
    let dt = 2e-4;
    let filter = Filter::notch(160.0, 0.1, 0.0, dt).unwrap();
    assert!(response(filter, 160.0, dt).0 < 1e-3);
    assert!((response(filter, 10.0, dt).0 - 1.0).abs() < 1e-3);
    assert!((response(filter, 1000.0, dt).0 - 1.0).abs() < 0.01);
    let half = Filter::notch(160.0, 0.1, 0.5, dt).unwrap();
    assert!((response(half, 160.0, dt).0 - 0.5).abs() < 1e-3);
}

#[test]
fn filters_start_settled() {
    for filter in [Filter::low_pass(0.3, 0.02), Filter::notch(10.0, 0.3, 0.1, 0.02)] {
        let mut state = None;
        for _ in 0..100 {
            assert!((filter.unwrap().step(&mut state, 42e-6) - 42e-6).abs() < 1e-18);
        }
    }
}

/// A PI law in state space, x the integral: u = x + (Kp + Ki) e, x+ = x + Ki e.
fn pi(back: Option<&[f64]>) -> StateSpace<4> {
    StateSpace::new(&[1.0], &[0.05e6], &[1.0], 0.15e6, back).unwrap()
}

fn track<F: Feedback>(controller: &Controller<F>, samples: u32) -> Vec<Command> {
    let gain = 1e-6;
    let mut state = controller.rest([]).unwrap();
    let mut y = 0.0;
    (0..samples)
        .map(|k| {
            // First what takes 40 V, out of reach, then -40 V, then 15 V.
            let r = gain * [40.0, -40.0, 15.0][(k / 300).min(2) as usize];
            let command = controller.step(&mut state, r, y, 0.0);
            y = gain * command.volts;
            command
        })
        .collect()
}

#[test]
fn state_space_equals_the_pid_that_it_describes() {
    let (kp, ti, dt) = (0.1e6, 0.04, 0.02);
    let pid = Pid::new(kp, ti, 0.0, None).unwrap().at(dt).unwrap();
    let limits = Limits::new(-1e3, 1e3).unwrap();
    let a = track(&Controller::new(limits, pid), 900);
    let b = track(&Controller::new(limits, pi(None)), 900);
    // They differ by what a start without a kick leaves out, which the integral works off.
    for k in [299, 599, 899] {
        assert!((a[k].volts - b[k].volts).abs() < 1e-5, "{:?} {:?}", a[k], b[k]);
    }
    // No such difference where both begin with an error of 0.
    let (mut one, mut other) = (pid.rest(), pi(None).rest());
    for k in 0..100 {
        let e = 1e-6 * f64::from(k % 13);
        let volts = pid.step(&mut one, &FeedbackSample::new(e));
        assert!((volts - pi(None).step(&mut other, &FeedbackSample::new(e))).abs() < 1e-12);
    }
}

#[test]
fn state_space_does_not_wind_up() {
    let limits = Limits::new(0.0, 28.0).unwrap();
    for back in [None, Some([1.0])] {
        let law = pi(back.as_ref().map(|gain| &gain[..]));
        let run = track(&Controller::new(limits, law), 900);
        let late = run[600..].iter().rposition(|command| command.error.abs() > 1e-7).unwrap();
        assert!(run[299].saturated && run[599].saturated);
        assert!(late < 110, "{late} samples with {back:?}");
    }
}

#[test]
fn state_space_starts_without_a_bump() {
    let controller = Controller::new(Limits::new(0.0, 75.0).unwrap(), pi(None));
    let mut state = controller.start(30.0, []).unwrap();
    let command = controller.step(&mut state, 41e-6, 40e-6, 5.0);
    assert!((command.volts - 30.0).abs() < 1e-12);
    let mut y = 30e-6;
    for _ in 0..500 {
        y = 1e-6 * controller.step(&mut state, 41e-6, y, 5.0).volts;
    }
    assert!((y - 41e-6).abs() < 1e-12);
}

#[test]
fn several_states_follow_their_equations() {
    let law = StateSpace::<3>::new(&[0.5, 0.2, -0.1, 0.9], &[1.0, 2.0], &[3.0, -1.0], 0.5, None);
    let law = law.unwrap();
    let mut state = law.rest();
    let mut x = [0.0, 0.0];
    for k in 0..30 {
        let e = (0.3 * f64::from(k)).sin();
        let u = 3.0 * x[0] - x[1] + 0.5 * e;
        assert!((law.step(&mut state, &FeedbackSample::new(e)) - u).abs() < 1e-12);
        x = [0.5 * x[0] + 0.2 * x[1] + e, -0.1 * x[0] + 0.9 * x[1] + 2.0 * e];
    }
}

#[test]
fn a_pd_asks_for_its_first_error_too_and_a_pid_does_not() {
    let run = |ti| {
        let law = Pid::new(1e5, ti, 0.01, None).unwrap().at(0.02).unwrap();
        let mut state = law.rest();
        [2e-5, 3e-5, 3e-5, 3e-5].map(|e| law.step(&mut state, &FeedbackSample::new(e)))
    };
    // No derivative kick at the first error, and in the end Kp e: nothing is lost of it.
    let [first, _, _, last] = run(f64::INFINITY);
    assert!((first - 2.0).abs() < 1e-12);
    assert!((last - 3.0).abs() < 1e-12);
    // The integral part of a PID makes up for it: no bump at the start.
    let [first, ..] = run(0.1);
    assert!((first - 1e5 * (0.02 / 0.1) * 2e-5).abs() < 1e-12);
    // A bumpless start keeps its voltage.
    let pd = Pid::new(1e5, f64::INFINITY, 0.0, None).unwrap().at(0.02).unwrap();
    let mut state = pd.start(5.0);
    assert!((pd.step(&mut state, &FeedbackSample::new(1e-5)) - 5.0).abs() < 1e-12);
}

#[test]
fn bad_parameters_are_named() {
    let inf = f64::INFINITY;
    let pid = |kp, ti, td, tt| Pid::new(kp, ti, td, tt).unwrap_err().name;
    assert_eq!(pid(f64::NAN, 1.0, 0.0, None), "kp");
    for ti in [0.0, -1.0, f64::NAN] {
        assert_eq!(pid(1.0, ti, 0.0, None), "ti");
    }
    assert_eq!(pid(1.0, 1.0, -1.0, None), "td");
    assert_eq!(pid(1.0, 1.0, inf, None), "td");
    assert_eq!(pid(1.0, 1.0, 1.0, Some(0.0)), "tt");
    assert_eq!(pid(1.0, inf, 1.0, Some(1.0)), "tt");
    let slow = Pid::new(1.0, 0.01, 0.0, None).unwrap();
    assert_eq!(slow.at(0.02).unwrap_err().name, "tt");
    assert_eq!(slow.at(0.0).unwrap_err().name, "dt");
    assert!(slow.at(0.0199).is_ok());
    assert!((Pid::new(1.0, 0.01, 0.0, None).unwrap().tt() - 0.01).abs() < 1e-15);
    assert!((Pid::new(1.0, 0.04, 0.09, None).unwrap().tt() - 0.06).abs() < 1e-15);
    // With no integral part there is no antiwindup, and so no offset after saturation.
    let pd = Pid::new(1e5, inf, 0.01, None).unwrap().at(0.02).unwrap();
    let mut state = pd.rest();
    for (e, excess) in [(0.0, 0.0), (1e-5, -7.0), (0.0, -7.0), (0.0, -7.0), (0.0, 0.0)] {
        pd.step(&mut state, &FeedbackSample { excess, ..FeedbackSample::new(e) });
    }
    assert!(pd.step(&mut state, &FeedbackSample::new(0.0)).abs() < 1e-12);

    assert_eq!(Limits::new(f64::NAN, 1.0).unwrap_err().name, "low");
    assert_eq!(Limits::new(0.0, inf).unwrap_err().name, "high");
    assert_eq!(Limits::new(28.0, 6.0).unwrap_err().name, "high");
    let text = Limits::new(28.0, 6.0).unwrap_err().to_string();
    assert_eq!(text, "high is 6 V: expected a voltage above low");
    for (limits, nan) in [((-5.0, 5.0), 0.0), ((6.0, 28.0), 6.0), ((-28.0, -6.0), -6.0)] {
        let limits = Limits::new(limits.0, limits.1).unwrap();
        assert!((limits.clip(f64::NAN) - nan).abs() < 1e-15);
    }

    assert_eq!(Filter::low_pass(0.0, 0.02).unwrap_err().name, "cutoff");
    assert_eq!(Filter::low_pass(1.0, f64::NAN).unwrap_err().name, "dt");
    assert_eq!(Filter::notch(160.0, 0.1, 0.0, 0.02).unwrap_err().name, "frequency");
    assert_eq!(Filter::notch(10.0, 0.0, 0.0, 0.02).unwrap_err().name, "width");
    assert_eq!(Filter::notch(10.0, 0.1, 2.0, 0.02).unwrap_err().name, "depth");

    let space = |a: &[f64], b: &[f64], c: &[f64], d: f64, back: Option<&[f64]>| {
        StateSpace::<2>::new(a, b, c, d, back).unwrap_err().name
    };
    assert_eq!(space(&[1.0, 2.0], &[1.0], &[1.0], 0.0, None), "a");
    assert_eq!(space(&[1.0], &[], &[1.0], 0.0, None), "b");
    assert_eq!(space(&[1.0; 9], &[1.0; 3], &[1.0; 3], 0.0, None), "b");
    assert_eq!(space(&[1.0], &[1.0], &[1.0, 2.0], 0.0, None), "c");
    assert_eq!(space(&[1.0], &[1.0], &[f64::NAN], 0.0, None), "c");
    assert_eq!(space(&[1.0], &[1.0], &[1.0], inf, None), "d");
    assert_eq!(space(&[1.0], &[1.0], &[1.0], 0.0, Some(&[])), "back");

    let inverse = |mass, t, a2, up| {
        DahlInverse::new(mass, 1.0, 1.0, t, 1.0, a2, 1.0, 0.0, up).unwrap_err().name
    };
    assert_eq!(inverse(-1.0, 1.0, 1.0, 1.0), "mass");
    assert_eq!(inverse(1.0, 0.0, 1.0, 1.0), "piezo_coefficient");
    assert_eq!(inverse(1.0, 1.0, -1.0, 1.0), "a2");
    assert_eq!(inverse(1.0, 1.0, 1.0, f64::NAN), "up");
    assert_eq!(DahlInverse::xu_li_2010().at(0.0).unwrap_err().name, "dt");
}
