//! What runs at the sample rate: within the limits and finite whatever comes in, and the
//! repetitive part beside its equation.

use piezotrack_control::{
    Controller, Feedback, Filter, Limits, Outcome, Pid, Repetitive, Smoothing, StateSpace,
};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

use crate::{any_number, around, cases, decades};

pub const DT: f64 = 0.02;
/// Room for every period drawn here.
pub const ROOM: usize = Repetitive::room(64);

/// What a program does with a session in one sampling interval.
#[derive(Clone, Debug)]
pub enum Act {
    Step(f64, f64, f64),
    Applied(f64),
    Reset,
}

pub fn acts() -> impl Strategy<Value = Vec<Act>> {
    let good = || (around(1e-4), around(1e-4), around(100.0));
    let act = prop_oneof![
        6 => good().prop_map(|(r, y, u)| Act::Step(r, y, u)),
        3 => (any_number(), any_number(), any_number()).prop_map(|(r, y, u)| Act::Step(r, y, u)),
        1 => any_number().prop_map(Act::Applied),
        1 => Just(Act::Reset),
    ];
    prop::collection::vec(act, 1..60)
}

fn smoothing() -> impl Strategy<Value = Smoothing> {
    prop_oneof![
        (decades(0.1, 2.0), any::<bool>())
            .prop_map(|(tq, compensated)| Smoothing::Lag { tq, compensated }),
        (1..=4_u32).prop_map(|order| Smoothing::ZeroPhase { order }),
        Just(Smoothing::None),
    ]
}

prop_compose! {
    pub fn learner()(
        period in 2.0..60.0_f64, whole in any::<bool>(), smoothing in smoothing(),
        kq in 0.01..1.99_f64, forgetting_factor in 0.5..=1.0_f64, lead in 0..4_u32,
        pause in any::<bool>(),
    ) -> Repetitive {
        let samples = if whole { period.round() } else { period };
        Repetitive { period: samples * DT, smoothing, kq, forgetting_factor, lead, pause }
    }
}

/// A controller with what can be sampled of the parts drawn.
pub fn composed<F: Feedback>(
    feedback: F,
    (low, range): (f64, f64),
    learner: Option<Repetitive>,
    (cutoff, notch): (f64, f64),
) -> Option<Controller<F>> {
    let mut controller = Controller::new(Limits::new(low, low + range).ok()?, feedback);
    controller.repetitive = learner.and_then(|learner| learner.at(DT).ok());
    controller.filters =
        [Filter::low_pass(cutoff, DT).ok(), Filter::notch(notch, 0.5, 0.1, DT).ok()];
    Some(controller)
}

pub fn stays_within<F: Feedback>(
    controller: &Controller<F>,
    acts: &[Act],
) -> Result<(), TestCaseError> {
    let mut state = controller.rest([0.0; ROOM]).unwrap();
    let limits = controller.limits.low()..=controller.limits.high();
    for act in acts {
        let command = match *act {
            Act::Step(r, y, u) => controller.step(&mut state, r, y, u),
            Act::Applied(volts) => {
                prop_assert_eq!(controller.applied(&mut state, volts).is_ok(), volts.is_finite());
                *state.last()
            }
            Act::Reset => {
                controller.reset(&mut state);
                *state.last()
            }
        };
        prop_assert!(limits.contains(&command.volts), "{command:?}");
        let parts = [command.unclipped, command.feedforward, command.feedback, command.repetitive];
        prop_assert!(parts.iter().all(|part| part.is_finite()), "{command:?}");
        prop_assert!(command.error.is_finite(), "{command:?}");
    }
    Ok(())
}

pub fn limits() -> impl Strategy<Value = (f64, f64)> {
    prop_oneof![
        3 => (around(100.0), decades(75.0, 2.0)),
        1 => (decades(-1e3, 5.0), decades(1e3, 9.0)),
    ]
}

proptest! {
    #![proptest_config(cases(1))]

    #[test]
    fn a_pid_commands_within_the_limits(
        (kp, ti, td) in (decades(1e5, 9.0), decades(0.01, 4.0), decades(0.01, 4.0)),
        limits in limits(),
        learner in prop::option::of(learner()),
        filters in (decades(5.0, 2.0), decades(5.0, 2.0)),
        acts in acts(),
    ) {
        let Ok(pid) = Pid::new(kp, ti, td, None).and_then(|pid| pid.at(DT)) else { return Ok(()) };
        if let Some(controller) = composed(pid, limits, learner, filters) {
            stays_within(&controller, &acts)?;
        }
    }

    #[test]
    fn any_state_space_law_commands_within_the_limits(
        a in prop::array::uniform4(decades(1.0, 3.0)),
        b in prop::array::uniform2(decades(1e5, 9.0)),
        c in prop::array::uniform2(around(10.0)),
        back in prop::option::of(prop::array::uniform2(around(1.0))),
        limits in limits(),
        learner in prop::option::of(learner()),
        acts in acts(),
    ) {
        let back = back.as_ref().map(<[f64; 2]>::as_slice);
        let law = StateSpace::<2>::new(&a, &b, &c, 0.0, back).unwrap();
        if let Some(controller) = composed(law, limits, learner, (5.0, 10.0)) {
            stays_within(&controller, &acts)?;
        }
    }

    #[test]
    fn the_repetitive_part_is_its_recursion(
        learner in learner(), errors in prop::collection::vec(around(1e-5), 1..300),
    ) {
        let Ok(sampled) = learner.at(DT) else { return Ok(()) };
        let law = sampled.recursion();
        let mut state = sampled.rest(vec![0.0; sampled.length()]).unwrap();
        let mut volts: Vec<f64> = Vec::new();
        let mut before = Outcome::default();
        for k in 0..errors.len() {
            let delayed = |i: usize| {
                let delay = law.nearest + law.taps.len() - 1 - i;
                let volt = k.checked_sub(delay).map_or(0.0, |at| volts[at]);
                let error = (k + law.lead).checked_sub(delay).map_or(0.0, |at| errors[at]);
                law.taps[i] * (volt + law.gain * error)
            };
            let learnt: f64 = (0..law.taps.len()).map(delayed).sum();
            let expected = law.pole * volts.last().copied().unwrap_or(0.0) + learnt;
            let got = sampled.step(&mut state, before, f64::INFINITY);
            let scale = volts.iter().fold(1e3, |most, v| f64::max(most, v.abs()));
            prop_assert!((got - expected).abs() <= 1e-9 * scale, "{got} {expected} at {k}");
            volts.push(got);
            before = Outcome { error: errors[k], excess: 0.0 };
        }
    }

    #[test]
    fn a_period_of_whole_samples_is_the_printed_law(
        samples in 3..50_u32,
        (kq, forgetting_factor) in (0.01..1.99_f64, 0.5..=1.0_f64),
        (tq, lag) in (0.01..1.0_f64, any::<bool>()),
        errors in prop::collection::vec(around(1e-5), 1..200),
    ) {
        // Without a filter uRC[k] = q (uRC[k-L] + Kq e[k-L]); behind a lag of pole p and one
        // sample, uRC[k] = p uRC[k-1] + q (1 - p) (uRC[k-L-1] + Kq e[k-L-1]).
        let smoothing =
            if lag { Smoothing::Lag { tq, compensated: false } } else { Smoothing::None };
        let period = f64::from(samples) * DT;
        let learner = Repetitive {
            forgetting_factor, lead: 0, pause: false, ..Repetitive::new(period, smoothing, kq).unwrap()
        };
        let sampled = learner.at(DT).unwrap();
        let (pole, delay) = if lag { ((-DT / tq).exp(), samples + 1) } else { (0.0, samples) };
        let mut state = sampled.rest(vec![0.0; sampled.length()]).unwrap();
        let mut volts: Vec<f64> = Vec::new();
        let mut before = Outcome::default();
        for k in 0..errors.len() {
            let learnt =
                k.checked_sub(delay as usize).map_or(0.0, |at| volts[at] + kq * 1e6 * errors[at]);
            let expected = pole * volts.last().copied().unwrap_or(0.0)
                + forgetting_factor * (1.0 - pole) * learnt;
            let got = sampled.step(&mut state, before, f64::INFINITY);
            prop_assert!((got - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{got} {expected}");
            volts.push(got);
            before = Outcome { error: errors[k], excess: 0.0 };
        }
    }
}
