//! Two axes in one time: what couples them, and what does not.
#![allow(missing_docs, clippy::unwrap_used, clippy::float_cmp, clippy::cast_precision_loss)]

use core::f64::consts::TAU;

use piezotrack_control::{Controller, Limits, Pid};
use piezotrack_core::identify::{cross_talk, noise_at_rest};
use piezotrack_core::models::{DahlStage, Plant};
use piezotrack_core::parts::Law;
use piezotrack_core::signal::contour_error::radial_errors;
use piezotrack_core::signal::metrics::Spread;
use piezotrack_core::signal::{Drive, Hold, NEVER};
use piezotrack_core::simulate::{
    Apparatus, ApparatusState, ClosedLoop, MissedTicks, ReferenceSamples, Timing, TwoAxes,
    VirtualStage, open_loops, track, track_both,
};

const UM: f64 = 1e-6;
const TS: f64 = 0.02;

/// What moves at once: 1 um for 1 V.
#[derive(Clone, Copy)]
struct Rigid;

impl Plant for Rigid {
    type State = f64;
    type Flow = ();

    fn rest(&self) -> f64 {
        0.0
    }

    fn flow(&self, _: f64) {}

    fn advance(&self, (): &(), state: &mut f64, _: f64, to: f64) {
        *state = UM * to;
    }

    fn displacement(&self, state: &f64) -> f64 {
        *state
    }
}

/// What rolls on under a voltage: 1 um/s for 1 V.
#[derive(Clone, Copy)]
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

    fn advance(&self, step: &f64, state: &mut f64, from: f64, to: f64) {
        *state += 0.5 * UM * step * (from + to);
    }

    fn displacement(&self, state: &f64) -> f64 {
        *state
    }
}

fn pid() -> Controller<Law> {
    Controller::new(Limits::new(0.0, 75.0).unwrap(), Law::Pid(Pid::xu_li_2010().at(TS).unwrap()))
}

fn open() -> Controller<Law> {
    Controller::new(Limits::new(-1e3, 1e3).unwrap(), Law::None)
}

/// `middle + radius cos(2 pi f t - behind)` at the control samples.
fn wave(samples: usize, middle: f64, radius: f64, frequency: f64, behind: f64) -> Vec<f64> {
    let at = |k: usize| middle + radius * (TAU * frequency * TS * k as f64 - behind).cos();
    (0..samples).map(at).collect()
}

fn timing(delay: f64, substeps: usize) -> Timing {
    Timing { interval: TS, samples: 0, delay, jitter: 0.0, substeps }
}

/// Two motions bit by bit.
fn same<S>(one: &ClosedLoop<S>, other: &ClosedLoop<S>) {
    assert_eq!(one.time, other.time);
    assert_eq!(one.displacement, other.displacement);
    assert_eq!(one.measured, other.measured);
    assert_eq!(one.command, other.command);
    assert_eq!(one.applied, other.applied);
}

#[test]
fn without_cross_talk_and_lag_each_axis_is_alone() {
    // Bit by bit, whatever the delay, and for different plants.
    let (stage, model) = (VirtualStage::xu_li_2010(3), DahlStage::xu_li_2010());
    let (x, y) = (stage.apparatus(), Apparatus::ideal(&model, 5e-5));
    let (to_x, to_y) =
        (wave(150, 50.0 * UM, 10.0 * UM, 0.5, 0.0), wave(150, 40.0 * UM, 20.0 * UM, 0.5, 1.0));
    let none = vec![0.0; 150];
    let courses =
        [&to_x, &to_y].map(|reference| ReferenceSamples { reference, feedforward: &none });
    for (delay, substeps) in [(0.0, 1), (0.7e-3, 10), (0.027, 3)] {
        let timing = timing(delay, substeps);
        let axes = TwoAxes { x, y, cross_talk: [0.0, 0.0], lag: 0.0, missed: MissedTicks::NONE };
        let start = (stage.start(), y.rest());
        let both = track_both(&axes, start, &timing, (&pid(), &pid()), courses, NEVER);
        let (along_x, along_y) = both.unwrap().unwrap();
        let alone = track(&x, stage.start(), &timing, &pid(), courses[0], NEVER);
        let alone = alone.unwrap().unwrap();
        same(&along_x.motion, &alone.motion);
        assert_eq!(along_x.commands, alone.commands);
        let alone = track(&y, y.rest(), &timing, &pid(), courses[1], NEVER).unwrap().unwrap();
        same(&along_y.motion, &alone.motion);
        assert_eq!(along_y.commands, alone.commands);
    }
}

#[test]
fn a_lag_makes_the_ellipse_of_its_angle() {
    // x = R cos a, y = R sin(a - b): with b = 2 pi f lag, r^2 = R^2 (1 - sin b sin(2 a - b)), so
    // the SD of the radial error is R sin(b) / sqrt 8 but for terms of b^2, and its largest and
    // smallest are on the diagonals. A voltage that is held for an interval is late by one.
    let (radius, frequency) = (40.0, 0.1);
    let plant = Rigid;
    let axis = Apparatus::ideal(&plant, 1.0);
    let (cosine, sine) =
        (wave(1001, 0.0, radius, frequency, 0.0), wave(1001, 0.0, radius, frequency, TAU / 4.0));
    for (whole, intervals) in [(1, 1.0), (2, 2.0), (5, 5.0)] {
        let axes = TwoAxes {
            x: axis,
            y: axis,
            cross_talk: [0.0, 0.0],
            lag: intervals * TS,
            missed: MissedTicks::NONE,
        };
        let courses =
            [&cosine, &sine].map(|volts| ReferenceSamples { reference: volts, feedforward: volts });
        let start = (axis.rest(), axis.rest());
        let run = track_both(&axes, start, &timing(0.0, 1), (&open(), &open()), courses, NEVER);
        let (x, y) = run.unwrap().unwrap();
        let angle = TAU * frequency * intervals * TS;
        // One turn, after the lag.
        let turn = 501..1001;
        let errors = radial_errors(
            &x.motion.measured[turn.clone()],
            &y.motion.measured[turn.clone()],
            [0.0, 0.0],
            radius * UM,
        );
        let found = Spread::of(errors.unwrap().into_iter());
        let expected = radius * UM * angle.sin() / 8.0_f64.sqrt();
        assert!((found.sd / expected - 1.0).abs() < angle, "{} {expected}", found.sd);
        let edge = |sign: f64| radius * UM * (1.0 + sign * angle.sin()).sqrt();
        assert!((found.peak_to_peak / (edge(1.0) - edge(-1.0)) - 1.0).abs() < 1e-3);
        // Sample by sample it is the same motion, so much later.
        for k in turn {
            assert!((y.motion.measured[k] - UM * sine[k - 1 - whole]).abs() < 1e-18);
        }
    }
}

#[test]
fn late_axes_without_cross_talk_and_lag_move_as_each_alone() {
    // Time is cut at the samples of both, so that steps differ, and nothing else does.
    let (stage, other) = (VirtualStage::xu_li_2010(3), VirtualStage::xu_li_2010_y(4));
    let (x, y) = (stage.apparatus(), other.apparatus());
    let reference = wave(150, 50.0 * UM, 10.0 * UM, 0.5, 0.0);
    let course = ReferenceSamples { reference: &reference, feedforward: &vec![0.0; 150] };
    for (delay, jitter, substeps) in [(0.0, 2e-3, 1), (0.027, 4e-3, 3)] {
        let timing = Timing { jitter, ..timing(delay, substeps) };
        let axes = TwoAxes { x, y, cross_talk: [0.0, 0.0], lag: 0.0, missed: MissedTicks::NONE };
        let start = (stage.start(), other.start());
        let both = track_both(&axes, start, &timing, (&pid(), &pid()), [course; 2], NEVER);
        let (along_x, along_y) = both.unwrap().unwrap();
        for (together, stage, axis) in [(&along_x, &stage, &x), (&along_y, &other, &y)] {
            let alone = track(axis, stage.start(), &timing, &pid(), course, NEVER);
            let alone = alone.unwrap().unwrap();
            for (a, b) in together.motion.displacement.iter().zip(&alone.motion.displacement) {
                assert!((a - b).abs() < 0.2 * UM, "{a:e} {b:e}");
            }
            assert_eq!(together.commands.len(), alone.commands.len());
        }
    }
}

#[test]
fn each_axis_is_late_by_its_own_time() {
    // Under a ramp without feedback: what the controllers read tells when they did.
    let (x, y) = (VirtualStage::xu_li_2010(1), VirtualStage::xu_li_2010_y(1));
    let plant = Rolling;
    let seeded = |stage: &VirtualStage| {
        let mut apparatus = Apparatus::ideal(&plant, 1.0);
        apparatus.sensor.seed = stage.sensor.seed;
        apparatus
    };
    let axes = TwoAxes {
        x: seeded(&x),
        y: seeded(&y),
        cross_talk: [0.0; 2],
        lag: 0.0,
        missed: MissedTicks::NONE,
    };
    let ones = vec![1.0; 3000];
    let zeros = vec![0.0; 3000];
    let course = ReferenceSamples { reference: &zeros, feedforward: &ones };
    let lateness = |lag: f64| {
        let timing = Timing { jitter: 2e-3, ..timing(0.0, 1) };
        let axes = TwoAxes { lag, ..axes };
        let begun = |rest: &mut ApparatusState<f64>| rest.command = 1.0;
        let mut start = (axes.x.rest(), axes.y.rest());
        begun(&mut start.0);
        begun(&mut start.1);
        let run = track_both(&axes, start, &timing, (&open(), &open()), [course; 2], NEVER);
        let (x, y) = run.unwrap().unwrap();
        let of = |motion: &[f64]| -> Vec<f64> {
            motion.iter().enumerate().map(|(k, x)| x / UM - TS * k as f64).collect()
        };
        let served: Vec<f64> = y.commands.iter().map(|command| -command.error / UM).collect();
        (of(&x.motion.measured), of(&y.motion.measured), served)
    };
    let (prompt_x, prompt_y, _) = lateness(0.0);
    let mean = |late: &[f64]| late.iter().sum::<f64>() / late.len() as f64;
    for late in [&prompt_x, &prompt_y] {
        assert!((mean(late) / 2e-3 - 1.0).abs() < 0.06, "{}", mean(late));
    }
    let together: f64 = prompt_x.iter().zip(&prompt_y).map(|(a, b)| (a - 2e-3) * (b - 2e-3)).sum();
    assert!((together / 3000.0).abs() < 0.06 * 4e-6, "{together:e}");
    // A lag moves when y's controller looks, not what is recorded.
    for (lag, whole) in [(0.013, 1), (0.04, 2), (0.047, 3)] {
        let (late_x, late_y, served) = lateness(lag);
        for k in 0..3000 {
            assert!((late_x[k] - prompt_x[k]).abs() < 1e-9);
            assert!((late_y[k] - prompt_y[k]).abs() < 1e-9, "{lag} {k}");
        }
        for (k, served) in served.iter().enumerate().skip(whole) {
            let late = served - (TS * (k - whole) as f64 + lag);
            assert!((-1e-9..0.9 * TS).contains(&late), "{lag} {k} {late:e}");
        }
    }
}

#[test]
fn a_lag_of_a_part_of_an_interval_is_kept_to_the_instant() {
    // Seen ten times in an interval, the step of y is 0.3 of it behind that of x.
    let plant = Rigid;
    let axis = Apparatus::ideal(&plant, 1.0);
    let steps: Vec<f64> = (0..20).map(|k| f64::from(k % 2)).collect();
    let course = ReferenceSamples { reference: &steps, feedforward: &steps };
    for (lag, delay) in [(3, 0), (0, 3), (2, 1), (3, 4), (13, 0), (9, 22)] {
        // In tenths of an interval.
        let seconds = |tenths: usize| 0.1 * TS * tenths as f64;
        let axes = TwoAxes {
            x: axis,
            y: axis,
            cross_talk: [0.0, 0.0],
            lag: seconds(lag),
            missed: MissedTicks::NONE,
        };
        let start = (axis.rest(), axis.rest());
        let timing = timing(seconds(delay), 10);
        let run = track_both(&axes, start, &timing, (&open(), &open()), [course; 2], NEVER);
        let (x, y) = run.unwrap().unwrap();
        for j in 50..190 {
            // An instant shows what acted before it.
            let at = |late: usize| UM * steps[(j - 1 - late) / 10];
            assert_eq!(x.motion.displacement[j], at(delay), "{j} {lag} {delay}");
            assert_eq!(y.motion.displacement[j], at(lag + delay), "{j} {lag} {delay}");
        }
        // The command beside an instant is the last one computed.
        let late = lag.div_ceil(10);
        assert_eq!(y.commands[12].volts, steps[12 - late]);
    }
}

#[test]
fn cross_talk_mixes_what_the_sensors_see() {
    let plant = Rigid;
    let axis = Apparatus::ideal(&plant, 1.0);
    let [xy, yx] = [0.03, -0.02];
    let axes =
        TwoAxes { x: axis, y: axis, cross_talk: [xy, yx], lag: 0.0, missed: MissedTicks::NONE };
    let (ux, uy) = (vec![3.0, 5.0, -1.0, 2.0], vec![0.0, 7.0, 4.0, -6.0]);
    let drives = [&ux, &uy].map(|u| Drive::new(u, 1e-3, Hold::First).unwrap());
    let start = (axis.rest(), axis.rest());
    let (x, y) = open_loops(&axes, start, [&drives[0], &drives[1]], NEVER).unwrap().unwrap();
    for k in 1..4 {
        assert!((x.measured[k] - UM * (ux[k] + xy * uy[k])).abs() < 1e-18);
        assert!((y.measured[k] - UM * (uy[k] + yx * ux[k])).abs() < 1e-18);
        assert_eq!(x.displacement[k], x.measured[k]);
    }

    // Under integrating feedback both readings settle where they should in spite of it.
    let level = [vec![20.0 * UM; 400], vec![60.0 * UM; 400]];
    let none = vec![0.0; 400];
    let courses = [0, 1]
        .map(|i| ReferenceSamples { reference: level[i].as_slice(), feedforward: none.as_slice() });
    let integral = Law::Pid(Pid::new(0.3e6, 0.02, 0.0, None).unwrap().at(TS).unwrap());
    let loops = Controller::new(Limits::new(-100.0, 100.0).unwrap(), integral);
    let run = track_both(
        &TwoAxes { lag: 0.008, ..axes },
        (axis.rest(), axis.rest()),
        &timing(0.0, 1),
        (&loops, &loops),
        courses,
        NEVER,
    );
    let (x, y) = run.unwrap().unwrap();
    let (dx, dy) = (UM * x.motion.command[399], UM * y.motion.command[399]);
    assert!((dx + xy * dy - 20.0 * UM).abs() < 1e-15);
    assert!((dy + yx * dx - 60.0 * UM).abs() < 1e-15);
}

#[test]
fn identified_cross_talk_is_the_stage_s_within_its_deviation() {
    // Over thirty seeds the deviations are those that are claimed.
    let u: Vec<f64> = (0..2000).map(|k| 37.5 - 37.5 * (TAU * 1e-3 * f64::from(k)).cos()).collect();
    let held = vec![0.0; u.len()];
    let (mut square, mut count) = (0.0, 0.0);
    for seed in 0..30 {
        let (x, y) = (VirtualStage::xu_li_2010(seed), VirtualStage::xu_li_2010_y(seed));
        let axes = TwoAxes {
            x: x.apparatus(),
            y: y.apparatus(),
            cross_talk: [0.015, 0.01],
            lag: 0.01,
            missed: MissedTicks::NONE,
        };
        let drives = [&u, &held].map(|u| Drive::new(u, 1e-3, Hold::First).unwrap());
        let start = (x.start(), y.start());
        let run = open_loops(&axes, start, [&drives[0], &drives[1]], NEVER).unwrap().unwrap();
        let found = cross_talk(&run.0.measured, &run.1.measured).unwrap();
        assert!((found.share - 0.01).abs() < 5.0 * found.sd, "{found:?}");
        square += ((found.share - 0.01) / found.sd).powi(2);
        count += 1.0;
    }
    let ratio = (square / count).sqrt();
    assert!((0.5..2.0).contains(&ratio), "{ratio}");
    let still = vec![3.0 * UM; 100];
    assert!(cross_talk(&still, &still).unwrap_err().to_string().contains("does not move"));
}

#[test]
fn noise_is_found_again_beside_the_creep() {
    for (noise, bandwidth, seed) in [(0.0964, 200.0, 1), (0.05, 50.0, 2), (0.2, 800.0, 3)] {
        let mut stage = VirtualStage::xu_li_2010(seed);
        stage.sensor.noise = noise * UM;
        stage.sensor.bandwidth = bandwidth;
        let held = vec![0.0; 50_000];
        let run = stage.simulate(&Drive::new(&held, 2e-4, Hold::Zero).unwrap(), NEVER);
        let found = noise_at_rest(&run.unwrap().unwrap().measured, 2e-4).unwrap();
        assert!((found.noise / (noise * UM) - 1.0).abs() < 0.05, "{found:?}");
        assert!((found.resolution / stage.sensor.resolution - 1.0).abs() < 1e-9);
        let sd = found.bandwidth_sd.unwrap();
        assert!((found.bandwidth - bandwidth).abs() < 4.0 * sd, "{found:?}");
        assert!(sd < 0.05 * bandwidth);
    }
}

#[test]
fn white_noise_and_numbers_on_no_grid_are_told_as_such() {
    let mut stage = VirtualStage::xu_li_2010(1);
    stage.sensor.bandwidth = f64::INFINITY;
    stage.sensor.resolution = 0.0;
    let held = vec![0.0; 5000];
    let run = stage.simulate(&Drive::new(&held, 2e-4, Hold::Zero).unwrap(), NEVER);
    let found = noise_at_rest(&run.unwrap().unwrap().measured, 2e-4).unwrap();
    assert_eq!(found.resolution, 0.0);
    assert!(found.bandwidth.is_infinite() && found.bandwidth_sd.is_none());
    assert!(noise_at_rest(&vec![1e-6; 200], 1e-3).is_err());
    assert!(noise_at_rest(&[1e-6; 20], 1e-3).is_err());
}

#[test]
fn refusals_name_the_argument() {
    let plant = Rigid;
    let axis = Apparatus::ideal(&plant, 1.0);
    let told = |cross_talk, lag| {
        TwoAxes { x: axis, y: axis, cross_talk, lag, missed: MissedTicks::NONE }
            .validate()
            .unwrap_err()
            .to_string()
    };
    assert!(told([0.1, f64::NAN], 0.0).starts_with("cross_talk[1] is NaN"));
    assert!(told([1.0, 1.0], 0.0).contains("product is below 1"));
    assert!(told([0.0, 0.0], -0.1).starts_with("lag is -0.1 s"));
    let missed = MissedTicks { chance: 1.5, most: 3 };
    let axes = TwoAxes { x: axis, y: axis, cross_talk: [0.0, 0.0], lag: 0.0, missed };
    let told = axes.validate().unwrap_err().to_string();
    assert!(told.starts_with("missed_ticks is 1.5: expected a number from 0 to 1"), "{told}");
}

#[test]
fn a_run_stops_when_told() {
    let plant = Rigid;
    let axis = Apparatus::ideal(&plant, 1.0);
    let axes =
        TwoAxes { x: axis, y: axis, cross_talk: [0.0, 0.0], lag: 0.01, missed: MissedTicks::NONE };
    let volts = [1.0; 9];
    let course = ReferenceSamples { reference: &volts, feedforward: &volts };
    let start = (axis.rest(), axis.rest());
    let stop = &|| true;
    let run = track_both(&axes, start, &timing(0.0, 1), (&open(), &open()), [course; 2], stop);
    assert!(run.unwrap().is_none());
    let drive = Drive::new(&volts, 1e-3, Hold::First).unwrap();
    assert!(open_loops(&axes, start, [&drive, &drive], stop).unwrap().is_none());
}

#[test]
fn missed_ticks_put_y_behind_by_whole_samples_of_the_path() {
    let plant = Rigid;
    let axis = Apparatus::ideal(&plant, 1.0);
    // The voltage tells which point of the path it is for.
    let points: Vec<f64> = (0..4000).map(f64::from).collect();
    let course = ReferenceSamples { reference: &points, feedforward: &points };
    let course = [course, course];
    let limits = Limits::new(-1e4, 1e4).unwrap();
    let open = Controller::new(limits, Law::None);
    let behind = |missed, seed| {
        let mut y = axis;
        y.sensor.seed = seed;
        let axes = TwoAxes { x: axis, y, cross_talk: [0.0, 0.0], lag: 0.0, missed };
        let start = (axis.rest(), axis.rest());
        let run = track_both(&axes, start, &timing(0.0, 1), (&open, &open), course, NEVER);
        let (x, y) = run.unwrap().unwrap();
        assert!(x.commands.iter().zip(&points).all(|(command, at)| command.volts == *at));
        let late = y.commands.iter().zip(&points).map(|(command, at)| at - command.volts);
        late.collect::<Vec<f64>>()
    };
    assert!(behind(MissedTicks::NONE, 3).iter().all(|late| *late == 0.0));
    assert!(behind(MissedTicks { chance: 1.0, most: 0 }, 3).iter().all(|late| *late == 0.0));
    let found = behind(MissedTicks { chance: 0.2, most: 3 }, 3);
    assert_eq!(found, behind(MissedTicks { chance: 0.2, most: 3 }, 3));
    assert_ne!(found, behind(MissedTicks { chance: 0.2, most: 3 }, 4));
    let steps: Vec<f64> = found.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(found[0] <= 1.0 && steps.iter().all(|step| step.abs() <= 1.0));
    // Each of 0 to 3 a quarter of the time; a missed tick shows unless the walk is at its end.
    for late in [0.0, 1.0, 2.0, 3.0] {
        let share = found.iter().filter(|one| **one == late).count() as f64 / 4000.0;
        assert!((share - 0.25).abs() < 0.12, "{late}: {share}");
    }
    let share = steps.iter().filter(|step| **step != 0.0).count() as f64 / 4000.0;
    assert!((share - 0.2 * 0.75).abs() < 0.03, "{share}");
}

#[test]
fn a_lag_that_varies_has_peaks_of_its_largest_value() {
    // Peak to peak by SD of the contour error: sqrt 8 for a constant lag. One that is each of 0 to
    // 3 samples a quarter of the time has the peaks of 3, and the SD of its mean square, 3.5.
    let plant = Rigid;
    let axis = Apparatus::ideal(&plant, 1.0);
    let turn = 500;
    let courses = [0.0, TAU / 4.0].map(|phase| wave(40 * turn + 1, 0.0, 40.0, 0.1, phase));
    let ratio = |lag, missed| {
        let axes = TwoAxes { x: axis, y: axis, cross_talk: [0.0, 0.0], lag, missed };
        let courses = [&courses[0], &courses[1]]
            .map(|volts| ReferenceSamples { reference: volts, feedforward: volts });
        let start = (axis.rest(), axis.rest());
        let run = track_both(&axes, start, &timing(0.0, 1), (&open(), &open()), courses, NEVER);
        let (x, y) = run.unwrap().unwrap();
        let [x, y] = [&x.motion.measured[turn..], &y.motion.measured[turn..]];
        let spread = Spread::of(radial_errors(x, y, [0.0, 0.0], 40.0 * UM).unwrap().into_iter());
        spread.peak_to_peak / spread.sd
    };
    let constant = ratio(3.0 * TS, MissedTicks::NONE);
    assert!((constant - 8.0_f64.sqrt()).abs() < 0.03, "{constant}");
    let varying = ratio(0.0, MissedTicks { chance: 0.1, most: 3 });
    let expected = (8.0_f64 * 9.0 / 3.5).sqrt();
    assert!((varying / expected - 1.0).abs() < 0.1, "{varying} {expected}");
}
