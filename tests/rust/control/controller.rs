//! PID, antiwindup and the composed controller, on plants whose answers are known.
#![allow(missing_docs, clippy::unwrap_used)]

use piezotrack_control::{
    Command, Controller, Feedback, FeedbackSample, Limits, Pid, Repetitive, SampledPid,
};

const DT: f64 = 0.02;
/// Static gain of the plant, m/V; with one sample of delay the published gains ring above 1.28.
const GAIN: f64 = 0.9e-6;

fn published() -> SampledPid {
    Pid::xu_li_2010().at(DT).unwrap()
}

fn close(a: f64, b: f64, within: f64) {
    assert!((a - b).abs() <= within, "{a} is not within {within} of {b}");
}

/// A sine from 0 to 110 um, 0.2 Hz, from rest.
fn sine(k: u32) -> f64 {
    55e-6 * (1.0 - (core::f64::consts::TAU * 0.2 * DT * f64::from(k)).cos())
}

/// Commands over `samples` in a loop with a static plant that answers one sample later.
fn track<F: Feedback>(
    controller: &Controller<F>,
    samples: u32,
    reference: impl Fn(u32) -> f64,
    feedforward: impl Fn(u32) -> f64,
) -> Vec<Command> {
    let mut state = controller.rest([0.0; Repetitive::room(256)]).unwrap();
    let mut y = 0.0;
    let mut out = Vec::new();
    for k in 0..samples {
        let command = controller.step(&mut state, reference(k), y, feedforward(k));
        y = GAIN * command.volts;
        out.push(command);
    }
    out
}

fn largest(commands: &[Command], value: impl Fn(&Command) -> f64) -> f64 {
    commands.iter().fold(0.0, |most, command| f64::max(most, value(command).abs()))
}

#[test]
fn incremental_form_equals_the_position_form() {
    // u = Kp (e + Ts/Ti sum e + Td/Ts (e - e_)), less what the first error alone gives
    let (kp, ti, td) = (0.120e6, 0.009, 0.044);
    let pid = published();
    let mut state = pid.start(5.0);
    let errors: Vec<f64> = (0..50).map(|k| 1e-6 * (f64::from(k) * 0.7).sin() + 3e-7).collect();
    let (mut sum, mut before) = (0.0, errors[0]);
    for &e in &errors {
        sum += e;
        let position = kp * (e - errors[0] + DT / ti * sum + td / DT * (e - before));
        close(pid.step(&mut state, &FeedbackSample::new(e)), 5.0 + position, 1e-12);
        before = e;
    }
}

#[test]
fn feedforward_is_not_integrated() {
    let limits = Limits::new(0.0, 200.0).unwrap();
    let feedforward = |k| 0.9 * sine(k) / GAIN;
    let ours = track(&Controller::new(limits, published()), 1000, sine, feedforward);
    assert!(largest(&ours[10..], |command| command.error) < 1e-6);

    // (23) and (25) as printed: the recursion starts from the total command.
    let (kp, ti, td) = (0.120e6, 0.009_f64, 0.044);
    let tt = (ti * td).sqrt();
    let (mut u, mut excess, mut e1, mut e2) = (0.0, 0.0, 0.0, 0.0);
    let (mut y, mut worst) = (0.0, 0.0);
    for k in 0..1000 {
        let e = sine(k) - y;
        u += kp * ((e - e1) + DT / ti * e + td / DT * (e - 2.0 * e1 + e2))
            + DT / tt * excess
            + feedforward(k);
        let v = limits.clip(u);
        excess = v - u;
        (e2, e1, y) = (e1, e, GAIN * v);
        worst = f64::max(worst, e.abs());
    }
    assert!(worst > 30e-6, "{worst}");
}

/// Samples until the error stays below 1 % of the step, after 200 samples out of reach.
fn recovery(limits: Limits, tt: Option<f64>, outside: f64, inside: f64) -> usize {
    let pid = Pid::new(0.120e6, 0.009, 0.044, tt).unwrap().at(DT).unwrap();
    let reference = |k| if k < 200 { outside } else { inside };
    let run = track(&Controller::new(limits, pid), 600, reference, |_| 0.0);
    let late = |c: &Command| c.error.abs() > 0.01 * (outside - inside).abs();
    run.iter().rposition(late).unwrap().saturating_sub(199)
}

#[test]
fn antiwindup_recovers_at_both_limits() {
    let limits = Limits::new(6.0, 28.0).unwrap();
    let (low, middle, high) = (-30e-6, 15e-6, 60e-6);
    for outside in [low, high] {
        let with = recovery(limits, None, outside, middle);
        let without = recovery(limits, Some(f64::INFINITY), outside, middle);
        assert!(with <= 15, "{with} samples from {outside} m");
        assert!(without > 100, "{without} samples from {outside} m");
    }
}

#[test]
fn saturated_command_comes_to_rest_where_integral_and_tracking_balance() {
    // Kp Ts/Ti e + Ts/Tt eu = 0 at either limit: u stands Kp Tt/Ti e beyond it.
    let limits = Limits::new(6.0, 28.0).unwrap();
    let tt = (0.009_f64 * 0.044).sqrt();
    for reference in [-40e-6, 80e-6] {
        let run = track(&Controller::new(limits, published()), 100, |_| reference, |_| 0.0);
        let last = run[99];
        assert!(last.saturated);
        close(last.unclipped - last.volts, 0.120e6 * tt / 0.009 * last.error, 1e-9);
    }
}

#[test]
fn antiwindup_sees_feedforward() {
    // The error is 0 and the feedback part alone well within the limits: what the feedforward
    // asks for too much decays with back-calculation's own pole, 1 - Ts/Tt.
    let pid = Pid::new(0.120e6, 0.009, 0.044, Some(0.05)).unwrap().at(DT).unwrap();
    let controller = Controller::new(Limits::new(6.0, 28.0).unwrap(), pid);
    for (excess, limit) in [(12.0, 28.0), (-12.0, 6.0)] {
        let mut state = controller.rest([]).unwrap();
        let mut expected = excess;
        for _ in 0..10 {
            let command = controller.step(&mut state, 1e-6, 1e-6, limit + excess);
            assert!(command.saturated);
            close(command.unclipped - limit, expected, 1e-9);
            expected *= 1.0 - DT / 0.05;
        }
    }
}

#[test]
fn antiwindup_sees_the_repetitive_part() {
    let mut controller = Controller::new(Limits::new(0.0, 75.0).unwrap(), published());
    controller.repetitive = Some(Repetitive::xu_li_2010(0.2).at(DT).unwrap());
    let run = track(&controller, 400, |_| 100e-6, |_| 0.0);
    let last = run.last().unwrap();
    // Out of reach for ever: uRC grows to the range of the limits, and uFB takes it off again.
    assert!((last.repetitive - 75.0).abs() < 1e-12, "{last:?}");
    assert!(last.feedback < 10.0, "{last:?}");
    assert!(last.unclipped - 75.0 < 20.0, "{last:?}");
}

#[test]
fn shrunk_limits_cost_little_with_antiwindup() {
    // Fig. 13 of the paper: limits of 6 and 28 V; error counted where the reference can be had.
    let limits = Limits::new(6.0, 28.0).unwrap();
    let worst = |tt| {
        let pid = Pid::new(0.120e6, 0.009, 0.044, tt).unwrap().at(DT).unwrap();
        let feedforward = |k: u32| 0.9 * sine(k) / GAIN;
        let run = track(&Controller::new(limits, pid), 1000, sine, feedforward);
        let reachable = |k: u32| {
            (k.saturating_sub(5)..=k).all(|k| {
                let volts = sine(k) / GAIN;
                volts > 7.0 && volts < 27.0
            })
        };
        (0..1000).filter(|&k| reachable(k)).map(|k| run[k as usize].error.abs()).fold(0.0, f64::max)
    };
    let (with, without) = (worst(None), worst(Some(f64::INFINITY)));
    assert!(with < 2e-6, "{with}");
    assert!(without > 5.0 * with, "{without} and {with}");
}

#[test]
fn what_was_really_applied_counts() {
    let controller = Controller::new(Limits::new(0.0, 75.0).unwrap(), published());
    let mut state = controller.rest([]).unwrap();
    controller.step(&mut state, 0.0, 0.0, 20.0);
    controller.applied(&mut state, 15.0).unwrap();
    let command = controller.step(&mut state, 0.0, 0.0, 20.0);
    close(command.feedback, -5.0 * DT / (0.009_f64 * 0.044).sqrt(), 1e-12);
    assert_eq!(controller.applied(&mut state, f64::NAN).unwrap_err().name, "volts");
}

#[test]
fn bad_numbers_reach_neither_actuator_nor_memory() {
    let mut controller = Controller::new(Limits::new(0.0, 75.0).unwrap(), published());
    controller.repetitive = Some(Repetitive::xu_li_2010(0.4).at(DT).unwrap());
    controller.filters[0] = Some(piezotrack_control::Filter::low_pass(10.0, DT).unwrap());
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308, -1e308] {
        for which in 0..3 {
            let mut state = controller.start(10.0, [0.0; 64]).unwrap();
            let mut y = 10.0 * GAIN;
            for k in 0..1500_u32 {
                let mut inputs = [12e-6 + 1e-6 * sine(k), y, 10.0 + 0.1 * f64::from(k % 20)];
                let hit = k == 0 || (300..310).contains(&k);
                if hit {
                    inputs[which] = bad;
                }
                let before = *state.last();
                let command = controller.step(&mut state, inputs[0], inputs[1], inputs[2]);
                assert!((0.0..=75.0).contains(&command.volts), "{command:?}");
                assert_eq!(command.measurement_ok, !(hit && which == 1));
                assert_eq!(command.reference_ok, !(hit && which != 1));
                if hit && which != 2 && k > 0 {
                    close(command.feedback, before.feedback, 0.0);
                    close(command.error, before.error, 0.0);
                }
                if hit && which == 2 {
                    close(command.feedforward, before.feedforward, 0.0);
                }
                y = GAIN * command.volts;
            }
            assert!(state.last().error.abs() < 1e-6, "{bad} at {which}: {:?}", state.last());
        }
    }
}

#[test]
fn starts_from_the_present_voltage() {
    let controller = Controller::new(Limits::new(0.0, 75.0).unwrap(), published());
    let mut state = controller.start(30.0, []).unwrap();
    // At rest where 30 V lead, with a feedforward that is 10 V off: no bump, and no drift.
    for _ in 0..10 {
        close(controller.step(&mut state, 36e-6, 36e-6, 40.0).volts, 30.0, 1e-12);
    }
    // A constant error gives no kick of the proportional and derivative parts, only its integral.
    let mut state = controller.start(30.0, []).unwrap();
    let command = controller.step(&mut state, 37e-6, 36e-6, 40.0);
    close(command.volts, 30.0 + 0.120 * DT / 0.009, 1e-12);
    assert_eq!(controller.start(80.0, []).unwrap_err().name, "present");
    assert_eq!(controller.start(f64::NAN, []).unwrap_err().name, "present");
}

#[test]
fn gains_change_without_a_bump() {
    let mut controller = Controller::new(Limits::new(0.0, 75.0).unwrap(), published());
    let mut state = controller.rest([]).unwrap();
    let mut y = 0.0;
    for _ in 0..2000 {
        y = GAIN * controller.step(&mut state, 50e-6, y, 0.0).volts;
    }
    let before = state.last().volts;
    controller.feedback = Pid::new(0.03e6, 0.02, 0.01, None).unwrap().at(DT).unwrap();
    for _ in 0..20 {
        let command = controller.step(&mut state, 50e-6, y, 0.0);
        close(command.volts, before, 1e-9);
        y = GAIN * command.volts;
    }
}

#[test]
fn reset_is_a_start_from_the_present_voltage() {
    let mut controller = Controller::new(Limits::new(0.0, 75.0).unwrap(), published());
    controller.repetitive = Some(Repetitive::xu_li_2010(0.4).at(DT).unwrap());
    let mut state = controller.start(10.0, [7.0; 64]).unwrap();
    for k in 0..100 {
        controller.step(&mut state, sine(k), 0.0, 20.0);
    }
    let fresh = controller.start(state.last().volts, [0.0; 64]).unwrap();
    assert_ne!(state, fresh);
    controller.reset(&mut state);
    assert_eq!(state, fresh);
    // Before the first step there is nothing to go on from.
    let mut unused = controller.rest([0.0; 64]).unwrap();
    controller.reset(&mut unused);
    assert_eq!(unused, controller.rest([0.0; 64]).unwrap());
}

#[test]
fn delay_line_may_be_lent() {
    let mut line = [0.0; 64];
    let mut controller = Controller::new(Limits::new(0.0, 75.0).unwrap(), ());
    controller.repetitive = Some(Repetitive::xu_li_2010(0.4).at(DT).unwrap());
    let mut state = controller.rest(&mut line[..]).unwrap();
    assert!(controller.step(&mut state, 1e-6, 0.0, 20.0).volts > 19.9);
    assert_eq!(controller.rest([0.0; 3]).unwrap_err().name, "line");
}

/// A fuzzer found it: of a command of 1e24 V the voltage was lost in the difference between them.
#[test]
fn what_reached_the_stage_is_within_the_limits_whatever_was_commanded() {
    let law = Pid::new(1e30, f64::INFINITY, 0.0, None).unwrap().at(DT).unwrap();
    let controller = Controller::new(Limits::new(4.0, 20.0).unwrap(), law);
    for (reference, feedforward) in [(1e-6, 10.0), (-1e-6, 10.0), (1e-6, 30.0), (-1e-6, -3.0)] {
        let mut state = controller.rest([]).unwrap();
        let command = controller.step(&mut state, reference, 0.0, feedforward);
        assert!(command.unclipped.abs() > 1e20);
        let reached = controller.reached(&state).unwrap_or(feedforward);
        assert!((4.0..=20.0).contains(&reached), "{reached}");
        // A report from outside of the limits is believed, as far as it can be.
        controller.applied(&mut state, 30.0).unwrap();
        let reached = controller.reached(&state).unwrap_or(feedforward);
        assert!((-12.0..=36.0).contains(&reached), "{reached}");
    }
}
