//! The virtual stage: each of its parts against what physics or the paper says of it.
#![allow(
    missing_docs,
    clippy::panic,
    clippy::unwrap_used,
    clippy::float_cmp,
    clippy::cast_precision_loss
)]

use core::f64::consts::TAU;

use piezotrack_core::models::{
    Creep, MOST_RELAXATIONS, Model, PrandtlIshlinskiiStage, Stage, StageState, Values,
};
use piezotrack_core::signal::metrics::widest_loop;
use piezotrack_core::signal::{Drive, Hold, NEVER};
use piezotrack_core::simulate::{
    Amplifier, MissedTicks, OpenLoop, Preconditioning, Sensor, TwoAxes, VirtualRun, VirtualStage,
    open_loop, open_loops,
};

const UM: f64 = 1e-6;

fn published() -> VirtualStage {
    VirtualStage::xu_li_2010(1)
}

/// The play operators, creep and mode of a stage.
fn plays(stage: &VirtualStage) -> PrandtlIshlinskiiStage {
    let Stage::PrandtlIshlinskii(plays) = stage.stage else { panic!("{stage:?}") };
    plays
}

/// The mode alone: no lag, no creep, no noise, from the virgin state.
fn bare() -> VirtualStage {
    let mut stage = plays(&published());
    stage.relaxation.creep = [Creep { share: 0.0, time: 1.0 }; MOST_RELAXATIONS];
    VirtualStage::bare(Stage::PrandtlIshlinskii(stage), published().step)
}

fn drive(stage: &VirtualStage, u: &[f64], dt: f64, hold: Hold) -> OpenLoop<StageState> {
    stage.validate().unwrap();
    let drive = Drive::new(u, dt, hold).unwrap();
    open_loop(&stage.apparatus(), stage.start(), &drive, NEVER).unwrap().unwrap()
}

/// `(1 - cos) / 2` up to `peak`, V, sampled at 5 kHz.
fn cosine(peak: f64, frequency: f64, samples: usize) -> Vec<f64> {
    let turn = TAU * frequency / 5000.0;
    let wave = |k: usize| 0.5 * peak * (1.0 - (turn * k as f64).cos());
    (0..samples).map(wave).collect()
}

/// Places and heights of the maxima, by a parabola through three samples.
fn peaks(x: &[f64], dt: f64) -> Vec<(f64, f64)> {
    let mut out = Vec::new();
    for k in 1..x.len() - 1 {
        let (a, b, c) = (x[k - 1], x[k], x[k + 1]);
        if b > a && b >= c {
            let s = 0.5 * (a - c) / (a - 2.0 * b + c);
            out.push(((k as f64 + s) * dt, b - 0.25 * (a - c) * s));
        }
    }
    out
}

#[test]
fn the_mode_rings_at_its_frequency_and_decays_with_its_damping() {
    // One volt moves no play, so this is a linear second-order system.
    let dt = 2e-5;
    let run = drive(&bare(), &[1.0; 2000], dt, Hold::Zero);
    let peaks = peaks(&run.displacement, dt);
    let end = plays(&bare()).operator.plays.linear;
    let zeta: f64 = 0.065;
    let period = 1.0 / (160.0 * (1.0 - zeta * zeta).sqrt());
    assert!(((peaks[1].0 - peaks[0].0) / period - 1.0).abs() < 1e-4);
    let ratio = ((peaks[0].1 - end) / (peaks[1].1 - end)).ln();
    assert!((ratio / (TAU * zeta / (1.0 - zeta * zeta).sqrt()) - 1.0).abs() < 1e-3, "{ratio}");
}

#[test]
fn creep_grows_with_the_logarithm_of_time_to_its_share() {
    let stage = VirtualStage { stage: published().stage, ..bare() };
    let run = drive(&stage, &vec![50.0; 10_001], 1e-2, Hold::Zero);
    let x = &run.displacement;
    // The mode has died away after 0.2 s.
    assert!(x[20..].windows(2).all(|pair| pair[1] >= pair[0] - 1e-15));
    let decade = |k: usize| x[10 * k] - x[k];
    let (first, second) = (decade(20), decade(200));
    assert!(first > 0.5 * second && second > 0.5 * first, "{first} {second}");
    let immediate = drive(&bare(), &[50.0; 101], 1e-2, Hold::Zero).displacement[100];
    assert!((x[10_000] / immediate - 1.012).abs() < 1e-5);
}

#[test]
fn the_published_step_is_near() {
    let run = drive(&published(), &vec![75.0; 2501], 2e-4, Hold::Zero);
    let x = &run.displacement;
    let peaks = peaks(x, 2e-4);
    assert!((x[1500] - 117.7622 * UM).abs() < 0.2 * UM, "{}", x[1500]);
    assert!((peaks[0].1 - 192.5302 * UM).abs() < 1.5 * UM, "{}", peaks[0].1);
    // The published second peak does not go with the published damping.
    assert!((peaks[1].1 - 170.2524 * UM).abs() < 4.0 * UM, "{}", peaks[1].1);
    let frequency = 1.0 / (peaks[2].0 - peaks[1].0);
    assert!((frequency - 160.0).abs() < 1.0, "{frequency}");
}

#[test]
fn the_settled_loop_closes_and_is_a_tenth_of_the_travel_wide() {
    let u = cosine(75.0, 0.25, 40_000);
    let run = drive(&published(), &u, 2e-4, Hold::First);
    let x = &run.displacement;
    assert!(x[0].abs() < 0.02 * UM && x[20_000].abs() < 0.1 * UM, "{} {}", x[0], x[20_000]);
    // The loop over u in volts, brought to the travel's own unit.
    let volts: Vec<f64> = x.iter().map(|here| here * 75.0 / x[10_000]).collect();
    let width = widest_loop(&u, &volts).unwrap().unwrap();
    assert!((width - 0.10).abs() < 0.01, "{width}");
}

#[test]
fn a_virgin_stage_does_not_come_back_to_its_zero() {
    let settings = VirtualStage { preconditioning: None, ..published() };
    let u = cosine(75.0, 0.25, 20_005);
    let run = drive(&settings, &u, 2e-4, Hold::First);
    assert_eq!(run.displacement[0], 0.0);
    assert!(run.displacement[20_000] > 5.0 * UM);
}

#[test]
fn a_rest_before_the_experiment_leaves_no_drift() {
    let drift = |rest: f64| {
        let cycles = Some(Preconditioning { swing: 75.0, rest });
        let settings = VirtualStage { preconditioning: cycles, ..published() };
        let run = drive(&settings, &[0.0; 11], 1.0, Hold::Zero);
        (run.displacement[10] - run.displacement[0]).abs()
    };
    assert!(drift(0.0) > 0.1 * UM);
    assert!(drift(120.0) < 1e-11);
}

#[test]
fn half_the_step_changes_little() {
    let coarse = published();
    let fine = VirtualStage { step: 0.5 * coarse.step, ..coarse };
    let most = |u: &[f64], hold| {
        let (a, b) = (drive(&coarse, u, 2e-4, hold), drive(&fine, u, 2e-4, hold));
        let differences = a.displacement.iter().zip(&b.displacement).map(|(a, b)| (a - b).abs());
        differences.fold(0.0, f64::max)
    };
    let slow = most(&cosine(75.0, 10.0, 1500), Hold::First);
    let step = most(&[75.0; 1000], Hold::Zero);
    assert!(slow < 1e-10, "{slow:e}");
    assert!(step < 30e-9, "{step:e}");
}

/// Readings of the published sensor on a stage at rest, and their moments.
fn at_rest(seed: u64, n: usize, dt: f64) -> (Vec<f64>, f64, f64) {
    let settings = VirtualStage { preconditioning: None, ..VirtualStage::xu_li_2010(seed) };
    let y = drive(&settings, &vec![0.0; n], dt, Hold::Zero).measured;
    let square = y.iter().map(|y| y * y).sum::<f64>() / n as f64;
    let product = y.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / (n - 1) as f64;
    (y, square.sqrt(), product / square)
}

#[test]
fn noise_has_the_published_size_and_the_spectrum_of_its_bandwidth() {
    let (y, rms, correlation) = at_rest(1, 200_000, 2e-4);
    assert!((rms - 0.097 * UM).abs() < 0.002 * UM, "{rms:e}");
    let share = (0.0964_f64 / 0.097).powi(2);
    assert!((correlation - share * (-TAU * 200.0 * 2e-4).exp()).abs() < 0.01, "{correlation}");
    // About two thirds within one standard deviation, a twentieth beyond two: normal.
    let within =
        |sigmas: f64| y.iter().filter(|y| y.abs() < sigmas * rms).count() as f64 / y.len() as f64;
    // Readings come in steps of 0.39 standard deviations, so the shares are coarse.
    assert!((within(1.0) - 0.683).abs() < 0.08 && (within(2.0) - 0.954).abs() < 0.02);
    // Read at 50 Hz it is white and as large.
    let (_, rms, correlation) = at_rest(2, 20_000, 2e-2);
    assert!((rms - 0.097 * UM).abs() < 0.002 * UM && correlation.abs() < 0.03);
}

#[test]
fn readings_are_whole_steps_of_the_converter() {
    let (y, ..) = at_rest(1, 5000, 2e-4);
    let step = 2.5e-3 / 65536.0;
    assert!((step - 0.038 * UM).abs() < 0.0002 * UM);
    assert!(y.iter().all(|y| (y / step - (y / step).round()).abs() < 1e-6));
    assert!(y.iter().any(|y| (y / step).round().abs() > 5.0));
}

#[test]
fn readings_stop_at_the_end_of_the_range() {
    let mut settings = bare();
    settings.sensor.range = 50.0 * UM;
    let run = drive(&settings, &[60.0; 500], 1e-3, Hold::Zero);
    assert_eq!(run.measured[499], 50.0 * UM);
    assert!(run.displacement[499] > 60.0 * UM);
}

#[test]
fn a_seed_is_an_experiment() {
    let u = cosine(75.0, 1.0, 2500);
    let run = |seed| drive(&VirtualStage::xu_li_2010(seed), &u, 2e-4, Hold::First);
    let (one, again, other) = (run(1), run(1), run(2));
    assert_eq!(one.displacement, again.displacement);
    assert_eq!(one.measured, again.measured);
    assert_eq!(one.displacement, other.displacement);
    let same = one.measured.iter().zip(&other.measured).filter(|(a, b)| a == b).count();
    assert!(same < one.measured.len() / 4, "{same}");
}

#[test]
fn an_experiment_goes_on_where_it_ended() {
    let stage = VirtualStage::xu_li_2010(1);
    let u = cosine(75.0, 1.0, 5000);
    let run = |u: &[f64], start| {
        let drive = Drive::new(u, 2e-4, Hold::First).unwrap();
        open_loop(&stage.apparatus(), start, &drive, NEVER).unwrap().unwrap()
    };
    let whole = run(&u, stage.start());
    let half = run(&u[..=2500], stage.start());
    let rest = run(&u[2500..], half.last);
    assert_eq!(whole.displacement[2500..], rest.displacement[..]);
    assert_eq!(whole.last.applied, rest.last.applied);
}

#[test]
fn the_amplifier_lags_slews_and_stops_at_its_limits() {
    let mut settings = published();
    settings.amplifier = Amplifier { bandwidth: 100.0, slew: 1e9, low: 0.0, high: 75.0 };
    let lag = settings.amplifier.lag();
    let run = drive(&settings, &[10.0; 3], lag, Hold::Zero);
    assert!((run.applied[1] - 10.0 * (1.0 - (-1.0_f64).exp())).abs() < 1e-9);

    settings.amplifier.slew = 1000.0;
    let run = drive(&settings, &[75.0; 200], 1e-3, Hold::Zero);
    let fastest = run.applied.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    assert!(fastest <= 1.0 + 1e-9 && fastest > 0.999, "{fastest}");

    let run = drive(&settings, &[90.0; 2000], 1e-3, Hold::Zero);
    assert!((run.applied[1999] - 75.0).abs() < 1e-9);
    let run = drive(&settings, &[-9.0; 2000], 1e-3, Hold::Zero);
    assert!(run.applied[1999].abs() < 1e-9);
}

#[test]
fn a_ramp_is_followed_at_a_distance_of_the_lag() {
    let amplifier = published().amplifier;
    let u: Vec<f64> = (0..1001).map(|k| 0.05 * f64::from(k)).collect();
    let run = drive(&published(), &u, 1e-4, Hold::First);
    assert!((u[1000] - run.applied[1000] - 500.0 * amplifier.lag()).abs() < 1e-6);
}

#[test]
fn settings_out_of_range_are_named() {
    let refused = |change: fn(&mut VirtualStage)| {
        let mut stage = published();
        change(&mut stage);
        stage.validate().unwrap_err().to_string()
    };
    assert!(refused(|s| s.amplifier.slew = 0.0).starts_with("slew is 0 V/s"));
    assert!(refused(|s| s.amplifier.low = 80.0).starts_with("limits is 80 V to 75 V"));
    assert!(refused(|s| s.sensor.range = 0.0).starts_with("range is 0 m"));
    assert!(refused(|s| s.sensor.delay = -1.0).starts_with("delay is -1 s"));
    assert!(refused(|s| s.sensor.offset = f64::NAN).starts_with("offset is NaN m"));
    assert!(refused(|s| s.step = 0.0).starts_with("step is 0 s"));
    let cycles = |swing, rest| Some(Preconditioning { swing, rest });
    let with = |preconditioning| VirtualStage { preconditioning, ..published() };
    let refused = |cycles| with(cycles).validate().unwrap_err().to_string();
    assert!(refused(cycles(75.0, 1e9)).starts_with("rest is"));
    assert!(refused(cycles(0.0, 0.0)).starts_with("swing is 0 V"));

    let stage = VirtualStage::xu_li_2010(1);
    let drive = Drive { u: &[0.0, f64::NAN], dt: 1e-3, hold: Hold::Zero };
    assert!(open_loop(&stage.apparatus(), stage.start(), &drive, NEVER).is_err());
}

/// A stage with first-order Dahl friction, whose loops close.
fn friction() -> Stage {
    let model = Model::named("first-order-dahl").unwrap();
    let values = [
        ("mass", 0.2),
        ("damping", 300.0),
        ("stiffness", 26065.0),
        ("piezo_coefficient", 0.05),
        ("rest_stiffness", 2e4),
        ("coulomb_force", 0.3),
        ("exponent", 1.0),
    ];
    let named = values.map(|(name, value)| (name.to_owned(), vec![value]));
    let creep = ["creep_weights", "creep_times"].map(|name| (name.to_owned(), vec![]));
    let parameters = model.info().parameters;
    model.build(&Values::named(parameters, named.into_iter().chain(creep)).unwrap()).unwrap()
}

#[test]
fn any_model_is_preconditioned_onto_its_settled_loop() {
    let cycles = Some(Preconditioning { swing: 75.0, rest: 1.0 });
    let virgin = VirtualStage::bare(friction(), 5e-5);
    let settled = VirtualStage { preconditioning: cycles, ..virgin };
    let u = cosine(75.0, 0.25, 20_001);
    let ends = |stage: &VirtualStage| {
        let x = drive(stage, &u, 2e-4, Hold::First).displacement;
        (x[0], (x[20_000] - x[0]).abs())
    };
    let (start, left) = ends(&settled);
    assert_eq!(start, 0.0);
    assert!(left < 0.1 * UM, "{left:e}");
    assert!(ends(&virgin).1 > UM);
}

#[test]
fn an_offset_is_added_to_what_the_sensor_shows() {
    let with = |offset: f64| {
        let mut stage = published();
        stage.sensor = Sensor { offset, ..Sensor::IDEAL };
        drive(&stage, &cosine(75.0, 1.0, 500), 2e-4, Hold::First)
    };
    let (plain, shifted) = (with(0.0), with(3.0 * UM));
    for (a, b) in plain.measured.iter().zip(&shifted.measured) {
        assert!((b - a - 3.0 * UM).abs() < 1e-15);
    }
}

#[test]
fn a_delayed_sensor_shows_what_was() {
    // Of a ramp through the amplifier alone, by any part of a sample and by several.
    let u: Vec<f64> = (0..200).map(|k| 0.1 * f64::from(k)).collect();
    let dt = 1e-3;
    let late = |delay: f64| {
        let mut stage = bare();
        stage.sensor.delay = delay;
        drive(&stage, &u, dt, Hold::First)
    };
    let prompt = late(0.0);
    assert_eq!(prompt.measured, prompt.displacement);
    for back in [1_usize, 2, 7] {
        let run = late(back as f64 * dt);
        assert!(run.measured[..=back].iter().all(|y| *y == 0.0));
        for k in back..200 {
            assert!((run.measured[k] - prompt.displacement[k - back]).abs() < 1e-15);
        }
    }
    // The same drive sampled four times as often has the instant between two samples among its own.
    let fine: Vec<f64> = (0..797).map(|k| 0.025 * f64::from(k)).collect();
    let truth = drive(&bare(), &fine, 0.25 * dt, Hold::First).displacement;
    let run = late(1.25 * dt);
    for k in 2..200 {
        assert!((run.measured[k] - truth[4 * k - 5]).abs() < 1e-13, "{k}");
    }
}

#[test]
fn each_of_two_axes_has_its_own_sensor_delay() {
    let u: Vec<f64> = (0..100).map(|k| 0.2 * f64::from(k)).collect();
    let drives = [&u, &u].map(|u| Drive::new(u, 1e-3, Hold::First).unwrap());
    let (mut x, mut y) = (bare(), bare());
    (x.sensor.delay, y.sensor.delay) = (2.5e-3, 1e-3);
    let run = |x: &VirtualStage, y: &VirtualStage| {
        let axes = TwoAxes {
            x: x.apparatus(),
            y: y.apparatus(),
            cross_talk: [0.1, 0.0],
            lag: 0.0,
            missed: MissedTicks::NONE,
        };
        let both = open_loops(&axes, (x.start(), y.start()), [&drives[0], &drives[1]], NEVER);
        both.unwrap().unwrap()
    };
    let (along_x, along_y) = run(&x, &y);
    let alone = |stage: &VirtualStage| drive(stage, &u, 1e-3, Hold::First).measured;
    for k in 0..100 {
        // What of y shows in x is as old as x's own reading.
        assert!((along_x.measured[k] - 1.1 * alone(&x)[k]).abs() < 1e-13, "{k}");
        assert!((along_y.measured[k] - alone(&y)[k]).abs() < 1e-13, "{k}");
    }
}

#[test]
fn a_run_that_goes_on_moves_as_one_that_was_not_divided() {
    let commands: Vec<f64> = (0..300).map(|k| 30.0 - 30.0 * (0.05 * f64::from(k)).cos()).collect();
    // A command that is held from sample to sample acts from the next on.
    let shifted: Vec<f64> = [0.0].into_iter().chain(commands.iter().copied()).collect();
    let mut late = published();
    late.sensor = Sensor { delay: 2.5e-3, ..Sensor::IDEAL };
    for stage in [VirtualStage { sensor: Sensor::IDEAL, ..published() }, late] {
        let whole = drive(&stage, &shifted, 1e-3, Hold::Zero);
        let mut run = VirtualRun::new(stage);
        let mut before = 1;
        for piece in [&commands[..1], &commands[1..4], &commands[4..200], &commands[200..]] {
            let part = run.advance(piece, 1e-3, NEVER).unwrap().unwrap();
            for k in 0..piece.len() {
                assert_eq!(part.displacement[k], whole.displacement[before + k], "{}", before + k);
                assert_eq!(part.measured[k], whole.measured[before + k], "{}", before + k);
            }
            before += piece.len();
        }
    }
}

#[test]
fn a_run_goes_on_at_another_interval_and_is_unchanged_by_what_it_refuses() {
    let stage = VirtualStage { sensor: Sensor::IDEAL, ..published() };
    let mut run = VirtualRun::new(stage);
    let slow = run.advance(&[20.0; 50], 2e-3, NEVER).unwrap().unwrap();
    assert!(run.advance(&[20.0, f64::NAN], 2e-3, NEVER).is_err());
    assert!(run.advance(&[20.0], 2e-3, &|| true).unwrap().is_none());
    let fast = run.advance(&[20.0; 400], 2.5e-4, NEVER).unwrap().unwrap();
    let mut whole = VirtualRun::new(stage);
    let other = whole.advance(&[20.0; 100], 2e-3, NEVER).unwrap().unwrap();
    assert_eq!(slow.displacement[49], other.displacement[49]);
    assert!((fast.displacement[399] - other.displacement[99]).abs() < 1e-3 * UM);
}

/// A fuzzer found it: the creep took a finite equilibrium beyond all numbers.
#[test]
fn an_equilibrium_that_overflows_with_its_creep_is_none() {
    let model = Model::named("dahl").unwrap();
    let (_, published) = model.info().published[0];
    let of = |creep: f64| {
        let mut given = vec![("creep_weights".to_owned(), vec![creep])];
        given.push(("creep_times".to_owned(), vec![1.0]));
        given.extend(published().iter().map(|(name, numbers)| (name.to_owned(), numbers.to_vec())));
        let values = Values::named(model.info().parameters, given).unwrap();
        model.build(&values).unwrap().equilibrium(&[1e8])
    };
    let settled = of(1.0).unwrap().number("x");
    assert!(settled.is_finite() && settled > 10.0, "{settled}");
    let refused = of(1e308).unwrap_err().to_string();
    assert!(refused.contains("no equilibrium"), "{refused}");
}
