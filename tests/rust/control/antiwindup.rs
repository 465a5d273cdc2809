//! What a controller does with readings that are none, under saturation, and when it is changed
//! or reset while it runs.
#![allow(missing_docs, clippy::unwrap_used)]

use piezotrack_control::{
    Controller, ControllerState, Feedback, Filter, Limits, Pid, Repetitive, SampledPid, Smoothing,
    Snapshot, Span, StateSpace,
};

const DT: f64 = 0.02;
const PERIOD: u32 = 250;
/// Static gain of the plant, m/V.
const GAIN: f64 = 1.3e-6;

fn pid() -> SampledPid {
    Pid::new(0.05e6, 0.05, 0.0, None).unwrap().at(DT).unwrap()
}

fn limits() -> Limits {
    Limits::new(0.0, 75.0).unwrap()
}

/// A loop around a plant of first order, stepped sample by sample.
struct Loop<F: Feedback> {
    controller: Controller<F>,
    state: ControllerState<F::State, Vec<f64>>,
    /// Of the reference, samples.
    period: f64,
    x: f64,
    k: u32,
}

impl<F: Feedback> Loop<F> {
    fn new(controller: Controller<F>) -> Self {
        let length = controller.repetitive.map_or(0, |part| part.length());
        let state = controller.rest(vec![0.0; length]).unwrap();
        Self { controller, state, period: f64::from(PERIOD), x: 0.0, k: 0 }
    }

    /// A sample of a raised cosine of this height, m; `reading` in place of what the sensor shows.
    fn step(&mut self, height: f64, reading: Option<f64>) -> f64 {
        let angle = core::f64::consts::TAU * f64::from(self.k) / self.period;
        let reference = 0.5 * height * (1.0 - angle.cos());
        let error = (reference - self.x).abs();
        let measured = reading.unwrap_or(self.x);
        let command = self.controller.step(&mut self.state, reference, measured, 0.0);
        assert!((0.0..=75.0).contains(&command.volts));
        self.x += 0.95 * (GAIN * command.volts - self.x);
        self.k += 1;
        error
    }

    /// Largest error in a period, m.
    fn period(&mut self, height: f64) -> f64 {
        (0..PERIOD).map(|_| self.step(height, None)).fold(0.0, f64::max)
    }

    /// Runs periods and returns the last one's largest error, m.
    fn periods(&mut self, count: u32, height: f64) -> f64 {
        (0..count).map(|_| self.period(height)).last().unwrap()
    }
}

fn learning(
    smoothing: Smoothing,
    settings: impl FnOnce(&mut Repetitive),
) -> Controller<SampledPid> {
    let mut controller = Controller::new(limits(), pid());
    let mut part = Repetitive::new(f64::from(PERIOD) * DT, smoothing, 0.3).unwrap();
    settings(&mut part);
    controller.repetitive = Some(part.at(DT).unwrap());
    controller
}

const SMOOTHINGS: [Smoothing; 4] = [
    Smoothing::ZeroPhase { order: 2 },
    Smoothing::ZeroPhase { order: 1 },
    Smoothing::Lag { tq: 0.2, compensated: false },
    Smoothing::Lag { tq: 0.2, compensated: true },
];

#[test]
fn learnt_voltage_is_well_again_two_periods_after_saturation() {
    for smoothing in SMOOTHINGS {
        for forgetting in [0.99, 1.0] {
            for fraction in [0.0, 0.37] {
                let mut run = Loop::new(learning(smoothing, |part| {
                    part.forgetting_factor = forgetting;
                    part.period += fraction * DT;
                }));
                run.period += fraction;
                let before = run.periods(40, 80e-6);
                let beyond = (0..1000).fold(0.0, |most: f64, _| {
                    run.period(300e-6);
                    most.max(run.state.last().repetitive.abs())
                });
                assert!(beyond <= 75.0, "{beyond} V");
                run.periods(2, 80e-6);
                let after = run.period(80e-6);
                // A period that is no whole number of samples is out of phase by up to half a one.
                let rounding = if fraction > 0.0 { 0.4e-6 } else { 1e-8 };
                let limit = 1.5 * before + rounding;
                assert!(after < limit, "{smoothing:?}, {forgetting}: {before} m, then {after} m");
            }
        }
    }
}

#[test]
fn learning_goes_on_where_a_small_part_of_a_period_is_saturated() {
    // 15 % of the period asks for more than 75 V.
    let height = 104e-6;
    let reachable = |run: &mut Loop<SampledPid>| {
        (0..PERIOD)
            .map(|k| (k, run.step(height, None)))
            .filter(|(k, _)| !(90..175).contains(k))
            .fold(0.0, |most: f64, (_, error)| most.max(error))
    };
    let mut plain = Loop::new(Controller::new(limits(), pid()));
    plain.periods(20, height);
    let without = reachable(&mut plain);
    let mut run = Loop::new(learning(SMOOTHINGS[0], |_| ()));
    run.periods(400, height);
    assert!(run.state.last().repetitive.abs() < 75.0);
    let with = reachable(&mut run);
    assert!(with < 0.3 * without, "{with} m, without {without} m");
}

#[test]
fn the_learnt_voltage_is_bounded_by_the_range_of_the_limits() {
    let mut run = Loop::new(learning(SMOOTHINGS[0], |part| {
        (part.pause, part.forgetting_factor) = (false, 1.0);
    }));
    for _ in 0..500 {
        run.period(300e-6);
        assert!(run.state.last().repetitive.abs() <= 75.0);
    }
    assert!(run.state.last().feedback.abs() < 200.0);
}

#[test]
fn a_reading_that_no_stage_can_have_is_no_measurement() {
    fn settles<F: Feedback + Copy>(controller: Controller<F>) {
        for reading in [9.91e37, -9.9e37, 1.0, -0.5, 0.02, f64::NAN, f64::INFINITY] {
            let mut run = Loop::new(controller);
            let before = run.periods(30, 80e-6);
            run.step(80e-6, Some(reading));
            assert!(!run.state.last().measurement_ok, "{reading}");
            let refused = run.state.refused();
            assert_eq!(refused.not_finite + refused.outside, 1);
            assert_eq!(refused.outside, u32::from(reading.is_finite()));
            let after = (1..PERIOD).map(|_| run.step(80e-6, None)).fold(0.0, f64::max);
            assert!(after < 1.2 * before + 1e-6, "{reading}: {before} m, then {after} m");
        }
    }
    let state_space = StateSpace::<2>::new(&[1.0], &[2e4], &[1.0], 0.0, None).unwrap();
    settles(Controller::new(limits(), state_space));
    settles(Controller::new(limits(), pid()));
    settles(learning(SMOOTHINGS[2], |part| part.pause = false));
    settles(learning(SMOOTHINGS[0], |_| ()));
    let slow = Pid::new(0.02e6, 0.1, 0.0, None).unwrap().at(DT).unwrap();
    let mut filtered = Controller::new(limits(), slow);
    filtered.filters[0] = Some(Filter::low_pass(5.0, DT).unwrap());
    settles(filtered);
}

#[test]
fn the_span_and_the_jump_are_those_of_the_stage() {
    let mut controller = Controller::new(limits(), pid());
    controller.span = Span::new(-5e-6, 120e-6).unwrap().with_max_jump(10e-6).unwrap();
    let mut state = controller.rest([]).unwrap();
    let mut accepted = |reading| controller.step(&mut state, 50e-6, reading, 30.0).measurement_ok;
    for (reading, right) in [
        (50e-6, true),
        (59e-6, true),
        (121e-6, false),
        (70e-6, true), // two samples have passed since 59 um
        (81e-6, false),
        (81e-6, true), // it may have moved that far by now
        (-6e-6, false),
        (f64::NAN, false),
    ] {
        assert_eq!(accepted(reading), right, "{reading}");
    }
    let refused = state.refused();
    assert_eq!((refused.outside, refused.jumps, refused.not_finite), (2, 1, 1));
    for (low, high) in [(0.0, 0.0), (1.0, 0.0), (-1.1, 0.0), (0.0, f64::NAN), (0.0, f64::INFINITY)]
    {
        assert_eq!(Span::new(low, high).unwrap_err().name, "span");
    }
    for jump in [0.0, -1.0, f64::NAN] {
        assert_eq!(Span::default().with_max_jump(jump).unwrap_err().name, "max_jump");
    }
}

#[test]
fn laws_in_state_space_have_an_antiwindup_of_their_own() {
    // 200 samples out of reach, or none, then within; samples until 1 um is left.
    let late = |law: StateSpace<4>, beyond: usize| {
        let controller = Controller::new(limits(), law);
        let mut state = controller.rest([]).unwrap();
        let (mut x, mut last) = (0.0, 0);
        for k in 0..2000 {
            let reference = if k < beyond { 300e-6 } else { 30e-6 };
            if k >= beyond && f64::abs(reference - x) > 1e-6 {
                last = k - beyond;
            }
            x += 0.95 * (GAIN * controller.step(&mut state, reference, x, 0.0).volts - x);
        }
        last
    };
    let none = Some(&[0.0, 0.0][..]);
    for (a, b, c, d) in [
        // PI, an integrator alone, an integrator behind a lag, a lag with a lead of its own
        (&[1.0, 0.0, 0.0, 0.0][..], &[0.02e6, 0.0][..], &[1.0, 0.0][..], 0.05e6),
        (&[1.0, 0.0, 0.0, 0.0][..], &[0.05e6, 0.0][..], &[1.0, 0.0][..], 0.0),
        (&[1.0, 0.0, 0.5, 0.5][..], &[0.05e6, 0.0][..], &[0.0, 1.0][..], 0.0),
        (&[1.0, 0.0, 0.0, 0.3][..], &[0.05e6, 0.02e6][..], &[1.0, -1.0][..], 0.04e6),
    ] {
        let law = |back| StateSpace::<4>::new(a, b, c, d, back).unwrap();
        assert!(law(None).antiwindup().is_some());
        let (fresh, with) = (late(law(None), 0), late(law(None), 200));
        assert!(with < fresh + 40, "{with} samples, {fresh} from rest, for {a:?}");
        let without = late(law(none), 200);
        assert!(without > 2 * with, "{without} samples without, {with} with, for {a:?}");
    }
    // PI: conditioning is a tracking time of about Ti.
    let pi = StateSpace::<4>::new(&[1.0], &[0.05e6], &[1.0], 0.15e6, None).unwrap();
    let gain = pi.antiwindup().unwrap()[0];
    assert!((gain - 0.05 / 0.15).abs() < 0.05, "{gain}");
    // An unstable part that the output does not show: no gain can help.
    let hidden =
        StateSpace::<4>::new(&[1.0, 0.0, 0.0, 1.1], &[1e4, 1e4], &[1.0, 0.0], 0.0, None).unwrap();
    assert!(hidden.antiwindup().is_none());
}

#[test]
fn a_reset_goes_on_from_the_voltage_that_is_there() {
    let mut run = Loop::new(learning(SMOOTHINGS[0], |_| ()));
    for _ in 0..5 * PERIOD + PERIOD / 3 {
        run.step(80e-6, None);
    }
    let (volts, x) = (run.state.last().volts, run.x);
    assert!(volts > 20.0);
    run.controller.reset(&mut run.state);
    let command = run.controller.step(&mut run.state, x, x, 12.0);
    assert!((command.volts - volts).abs() < 1e-9, "{volts} V, then {} V", command.volts);
    assert!(command.repetitive.abs() < 1e-12);
    // From what the amplifier gave, where that was reported.
    run.controller.applied(&mut run.state, volts - 3.0).unwrap();
    run.controller.reset(&mut run.state);
    let command = run.controller.step(&mut run.state, x, x, 12.0);
    assert!((command.volts - volts + 3.0).abs() < 1e-9);
    // Before the first command there is none that a reported voltage could differ from.
    let controller = Controller::new(limits(), pid());
    let mut state = controller.rest([]).unwrap();
    controller.applied(&mut state, 37.0).unwrap();
    assert!(controller.step(&mut state, 0.0, 0.0, 0.0).volts.abs() < 1e-12);
    // Nothing holds a voltage without feedback: the feedforward it is, with no measurement too.
    let controller = Controller::new(limits(), ());
    let mut state = controller.rest([]).unwrap();
    controller.step(&mut state, 0.0, f64::NAN, 30.0);
    controller.reset(&mut state);
    assert!((controller.step(&mut state, 0.0, f64::NAN, 20.0).volts - 20.0).abs() < 1e-12);
}

#[test]
fn settings_change_without_a_bump() {
    let base = || {
        let mut controller = learning(SMOOTHINGS[0], |_| ());
        controller.filters[0] = Some(Filter::low_pass(5.0, DT).unwrap());
        controller
    };
    let with = |change: &dyn Fn(&mut Controller<SampledPid>)| {
        let mut controller = base();
        change(&mut controller);
        controller
    };
    let others = [
        with(&|other| other.filters = [None; 2]),
        with(&|other| other.filters[0] = Some(Filter::low_pass(1.0, DT).unwrap())),
        with(&|other| other.filters[1] = Some(Filter::notch(10.0, 0.5, 0.0, DT).unwrap())),
        with(&|other| other.feedback = Pid::new(0.03e6, 0.03, 0.0, None).unwrap().at(DT).unwrap()),
        learning(SMOOTHINGS[0], |part| part.kq = 0.1),
    ];
    for other in others {
        let mut run = Loop::new(base());
        for _ in 0..600 {
            run.step(80e-6, None);
        }
        let (before, measured) = (run.state.last().volts, run.x);
        run.controller.retune(&other, &mut run.state).unwrap();
        // The reference is where the stage is: only the rest of the filter could move it.
        let command = other.step(&mut run.state, measured, measured, 0.0);
        let moved = (command.volts - before).abs();
        // Gains of the PID alone keep its state, and so answer the change of the error.
        let answer = 0.05e6 * (run.state.last().error - command.error).abs();
        let keeps = other.filters == run.controller.filters;
        assert!(moved < if keeps { 5.0 } else { 0.05 } + answer, "{moved} V");
    }
    let mut run = Loop::new(base());
    let shorter = {
        let mut controller = base();
        let part = Repetitive::new(2.0, SMOOTHINGS[0], 0.3).unwrap().at(DT).unwrap();
        controller.repetitive = Some(part);
        controller
    };
    assert_eq!(run.controller.retune(&shorter, &mut run.state).unwrap_err().name, "repetitive");
}

#[test]
fn a_reported_voltage_pauses_learning_as_a_limit_does() {
    // An amplifier that clips at 40 V although the limits are 0 and 75 V.
    let learnt = |tells: bool| {
        let mut run = Loop::new(learning(SMOOTHINGS[0], |_| ()));
        run.periods(20, 45e-6);
        for _ in 0..200 * PERIOD {
            let command = *run.state.last();
            let given = command.volts.min(40.0);
            if tells {
                run.controller.applied(&mut run.state, given).unwrap();
            }
            run.x += 0.95 * (GAIN * given - run.x);
            let angle = core::f64::consts::TAU * f64::from(run.k) / f64::from(PERIOD);
            let reference = 45e-6 * (1.0 - angle.cos());
            run.controller.step(&mut run.state, reference, run.x, 0.0);
            run.k += 1;
        }
        run.periods(2, 45e-6);
        run.period(45e-6)
    };
    let (told, untold) = (learnt(true), learnt(false));
    assert!(told < 0.5 * untold, "{told} m, untold {untold} m");
}

#[test]
fn a_state_is_read_back_bit_for_bit() {
    let mut controller = learning(SMOOTHINGS[3], |part| part.lead = 2);
    controller.filters[0] = Some(Filter::low_pass(5.0, DT).unwrap());
    let mut run = Loop::new(controller);
    for height in [80e-6, 300e-6, 80e-6] {
        for samples in [1, 30, 200, 400] {
            for _ in 0..samples {
                run.step(height, None);
            }
            let mut numbers = Vec::new();
            run.state.save(&mut |number| numbers.push(number));
            let mut restored = controller.rest(vec![0.0; controller.repetitive.unwrap().length()]);
            let state = restored.as_mut().unwrap();
            let mut left = numbers.iter().copied();
            state.load(&mut || left.next()).unwrap();
            assert_eq!(left.next(), None);
            assert_eq!(*state, run.state);
            // One number less, and a state without the repetitive part, are no such state.
            let mut left = numbers[1..].iter().copied();
            assert!(state.load(&mut || left.next()).is_none());
            let mut left = numbers.iter().copied();
            let plain = Controller::new(limits(), pid());
            assert!(plain.rest([]).unwrap().load(&mut || left.next()).is_none());
        }
    }
}

#[test]
fn an_absurd_report_of_the_amplifier_is_ignored() {
    let law = StateSpace::<2>::new(&[1.0], &[2e4], &[1.0], 0.0, None).unwrap();
    for volts in [9.91e37, -1e17, 151.0, -76.0] {
        let mut run = Loop::new(Controller::new(limits(), law));
        run.periods(30, 80e-6);
        let before = run.state.clone();
        run.controller.applied(&mut run.state, volts).unwrap();
        assert_eq!(run.state, before, "{volts} V");
    }
    // What may be there, but not between the limits, is where a reset starts from a limit.
    let mut run = Loop::new(Controller::new(limits(), law));
    run.step(80e-6, None);
    run.controller.applied(&mut run.state, 149.0).unwrap();
    run.controller.reset(&mut run.state);
    assert!((run.state.last().volts - 75.0).abs() < 1e-12);
}
