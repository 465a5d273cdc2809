//! Controllers in lanes beside the same ones by themselves: the same bits, whatever comes in.

use core::ops::{Add, Div, Mul, Neg, Sub};

use piezotrack_control::{
    Cast, Controller, ControllerState, Filter, Limits, Lockstep, Number, Pid, PidState, Real,
    Repetitive, SampledPid, Snapshot, Span,
};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

use crate::control::{DT, ROOM, learner};
use crate::{any_number, around, cases, decades};

const LANES: usize = 4;

/// A vector of four lanes.
#[derive(Clone, Copy, Debug)]
struct Four<T>([T; LANES]);

impl<T: Real> Four<T> {
    fn paired(self, other: Self, function: impl Fn(T, T) -> T) -> Self {
        Self(core::array::from_fn(|i| function(self.0[i], other.0[i])))
    }
}

macro_rules! lane_by_lane {
    ($($trait:ident, $method:ident;)*) => {
        $(impl<T: Real> $trait for Four<T> {
            type Output = Self;

            fn $method(self, other: Self) -> Self {
                self.paired(other, $trait::$method)
            }
        })*
    };
}
lane_by_lane! { Add, add; Sub, sub; Mul, mul; Div, div; }

impl<T: Real> Neg for Four<T> {
    type Output = Self;

    fn neg(self) -> Self {
        Self(self.0.map(Neg::neg))
    }
}

impl<T: Real> Number for Four<T> {
    type Lane = T;

    fn like(self, value: f64) -> Self {
        self.each(T::of(value))
    }

    fn each(self, value: T) -> Self {
        Self([value; LANES])
    }

    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(core::array::from_fn(|i| self.0[i].mul_add(factor.0[i], term.0[i])))
    }

    fn sqrt(self) -> Self {
        Self(self.0.map(Number::sqrt))
    }

    fn lanewise<const A: usize>(arguments: [Self; A], function: impl Fn([T; A]) -> T) -> Self {
        Self(core::array::from_fn(|i| function(arguments.map(|argument| argument.0[i]))))
    }

    fn where_negative(self, yes: Self, no: Self) -> Self {
        Self(core::array::from_fn(|i| self.0[i].where_negative(yes.0[i], no.0[i])))
    }

    fn any_negative(self) -> bool {
        self.0.into_iter().any(Number::any_negative)
    }

    fn all_within(self, low: Self, high: Self) -> bool {
        (0..LANES).all(|i| self.0[i].all_within(low.0[i], high.0[i]))
    }

    fn lane(&self, lane: usize) -> T {
        self.0[lane]
    }

    fn by_lane(self, values: impl FnMut(usize) -> T) -> Self {
        Self(core::array::from_fn(values))
    }

    fn larger(self, other: Self) -> Self {
        self.paired(other, Number::larger)
    }

    fn smaller(self, other: Self) -> Self {
        self.paired(other, Number::smaller)
    }
}

/// Inputs of a sample: usual nearly always, so that most steps go in lanes.
#[derive(Clone, Debug)]
struct Sample {
    reference: f64,
    /// Added to the displacement that follows the voltage, in one lane or in all.
    beside: f64,
    lane: usize,
    feedforward: f64,
    /// 0 where the states are compared and the lanes go on from there, 1 where they are written only.
    settles: u32,
}

fn samples() -> impl Strategy<Value = Vec<Sample>> {
    let number = |usual: f64| prop_oneof![60 => around(usual), 1 => any_number()];
    let sample = move |amplitude: f64| {
        (number(amplitude), number(1e-6), 0..=LANES, number(10.0), 0..20_u32).prop_map(
            |(reference, beside, lane, feedforward, settles)| Sample {
                reference,
                beside,
                lane,
                feedforward,
                settles,
            },
        )
    };
    let amplitude = prop_oneof![4 => Just(60e-6), 1 => Just(0.03)];
    amplitude.prop_flat_map(move |amplitude| prop::collection::vec(sample(amplitude), 1..400))
}

prop_compose! {
    fn controller()(
        // Some of them soon overflow, in one of the types or the other.
        kp in prop_oneof![
            20 => decades(1e5, 3.0), 1 => decades(1e307, 1.0), 1 => decades(1e36, 1.0),
        ],
        (ti, td) in (decades(0.03, 2.0), decades(0.003, 2.0)),
        tt in prop_oneof![3 => Just(None), 1 => Just(Some(f64::INFINITY))],
        (integral, derivative) in (0..10_u32, any::<bool>()),
        (low, range) in (-60.0..20.0_f64, decades(60.0, 0.5)),
        filters in (prop::option::of(decades(5.0, 1.0)), prop::option::of(decades(5.0, 0.5))),
        narrow in 0..6_u32, jumps in 0..20_u32,
    ) -> Controller<SampledPid> {
        let ti = if integral == 0 { f64::INFINITY } else { ti };
        let pid = Pid::new(kp, ti, if derivative { td } else { 0.0 }, tt).unwrap();
        // Without back-calculation where that would be unstable, or the gain cannot be sampled.
        let plain = Pid::new(0.1e6, ti, td, Some(f64::INFINITY)).unwrap();
        let pid = pid.at(DT).or_else(|_| plain.at(DT));
        let mut one = Controller::new(Limits::new(low, low + range).unwrap(), pid.unwrap());
        one.filters = [
            filters.0.map(|cutoff| Filter::low_pass(cutoff, DT).unwrap()),
            filters.1.map(|notch| Filter::notch(notch, 0.5, 0.1, DT).unwrap()),
        ];
        if narrow == 0 {
            one.span = Span::new(-40e-6, 80e-6).unwrap();
        }
        if jumps == 0 {
            one.span = one.span.with_max_jump(30e-6).unwrap();
        }
        one
    }
}

/// Up to four controllers: with repetitive parts of one shape, of several, or some without.
fn controllers() -> impl Strategy<Value = Vec<Controller<SampledPid>>> {
    let gains = prop::collection::vec((controller(), 0.01..1.9_f64, learner()), 1..=LANES);
    (gains, prop::option::of(learner()), 0..6_u32).prop_map(|(gains, shared, kind)| {
        let sampled = |part: Repetitive| part.at(DT).ok();
        let with = |(i, (mut one, kq, own)): (usize, (Controller<SampledPid>, f64, Repetitive))| {
            let same = shared.and_then(|shared| sampled(Repetitive { kq, ..shared }));
            one.repetitive = match kind {
                0 => sampled(own),
                1 if i.is_multiple_of(2) => sampled(own),
                1 => None,
                _ => same,
            };
            one
        };
        gains.into_iter().enumerate().map(with).collect()
    })
}

type States<T> = Vec<ControllerState<PidState<T>, Vec<T>, T>>;

fn bits<T: Real>(states: &States<T>) -> Vec<u64> {
    let mut out = Vec::new();
    for state in states {
        state.save(&mut |number| out.push(number.to_bits()));
    }
    out
}

/// Steps the controllers in lanes, and each by itself, on a stage that follows the voltage.
fn agree<T: Real>(
    controllers: &[Controller<SampledPid<T>, T>],
    samples: &[Sample],
    lined: bool,
) -> Result<(), TestCaseError> {
    let zero = Four([T::ZERO; LANES]);
    let rest = || controllers.iter().map(|one| one.rest(vec![T::ZERO; ROOM]).unwrap()).collect();
    let (mut alone, mut states): (States<T>, States<T>) = (rest(), rest());
    // Room for parts of any shape, also where they have none in lanes.
    let mut line = vec![zero; if lined { ROOM } else { 0 }];
    prop_assert!(Lockstep::<Four<T>, Vec<T>>::room(controllers) <= ROOM);
    let mut together = Some(Lockstep::new(zero, controllers, &mut states, &mut line));
    let mut x = zero;
    for sample in samples {
        let (reference, feedforward) = (T::of(sample.reference), T::of(sample.feedforward));
        let disturbed = |lane: usize| lane == sample.lane || sample.lane == LANES;
        let measured =
            x.by_lane(|lane| x.0[lane] + T::of(if disturbed(lane) { sample.beside } else { 0.0 }));
        let Some(all) = &mut together else { break };
        let command = all.step(reference, measured, feedforward);
        for (lane, (one, state)) in controllers.iter().zip(&mut alone).enumerate() {
            let expected = one.step(state, reference, measured.0[lane], feedforward);
            let (volts, saturated) = (command.volts.0[lane], command.saturated.0[lane]);
            prop_assert_eq!(volts.into().to_bits(), expected.volts.into().to_bits());
            prop_assert_eq!(saturated, T::count(u32::from(expected.saturated)));
        }
        x = x + (command.volts * x.like(1.5e-6) - x) * x.like(0.9);
        if sample.settles < 2 {
            all.settle();
        }
        if sample.settles == 0 {
            prop_assert_eq!(bits(&states), bits(&alone));
            together = Some(Lockstep::new(zero, controllers, &mut states, &mut line));
        }
    }
    if let Some(all) = &mut together {
        all.settle();
    }
    prop_assert_eq!(bits(&states), bits(&alone));
    Ok(())
}

proptest! {
    #![proptest_config(cases(1))]

    #[test]
    fn controllers_in_lanes_have_the_bits_of_each_by_itself(
        controllers in controllers(), samples in samples(), lined in any::<bool>(),
    ) {
        agree(&controllers, &samples, lined)?;
        let single: Vec<Controller<SampledPid<f32>, f32>> =
            controllers.iter().filter_map(|one| one.cast().ok()).collect();
        agree(&single, &samples, lined)?;
    }
}

#[test]
fn a_law_that_overflows_in_lanes_has_the_bits_of_one_by_itself() {
    let limits = Limits::new(0.0, 75.0).unwrap();
    let at = |kp: f64| {
        let pid = Pid::new(kp, DT, 0.0, Some(f64::INFINITY)).unwrap();
        Controller::new(limits, pid.at(DT).unwrap())
    };
    let sample = |k: u32| Sample {
        // At rest first: what is huge does not begin in lanes.
        reference: match k {
            0..5 => 0.0,
            _ if k % 300 < 200 => 0.02,
            _ => -0.02,
        },
        beside: 0.0,
        lane: 0,
        feedforward: 0.0,
        settles: if k.is_multiple_of(150) { 0 } else { 2 },
    };
    let samples: Vec<Sample> = (0..900).map(sample).collect();
    agree(&[at(1e4), at(1e308), at(1e5)], &samples, false).unwrap();
    let single: [Controller<SampledPid<f32>, f32>; 3] =
        [1e4, 1e38, 1e5].map(|kp| at(kp).cast().unwrap());
    agree(&single, &samples, false).unwrap();
}
