//! Repetitive control beside the published PID, in loops with a static plant.
#![allow(missing_docs, clippy::unwrap_used)]

use core::f64::consts::TAU;

use piezotrack_control::{
    Command, Controller, FeedbackSample, Limits, Outcome, Pid, Repetitive, SampledPid, Smoothing,
};

const DT: f64 = 0.02;
const WIDE: (f64, f64) = (-1e6, 1e6);

fn published() -> SampledPid {
    Pid::xu_li_2010().at(DT).unwrap()
}

/// A 55 um sine about 55 um, from rest, with `period` in samples, and a second harmonic.
fn sine(k: u32, period: f64) -> f64 {
    let angle = TAU * f64::from(k) / period;
    55e-6 * (1.0 - angle.cos()) + 5e-6 * (1.0 - (2.0 * angle).cos())
}

/// A static plant of `gain` m/V that answers one sample later, with feedforward 10 % off.
fn track(
    learner: Option<Repetitive>,
    limits: (f64, f64),
    gain: f64,
    period: f64,
    periods: f64,
) -> Vec<Command> {
    track_lagging(learner, limits, (gain, 0.0), period, periods)
}

/// The same with a plant of first order: `plant` is its gain, m/V, and its pole.
fn track_lagging(
    learner: Option<Repetitive>,
    limits: (f64, f64),
    (gain, pole): (f64, f64),
    period: f64,
    periods: f64,
) -> Vec<Command> {
    let mut controller = Controller::new(Limits::new(limits.0, limits.1).unwrap(), published());
    controller.repetitive = learner.map(|learner| learner.at(DT).unwrap());
    let mut state = controller.rest(vec![0.0; 600]).unwrap();
    let mut y = 0.0;
    let mut out = Vec::new();
    while f64::from(u32::try_from(out.len()).unwrap()) < periods * period {
        let r = sine(u32::try_from(out.len()).unwrap(), period);
        let command = controller.step(&mut state, r, y, 0.9 * r / gain);
        y = pole * y + (1.0 - pole) * gain * command.volts;
        out.push(command);
    }
    out
}

fn largest(commands: &[Command], value: impl Fn(&Command) -> f64) -> f64 {
    commands.iter().fold(0.0, |most, command| f64::max(most, value(command).abs()))
}

/// Amplitude of the error at the fundamental, over the last period.
fn fundamental(commands: &[Command], period: u32) -> f64 {
    let last = &commands[commands.len() - period as usize..];
    let (mut re, mut im) = (0.0, 0.0);
    for (k, command) in (0_u32..).zip(last) {
        let angle = TAU * f64::from(k) / f64::from(period);
        re += command.error * angle.cos();
        im += command.error * angle.sin();
    }
    2.0 / f64::from(period) * re.hypot(im)
}

fn lag(tq: f64, compensated: bool) -> Smoothing {
    Smoothing::Lag { tq, compensated }
}

#[test]
fn recursion_is_the_published_one() {
    // uRC[k] = p uRC[k-1] + (1-p)(uRC[k-N-1] + Kq e[k-N-1]), Kq in V/m
    let part = Repetitive::xu_li_2010(0.2).at(DT).unwrap();
    let mut state = part.rest([0.0; 22]).unwrap();
    let p = (-DT / 0.2).exp();
    let (mut u, mut e) = (vec![0.0; 12], vec![0.0; 12]);
    for k in 12..200_usize {
        let expected = p * u[k - 1] + (1.0 - p) * (u[k - 11] + 1e6 * e[k - 11]);
        let before = Outcome { error: e[k - 1], excess: 0.0 };
        let volts = part.step(&mut state, before, 75.0);
        assert!((volts - expected).abs() < 1e-12, "{volts} V, {expected} V at {k}");
        u.push(volts);
        e.push(1e-6 * f64::from(u32::try_from(k * k % 17).unwrap()));
    }
}

#[test]
fn printed_coefficients_diverge_and_ours_do_not() {
    // (30), beside the PID, static plant: growth of uRC from the 50th to the 1000th period.
    let (gain, n) = (0.9e-6, 100_usize);
    let pid = published();
    let mut state = piezotrack_control::Feedback::rest(&pid);
    let (mut u, mut e) = (vec![0.0; n + 2], vec![0.0; n + 2]);
    let mut y = 0.0;
    for k in n + 2..1000 * n {
        let r = sine(u32::try_from(k - n - 2).unwrap(), 100.0);
        e.push(r - y);
        u.push(
            1.81 * u[k - 1] - 0.8187 * u[k - 2] + 0.0952 * u[k - n - 1] - 0.0861 * u[k - n - 2]
                + 1e6 * (0.0952 * e[k - n - 1] - 0.0861 * e[k - n - 2]),
        );
        let feedback =
            piezotrack_control::Feedback::step(&pid, &mut state, &FeedbackSample::new(e[k]));
        y = gain * (feedback + 0.9 * r / gain + u[k]);
    }
    let most =
        |from: usize| u[from * n..(from + 1) * n].iter().fold(0.0, |m, u| f64::max(m, u.abs()));
    assert!(most(998) > 100.0 * most(50), "{} {}", most(50), most(998));

    let ours = track(Some(Repetitive::xu_li_2010(2.0)), WIDE, gain, 100.0, 1000.0);
    let most = |from: usize| largest(&ours[from * n..(from + 1) * n], |c| c.repetitive);
    assert!(most(998) < 1.01 * most(50), "{} {}", most(50), most(998));
}

#[test]
fn hidden_root_drifts_under_saturation_in_the_papers_form_only() {
    for period in [2.0, 5.0] {
        let n = period / DT;
        let paper = Repetitive::xu_li_2010(period);
        let ours = Repetitive::new(period, lag(0.2, false), 1.0).unwrap();
        let run = |learner, periods| track(Some(learner), (6.0, 28.0), 1.0e-6, n, periods);
        // The forgetting factor forgets within some 100 periods.
        let (paper, ours) = (run(paper, 98.0), run(ours, 1000.0));
        let late = |commands: &[Command], share: usize| {
            let end = commands.len() / share;
            largest(&commands[end - 250..end], |command| command.repetitive)
        };
        // As far as the range of the limits lets it.
        assert!(late(&paper, 1) > 21.9 && late(&paper, 1) >= late(&paper, 2));
        assert!(late(&ours, 1) < 5.0 && late(&ours, 1) < 1.05 * late(&ours, 2) + 1e-9);
    }
}

#[test]
fn compensated_lag_reduces_the_fundamental() {
    // Table 1's plant: a lag of D/K = 0.1 s, T/K = 1.8 um/V at rest.
    let plant = (0.0468 / 26065.0, (-DT * 26065.0 / 2597.3_f64).exp());
    for (period, samples, plain, compensated) in [(5.0, 250, 0.76, 0.29), (2.0, 100, 0.74, 0.62)] {
        let n = f64::from(samples);
        let amplitude = |smoothing: Option<Smoothing>| {
            let learner = smoothing
                .map(|smoothing| Repetitive { smoothing, ..Repetitive::xu_li_2010(period) });
            fundamental(&track_lagging(learner, WIDE, plant, n, 100.0), samples)
        };
        let without = amplitude(None);
        let ratio = |compensated| amplitude(Some(lag(0.2, compensated))) / without;
        assert!((ratio(true) - compensated).abs() < 0.03, "{}", ratio(true));
        assert!((ratio(false) - plain).abs() < 0.04, "{}", ratio(false));
    }
}

#[test]
fn fractional_periods_learn() {
    let period = 100.37;
    for smoothing in [Smoothing::ZeroPhase { order: 1 }, Smoothing::ZeroPhase { order: 4 }] {
        let error = |samples: Option<f64>| {
            let learner = samples.map(|samples| {
                let kq = 0.3;
                let new = Repetitive::new(samples * DT, smoothing, kq).unwrap();
                Repetitive { forgetting_factor: 1.0, lead: 1, ..new }
            });
            let run = track(learner, WIDE, 0.6e-6, period, 200.0);
            largest(&run[run.len() - 400..], |command| command.error)
        };
        let (none, rounded, exact) = (error(None), error(Some(100.0)), error(Some(period)));
        assert!(exact < 0.1 * none, "{exact} m of {none} m");
        assert!(exact < 0.2 * rounded, "{exact} m, rounded {rounded} m");
    }
}

#[test]
fn memory_stays_in_step_through_a_dropout() {
    let mut controller = Controller::new(Limits::new(-100.0, 200.0).unwrap(), published());
    let new = Repetitive::new(2.0, Smoothing::ZeroPhase { order: 2 }, 0.3).unwrap();
    controller.repetitive = Some(new.at(DT).unwrap());
    let mut state = controller.rest(vec![0.0; 220]).unwrap();
    let gain = 0.6e-6;
    let (mut y, mut before, mut after) = (0.0, 0.0, 0.0);
    for k in 0..10_000 {
        let r = sine(k, 100.0);
        let lost = (8000..8007).contains(&k);
        let command =
            controller.step(&mut state, r, if lost { f64::NAN } else { y }, 0.9 * r / gain);
        y = gain * command.volts;
        if (7900..8000).contains(&k) {
            before = f64::max(before, command.error.abs());
        } else if (8050..8150).contains(&k) {
            after = f64::max(after, command.error.abs());
        }
    }
    assert!(after < 1.5 * before, "{after} m, before {before} m");
}

#[test]
fn settings_are_refused_by_name() {
    let smoothing = lag(0.2, false);
    let new = Repetitive::new;
    for kq in [0.0, 2.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(new(5.0, smoothing, kq).unwrap_err().name, "kq");
    }
    for period in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(new(period, smoothing, 1.0).unwrap_err().name, "period");
    }
    assert_eq!(new(5.0, lag(0.0, false), 1.0).unwrap_err().name, "tq");
    assert_eq!(new(5.0, Smoothing::ZeroPhase { order: 5 }, 1.0).unwrap_err().name, "order");
    let good = new(5.0, smoothing, 1.0).unwrap();
    assert_eq!(
        Repetitive { forgetting_factor: 1.01, ..good }.at(DT).unwrap_err().name,
        "forgetting_factor"
    );
    assert_eq!(Repetitive { lead: 251, ..good }.at(DT).unwrap_err().name, "lead");
    assert!(Repetitive { lead: 250, ..good }.at(DT).is_ok());
    assert_eq!(good.at(0.0).unwrap_err().name, "dt");
    assert_eq!(good.at(3.0).unwrap_err().name, "period");
    assert!(good.at(2.5).is_ok());
    // Ten samples of a period, although the compensated lag needs one only, in two lines.
    assert_eq!(new(0.2, lag(0.2, true), 1.0).unwrap().at(DT).unwrap().length(), 20);
    assert_eq!(new(0.19, lag(0.2, true), 1.0).unwrap().at(DT).unwrap_err().name, "period");
}
