//! The online feedforward: its differences, its delay compensation, and the inverses behind it.
#![allow(missing_docs, clippy::unwrap_used, clippy::float_cmp)]

use core::f64::consts::{PI, TAU};

use piezotrack_control::hysteresis::{Operator, Play};
use piezotrack_control::inverse::after_drive;
use piezotrack_control::{
    BoucWenInverse, Creep, DahlInverse, Dynamics, FirstOrderDahlInverse, InputInverse, Inverse,
    Limits, OnlineFeedforward, OperatorInverse, OscillatorInverse, PlayInverse,
    PrandtlIshlinskiiInverse, ReferenceSample,
};
use piezotrack_core::models::{
    Experiment, InputOperator, InputStageState, Invertible, PlayHysteresis, PrandtlIshlinskiiStage,
    Relaxation, StageModel,
};
use piezotrack_core::signal::{Drive, Hold, NEVER};

/// Passes on the displacement, the velocity or the acceleration that reach an inverse.
struct Probe(usize);

impl Inverse for Probe {
    type State = ();

    fn rest(&self) {}

    fn step(&self, (): &mut (), x: f64, v: f64, a: f64) -> f64 {
        [x, v, a][self.0]
    }
}

fn probe(what: usize, dt: f64, delay: f64) -> OnlineFeedforward<Probe> {
    OnlineFeedforward::new(Probe(what), dt, 0.0, delay).unwrap()
}

const AMPLITUDE: f64 = 40e-6;
const OMEGA: f64 = TAU * 5.0;

/// Displacement, velocity and acceleration of a sine.
fn sine(t: f64) -> [f64; 3] {
    let (sin, cos) = (OMEGA * t).sin_cos();
    [AMPLITUDE * sin, AMPLITUDE * OMEGA * cos, -AMPLITUDE * OMEGA * OMEGA * sin]
}

fn at(t: f64) -> ReferenceSample {
    ReferenceSample::new(sine(t)[0])
}

fn with_preview(t: f64, dt: f64) -> ReferenceSample {
    ReferenceSample { preview: Some(sine(t + dt)[0]), ..at(t) }
}

fn with_derivatives(t: f64) -> ReferenceSample {
    let [position, v, a] = sine(t);
    ReferenceSample { position, velocity: Some(v), acceleration: Some(a), preview: None }
}

/// Largest deviation of what a probe shows from `expected(t)` over a period, after the start.
fn worst(
    feedforward: &OnlineFeedforward<Probe>,
    dt: f64,
    sample: impl Fn(f64) -> ReferenceSample,
    expected: impl Fn(f64) -> f64,
) -> f64 {
    let mut state = feedforward.rest();
    let mut worst = 0.0;
    let mut k = 0_u32;
    while f64::from(k) * dt < 0.2 {
        let t = f64::from(k) * dt;
        let shown = feedforward.step(&mut state, &sample(t));
        if k > 2 {
            worst = f64::max(worst, (shown - expected(t)).abs());
        }
        k += 1;
    }
    worst
}

#[test]
fn central_differences_are_of_second_order() {
    for (what, third) in [(1, OMEGA.powi(2) / 6.0), (2, OMEGA.powi(2) / 12.0)] {
        let scale = AMPLITUDE * OMEGA.powi(i32::try_from(what).unwrap());
        let error = |dt: f64| {
            let sample = |t: f64| with_preview(t, dt);
            worst(&probe(what, dt, 0.0), dt, sample, |t| sine(t)[what]) / scale
        };
        let (coarse, fine) = (error(1e-3), error(5e-4));
        assert!((coarse / fine - 4.0).abs() < 0.01, "{what}: {coarse} {fine}");
        // The first term left out of the Taylor series.
        assert!((coarse / (third * 1e-6) - 1.0).abs() < 0.01, "{what}: {coarse}");
    }
}

#[test]
fn without_preview_the_velocity_is_half_a_sample_and_the_acceleration_one_sample_late() {
    for (what, samples) in [(1, 0.5), (2, 1.0)] {
        let scale = AMPLITUDE * OMEGA.powi(i32::try_from(what).unwrap());
        let error = |dt: f64, late: f64| {
            worst(&probe(what, dt, 0.0), dt, at, |t| sine(t - late * dt)[what]) / scale
        };
        // Against the derivative of now the error is of first order, that of the lag ...
        let (coarse, fine) = (error(1e-3, 0.0), error(5e-4, 0.0));
        assert!((coarse / fine - 2.0).abs() < 0.05, "{what}: {coarse} {fine}");
        assert!((coarse / (samples * OMEGA * 1e-3) - 1.0).abs() < 0.05, "{what}: {coarse}");
        // ... and against the late one of second order.
        let (coarse, fine) = (error(1e-3, samples), error(5e-4, samples));
        assert!((coarse / fine - 4.0).abs() < 0.05, "{what}: {coarse} {fine}");
    }
}

#[test]
fn the_delay_is_compensated_to_third_order() {
    let dt = 1e-3;
    let error = |what: usize, delay: f64| {
        worst(&probe(what, dt, delay), dt, with_derivatives, |t| sine(t + delay)[what])
    };
    let (coarse, fine) = (error(0, 4e-3), error(0, 2e-3));
    assert!((coarse / fine - 8.0).abs() < 0.2, "{coarse} {fine}");
    assert!((coarse / (AMPLITUDE * (OMEGA * 4e-3).powi(3) / 6.0) - 1.0).abs() < 0.05, "{coarse}");
    let (coarse, fine) = (error(1, 4e-3), error(1, 2e-3));
    assert!((coarse / fine - 4.0).abs() < 0.1, "{coarse} {fine}");
}

#[test]
fn the_offset_is_taken_off_and_the_first_sample_stands_still() {
    let shown = |what: usize| {
        let feedforward = OnlineFeedforward::new(Probe(what), 1e-3, 0.5e-6, 0.01).unwrap();
        feedforward.step(&mut feedforward.rest(), &ReferenceSample::new(2e-6))
    };
    assert_eq!([shown(0), shown(1), shown(2)], [1.5e-6, 0.0, 0.0]);
}

#[test]
fn derivatives_that_are_given_are_used_as_they_are() {
    let sample = ReferenceSample {
        position: 1e-6,
        velocity: Some(2e-3),
        acceleration: Some(-0.25),
        preview: Some(7e-6),
    };
    for (what, expected) in [1e-6, 2e-3, -0.25].into_iter().enumerate() {
        let feedforward = probe(what, 1e-3, 0.0);
        assert_eq!(feedforward.step(&mut feedforward.rest(), &sample), expected);
    }
}

#[test]
fn a_reference_that_is_missing_goes_on_with_its_velocity() {
    let dt = 1e-3;
    let ramp = |k: u32| 1e-6 + 3e-6 * f64::from(k);
    let feedforward = probe(1, dt, 0.0);
    for missing in [f64::NAN, f64::INFINITY] {
        let mut state = feedforward.rest();
        let first = feedforward.step(&mut state, &ReferenceSample::new(missing));
        assert!(!first.is_finite());
        assert_eq!(state, feedforward.rest()); // nothing to go on from
        for k in 0..20 {
            let lost = (5..=7).contains(&k);
            let position = if lost { missing } else { ramp(k) };
            let v = feedforward.step(&mut state, &ReferenceSample::new(position));
            if lost {
                assert!(!v.is_finite());
            } else if k > 0 {
                assert!((v - 3e-3).abs() < 1e-15, "{v} at {k}");
            }
        }
    }
}

#[test]
fn numbers_out_of_range_are_refused() {
    let refused = |dt: f64, offset: f64, delay: f64| {
        OnlineFeedforward::new(Probe(0), dt, offset, delay).map(drop).unwrap_err().name
    };
    assert_eq!(refused(0.0, 0.0, 0.0), "dt");
    assert_eq!(refused(1e-3, f64::NAN, 0.0), "offset");
    assert_eq!(refused(1e-3, 0.0, -1e-6), "delay");
}

/// A reference that starts smoothly from rest at 0.
fn raised(t: f64) -> [f64; 3] {
    let (sin, cos) = (OMEGA * t).sin_cos();
    let a = AMPLITUDE;
    [a * (1.0 - cos), a * OMEGA * sin, a * OMEGA * OMEGA * cos]
}

/// Largest difference between online feedforward, with preview, and the inverse fed with the
/// derivatives of the reference, as a share of the largest drive.
fn deviation<I: Inverse>(make: impl Fn(f64) -> I, dt: f64) -> f64 {
    let whole = make(dt);
    let mut along = whole.rest();
    let online = OnlineFeedforward::new(make(dt), dt, 0.0, 0.0).unwrap();
    let mut state = online.rest();
    let (mut worst, mut largest) = (0.0, 0.0);
    let mut k = 0_u32;
    while f64::from(k) * dt < 0.4 {
        let t = f64::from(k) * dt;
        let [x, v, a] = raised(t);
        let preview = Some(raised(t + dt)[0]);
        let sample = ReferenceSample { preview, ..ReferenceSample::new(x) };
        let exact = whole.step(&mut along, x, v, a);
        let found = online.step(&mut state, &sample);
        // The first sample counts as having stood still.
        if k > 0 {
            worst = f64::max(worst, (found - exact).abs());
        }
        largest = f64::max(largest, exact.abs());
        k += 1;
    }
    assert!(largest > 0.0 && worst.is_finite());
    worst / largest
}

#[test]
fn every_inverse_gives_the_drive_of_the_exact_derivatives() {
    let dahl = |dt: f64| DahlInverse::xu_li_2010().at(dt).unwrap();
    let first = |dt: f64| {
        FirstOrderDahlInverse::new(0.18, 50.0, 2.6e4, 0.0468, (1e4, 0.3, 1.0), dt).unwrap()
    };
    let oscillator =
        |dt: f64| OscillatorInverse::new(0.18, 50.0, 2.6e4, (1e4, 2e4, -1e4, 1.0), dt).unwrap();
    let bouc_wen = |_| BoucWenInverse::new(0.2, 40.0, 2e4, 1.2e-6, 0.3, 0.05, 0.02, 1.0).unwrap();
    let prandtl_ishlinskii = |dt: f64| {
        let creep = [Creep { share: 0.01, time: 0.1 }];
        PrandtlIshlinskiiInverse::<3, 1, 1>::new(&PLAY, &creep, MODE, dt).unwrap()
    };
    let errors = |dt: f64| {
        [
            deviation(dahl, dt),
            deviation(first, dt),
            deviation(oscillator, dt),
            deviation(bouc_wen, dt),
            deviation(prandtl_ishlinskii, dt),
        ]
    };
    // (w dt)^2 / 6 = 1.6e-6 of the velocity and half as much of the acceleration.
    for (coarse, fine) in errors(1e-4).into_iter().zip(errors(5e-5)) {
        assert!(coarse < 2e-6 && fine < 0.3 * coarse, "{coarse} {fine}");
    }
}

/// Weights in m/V, dead zones in m.
const PLAY: Play<f64, 3, 1> = Play {
    linear: 1e-6,
    thresholds: [4.0, 10.0, 20.0],
    weights: [0.2e-6, 0.1e-6, 0.15e-6],
    dead_zone_thresholds: [30e-6],
    dead_zone_weights: [0.1],
};
const MODE: Dynamics = Dynamics::Second { frequency: 300.0, damping_ratio: 0.05 };

/// A drive that turns at places which do not repeat, V.
fn path(count: u32) -> Vec<f64> {
    let wave = |t: f64| 25.0 * t.sin() + 12.0 * (2.7 * t).sin() + 3.0 * (17.3 * t).sin();
    (0..count).map(|k| wave(0.01 * f64::from(k))).collect()
}

const CREEP: [Creep; 2] = [Creep { share: 0.02, time: 0.03 }, Creep { share: 0.01, time: 2.0 }];

fn stage() -> PrandtlIshlinskiiStage {
    let Play { linear, thresholds, weights, dead_zone_thresholds, dead_zone_weights } = PLAY;
    let (shares, times) = (CREEP.map(|one| one.share), CREEP.map(|one| one.time));
    PrandtlIshlinskiiStage {
        operator: PlayHysteresis::new(
            linear,
            &thresholds,
            &weights,
            &dead_zone_thresholds,
            &dead_zone_weights,
        )
        .unwrap(),
        relaxation: Relaxation::new(&shares, &times, Dynamics::None).unwrap(),
    }
}

/// Displacements of a stage whose hysteresis goes in a straight line from sample to sample, as its
/// inverse has it: of the hysteresis of a straight drive where no play starts to move, m.
fn straight(
    stage: &PrandtlIshlinskiiStage,
    mut state: InputStageState<<PlayHysteresis as InputOperator>::State>,
    u: &[f64],
    dt: f64,
) -> Vec<f64> {
    let flow = stage.relaxation.flow(dt);
    let follow = |(k, volts): (usize, &f64)| {
        let h = stage.operator.follow(&mut state.operator, *volts) - stage.zero();
        if k == 0 {
            stage.relaxation.jump(&mut state.relaxation, h);
        } else {
            stage.relaxation.step(&flow, &mut state.relaxation, h);
        }
        state.relaxation.x
    };
    u.iter().enumerate().map(follow).collect()
}

#[test]
fn corners_between_samples_are_the_only_error_of_an_inverse() {
    // Of second order: each corner lies in a part of a step, in which hysteresis rises by a part.
    let error = |every: u32| {
        let (stage, dt) = (stage(), 0.01 / f64::from(every));
        let u: Vec<f64> = (0..5000 * every)
            .map(|k| f64::from(k) * dt)
            .map(|t| 25.0 * t.sin() + 12.0 * (2.7 * t).sin() + 3.0 * (17.3 * t).sin())
            .collect();
        let drive = Drive::new(&u, dt, Hold::First).unwrap();
        let run = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap();
        let (inverse, mut state) = stage.inverse(dt, None).unwrap();
        let off = run.x.iter().zip(&u).map(|(&x, volts)| {
            let found = inverse.step(&mut state, x, 0.0, 0.0);
            (found - volts).abs()
        });
        off.fold(0.0, f64::max)
    };
    let errors = [1, 4, 16].map(error);
    assert!(errors[0] < 1e-4 * 40.0, "{errors:?}");
    for pair in errors.windows(2) {
        assert!(pair[1] < pair[0] / 10.0, "{errors:?}");
    }
}

#[test]
fn hysteresis_and_creep_are_undone_to_rounding() {
    let (stage, dt) = (stage(), 0.01);
    let u = path(5000);
    let displacements = straight(&stage, stage.at_rest(), &u, dt);
    // The simulation's inverse with room for more, and one of just the size that is needed.
    let (roomy, mut first) = stage.inverse(dt, None).unwrap();
    let exact =
        PrandtlIshlinskiiInverse::<3, 1, 2>::new(&PLAY, &CREEP, Dynamics::None, dt).unwrap();
    let mut second = exact.rest();
    let largest = u.iter().fold(0.0, |most, volts| f64::max(most, volts.abs()));
    for (&x, &volts) in displacements.iter().zip(&u) {
        for found in [roomy.step(&mut first, x, 0.0, 0.0), exact.step(&mut second, x, 0.0, 0.0)] {
            assert!((found - volts).abs() < 1e-12 * largest, "{found} for {volts}");
        }
    }
}

#[test]
fn an_inverse_goes_on_from_where_a_stage_is() {
    let (stage, dt) = (stage(), 0.01);
    let u = path(3000);
    let (before, after) = u.split_at(1111);
    let drive = Drive::new(before, dt, Hold::First).unwrap();
    let middle = stage.simulate(&Experiment::of(&drive, NEVER)).unwrap().unwrap().last;
    let displacements = straight(&stage, stage.state(Some(&middle)).unwrap(), after, dt);
    let (inverse, memory) = stage.inverse(dt, Some(&middle)).unwrap();
    let feedforward = OnlineFeedforward::new(inverse, dt, 0.0, 0.0).unwrap();
    let mut state = feedforward.start(memory);
    for (&x, &volts) in displacements.iter().zip(after) {
        let found = feedforward.step(&mut state, &ReferenceSample::new(x));
        assert!((found - volts).abs() < 1e-12 * 40.0, "{found} for {volts}");
    }
}

#[test]
fn the_inverse_of_the_plays_alone_needs_no_derivatives() {
    let inverse = PlayInverse::new(&PLAY).unwrap();
    let feedforward = OnlineFeedforward::new(inverse, 1.0, 0.0, 0.0).unwrap();
    let (mut there, mut state) = (PLAY.rest(), feedforward.rest());
    for volts in path(2000) {
        let x = PLAY.follow(&mut there, volts);
        let found = feedforward.step(&mut state, &ReferenceSample::new(x));
        assert!((found - volts).abs() < 1e-12 * 40.0, "{found} for {volts}");
    }
}

#[test]
fn a_bad_sample_leaves_the_prandtl_ishlinskii_inverse_alone() {
    let inverse = PrandtlIshlinskiiInverse::<3, 1, 2>::new(&PLAY, &CREEP, MODE, 1e-3).unwrap();
    let mut state = inverse.rest();
    inverse.step(&mut state, 5e-6, 0.0, 0.0);
    let before = state;
    for bad in [f64::NAN, f64::INFINITY, -1e200] {
        assert!(inverse.step(&mut state, bad, 0.0, 0.0).is_nan());
        assert!(inverse.step(&mut state, 5e-6, bad, 0.0).is_nan());
        assert!(inverse.step(&mut state, 5e-6, 0.0, if bad < 0.0 { -1e300 } else { bad }).is_nan());
        assert_eq!(state, before);
    }
}

/// An operator that puts out at most 1 m.
#[derive(Clone, Copy)]
struct Saturated;

impl OperatorInverse for Saturated {
    type State = ();

    fn rest(&self) {}

    fn follow(&self, (): &mut (), output: f64) -> f64 {
        libm::atanh(output)
    }
}

#[test]
fn what_the_operator_cannot_put_out_leaves_no_trace() {
    let inverse = InputInverse::<_, 2>::with(Saturated, 0.0, &CREEP, Dynamics::None, 0.01).unwrap();
    let mut state = inverse.rest();
    assert!(inverse.step(&mut state, 2.0, 0.0, 0.0).is_nan());
    assert_eq!(state, inverse.rest());
    inverse.step(&mut state, 0.3, 0.0, 0.0);
    let before = state;
    assert!(inverse.step(&mut state, -2.0, 0.0, 0.0).is_nan());
    assert_eq!(state, before);
}

#[test]
fn stages_without_an_inverse_are_refused() {
    let refused = |play: Play<f64, 3, 1>, creep: &[Creep], dynamics: Dynamics, dt: f64| {
        PrandtlIshlinskiiInverse::<3, 1, 1>::new(&play, creep, dynamics, dt).unwrap_err().name
    };
    let none = Dynamics::None;
    assert_eq!(refused(PLAY, &[], none, 0.0), "dt");
    assert_eq!(refused(PLAY, &CREEP, none, 1e-3), "creep");
    assert_eq!(refused(PLAY, &[Creep { share: -0.1, time: 1.0 }], none, 1e-3), "creep_weights");
    assert_eq!(refused(PLAY, &[Creep { share: 0.1, time: 0.0 }], none, 1e-3), "creep_times");
    assert_eq!(refused(PLAY, &[], Dynamics::First { time: -PI }, 1e-3), "time_constant");
    assert_eq!(refused(Play { linear: 0.0, ..PLAY }, &[], none, 1e-3), "linear");
}

/// Counts how often an inverse is evaluated.
struct Counted<I>(I, core::cell::Cell<u32>);

impl<I: Inverse> Inverse for Counted<I> {
    type State = I::State;

    fn rest(&self) -> I::State {
        self.0.rest()
    }

    fn step(&self, state: &mut I::State, x: f64, v: f64, a: f64) -> f64 {
        self.1.set(self.1.get() + 1);
        self.0.step(state, x, v, a)
    }
}

/// Where the stage got another drive, the inverse is there for which it is the right one; it is found
/// in a number of evaluations that firmware can rely on.
#[test]
fn the_displacement_of_a_clipped_drive_takes_few_evaluations() {
    let dt = 0.02;
    let inverse = Counted(DahlInverse::xu_li_2010().at(dt).unwrap(), core::cell::Cell::new(0));
    let (mut before, mut sum, mut most, mut clipped) = (inverse.rest(), 0, 0, 0);
    let mut off = [0.0; 2];
    for k in 0..600 {
        let [x, v, a] = sine(0.037 * f64::from(k));
        let target = [x + AMPLITUDE, 0.1 * v, 0.01 * a];
        let mut state = before;
        let asked = inverse.step(&mut state, target[0], target[1], target[2]);
        let reached = asked.clamp(8.0, 50.0);
        if asked.to_bits() == reached.to_bits() {
            (before, off) = (state, [0.0; 2]);
            continue;
        }
        inverse.1.set(0);
        let (after, off_after) = after_drive(&inverse, &before, target, off, dt, reached).unwrap();
        sum += inverse.1.get();
        most = most.max(inverse.1.get());
        clipped += 1;
        let way = found_by_bisection(&inverse, &before, target, off, dt, reached);
        let difference = (off_after[0] - off[0] - way).abs();
        assert!(difference < 1e-15, "{k}: {difference:e} m");
        assert!((off_after[1] - way / dt).abs() < 1e-12, "{k}");
        (before, off) = (after, off_after);
    }
    assert!(clipped > 100, "{clipped}");
    assert!(most <= 42, "{most}");
    assert!(sum < 10 * clipped, "{sum} for {clipped}");
}

/// One sample of the reference that no stage can follow is forgotten: the stage did not go there.
#[test]
fn a_jump_of_the_reference_leaves_the_feedforward_as_it_was() {
    let dt = 1e-3;
    let limits = Limits::new(0.0, 75.0).unwrap();
    let voltages = |jump: f64| -> Vec<f64> {
        let inverse = DahlInverse::xu_li_2010().at(dt).unwrap();
        let feedforward = OnlineFeedforward::new(inverse, dt, 0.0, 0.0).unwrap();
        let mut state = feedforward.rest();
        let place = |k: i32| {
            let there = 50e-6 - 0.5 * AMPLITUDE * (TAU * 1e-3 * f64::from(k)).cos();
            there + if k == 300 { jump } else { 0.0 }
        };
        (0..1000)
            .map(|k| {
                let sample = ReferenceSample {
                    preview: Some(place(k + 1)),
                    ..ReferenceSample::new(place(k))
                };
                feedforward.step_within(&mut state, &sample, &limits)
            })
            .collect()
    };
    let (with, without) = (voltages(20e-6), voltages(0.0));
    let largest = |range: core::ops::Range<usize>| {
        range.map(|k| (with[k] - without[k]).abs()).fold(0.0, f64::max)
    };
    assert!(largest(299..302) > 75.0, "the jump is beyond the limits");
    assert!(largest(310..1000) < 0.1, "{} V", largest(310..1000));
}

/// The way by which a stage is off for a drive, by plain bisection over 2 mm.
fn found_by_bisection<I: Inverse>(
    inverse: &I,
    before: &I::State,
    [x, v, a]: [f64; 3],
    off: [f64; 2],
    dt: f64,
    volts: f64,
) -> f64 {
    let (mut low, mut high) = (-1e-3, 1e-3);
    for _ in 0..100 {
        let way = 0.5 * (low + high);
        let mut state = *before;
        let faster = way / dt;
        let asked =
            inverse.step(&mut state, x + off[0] + way, v + faster, a + (faster - off[1]) / dt);
        if asked < volts {
            low = way;
        } else {
            high = way;
        }
    }
    low
}
