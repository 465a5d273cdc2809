//! A sampled controller on a continuous plant.
#![allow(
    missing_docs,
    clippy::panic,
    clippy::unwrap_used,
    clippy::float_cmp,
    clippy::cast_precision_loss
)]

use core::f64::consts::TAU;

use piezotrack_core::models::{
    BoucWenStage, DahlStage, Dynamics, Experiment, InputStage, Plant, PlayHysteresis, Relaxation,
    Stage, StageModel, StageState,
};
use piezotrack_core::signal::metrics::{each_period, tracking};
use piezotrack_core::signal::{Drive, Hold, NEVER};
use piezotrack_core::simulate::{
    Amplifier, Apparatus, ClosedLoop, Timing, VirtualStage, closed_loop, open_loop,
};

const UM: f64 = 1e-6;
const TS: f64 = 0.02;

/// Equations (22) to (25) of Xu and Li 2010 with the feedback's own past in the recursion.
fn pid(reference: &[f64], limits: (f64, f64)) -> impl FnMut(usize, f64) -> f64 {
    let (kp, ti, td): (f64, f64, f64) = (0.120 / UM, 0.009, 0.044);
    let tt = (ti * td).sqrt();
    let (mut u, mut before, mut earlier, mut excess) = (0.0, 0.0, 0.0, 0.0);
    move |k, measured| {
        let e = reference[k] - measured;
        if k == 0 {
            (before, earlier) = (e, e);
        }
        u += kp * (e - before) + kp * TS / ti * e + kp * td / TS * (e - 2.0 * before + earlier);
        u += TS / tt * excess;
        (before, earlier) = (e, before);
        let volts = f64::clamp(u, limits.0, limits.1);
        excess = volts - u;
        volts
    }
}

fn sine(high: f64, frequency: f64, samples: usize) -> Vec<f64> {
    let wave = |k: usize| 0.5 * high * (1.0 - (TAU * frequency * TS * k as f64).cos());
    (0..samples).map(wave).collect()
}

fn timing(samples: usize, delay: f64, substeps: usize) -> Timing {
    Timing { interval: TS, samples, delay, jitter: 0.0, substeps }
}

fn tracked(stage: &VirtualStage, reference: &[f64], timing: &Timing) -> ClosedLoop<StageState> {
    let apparatus = stage.apparatus();
    closed_loop(&apparatus, stage.start(), timing, pid(reference, (0.0, 75.0)), NEVER)
        .unwrap()
        .unwrap()
}

#[test]
fn the_published_gains_are_stable_and_track_nearly_as_published() {
    // Fig. 12: PID alone, 0.2 Hz, 0 to 110 um; published 4.44 um, 0.063 rad, 6.24 %.
    let reference = sine(110.0 * UM, 0.2, 1000);
    for seed in 1..5 {
        let stage = VirtualStage::xu_li_2010(seed);
        let run = tracked(&stage, &reference, &timing(1000, 0.0, 1));
        for period in each_period(&reference, &run.measured, TS, 5.0).unwrap() {
            assert!(period.max_error > 3.4 * UM && period.max_error < 4.44 * UM);
            assert!((period.phase_lag.unwrap() - 0.063).abs() < 0.004);
            assert!((period.widest_loop.unwrap() - 0.0624).abs() < 0.005);
        }
    }
}

#[test]
fn the_loop_is_safely_stable() {
    // A fifth more gain, and amplifiers slower and faster than the one chosen, are stable too.
    let reference = sine(110.0 * UM, 0.2, 1000);
    for (gain, bandwidth) in [(1.2, 225.0), (1.0, 100.0), (1.0, 1000.0)] {
        let mut stage = VirtualStage::xu_li_2010(1);
        let Stage::PrandtlIshlinskii(plays) = &mut stage.stage else { panic!() };
        let plays = &mut plays.operator.plays;
        plays.linear *= gain;
        plays.weights.iter_mut().for_each(|weight| *weight *= gain);
        plays.dead_zone_thresholds.iter_mut().for_each(|threshold| *threshold *= gain);
        stage.amplifier.bandwidth = bandwidth;
        let run = tracked(&stage, &reference, &timing(1000, 0.0, 1));
        let whole = tracking(&reference, &run.displacement, TS, Some(0.2)).unwrap();
        assert!(whole.max_error < 4.44 * UM, "{gain} {bandwidth}: {}", whole.max_error);
    }
}

/// Error at the end of a small step, as a multiple of the step, without hysteresis or noise.
fn ringing(gain: f64, frequency: f64, lag: f64) -> f64 {
    let dynamics = Dynamics::Second { frequency, damping_ratio: 0.065 };
    let plays = InputStage {
        operator: PlayHysteresis::new(gain * UM, &[], &[], &[], &[]).unwrap(),
        relaxation: Relaxation::new(&[], &[], dynamics).unwrap(),
    };
    let step = if lag > 0.0 { 1e-4 } else { 1e-2 };
    let mut stage = VirtualStage::bare(Stage::PrandtlIshlinskii(plays), step);
    stage.amplifier = Amplifier { bandwidth: 1.0 / (TAU * lag), ..Amplifier::IDEAL };
    let reference = vec![UM; 4000];
    let controller = pid(&reference, (f64::NEG_INFINITY, f64::INFINITY));
    let run =
        closed_loop(&stage.apparatus(), stage.start(), &timing(4000, 0.0, 1), controller, NEVER);
    let x = run.unwrap().unwrap().displacement;
    x[3900..].iter().map(|x| (x / reference[0] - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn the_sampled_loop_is_stable_up_to_the_gains_known_without_hysteresis() {
    // Limits computed apart: overall gain in um/V by frequency and amplifier lag. Its sample of
    // delay is that of the hold: a command acts at once, and shows in the next reading.
    for (limit, frequency, lag) in [
        (2.34, 150.0, 0.0),
        (2.21, 155.0, 0.0),
        (1.81, 160.0, 0.0),
        (1.33, 165.0, 0.0),
        (0.94, 170.0, 0.0),
        (0.83, 172.7, 0.0),
        (1.98, 160.0, 1e-3),
        (1.46, 160.0, 4e-3),
    ] {
        let (below, above) =
            (ringing(0.97 * limit, frequency, lag), ringing(1.03 * limit, frequency, lag));
        assert!(below < 0.5 && above > 2.0, "{limit} {frequency} {lag}: {below:e} {above:e}");
    }
}

/// Displacement and times where the command is a wave that does not look at the reading.
fn blind<P: Plant>(apparatus: &Apparatus<'_, P>, delay: f64, substeps: usize) -> Vec<f64> {
    let wave = |k: usize, _: f64| 20.0 + 15.0 * (0.4 * k as f64).sin();
    let timing = timing(40, delay, substeps);
    let run = closed_loop(apparatus, apparatus.rest(), &timing, wave, NEVER).unwrap().unwrap();
    run.displacement
}

#[test]
fn a_delay_shifts_the_response_by_any_fraction_of_a_sample() {
    let stage = VirtualStage::xu_li_2010(1);
    let dahl = DahlStage::xu_li_2010();
    let substeps = 200;
    for instants in [1, 60, 71, 200, 333, 500] {
        let delay = TS * f64::from(instants) / 200.0;
        let shift = usize::try_from(instants).unwrap();
        let virtual_stage = stage.apparatus();
        let dahl_stage = Apparatus::ideal(&dahl, 1e-4);
        for (prompt, late) in [
            (blind(&virtual_stage, 0.0, substeps), blind(&virtual_stage, delay, substeps)),
            (blind(&dahl_stage, 0.0, substeps), blind(&dahl_stage, delay, substeps)),
        ] {
            assert!(late[..=shift].iter().all(|x| x.abs() < 1e-18));
            for (a, b) in prompt.iter().zip(&late[shift..]) {
                assert!((a - b).abs() < 1e-12, "{instants}: {a:e} {b:e}");
            }
        }
    }
}

#[test]
fn a_delay_between_the_instants_kept_acts_where_it_should() {
    // 7.1 ms lies between instants of 5 ms, and on one of 0.1 ms.
    let stage = VirtualStage::xu_li_2010(1);
    let apparatus = stage.apparatus();
    let (few, many) = (blind(&apparatus, 7.1e-3, 4), blind(&apparatus, 7.1e-3, 200));
    for (a, b) in few.iter().zip(many.iter().step_by(50)) {
        assert!((a - b).abs() < 2e-9, "{a:e} {b:e}");
    }
}

/// What rolls on at 1 um/s, and at 3 um/s when it has a voltage.
struct Rolling;

impl Plant for Rolling {
    type State = f64;
    type Flow = f64;

    fn rest(&self) -> f64 {
        0.0
    }

    fn flow(&self, step: f64) -> f64 {
        step
    }

    fn advance(&self, step: &f64, state: &mut f64, from: f64, _: f64) {
        *state += UM * step * (1.0 + 2.0 * from);
    }

    fn displacement(&self, state: &f64) -> f64 {
        *state
    }
}

#[test]
fn late_samples_read_and_act_late() {
    // The voltage is on in every other interval, from when the sample of that came.
    let apparatus = Apparatus::ideal(&Rolling, 1.0);
    let (samples, jitter, substeps) = (4001, 3e-3, 4);
    for delay in [0.0, 0.3 * TS, 1.95 * TS] {
        let timing = Timing { jitter, ..timing(samples, delay, substeps) };
        let blind = |k: usize, _: f64| if k.is_multiple_of(2) { 1.0 } else { 0.0 };
        let run = closed_loop(&apparatus, apparatus.rest(), &timing, blind, NEVER);
        let run = run.unwrap().unwrap();
        assert_eq!(run.measured.len(), (samples - 1) * substeps + 1);
        // Without a command yet it rolls at 1 um/s, so the first reading tells how late it was;
        // from then on what was on before a reading does.
        let mut late = Vec::new();
        let mut on = 0.0;
        for k in 0..samples {
            // With the commands before k known, x(t) is known from their effects on.
            let effects: Vec<f64> =
                late.iter().enumerate().map(|(j, late)| TS * j as f64 + late + delay).collect();
            if k.is_multiple_of(2) && k > 9 {
                let i = k / 2 - 5;
                on += effects[2 * i + 1] - effects[2 * i];
            }
            let at = |t: f64| {
                let spans = effects.iter().step_by(2).enumerate().skip((k / 2).saturating_sub(4));
                let recent: f64 = spans
                    .map(|(i, &from)| {
                        let to = effects.get(2 * i + 1).copied().unwrap_or(f64::INFINITY);
                        (t.min(to) - from).max(0.0)
                    })
                    .sum();
                UM * (t + 2.0 * (on + recent))
            };
            let (mut low, mut high) = (TS * k as f64, TS * (k + 1) as f64);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if at(middle) < run.measured[k * substeps] { low = middle } else { high = middle }
            }
            late.push(low - TS * k as f64);
        }
        let mean = late.iter().sum::<f64>() / late.len() as f64;
        let longer = late.iter().filter(|&&late| late > jitter).count() as f64 / samples as f64;
        assert!((mean / jitter - 1.0).abs() < 0.05, "{mean}");
        assert!((longer - (-1.0_f64).exp()).abs() < 0.03, "{longer}");
        assert!(late.iter().all(|late| *late < 0.9 * TS + 1e-9));
    }
}

#[test]
fn a_jitter_of_next_to_nothing_changes_nothing() {
    let stage = VirtualStage::xu_li_2010(1);
    let reference = sine(50.0 * UM, 0.5, 100);
    for delay in [0.0, 7.1e-3, TS] {
        let prompt = tracked(&stage, &reference, &timing(100, delay, 3));
        let late = Timing { jitter: 1e-9, ..timing(100, delay, 3) };
        let late = tracked(&stage, &reference, &late);
        for (a, b) in prompt.measured.iter().zip(&late.measured).skip(3).step_by(3) {
            assert!((a - b).abs() < 0.08 * UM, "{a:e} {b:e}");
        }
        for (a, b) in prompt.displacement.iter().zip(&late.displacement) {
            assert!((a - b).abs() < 0.08 * UM, "{a:e} {b:e}");
        }
    }
}

#[test]
fn instants_kept_for_plots_change_nothing() {
    let stage = VirtualStage::xu_li_2010(1);
    let reference = sine(50.0 * UM, 0.5, 100);
    let one = tracked(&stage, &reference, &timing(100, TS, 1));
    let many = tracked(&stage, &reference, &timing(100, TS, 10));
    assert_eq!((one.time.len(), many.time.len()), (100, 991));
    for k in 0..100 {
        assert!((one.displacement[k] - many.displacement[10 * k]).abs() < 1e-9);
        assert!((one.time[k] - many.time[10 * k]).abs() < 1e-12);
    }
    // Between control samples reading and command stay, while the stage moves on.
    assert_eq!(many.measured[500], many.measured[509]);
    assert_eq!(many.command[500], many.command[509]);
    assert!(many.displacement[500..510].windows(2).all(|pair| pair[0] != pair[1]));
}

#[test]
fn a_dahl_plant_moves_as_its_own_simulation() {
    let stage = DahlStage::xu_li_2010();
    let u: Vec<f64> = (0..60).map(|k| 30.0 + 25.0 * (0.3 * f64::from(k)).sin()).collect();
    let drive = Drive::new(&u, TS, Hold::Zero).unwrap();
    let exact = stage
        .simulate(&Experiment { accuracy: 1e-13, ..Experiment::of(&drive, NEVER) })
        .unwrap()
        .unwrap();
    let apparatus = Apparatus::ideal(&stage, 5e-5);
    let run = closed_loop(&apparatus, apparatus.rest(), &timing(60, 0.0, 3), |k, _| u[k], NEVER);
    for (k, x) in run.unwrap().unwrap().displacement.iter().step_by(3).enumerate() {
        assert!((x - exact.x[k]).abs() < 1e-12, "{k}");
    }
    let open = open_loop(&apparatus, apparatus.rest(), &drive, NEVER).unwrap().unwrap();
    for (a, b) in open.displacement.iter().zip(&exact.x) {
        assert!((a - b).abs() < 1e-12);
    }
}

#[test]
fn an_amplifier_can_stand_before_any_plant() {
    let stage = DahlStage::xu_li_2010();
    let mut apparatus = Apparatus::ideal(&stage, 1e-4);
    apparatus.amplifier = Amplifier { bandwidth: 200.0, slew: 500.0, low: 0.0, high: 75.0 };
    let run = closed_loop(&apparatus, apparatus.rest(), &timing(20, 0.0, 20), |_, _| 100.0, NEVER);
    let applied = run.unwrap().unwrap().applied;
    let fastest = applied.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    assert!((fastest - 0.5).abs() < 1e-9, "{fastest}");
    assert!((applied[380] - 75.0).abs() < 1e-9);
}

#[test]
fn no_bad_number_gets_through() {
    let stage = VirtualStage::xu_li_2010(1);
    let apparatus = stage.apparatus();
    let refused = |timing: &Timing, controller: fn(usize, f64) -> f64| {
        let run = closed_loop(&apparatus, stage.start(), timing, controller, NEVER);
        run.unwrap_err().to_string()
    };
    let message = refused(&timing(10, 0.0, 1), |k, _| if k == 3 { f64::NAN } else { 1.0 });
    assert!(message.contains("NaN V at sample 3"), "{message}");
    assert!(refused(&timing(0, 0.0, 1), |_, _| 0.0).starts_with("samples is 0"));
    assert!(refused(&timing(9, 0.0, 0), |_, _| 0.0).starts_with("substeps is 0"));
    assert!(refused(&timing(9, -1.0, 1), |_, _| 0.0).starts_with("delay is -1 s"));
    let early = Timing { jitter: -1.0, ..timing(9, 0.0, 1) };
    assert!(refused(&early, |_, _| 0.0).starts_with("jitter is -1 s"));
    assert!(refused(&timing(usize::MAX, 0.0, 2), |_, _| 0.0).starts_with("samples is too many"));
    let long = Timing { interval: 1e9, ..timing(9, 0.0, 1) };
    assert!(refused(&long, |_, _| 0.0).starts_with("step is 2e-5 s"));

    let unstable = DahlStage { up: 1e305, ..DahlStage::xu_li_2010() };
    let bare = Apparatus::ideal(&unstable, 1e-4);
    let run = closed_loop(&bare, bare.rest(), &timing(5000, 0.0, 1), |_, _| 75.0, NEVER);
    assert!(run.unwrap_err().to_string().contains("not finite at"));
}

#[test]
fn a_run_stops_when_asked() {
    let stage = VirtualStage::xu_li_2010(1);
    let run =
        closed_loop(&stage.apparatus(), stage.start(), &timing(9, 0.0, 1), |_, _| 0.0, &|| true);
    assert!(run.unwrap().is_none());
}

#[test]
fn a_kernel_led_step_by_step_moves_as_it_does_alone() {
    let stage = BoucWenStage::xu_li_2010_corrected();
    let u: Vec<f64> = sine(75.0, 0.5, 400);
    for hold in [Hold::First, Hold::Zero] {
        let drive = Drive::new(&u, TS, hold).unwrap();
        let experiment = Experiment { accuracy: 1e-12, ..Experiment::of(&drive, NEVER) };
        let alone = stage.simulate(&experiment).unwrap().unwrap();
        let largest = |step: f64| {
            let apparatus = Apparatus::ideal(&stage, step);
            let run = open_loop(&apparatus, apparatus.rest(), &drive, NEVER).unwrap().unwrap();
            let gaps = run.displacement.iter().zip(&alone.x).map(|(a, b)| (a - b).abs());
            gaps.fold(0.0, f64::max)
        };
        // Under a held voltage every step is exact; under a ramp those of fourth order.
        let (long, short) = (largest(TS), largest(TS / 8.0));
        assert!(short < 1e-12, "{hold:?}: {short:e}");
        assert!(if hold == Hold::Zero { long < 1e-15 } else { long > 100.0 * short }, "{long:e}");
    }
}

#[test]
fn the_delay_of_a_sensor_is_a_delay_of_the_loop() {
    let reference = sine(50.0 * UM, 0.5, 100);
    let mut stage = VirtualStage::xu_li_2010(1);
    let late = tracked(&stage, &reference, &timing(100, 1.5e-3, 3));
    stage.sensor.delay = 0.5e-3;
    let shared = tracked(&stage, &reference, &timing(100, 1e-3, 3));
    assert_eq!(late.displacement, shared.displacement);
    assert_eq!(late.measured, shared.measured);
}
