//! Feedforward in single precision beside the same in double, within bounds of rounding.
//!
//! As in [`super::single_precision`]: an operation in `f32` is off by at most [`U`] of its result.
#![allow(missing_docs, clippy::unwrap_used)]

use core::f64::consts::TAU;

use piezotrack_control::hysteresis::{AsymmetricPlay, LuGre, Play, PlayFamily};
use piezotrack_control::inverse::{NetworkNumbers, NeuralNetworkInverse};
use piezotrack_control::{
    AsymmetricBoucWenInverse, AsymmetricPlayInverse, BoucWenInverse, Cast, Creep, CreepingInverse,
    DahlInverse, Dynamics, FirstOrderDahlInverse, InputInverse, Inverse, Limits, LuGreInverse,
    Mode, Modes, ModesInverse, OnlineFeedforward, OscillatorInverse, ParallelDahlInverse,
    PrandtlIshlinskiiInverse, Real, ReferenceSample, Snapshot,
};

const DT: f64 = 1e-3;
const SAMPLES: u32 = 2500;
/// Largest relative error of a rounding to `f32`.
const U: f64 = 0.5 * f32::EPSILON as f64;
/// Samples of which friction remembers the roundings: half a wave has 125, and is at least twice as
/// long as the path along which what was before falls by e.
const REMEMBERED: f64 = 125.0 * 1.2;
/// Largest displacement, velocity and acceleration of the reference, in SI units.
const LARGEST: [f64; 3] = [60e-6, 30e-6 * 4.0 * TAU, 30e-6 * 16.0 * TAU * TAU];

/// A raised cosine of 4 Hz, in which a smaller one turns within the loop.
fn reference(k: u32) -> [f64; 3] {
    let (w, t) = (4.0 * TAU, DT * f64::from(k));
    let (sin, cos) = (w * t).sin_cos();
    [30e-6 * (1.0 - cos), 30e-6 * w * sin, 30e-6 * w * w * cos]
}

/// The drives for a reference whose derivatives are known, or for the displacements alone.
fn drives<I: Inverse<T>, T: Real>(
    feedforward: &OnlineFeedforward<I, T>,
    cast: fn(f64) -> T,
    known: bool,
) -> Vec<f64> {
    let mut state = feedforward.rest();
    let step = |k| {
        let [x, v, a] = reference(k).map(cast);
        let sample = ReferenceSample {
            velocity: known.then_some(v),
            acceleration: known.then_some(a),
            preview: Some(cast(reference(k + 1)[0])),
            ..ReferenceSample::new(x)
        };
        feedforward.step(&mut state, &sample).into()
    };
    (0..SAMPLES).map(step).collect()
}

/// Largest difference, V, and largest drive, V.
fn apart<I>(inverse: I, known: bool) -> [f64; 2]
where
    I: Inverse + Cast,
    I::In<f32>: Inverse<f32>,
{
    let double = OnlineFeedforward::new(inverse, DT, 0.0, 0.0).unwrap();
    let single = double.cast::<f32>().unwrap();
    let single = drives(&single, f32::of, known);
    let double = drives(&double, |value| value, known);
    assert!(double.iter().chain(&single).all(|volts| volts.is_finite()));
    let pairs = double.iter().zip(&single).map(|(one, other)| (one - other).abs());
    [pairs.fold(0.0, f64::max), double.iter().map(|volts| volts.abs()).fold(0.0, f64::max)]
}

/// Roundings of three products of two rounded factors, and of their sums.
fn linear([x, v, a]: [f64; 3]) -> f64 {
    6.0 * U * (x * LARGEST[0] + v * LARGEST[1] + a * LARGEST[2])
}

/// Roundings of second and first differences of rounded displacements, and of their own.
fn differences([_, v, a]: [f64; 3]) -> f64 {
    let x = U * LARGEST[0];
    2.0 * v * x / DT + 6.0 * a * x / (DT * DT)
}

/// Between two turns the state of the Dahl operator, (sqrt(a2) q1, q2), is turned by a matrix that
/// does not expand it. Its roundings go to either side and decay along the path, and those of the
/// ends of a move cancel in the next one: all of them together are below three of its largest force.
#[test]
fn the_inverse_of_a_dahl_stage_differs_by_the_roundings_of_its_samples() {
    let inverse = DahlInverse::xu_li_2010().at(DT).unwrap();
    let [inertia, damping, stiffness, level, _, _, a2, up, _] = inverse.coefficients();
    let root = f64::sqrt(a2);
    // Where the force has its largest slope, and while it rises from there.
    let state = 2.0 * up * LARGEST[0];
    let weights = [stiffness, damping, inertia];
    for known in [true, false] {
        let [found, largest] = apart(inverse, known);
        let mut bound = linear(weights) + 3.0 * U * (level * state / root + largest);
        bound += if known { 0.0 } else { differences(weights) };
        assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
        assert!(bound < 0.01 * largest, "{bound} V of {largest} V");
    }
}

/// Two equations give displacement and velocity of the mechanics behind the creep, whose output is
/// a share of both: ten roundings of each, and the velocity is a difference over an interval.
#[test]
fn the_inverse_of_a_stage_that_creeps_differs_by_the_roundings_of_its_mechanics() {
    let stage = DahlInverse::xu_li_2010().at(DT).unwrap();
    let creep = [Creep { share: 0.02, time: 0.1 }];
    let inverse = CreepingInverse::<_, 1>::new(stage, &creep, DT).unwrap();
    let [alone, _] = apart(stage, true);
    let [found, largest] = apart(inverse, true);
    let [inertia, damping, stiffness, ..] = stage.coefficients();
    let memory = 1.0 + 0.04 / (1.0 - f64::exp(-DT / 0.1));
    let mechanics = memory * 10.0 * U * LARGEST[0];
    let bound = 2.0 * alone + mechanics * (stiffness + damping / DT + inertia / (DT * 0.1));
    assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
    assert!(bound < 0.01 * largest, "{bound} V of {largest} V");
}

/// Deflections decay towards their limit along the path, as those of Dahl friction do.
#[test]
fn the_inverse_of_lugre_friction_differs_by_the_roundings_of_its_samples() {
    let friction = LuGre {
        rest_stiffness: 1e4,
        micro_damping: 5.0,
        coulomb_force: 0.05,
        static_force: 0.07,
        stribeck_velocity: 1e-3,
    };
    let inverse = LuGreInverse::new([0.18, 50.0, 2.6e4], 0.0468, &friction, DT).unwrap();
    let [found, largest] = apart(inverse, true);
    let sample = 1e4 * 3.0 * U * LARGEST[0] + 100.0 * U * 0.07;
    let weights = [2.6e4 / 0.0468, 55.0 / 0.0468, 0.18 / 0.0468];
    let bound = linear(weights) + REMEMBERED * sample / 0.0468;
    assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
    assert!(bound < 0.1 * largest, "{bound} V of {largest} V");
}

/// A network has no memory but its plays, and tanh does not expand.
#[test]
fn a_network_differs_by_the_roundings_of_a_sample() {
    let numbers = NetworkNumbers {
        centre: 30e-6,
        scales: [30e-6, 1e-3, 1.0],
        thresholds: &[0.1, 0.3],
        hidden: &[0.5, 0.1, 0.0, -0.4, 0.2, -0.3, 0.0, 0.1, 0.2, 0.1],
        biases: &[0.1, -0.2],
        outputs: &[3.0, -2.0],
        direct: &[20.0, 1.0, 0.1, 2.0, 3.0],
        offset: 35.0,
    };
    let inverse = NeuralNetworkInverse::new(&numbers).unwrap();
    let [found, largest] = apart(inverse, true);
    // Scaled inputs up to one (and the velocity up to one, the acceleration up to twenty), each of
    // six roundings; the scaled displacement is a difference of numbers of twice its size.
    let inputs = 8.0 * U * (26.1 + 3.0 * 1.2 + 2.0 * 0.7) + 8.0 * U * 20.0 * 0.1;
    let bound = inputs + 16.0 * U * largest;
    assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
}

/// Friction decays towards its limit along the path, and with it each sample's roundings.
#[test]
fn inverses_of_friction_differ_by_the_roundings_of_their_samples() {
    let (mass, damping, stiffness, piezo) = (0.18, 50.0, 2.6e4, 0.0468);
    let weights = [stiffness / piezo, damping / piezo, mass / piezo];
    // Moves are off by three roundings, the exponential by thirty operations of its series.
    let bound = |slope: f64, force: f64| {
        let sample = slope * 3.0 * U * LARGEST[0] + 30.0 * U * force;
        linear(weights) + REMEMBERED * sample / piezo
    };
    let one = |exponent: f64| {
        let friction = (1e4, 0.05, exponent);
        FirstOrderDahlInverse::new(mass, damping, stiffness, piezo, friction, DT).unwrap()
    };
    // A power's relative error is that of its logarithm too, below 20.
    for (inverse, times) in [(one(1.0), 1.0), (one(1.5), 20.0)] {
        let [found, largest] = apart(inverse, true);
        let bound = times * bound(1e4, 0.05);
        assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
        assert!(bound < 0.1 * largest, "{bound} V of {largest} V");
    }
    let friction = ([3e3, 2e3, 1e3], 2e-6, 3.5);
    let inverse = ParallelDahlInverse::new(mass, damping, stiffness, piezo, friction, DT).unwrap();
    let [found, _] = apart(inverse, true);
    let bound = bound(6e3, 3e3 * 2e-6 + 2e3 * 7e-6 + 1e3 * 24.5e-6);
    assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
}

/// Bounded, as beta + gamma is above 0, and dissipative: two outputs do not part along a path.
#[test]
fn the_inverse_of_an_oscillator_differs_by_the_roundings_of_its_samples() {
    for exponent in [1.0, 1.6] {
        let (alpha, limit) = (2e4_f64, 0.2_f64);
        // (A/(beta + gamma))^(1/n) is the limit.
        let rate = alpha / limit.powf(exponent);
        let hysteresis = (alpha, 0.6 * rate, 0.4 * rate, exponent);
        let inverse = OscillatorInverse::new(0.18, 50.0, 2.6e4, hysteresis, DT).unwrap();
        let [found, _] = apart(inverse, true);
        // Of a power and a series, in seven pieces of the path that decays.
        let operations = if exponent > 1.0 { 7.0 * 60.0 } else { 60.0 };
        let sample = alpha * 3.0 * U * LARGEST[0] + operations * U * limit;
        let bound = linear([2.6e4, 50.0, 0.18]) + REMEMBERED * sample;
        assert!(found > 0.0 && found < bound, "{found} N of {bound} N");
    }
}

/// The drive is found to four roundings of displacements, over what the slope of the hysteresis
/// leaves of that of the drive; friction decays along the path.
#[test]
fn the_inverse_of_a_bouc_wen_stage_differs_by_the_roundings_of_its_samples() {
    let (mass, damping, stiffness, piezo) = (0.01, 5.0, 1e5, 1e-6);
    let (alpha, beta, gamma) = (0.3, 0.06, 0.04);
    let stage = |n| BoucWenInverse::new(mass, damping, stiffness, piezo, alpha, beta, gamma, n);
    let rates = [beta, gamma, 0.01, 0.005];
    let other = [mass, damping, stiffness, piezo];
    let asymmetric = AsymmetricBoucWenInverse::asymmetric(other, alpha, rates).unwrap();
    for [found, largest] in [apart(stage(1.0).unwrap(), true), apart(asymmetric, true)] {
        let before = linear([1.0, damping / stiffness, mass / stiffness]);
        let solved = 8.0 * U * (LARGEST[0] + piezo * largest);
        let bound = (before + solved) / (piezo * (1.0 - 2.0 * alpha * 0.06 / 0.1));
        assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
    }
}

/// Plays remember displacements, not sums: no rounding of a sample outlasts the next turn there,
/// and creep forgets them by its pole.
#[test]
fn the_inverse_of_plays_differs_by_the_roundings_of_a_sample() {
    let play = Play {
        linear: 1e-6,
        thresholds: [5.0, 15.0],
        weights: [0.2e-6, 0.1e-6],
        dead_zone_thresholds: [30e-6],
        dead_zone_weights: [0.1],
    };
    let creep = [Creep { share: 0.01, time: 0.5 }];
    let memory = 1.0 + 0.02 / (1.0 - f64::exp(-DT / 0.5));
    let dynamics = [
        Dynamics::None,
        Dynamics::First { time: 2e-3 },
        Dynamics::Second { frequency: 160.0, damping_ratio: 0.05 },
    ];
    for one in dynamics {
        let inverse = PrandtlIshlinskiiInverse::<2, 1, 1>::new(&play, &creep, one, DT).unwrap();
        let [found, largest] = apart(inverse, true);
        // Displacement and derivatives below 70 um together; ten operations before the plays; the
        // slopes of the inverse, in magnitude, add up to less than three of the first.
        let before = memory * 13.0 * U * 70e-6 + linear([1.0, 2e-3, 1e-6]);
        let bound = 3.0 / 1e-6 * before + 10.0 * U * largest;
        assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
        assert!(bound < 1e-3 * largest, "{bound} V of {largest} V");
    }
}

/// Of asymmetric plays the drive is searched for: the operator's sum has roundings of displacements,
/// its curves some of a drive, over the least slope.
#[test]
fn the_inverse_of_asymmetric_plays_differs_by_the_roundings_of_a_sample() {
    let family = PlayFamily { thresholds: [2.0, 6.0], weights: [0.06e-6, 0.03e-6], count: 2 };
    let families = [family; 3];
    let operator = AsymmetricPlay { linear: 1e-6, range: (0.0, 75.0), families };
    let inverse = AsymmetricPlayInverse(operator);
    let inverse = InputInverse::<_, 0>::with(inverse, 0.0, &[], Dynamics::None, DT).unwrap();
    let [found, largest] = apart(inverse, true);
    // A product and a sum of each play and of the straight path; ten operations of a curve and its
    // play, whose weights and slopes add up to less than the straight path.
    let bound = 2.0 * 7.0 * U * LARGEST[0] / 1e-6 + 10.0 * U * 75.0 + 4.0 * U * largest;
    assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
    assert!(bound < 1e-5 * largest, "{bound} V of {largest} V");
}

/// A stable filter of fourth order at most: what a rounding adds decays as its answer does.
#[test]
fn the_inverse_of_modes_differs_by_the_answer_of_its_filter() {
    let second = Mode { weight: 0.3, frequency: 400.0, damping_ratio: 0.1 };
    let modes = Modes::new(150.0, 0.05, &[second]).unwrap();
    let inverse = ModesInverse::new(&modes, DT).unwrap();
    let single = inverse.cast::<f32>().unwrap();
    let ([x, v, a], begin) = (reference(0), |of: [f64; 3]| of.map(f32::of));
    let mut one = inverse.begin(x, v, a);
    let [x, v, a] = begin([x, v, a]);
    let mut other = single.begin(x, v, a);
    let (mut found, mut largest) = (0.0_f64, 0.0_f64);
    for k in 1..SAMPLES {
        let [x, v, a] = reference(k);
        inverse.step(&mut one, x, v, a);
        let [x, v, a] = begin([x, v, a]);
        single.step(&mut other, x, v, a);
        let (double, single) = (inverse.output(&one), single.output(&other));
        found = found.max((double - f64::from(single)).abs());
        largest = largest.max(double.abs());
    }
    // The state of the filter after a step from nothing, whose sum its roundings cannot exceed.
    let mut state = inverse.begin(0.0, 0.0, 0.0);
    let mut answer = 0.0;
    for k in 0..SAMPLES {
        inverse.step(&mut state, if k == 0 { 1.0 } else { 0.0 }, 0.0, 0.0);
        answer += inverse.output(&state).abs();
    }
    let bound = (1.0 + answer) * 30.0 * U * 70e-6;
    assert!(found > 0.0 && found < bound, "{found} m of {bound} m");
}

/// A clipped drive is found again to sixteen roundings of the drives that it is compared with; what
/// the inverse remembers is off by as little.
#[test]
fn a_clipped_drive_is_remembered_in_single_precision() {
    fn clipped<I: Inverse<T>, T: Real>(
        feedforward: &OnlineFeedforward<I, T>,
        limits: &Limits<T>,
        cast: fn(f64) -> T,
    ) -> Vec<f64> {
        let mut state = feedforward.rest();
        let step = |k| {
            let [x, v, a] = reference(k).map(cast);
            let (velocity, acceleration) = (Some(v), Some(a));
            let sample = ReferenceSample { velocity, acceleration, ..ReferenceSample::new(x) };
            feedforward.step_within(&mut state, &sample, limits).into()
        };
        (0..SAMPLES).map(step).collect()
    }
    let limits = Limits::new(0.0, 40.0).unwrap();
    let play = Play {
        linear: 1e-6,
        thresholds: [5.0, 15.0],
        weights: [0.2e-6, 0.1e-6],
        dead_zone_thresholds: [],
        dead_zone_weights: [],
    };
    let inverse = PrandtlIshlinskiiInverse::<2, 0, 0>::new(&play, &[], Dynamics::None, DT).unwrap();
    let double = OnlineFeedforward::new(inverse, DT, 0.0, 0.0).unwrap();
    let single = double.cast::<f32>().unwrap();
    let single = clipped(&single, &limits.cast().unwrap(), f32::of);
    let double = clipped(&double, &limits, |value| value);
    assert!(double.iter().filter(|volts| **volts > 40.0).count() > 100);
    let pairs = double.iter().zip(&single).map(|(one, other)| (one - other).abs());
    let found = pairs.fold(0.0, f64::max);
    let largest = double.iter().copied().fold(0.0, f64::max);
    let same = 32.0 * U * (largest + 40.0 + 40.0);
    // A play's inverse passes it on thrice at most, and then the roundings of a sample.
    let bound = 3.0 * same + 3.0 / 1e-6 * 13.0 * U * 70e-6 + 10.0 * U * largest;
    assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
}

#[test]
fn the_state_of_a_feedforward_in_single_precision_is_kept_as_numbers() {
    let inverse = DahlInverse::xu_li_2010().at(DT).unwrap();
    let feedforward = OnlineFeedforward::new(inverse, DT, 0.0, 0.0).unwrap();
    let single = feedforward.cast::<f32>().unwrap();
    let mut state = single.rest();
    for k in 0..40 {
        let position = f32::of(reference(k)[0]);
        single.step(&mut state, &ReferenceSample::new(position));
    }
    let mut kept = Vec::new();
    state.save(&mut |number| kept.push(number));
    let (mut restored, mut numbers) = (single.rest(), kept.iter().copied());
    assert!(restored.load(&mut || numbers.next()).is_some());
    let next = ReferenceSample::new(f32::of(reference(40)[0]));
    let there = single.step(&mut state, &next);
    assert_eq!(there.to_bits(), single.step(&mut restored, &next).to_bits());
}
