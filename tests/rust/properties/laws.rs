//! Every feedback law of `Law` in the controller: limits, recovery, snapshots, bumpless start.

use piezotrack_control::hysteresis::{BoucWen, Dahl};
use piezotrack_control::{
    Controller, ControllerState, DisturbanceObserver, Feedback, Filter, HysteresisObserver,
    IntegralResonantControl, LeadLag, Limits, Observable, Pid, PositivePositionFeedback,
    PositiveVelocityPositionFeedback, Repetitive, ScheduledPid, SlidingMode, Smoothing, Snapshot,
    Span, StateSpace,
};
use piezotrack_core::parts::{Law, LawState, MOST_STATES};
use proptest::prelude::*;

use crate::control::{Act, DT, ROOM, acts, composed, learner, limits, stays_within};
use crate::{any_number, around, cases, decades};

type State = ControllerState<LawState, [f64; ROOM]>;

/// Gain of the stage, m/V: it goes 0.9 of the way to where its voltage leads in a sample.
const GAIN: f64 = 1.5e-6;

/// What the sensor can show, m.
const SPAN: f64 = 0.5e-3;

fn sliding(switching: f64, ti: f64, td: f64) -> Option<SlidingMode> {
    SlidingMode::new(switching, 20e-6, ti, td, 0.03).ok()
}

fn hysteresis<O: Observable>(operator: O, correction: f64) -> Option<HysteresisObserver<O>> {
    HysteresisObserver::new(operator, GAIN, 0.0, correction, 100e-6).ok()
}

/// A weak hysteresis, up to 2 V, which the stage here does not have.
fn dahl() -> Dahl<f64> {
    Dahl { a1: 120.0, a2: 1.2e6, gain: 4e8 }
}

fn bouc_wen() -> BoucWen<f64> {
    BoucWen { rise: 0.1, beta: 0.04, gamma: 0.03, exponent: 1.0 }
}

/// All laws with one gain (V/m) and time (s), where they can be sampled.
fn laws(kp: f64, time: f64, cutoff: f64) -> Vec<Law> {
    let pid = Pid::new(kp, time, 0.0, None).ok();
    let slow = Pid::new(0.5 * kp, 2.0 * time, 0.0, None).ok();
    let observer = DisturbanceObserver::new(GAIN, 0.0, cutoff).ok();
    let lagging = DisturbanceObserver::new(GAIN, 0.01, cutoff).ok();
    let sampled = pid.and_then(|pid| pid.at(DT).ok());
    let surface = sliding(kp * 20e-6, time, 0.0).and_then(|one| one.at(DT).ok());
    let derivative = sliding(kp * 20e-6, 2.0 * time, 0.01).and_then(|one| one.at(DT).ok());
    let bare = sliding(kp * 20e-6, f64::INFINITY, 0.0).and_then(|one| one.at(DT).ok());
    let scheduled = || {
        let gains = [pid?, slow?, slow?, pid?];
        ScheduledPid::new(&[5e-6, 50e-6], &[0.1, 1.0], &gains, (20e-6, 0.3), DT).ok()
    };
    let integral = kp * DT / time;
    let back = [0.3];
    let lead_lag = LeadLag::new(kp, 0.0, time).ok();
    let around = |law| move |one: DisturbanceObserver| one.around(law, DT).ok();
    vec![
        Some(Law::None),
        sampled.map(Law::Pid),
        scheduled().map(Law::Scheduled),
        StateSpace::new(&[1.0], &[integral], &[1.0], 0.5 * kp, Some(&back))
            .ok()
            .map(Law::StateSpace),
        lead_lag.and_then(|one| one.at::<MOST_STATES>(DT).ok()).map(Law::StateSpace),
        surface.map(Law::SlidingMode),
        derivative.map(Law::SlidingMode),
        sampled.and_then(|law| observer.and_then(around(law))).map(Law::ObservedPid),
        sampled.and_then(|law| lagging.and_then(around(law))).map(Law::ObservedPid),
        bare.and_then(|law| observer.and_then(|one| one.around(law, DT).ok()))
            .map(Law::ObservedSlidingMode),
        sampled
            .and_then(|law| hysteresis(dahl(), 0.0)?.around(law, DT).ok())
            .map(Law::DahlObserver),
        sampled
            .and_then(|law| hysteresis(dahl(), 0.3)?.around(law, DT).ok())
            .map(Law::DahlObserver),
        sampled
            .and_then(|law| hysteresis(bouc_wen(), 0.2)?.around(law, DT).ok())
            .map(Law::BoucWenObserver),
        sampled
            .and_then(|law| {
                IntegralResonantControl::new(5.0 * cutoff / GAIN, 10.0 * GAIN)
                    .ok()?
                    .around(law, DT)
                    .ok()
            })
            .map(Law::Damped),
        sampled
            .and_then(|law| {
                PositivePositionFeedback::new(0.1 / GAIN, 20.0 * cutoff, 0.5)
                    .ok()?
                    .around(law, DT)
                    .ok()
            })
            .map(Law::Damped),
        sampled
            .and_then(|law| {
                PositiveVelocityPositionFeedback::new(-0.05 / GAIN, 0.1 / GAIN, 20.0 * cutoff, 0.5)
                    .ok()?
                    .around(law, DT)
                    .ok()
            })
            .map(Law::Damped),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// The table with gains that are stable on the stage, with and without the other parts.
fn stable() -> Vec<Controller<Law>> {
    let learner = Repetitive {
        forgetting_factor: 0.95,
        ..Repetitive::new(20.0 * DT, Smoothing::ZeroPhase { order: 2 }, 0.1).unwrap()
    };
    let filter = Filter::low_pass(15.0, DT).unwrap();
    let limits = Limits::new(0.0, 75.0).unwrap();
    let mut out = Vec::new();
    for law in laws(0.1e6, 0.1, 0.5) {
        for parts in 0..4 {
            let mut controller = Controller::new(limits, law);
            controller.repetitive = (parts & 1 > 0).then(|| learner.at(DT).unwrap());
            controller.span = Span::new(-SPAN, SPAN).unwrap();
            controller.filters = [(parts & 2 > 0).then_some(filter), None];
            out.push(controller);
        }
    }
    out
}

fn one_of_the_table() -> impl Strategy<Value = Controller<Law>> {
    let table = stable();
    (0..table.len()).prop_map(move |i| table[i])
}

/// The stage from `x` (m) under the controller at rest, for so many samples; its last place.
fn driven(controller: &Controller<Law>, state: &mut State, mut x: f64, samples: u32) -> f64 {
    for _ in 0..samples {
        let volts = controller.step(state, 50e-6, x, 32.0).volts;
        x += 0.9 * (GAIN * volts - x);
    }
    x
}

fn numbers(state: &State) -> Vec<f64> {
    let mut out = Vec::new();
    state.save(&mut |number| out.push(number));
    out
}

fn act_on(controller: &Controller<Law>, state: &mut State, act: &Act) -> f64 {
    match *act {
        Act::Step(r, y, u) => controller.step(state, r, y, u).volts,
        Act::Applied(volts) => {
            let _ = controller.applied(state, volts);
            state.last().volts
        }
        Act::Reset => {
            controller.reset(state);
            state.last().volts
        }
    }
}

#[test]
fn the_table_has_every_law() {
    let kinds: Vec<_> = laws(0.1e6, 0.1, 0.5).iter().map(std::mem::discriminant).collect();
    for (i, kind) in kinds.iter().enumerate() {
        // Adjacent laws of one kind only: ten kinds, all of them sampled.
        assert_eq!(kinds.iter().rposition(|other| other == kind), {
            let run = kinds[i..].iter().take_while(|other| *other == kind).count();
            Some(i + run - 1)
        });
    }
    let mut changes = 1;
    for pair in kinds.windows(2) {
        changes += usize::from(pair[0] != pair[1]);
    }
    assert_eq!((kinds.len(), changes), (16, 10));
}

proptest! {
    #![proptest_config(cases(1))]

    #[test]
    fn every_law_commands_within_the_limits(
        (kp, time, cutoff) in (decades(1e5, 6.0), decades(0.1, 3.0), decades(1.0, 3.0)),
        limits in limits(),
        learner in prop::option::of(learner()),
        filters in (decades(5.0, 2.0), decades(5.0, 2.0)),
        acts in acts(),
    ) {
        for law in laws(kp, time, cutoff) {
            if let Some(controller) = composed(law, limits, learner, filters) {
                stays_within(&controller, &acts)?;
            }
        }
    }

    #[test]
    fn every_loop_recovers_from_saturation_and_bad_readings(
        controller in one_of_the_table(),
        far in around(500e-6),
        bad in prop::collection::vec((any_number(), any_number(), any_number()), 0..60),
        applied in prop::option::of(any_number()),
    ) {
        let mut state = controller.rest([0.0; ROOM]).unwrap();
        let undisturbed = driven(&controller, &mut state, 0.0, 3000);
        // A law without an integral leaves an error; none leaves more than the feedforward alone.
        prop_assert!((undisturbed - 50e-6).abs() < 2.001e-6, "{undisturbed}");
        let mut state = controller.rest([0.0; ROOM]).unwrap();
        let mut x = 0.0;
        for _ in 0..100 {
            x += 0.9 * (GAIN * controller.step(&mut state, far, x, 60.0).volts - x);
        }
        for (r, y, u) in &bad {
            x += 0.9 * (GAIN * controller.step(&mut state, *r, *y, *u).volts - x);
        }
        if let Some(volts) = applied {
            let _ = controller.applied(&mut state, volts);
        }
        // 60 s, twenty times the slowest integral, which the schedule has at half the gain.
        let most = if controller.repetitive.is_none() { 1e-9 } else { 0.1e-6 };
        let end = driven(&controller, &mut state, x, 3000);
        prop_assert!((end - undisturbed).abs() < most, "{end} in place of {undisturbed}");
    }

    #[test]
    fn a_restored_session_goes_on_with_the_same_bits(
        controller in one_of_the_table(), before in acts(), after in acts(),
    ) {
        let mut state = controller.rest([0.0; ROOM]).unwrap();
        for act in &before {
            act_on(&controller, &mut state, act);
        }
        let kept = numbers(&state);
        let mut restored = controller.rest([0.0; ROOM]).unwrap();
        let mut read = kept.iter().copied();
        prop_assert!(restored.load(&mut || read.next()).is_some());
        prop_assert_eq!(read.next(), None);
        for act in &after {
            let pair = [&mut state, &mut restored].map(|one| act_on(&controller, one, act));
            prop_assert_eq!(pair[0].to_bits(), pair[1].to_bits());
        }
        let bits = |state| numbers(state).into_iter().map(f64::to_bits).collect::<Vec<_>>();
        prop_assert_eq!(bits(&state), bits(&restored));
        // Cut short it is refused.
        let mut read = kept.iter().copied().take(kept.len() - 1);
        prop_assert!(restored.load(&mut || read.next()).is_none());
    }

    #[test]
    fn every_law_that_holds_starts_without_a_bump(
        controller in one_of_the_table(), present in 0.0..75.0_f64, place in around(100e-6),
        feedforward in 0.0..75.0_f64, before in acts(),
    ) {
        prop_assume!(controller.feedback.holds());
        let mut state = controller.start(present, [0.0; ROOM]).unwrap();
        let first = controller.step(&mut state, place, place, feedforward).volts;
        prop_assert!((first - present).abs() < 1e-9, "{first} from {present}");
        // And so it goes on after a reset amid anything.
        for act in &before {
            act_on(&controller, &mut state, act);
        }
        controller.reset(&mut state);
        let there = state.last().volts;
        let next = controller.step(&mut state, place, place, feedforward).volts;
        prop_assert!((next - there).abs() < 1e-9, "{next} from {there}");
    }
}
