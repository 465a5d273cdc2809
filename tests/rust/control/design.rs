//! Design of the sampled loop: published numbers, closed forms, and the loop itself as judge.
#![allow(missing_docs, clippy::unwrap_used)]

use core::f64::consts::{PI, TAU};
use std::time::Instant;

use nalgebra::DMatrix;
use piezotrack_control::{
    Controller, Feedback, Filter, Limits, Pid, Repetitive, SampledPid, SampledRepetitive,
    Smoothing, StateSpace,
};
use piezotrack_core::Error;
use piezotrack_core::design::{LinearFeedback, LoopPlant, SampledLoop, check_loop, margins};
use piezotrack_core::integrator::Mechanics;
use piezotrack_core::models::dahl::{DahlStage, extremes, linearised};

const DT: f64 = 0.02;

fn published() -> SampledPid {
    Pid::xu_li_2010().at(DT).unwrap()
}

fn close(a: f64, b: f64, within: f64) {
    assert!((a - b).abs() <= within, "{a} is not within {within} of {b}");
}

/// The largest stable gain of a plant of 1 um/V with the published PID, um/V.
fn limit(plant: &LoopPlant, repetitive: Option<&SampledRepetitive>) -> f64 {
    let range = SampledLoop::new(plant, &published(), &[], repetitive, DT).unwrap().stable_gains();
    assert!(range.unwrap().low < 1e-12);
    range.unwrap().high
}

fn mode(frequency: f64) -> LoopPlant {
    LoopPlant::mode(1e-6, frequency, 0.065).unwrap()
}

/// Table 1 of Xu and Li 2010 without its hysteresis.
fn table_1() -> LoopPlant {
    let stage = DahlStage::xu_li_2010();
    LoopPlant::mechanical(&stage.mechanics, stage.piezo_coefficient).unwrap()
}

#[test]
fn limits_of_the_published_gains() {
    // The expected numbers are the first of a search in steps of 0.01, and so above.
    let check = |plant: &LoopPlant, published: f64| {
        let found = limit(plant, None);
        println!("limit {found:.4} um/V, published {published}");
        assert!(found <= published && found > published - 0.01, "{found} {published}");
    };
    check(&LoopPlant::fixed_gain(1e-6).unwrap(), 1.28);
    let modes =
        [(150.0, 2.34), (155.0, 2.21), (160.0, 1.81), (165.0, 1.33), (170.0, 0.94), (172.7, 0.83)];
    for (frequency, published) in modes {
        check(&mode(frequency), published);
    }
    for (lag, published) in [(1e-3, 1.98), (4e-3, 1.46)] {
        check(&mode(160.0).with_amplifier(1.0 / (TAU * lag)).unwrap(), published);
    }
}

#[test]
fn closed_form_of_the_static_limit() {
    // 1 + L = 0 at z = -1: G Kp (1 + Ts/(2 Ti) + 2 Td/Ts) = 1
    let exact = 1.0 / (0.120 * (1.0 + DT / 0.018 + 2.0 * 0.044 / DT));
    close(limit(&LoopPlant::fixed_gain(1e-6).unwrap(), None), exact, 1e-12);
}

#[test]
fn slowest_roots_with_repetitive_control() {
    for (period, n, radius, periods) in [(2.0, 100.0, 0.9987, 8.0), (5.0, 250.0, 0.99989, 35.0)] {
        let part = Repetitive::xu_li_2010(period).at(DT).unwrap();
        let start = Instant::now();
        let one = SampledLoop::new(&table_1(), &published(), &[], Some(&part), DT).unwrap();
        let verdict = one.check().unwrap();
        println!("N = {n}: {verdict:?} in {:?}", start.elapsed());
        assert!(verdict.stable && verdict.hidden == 1);
        let root = verdict.slowest.unwrap();
        close(root.radius, radius, if n < 200.0 { 5e-5 } else { 5e-6 });
        close(verdict.periods.unwrap(), periods, 0.5);
        close(root.samples, verdict.periods.unwrap() * n, 1e-6);
        // An odd place of the spectrum: the lag adds ten samples to the period
        close(1.0 / (root.frequency * DT), n + 10.0, n * 0.05);
        assert!(verdict.small_gain.unwrap() <= 1.0);
        let gain = limit(&LoopPlant::fixed_gain(1e-6).unwrap(), Some(&part));
        println!("static plant: {gain}");
        close(gain, 1.21, 0.01);
        // What runs by default forgets, and has no hidden root
        let part = Repetitive { forgetting_factor: 0.99, ..Repetitive::xu_li_2010(period) }
            .at(DT)
            .unwrap();
        let one = SampledLoop::new(&table_1(), &published(), &[], Some(&part), DT).unwrap();
        let verdict = one.check().unwrap();
        assert!(verdict.stable && verdict.hidden == 0 && verdict.small_gain.unwrap() < 0.999);
        assert!(verdict.slowest.unwrap().radius < 1.0);
    }
}

#[test]
fn printed_coefficients_have_a_pole_outside() {
    // (30) of the paper, N = 250, by Newton's method on the real axis from above
    let f = |z: f64| 1.0 - 1.81 / z + 0.8187 / (z * z) - (0.0952 - 0.0861 / z) * z.powi(-251);
    let mut z = 1.01_f64;
    for _ in 0..100 {
        z -= f(z) * 1e-7 / (f(z + 1e-7) - f(z));
    }
    close(z, 1.000_172, 5e-7);
    // Ours, with nothing in the loop
    let part = Repetitive::xu_li_2010(5.0).at(DT).unwrap();
    let plant = LoopPlant::fixed_gain(0.0).unwrap();
    let alone = SampledLoop::new(&plant, &(), &[], Some(&part), DT).unwrap();
    assert_eq!(alone.roots_outside(1.0 + 1e-9), Some(0));
    assert_eq!(alone.roots_outside(1.0 - 1e-9), Some(1));
    close(alone.slowest_root().unwrap().unwrap().radius, 1.0, 1e-12);
}

#[test]
fn margins_of_an_integrating_loop_in_closed_form() {
    // L = g/(z - 1): gain margin 2/g; |L| = 1 at w Ts = 2 asin(g/2), phase margin
    // pi/2 - asin(g/2); Ms = 2/(2 - g) at half the sampling rate.
    let dt = 1e-3;
    let plant = LoopPlant::fixed_gain(1e-6).unwrap();
    for g in [0.05, 0.3, 1.0, 1.7] {
        let law = StateSpace::<3>::new(&[1.0], &[g * 1e6], &[1.0], g * 1e6, None).unwrap();
        let found = margins(&plant, &law, &[], dt).unwrap();
        let angle = 2.0 * (0.5 * g).asin();
        let phase = 0.5 * (PI - angle);
        assert!(found.stable);
        close(found.gain.unwrap(), 2.0 / g, 1e-10 / g);
        close(found.gain_frequency.unwrap(), 500.0, 1e-6);
        close(found.phase.unwrap(), phase, 1e-9);
        close(found.crossover.unwrap(), angle / (TAU * dt), 1e-6);
        close(found.phase_frequency.unwrap(), angle / (TAU * dt), 1e-6);
        close(found.delay.unwrap(), phase / angle * dt, 1e-10);
        close(found.sensitivity, 2.0 / (2.0 - g), 1e-9);
        close(found.sensitivity_frequency, 500.0, 0.1);
    }
    let law = StateSpace::<3>::new(&[1.0], &[2.5e6], &[1.0], 2.5e6, None).unwrap();
    let found = margins(&plant, &law, &[], dt).unwrap();
    assert!(!found.stable);
    close(found.gain.unwrap(), 0.8, 1e-10);
}

#[test]
fn response_is_that_of_the_parts() {
    // A mode far below the sampling rate, against the continuous transfer function times the
    // hold's (1 - exp(-s Ts))/(s Ts) and a delay
    let (dt, frequency, damping, delay) = (1e-6, 160.0, 0.065, 3.4e-6);
    let plant = LoopPlant::mode(1.5e-6, frequency, damping).unwrap().with_delay(delay).unwrap();
    let plant = plant.with_amplifier(800.0).unwrap();
    let law = StateSpace::<1>::new(&[0.0], &[0.0], &[0.0], 1.0e6, None).unwrap();
    let one = SampledLoop::new(&plant, &law, &[], None, dt).unwrap();
    let at = [1.0, 50.0, 159.0, 400.0, 3000.0];
    let response = one.response(&at).unwrap();
    for (f, [re, im]) in at.iter().zip(&response.open) {
        let (r, a) = (f / frequency, f / 800.0);
        let mode = nalgebra::Complex::new(1.0 - r * r, 2.0 * damping * r);
        let amplifier = nalgebra::Complex::new(1.0, a);
        let lag = nalgebra::Complex::from_polar(1.5, -TAU * f * (delay + 0.5 * dt));
        let exact = lag / (mode * amplifier);
        close(*re, exact.re, 2e-4 * exact.norm());
        close(*im, exact.im, 2e-4 * exact.norm());
    }
    assert!(one.response(&[6e5]).is_err() && one.response(&[f64::NAN]).is_err());
}

#[test]
fn dahl_stage_is_linearised_along_its_virgin_branch() {
    let stage = DahlStage::xu_li_2010();
    // From 1.80 to 1.44 um/V over the stroke, and softer the other way
    close(linearised(&stage, 0.0).unwrap().static_gain(), 1.80e-6, 5e-9);
    close(linearised(&stage, 117e-6).unwrap().static_gain(), 1.44e-6, 5e-9);
    let [softest, stiffest] = extremes(&stage, 0.0..=117e-6).unwrap();
    close(softest.static_gain(), 1.80e-6, 5e-9);
    close(stiffest.static_gain(), 1.44e-6, 5e-9);
    // The extreme inside a long range: q2' = 0
    let [_, stiffest] = extremes(&stage, 0.0..=2.5e-3).unwrap();
    let lowest = (1..2500).map(|i| {
        linearised(&stage, 1e-6 * f64::from(i)).map_or(f64::INFINITY, |plant| plant.static_gain())
    });
    close(stiffest.static_gain(), lowest.fold(f64::INFINITY, f64::min), 1e-13);
    // dFh/dx of the operator itself, by a difference of closed forms of the force
    for (a1, a2) in [(121.9874, 1.1773e6), (5e3, 1.1773e6), (2e3, 1e6), (0.0, 0.0)] {
        let stage = DahlStage { a1, a2, ..stage };
        let x = 400e-6;
        let (mut q1, mut q2) = (0.0, 0.0);
        let h = x / 1e6;
        for _ in 0..1_000_000 {
            let (m1, m2) = (q1 + 0.5 * h * q2, q2 + 0.5 * h * (stage.up - a2 * q1 - a1 * q2));
            q1 += h * m2;
            q2 += h * (stage.up - a2 * m1 - a1 * m2);
        }
        let exact = stage.piezo_coefficient / (stage.mechanics.stiffness + stage.b1 * q2);
        close(linearised(&stage, x).unwrap().static_gain(), exact, 1e-9 * exact);
    }
}

/// A plant in continuous time, in small Runge-Kutta steps: an independent judge.
struct Simulated {
    gain: f64,
    natural: f64,
    damping: f64,
    amplifier: f64,
    delay: f64,
}

impl Simulated {
    fn plant(&self) -> LoopPlant {
        LoopPlant::mode(self.gain, self.natural / TAU, self.damping)
            .and_then(|plant| plant.with_amplifier(self.amplifier / TAU))
            .and_then(|plant| plant.with_delay(self.delay))
            .unwrap()
    }

    fn slope(&self, [x, v, a]: [f64; 3], u: f64) -> [f64; 3] {
        let square = self.natural * self.natural;
        let force = square * (self.gain * a - x);
        [v, force - 2.0 * self.damping * self.natural * v, self.amplifier * (u - a)]
    }

    /// Growth of a displacement far below any span, a sample, over the later half of `samples`.
    fn growth<F: Feedback>(&self, controller: &Controller<F>, dt: f64, samples: usize) -> f64 {
        let mut state = controller.rest(vec![0.0; 2000]).unwrap();
        let (mut x, mut past) = ([0.0; 3], vec![0.0; 8]);
        let mut peaks = [0.0_f64; 2];
        for k in 0..samples {
            let reference = if k < 5 { 1e-60 } else { 0.0 };
            past.insert(0, controller.step(&mut state, reference, x[0], 0.0).volts);
            past.truncate(8);
            let steps = 64_u32;
            let h = dt / f64::from(steps);
            for i in 0..steps {
                // Delays in these tests are whole numbers of steps
                let late = |age: u32| self.delay > h * f64::from(i) + dt * f64::from(age) + 1e-9;
                let u = past[(0..7).find(|age| !late(*age)).unwrap() as usize];
                let moved = |s: [f64; 3], d: [f64; 3], h: f64| {
                    [s[0] + h * d[0], s[1] + h * d[1], s[2] + h * d[2]]
                };
                let k1 = self.slope(x, u);
                let k2 = self.slope(moved(x, k1, 0.5 * h), u);
                let k3 = self.slope(moved(x, k2, 0.5 * h), u);
                let k4 = self.slope(moved(x, k3, h), u);
                for j in 0..3 {
                    x[j] += h / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]);
                }
            }
            let window = samples / 4;
            if k >= samples / 2 {
                let peak = &mut peaks[usize::from(k >= samples / 2 + window)];
                *peak = peak.max(x[0].abs());
            }
        }
        (peaks[1] / peaks[0]).powf(4.0 / f64::from(u32::try_from(samples).unwrap()))
    }
}

#[test]
fn verdicts_agree_with_the_running_controller() {
    let dt = 1e-3;
    let wide = Limits::new(-1e60, 1e60).unwrap();
    let lag = Smoothing::Lag { tq: 3e-3, compensated: true };
    let mut random = 12_345_u32;
    let mut draw = |low: f64, high: f64| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        low + (high - low) * f64::from(random >> 8) / 16_777_216.0
    };
    for setting in 0..8 {
        let mut plant = Simulated {
            gain: 1e-6,
            natural: draw(200.0, 2000.0),
            damping: draw(0.05, 0.7),
            amplifier: draw(300.0, 3000.0),
            delay: (draw(0.0, 200.0)).round() * dt / 64.0,
        };
        let pid = Pid::new(draw(0.05e6, 0.3e6), draw(2e-3, 20e-3), draw(0.0, 1e-3), None);
        let mut controller = Controller::new(wide, pid.unwrap().at(dt).unwrap());
        if setting % 2 == 1 {
            controller.filters[0] = Some(Filter::low_pass(draw(50.0, 300.0), dt).unwrap());
            controller.filters[1] = Some(Filter::notch(150.0, 0.4, 0.1, dt).unwrap());
        }
        if setting % 4 > 1 {
            let smoothing = if setting > 4 { lag } else { Smoothing::ZeroPhase { order: 2 } };
            let part = Repetitive::new(draw(20.0, 30.0) * dt, smoothing, draw(0.02, 0.2)).unwrap();
            let part = Repetitive { lead: setting % 3, ..part };
            controller.repetitive = Some(part.at(dt).unwrap());
        }
        let one = SampledLoop::of(&plant.plant(), &controller, dt).unwrap();
        let range = one.stable_gains().unwrap();
        for factor in [0.97, 1.03] {
            plant.gain = 1e-6 * range.high * factor;
            let verdict = check_loop(&plant.plant(), &controller, dt).unwrap();
            let root = verdict.slowest.unwrap();
            let growth = plant.growth(&controller, dt, 4000);
            println!("{setting} x {factor}: {} root {root:?}, seen {growth}", range.high);
            assert_eq!(verdict.stable, factor < 1.0);
            assert!((growth < 1.0) == (factor < 1.0) && (root.radius < 1.0) == (factor < 1.0));
            // Several slow roots make up what is seen of a repetitive loop below its limit.
            if factor > 1.0 || controller.repetitive.is_none() {
                close(growth, root.radius, 0.05 * (1.0 - root.radius).abs() + 2e-5);
            } else {
                assert!(growth < root.radius + 2e-5);
            }
        }
    }
}

/// All roots of the loop of a static plant, as eigenvalues of its state's matrix: PID memory,
/// repetitive line, last voltage.
fn eigenvalues(gain: f64, part: &SampledRepetitive) -> Vec<nalgebra::Complex<f64>> {
    // In V/um and um, so that all entries are of one size
    let [kp, ki, kd] = published().weights().map(|weight| weight * 1e-6);
    let gain = gain * 1e6;
    let recursion = part.recursion();
    let learning = recursion.gain * 1e-6;
    let length = recursion.nearest + recursion.taps.len();
    // State: y, e1, e2, uFB, then uRC and e of the last samples
    let n = 4 + 2 * length;
    let mut matrix = DMatrix::zeros(n, n);
    for column in 0..n {
        let mut s = vec![0.0; n];
        s[column] = 1.0;
        let e = -s[0];
        let feedback = s[3] + kp * (e - s[1]) + ki * e + kd * (e - 2.0 * s[1] + s[2]);
        let mut learnt = recursion.pole * s[4];
        for (i, tap) in recursion.taps.iter().rev().enumerate() {
            let age = recursion.nearest + i - 1;
            learnt += tap * (s[4 + age] + learning * s[4 + length + age - recursion.lead]);
        }
        let mut next = vec![0.0; n];
        next[..4].copy_from_slice(&[gain * (feedback + learnt), e, s[1], feedback]);
        next[4] = learnt;
        next[4 + length] = e;
        for i in 1..length {
            next[4 + i] = s[3 + i];
            next[4 + length + i] = s[3 + length + i];
        }
        matrix.column_mut(column).copy_from_slice(&next);
    }
    matrix.complex_eigenvalues().iter().copied().collect()
}

#[test]
fn hidden_root_is_at_exactly_one() {
    for (period, gain) in [(9.0, 0.9e-6), (24.5, 1.0e-6), (12.0, 1.4e-6), (20.0, 1.9e-6)] {
        let part = Repetitive::xu_li_2010(period * DT).at(DT).unwrap();
        let plant = LoopPlant::fixed_gain(gain).unwrap();
        let one = SampledLoop::new(&plant, &published(), &[], Some(&part), DT).unwrap();
        assert_eq!(one.hidden_roots(), 1);
        let mut roots = eigenvalues(gain, &part);
        let hidden = (0..roots.len())
            .min_by(|i, j| (roots[*i] - 1.0).norm().total_cmp(&(roots[*j] - 1.0).norm()))
            .unwrap();
        let root = roots.swap_remove(hidden);
        println!("hidden root {root}");
        assert!((root - 1.0).norm() < 1e-12);
        let slowest = roots.iter().map(|root| root.norm()).fold(0.0, f64::max);
        close(one.slowest_root().unwrap().unwrap().radius, slowest, 1e-11);
        let outside = roots.iter().filter(|root| root.norm() > 1.0).count();
        assert_eq!(one.roots_outside(1.0), Some(outside));
        let within = roots.iter().filter(|root| root.norm() > 0.9).count();
        assert_eq!(one.roots_outside(0.9), Some(within));
    }
    // A forgetting factor moves it inside, where it is found again and set apart
    for (period, gain) in [(12.0, 0.9e-6), (24.5, 1.0e-6)] {
        let part = Repetitive { forgetting_factor: 0.95, ..Repetitive::xu_li_2010(period * DT) };
        let part = part.at(DT).unwrap();
        let plant = LoopPlant::fixed_gain(gain).unwrap();
        let one = SampledLoop::new(&plant, &published(), &[], Some(&part), DT).unwrap();
        let verdict = one.check().unwrap();
        assert!(verdict.hidden == 0 && verdict.stable);
        let mut roots = eigenvalues(gain, &part);
        let hidden = verdict.almost_hidden.unwrap().radius;
        let found = roots.iter().position(|root| (root - hidden).norm() < 1e-10).unwrap();
        let radius = |roots: &[nalgebra::Complex<f64>]| {
            roots.iter().map(|root| root.norm()).fold(0.0, f64::max)
        };
        close(verdict.slowest.unwrap().radius, radius(&roots), 1e-11);
        roots.swap_remove(found);
        close((-1.0 / (verdict.periods.unwrap() * period)).exp(), radius(&roots), 1e-10);
    }
    // An incremental PD keeps its start value
    let law = Pid::new(1e4, f64::INFINITY, 1e-3, None).unwrap().at(DT).unwrap();
    let plant = LoopPlant::fixed_gain(1e-6).unwrap();
    let one = SampledLoop::new(&plant, &law, &[], None, DT).unwrap();
    assert!(one.hidden_roots() == 1 && one.is_stable());
}

#[test]
fn a_gain_in_the_wrong_unit_is_named() {
    let limits = Limits::new(0.0, 75.0).unwrap();
    let check = |kp: f64, plant: &LoopPlant| {
        let pid = Pid::new(kp, 0.009, 0.044, None).unwrap().at(DT).unwrap();
        check_loop(plant, &Controller::new(limits, pid), DT).unwrap()
    };
    let plant = LoopPlant::fixed_gain(1.2e-6).unwrap();
    let right = check(0.120e6, &plant);
    assert!(right.stable && right.hint.is_none());
    close(right.gains.unwrap().high, 1.28 / 1.2, 1e-3);
    let high = check(0.120e12, &plant);
    println!("{}", high.hint.as_ref().unwrap());
    assert!(!high.stable && high.outside == Some(1));
    assert!(high.hint.unwrap().contains("did you mean 1.200e5 V/m, that is 1.200e-1 V/um?"));
    close(high.gains.unwrap().high * 1e6, 1.28 / 1.2, 1e-3);
    let low = check(0.120, &plant);
    println!("{}", low.hint.as_ref().unwrap());
    assert!(low.stable && low.hint.unwrap().contains("did you mean 1.200e-1 V/um?"));
    let reversed = check(-0.120e6, &plant);
    println!("{}", reversed.hint.as_ref().unwrap());
    assert!(!reversed.stable && reversed.gains.is_none());
    assert!(reversed.hint.unwrap().contains("reversed"));
    let none = check(0.0, &plant);
    assert!(none.hint.is_none());
    // Published gains on a plant that needs less
    let verdict = check(0.120e6, &mode(172.7));
    assert!(!verdict.stable && verdict.hint.is_none());
    close(verdict.gains.unwrap().high, 0.83, 0.01);
}

#[test]
fn delay_is_exact_between_samples() {
    // A static plant sees only whole samples; one that lags is continuous in the delay.
    let fixed =
        |delay: f64| limit(&LoopPlant::fixed_gain(1e-6).unwrap().with_delay(delay).unwrap(), None);
    close(fixed(0.0), fixed(0.019), 1e-12);
    println!("two samples: {}", fixed(0.02));
    assert!((fixed(0.02) - fixed(0.0)).abs() > 0.05);
    close(fixed(0.02), fixed(0.06 / 3.0 * (1.0 + 1e-13)), 1e-12);
    let lagging = |delay: f64| {
        limit(&mode(3.0).with_amplifier(5.0).unwrap().with_delay(delay).unwrap(), None)
    };
    close(lagging(0.02), lagging(0.02 - 1e-9), 1e-5);
    close(lagging(0.02), lagging(0.02 + 1e-9), 1e-5);
    println!("lagging {} {} {}", lagging(0.0), lagging(0.01), lagging(0.02));
    assert!((lagging(0.01) / lagging(0.0) - 1.0).abs() > 0.03);
}

#[test]
fn stiff_and_fast_plants_keep_their_digits() {
    // An overdamped plant at 5 kHz and at 1 MHz: slow pole K/D, fast pole near D/M
    let mechanics = Mechanics { mass: 0.1828, damping: 2597.3, stiffness: 26065.0 };
    let plant = LoopPlant::mechanical(&mechanics, 0.0468).unwrap();
    for dt in [2e-4, 1e-6, 1e-8] {
        let one = SampledLoop::new(&plant, &(), &[], None, dt).unwrap();
        let root = one.slowest_root().unwrap().unwrap();
        let half = 0.5 * mechanics.damping / mechanics.mass;
        let slow = mechanics.stiffness
            / mechanics.mass
            / (half + (half * half - mechanics.stiffness / mechanics.mass).sqrt());
        close(root.samples * slow * dt, 1.0, 1e-6);
        assert!(one.is_stable());
    }
}

#[test]
fn long_periods_are_cheap() {
    for (period, n) in [(5.0, 250), (100.0, 5000), (2e4, 1_000_000)] {
        let part = Repetitive::new(period, Smoothing::ZeroPhase { order: 2 }, 0.1).unwrap();
        let part = part.at(DT).unwrap();
        let start = Instant::now();
        let one = SampledLoop::new(&table_1(), &published(), &[], Some(&part), DT).unwrap();
        let verdict = one.check().unwrap();
        println!("N = {n}: {:?}, {verdict:?}", start.elapsed());
        assert!(verdict.stable && verdict.exact == (n < 10_000));
        // Far too high a gain is found out as fast
        let start = Instant::now();
        let verdict = one.amplified(1e6).check().unwrap();
        println!("   {:?}, {:?}", start.elapsed(), verdict.gains);
        assert!(!verdict.stable);
    }
}

#[test]
fn bad_input_is_named() {
    let named = |error: Error, part: &str| assert!(error.to_string().contains(part), "{error}");
    named(LoopPlant::fixed_gain(f64::NAN).unwrap_err(), "gain");
    named(LoopPlant::mode(1e-6, 0.0, 0.1).unwrap_err(), "frequency");
    named(LoopPlant::mode(1e-6, 1.0, -0.1).unwrap_err(), "damping");
    named(mode(160.0).with_delay(-1.0).unwrap_err(), "delay");
    named(mode(160.0).with_amplifier(0.0).unwrap_err(), "bandwidth");
    named(LoopPlant::state_space(&[1.0], &[1.0, 2.0], &[1.0], 0.0).unwrap_err(), "a has");
    named(LoopPlant::state_space(&[0.0; 121], &[0.0; 11], &[0.0; 11], 0.0).unwrap_err(), "b has");
    let stage = DahlStage::xu_li_2010();
    named(linearised(&stage, f64::NAN).unwrap_err(), "at");
    named(linearised(&stage, -2e-3).unwrap_err(), "K + dFh/dx");
    named(extremes(&stage, 1.0..=0.0).unwrap_err(), "range");
    close(LoopPlant::fixed_gain(2.0).unwrap().static_gain(), 2.0, 0.0);
    let law = published();
    let new = |plant: &LoopPlant, dt| SampledLoop::new(plant, &law, &[], None, dt);
    named(new(&mode(160.0), 0.0).unwrap_err(), "dt");
    named(new(&mode(160.0).with_delay(1e9).unwrap(), DT).unwrap_err(), "delay");
    // What cannot be computed is said, and ends
    let wild = LoopPlant::state_space(&[1e200, 1e300, -1e300, 7.0], &[1e300; 2], &[1e300; 2], 0.0);
    assert!(new(&wild.unwrap(), DT).is_err());
    let huge = LoopPlant::fixed_gain(1e140).unwrap();
    assert!(new(&huge, DT).unwrap().check().map_or(true, |verdict| !verdict.stable));
    let verdict = new(&LoopPlant::fixed_gain(0.0).unwrap(), DT).unwrap().check().unwrap();
    assert!(!verdict.stable); // an integrator left to itself
    let _ = law.transfer_function();
}
