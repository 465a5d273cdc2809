//! Loops in lanes against loops simulated one by one.
#![allow(missing_docs, clippy::unwrap_used)]

use piezotrack_control::{Controller, Filter, Limits, Pid, Repetitive, Smoothing};
use piezotrack_core::design::{LoopPlant, SampledLoop};
use piezotrack_core::models::Model;
use piezotrack_core::parts::Law;
use piezotrack_core::signal::NEVER;
use piezotrack_core::simulate::{ReferenceSamples, Timing, VirtualStage, track};
use piezotrack_core::tune::{
    Aim, ErrorSignal, Judge, Nominal, PlantSet, Requirements, RunMetrics, Setting, Sought,
    SoughtController, Structure, Task, Template, Tuning, pid,
};

const DT: f64 = 0.02;

fn reference(samples: u32) -> Vec<f64> {
    let at = |k: u32| 50e-6 * (1.0 - libm::cos(std::f64::consts::TAU * 0.2 * DT * f64::from(k)));
    (0..samples).map(at).collect()
}

fn controllers(count: u32) -> Vec<Controller<Law>> {
    let limits = Limits::new(0.0, 75.0).unwrap();
    (0..count)
        .map(|i| {
            let kp = 0.02e6 + 0.01e6 * f64::from(i);
            let pid = Pid::new(kp, 0.02, 0.01, None).unwrap().at(DT).unwrap();
            let mut one = Controller::new(limits, Law::Pid(pid));
            if i % 3 == 1 {
                one.filters[0] = Some(Filter::low_pass(10.0, DT).unwrap());
            }
            if i % 3 == 2 {
                let part = Repetitive::new(5.0, Smoothing::ZeroPhase { order: 2 }, 0.2).unwrap();
                one.repetitive = Some(part.at(DT).unwrap());
            }
            one
        })
        .collect()
}

pub fn task<'a>(stage: &'a VirtualStage, samples: ReferenceSamples<'a>, delay: f64) -> Task<'a> {
    let timing =
        Timing { interval: DT, samples: samples.reference.len(), delay, jitter: 0.0, substeps: 1 };
    Task {
        stage,
        voltages_before: &[],
        timing,
        samples,
        beside: &[],
        shown_at: 0.0,
        from: 250,
        error: ErrorSignal::Measured,
    }
}

/// Largest and rms error of a loop that is simulated by itself, in fine steps.
fn alone(task: &Task<'_>, controller: &Controller<Law>) -> (f64, f64) {
    let start = task.stage.start_after(task.voltages_before);
    let apparatus = task.stage.apparatus();
    let run = track(&apparatus, start, &task.timing, controller, task.samples, NEVER);
    let run = run.unwrap().unwrap();
    let pairs = run.motion.measured.iter().zip(task.samples.reference);
    let errors: Vec<f64> = pairs.skip(task.from).map(|(y, r)| (r - y).abs()).collect();
    let count = errors.iter().fold(0.0, |count, _| count + 1.0);
    let rms = libm::sqrt(errors.iter().map(|e| e * e).sum::<f64>() / count);
    (errors.into_iter().fold(0.0, f64::max), rms)
}

fn agrees(stage: &VirtualStage, delay: f64, tolerance: f64) {
    let reference = reference(750);
    let feedforward = vec![0.0; 750];
    let samples = ReferenceSamples { reference: &reference, feedforward: &feedforward };
    let task = task(stage, samples, delay);
    let all = controllers(11);
    let found = task.ready().unwrap().figures(&all, NEVER).unwrap();
    for (i, (controller, figures)) in all.iter().zip(&found).enumerate() {
        let (largest, rms) = alone(&task, controller);
        let near = |a: f64, b: f64| (a - b).abs() < tolerance * b;
        let RunMetrics { rms: in_lanes, largest: widest, .. } = *figures;
        assert!(near(in_lanes, rms), "{i}: {in_lanes:e} in lanes, {rms:e} alone");
        assert!(near(widest, largest), "{i}: {widest:e} in lanes, {largest:e} alone");
    }
}

#[test]
fn loops_on_the_published_stage_are_those_simulated_one_by_one() {
    agrees(&VirtualStage::xu_li_2010(1), 0.0, 0.005);
    agrees(&VirtualStage::xu_li_2010(1), 0.7e-3, 0.005);
    for slew in [3e4, 6e3, 1e3] {
        let mut slow = VirtualStage::xu_li_2010(1);
        slow.amplifier.slew = slew;
        agrees(&slow, 0.0, 0.005);
        agrees(&slow, 0.7e-3, 0.005);
    }
}

#[test]
fn loops_of_every_model_are_those_simulated_one_by_one() {
    for model in [Model::Dahl, Model::BoucWen] {
        let stage = model.build(&(model.info().published[0].1)()).unwrap();
        let mut stage = VirtualStage::bare(stage, 5e-5);
        stage.sensor.noise = 20e-9;
        agrees(&stage, 0.0, 0.005);
        agrees(&stage, 31e-3, 0.005);
    }
}

#[test]
fn the_bits_do_not_depend_on_the_threads_or_the_neighbours() {
    let dahl = Model::Dahl.build(&(Model::Dahl.info().published[0].1)()).unwrap();
    for stage in [VirtualStage::xu_li_2010(3), VirtualStage::bare(dahl, 5e-5)] {
        let reference = reference(300);
        let feedforward = vec![0.0; 300];
        let samples = ReferenceSamples { reference: &reference, feedforward: &feedforward };
        let task = Task { from: 10, ..task(&stage, samples, 1e-3) };
        let all = controllers(19);
        let task = task.ready().unwrap();
        let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let one = pool(1).install(|| task.figures(&all, NEVER)).unwrap();
        let three = pool(3).install(|| task.figures(&all, NEVER)).unwrap();
        assert_eq!(one, three);
        let single = task.figures(&all[7..8], NEVER).unwrap();
        assert_eq!(single[0], one[7]);
    }
}

/// Margins from the grid against the exact ones, over gains from far too low to unstable.
#[test]
fn margins_on_the_grid_are_the_exact_ones() {
    let stage = VirtualStage::xu_li_2010(1);
    let ringing = LoopPlant::mode(1.5e-6, 160.0, 0.02).unwrap().with_delay(0.3e-3).unwrap();
    let slow = LoopPlant::mode(1.5e-6, 3.0, 0.1).unwrap().with_delay(0.05).unwrap();
    let plants: Vec<LoopPlant> =
        stage.loop_plants(0.0, 75.0).unwrap().into_iter().chain([ringing, slow]).collect();
    let limits = Limits::new(0.0, 75.0).unwrap();
    let (mut stable, mut unstable) = (0, 0);
    for (dt, most) in [(0.02, 0.8e6), (1e-3, 0.3e6)] {
        for (i, plant) in plants.iter().enumerate() {
            let set = PlantSet::new(std::slice::from_ref(plant), dt).unwrap();
            for share in 0..60_u32 {
                let gain = most * 10_f64.powf(-3.0 * f64::from(share) / 60.0);
                let kd = if share % 2 == 0 { 0.3 * gain } else { 0.0 };
                let law = pid(0.7 * gain, gain, kd, dt).unwrap().at(dt).unwrap();
                let mut controller = Controller::new(limits, Law::Pid(law));
                if share % 3 == 0 {
                    controller.filters[0] = Some(Filter::low_pass(0.1 / dt, dt).unwrap());
                }
                let exact = SampledLoop::of(plant, &controller, dt).unwrap().margins();
                let found = set.robustness(&controller);
                let place = format!("plant {i} at {dt} s, gain {gain:e}");
                let margin = exact.gain.unwrap_or(f64::INFINITY);
                if (margin - 1.0).abs() < 0.02 {
                    continue;
                }
                assert_eq!(
                    found.unstable.value == 0.0,
                    exact.stable,
                    "{place}: {found:?} {exact:?}"
                );
                if !exact.stable {
                    unstable += 1;
                    continue;
                }
                stable += 1;
                // A loop on the edge of instability is not sought.
                let accuracy = if exact.sensitivity < 5.0 { 0.01 } else { 0.5 };
                let near = |a: f64, b: f64| (a - b).abs() < accuracy * b;
                assert!(
                    near(found.sensitivity.value, exact.sensitivity),
                    "{place}: {found:?} {exact:?}"
                );
                if let Some(phase) = exact.phase {
                    assert!(near(found.phase_margin.value, phase), "{place}: {found:?} {exact:?}");
                }
            }
        }
    }
    assert!(stable > 100 && unstable > 100, "{stable} stable, {unstable} unstable");
}

fn required() -> Requirements {
    Requirements {
        gain_margin: 2.0,
        phase_margin: 0.5,
        sensitivity: 2.0,
        learning: 1.0,
        slew: f64::INFINITY,
        largest_saturation: 0.0,
        largest_error: f64::INFINITY,
    }
}

fn sought(gain: f64) -> Vec<Sought> {
    [Setting::Proportional, Setting::Integral, Setting::Derivative]
        .map(|setting| Sought { setting, low: 1e-4 / gain, high: 2.0 / gain, logarithmic: true })
        .to_vec()
}

/// On a plant without dynamics the largest integral gain with Ms = 2 is known: an integrator behind
/// a delay of one sample, L = k/(z - 1), has its smallest distance from -1 at z = -1, 1 - k/2, so
/// that k = 1. Proportional and derivative action are kept out of the way.
#[test]
fn the_integral_gain_from_margins_alone_is_the_known_one() {
    let plant = LoopPlant::fixed_gain(1e-6).unwrap();
    let dt = 0.01;
    let one = |setting, low: f64, high: f64| Sought { setting, low, high, logarithmic: true };
    let limits = Limits::new(0.0, 75.0).unwrap();
    let base = Controller::new(limits, Law::None);
    let axis = SoughtController {
        sought: vec![one(Setting::Proportional, 1.0, 1.000_001), one(Setting::Integral, 1e4, 1e7)],
        template: Template { base, dt, period: None, structure: Structure::Pid, sign: 1.0 },
        plants: PlantSet::new(&[plant], dt).unwrap(),
    };
    let tuning = Tuning {
        axes: vec![axis],
        tasks: Vec::new(),
        stages: 1,
        required: Requirements { phase_margin: 0.0, gain_margin: 1.001, ..required() },
        aim: Aim::Disturbance,
        tolerances: Vec::new(),
        effort: 0.0,
        particles: 20,
        iterations: 100,
        seed: 1,
        starts: Vec::new(),
    };
    let found = tuning.search(NEVER).unwrap();
    let integral = found.settings[0][1].1 * 1e-6;
    // The reading of a sample is taken before its command acts: z/(z - 1) behind one sample.
    assert!((integral - 1.0).abs() < 1e-3, "{integral}");
    assert!((found.robustness.sensitivity.value - 2.0).abs() < 2e-3);
}

#[test]
fn a_search_beats_the_published_gains_and_keeps_its_margins() {
    let stage = VirtualStage::xu_li_2010(1);
    let reference = reference(750);
    let feedforward = vec![0.0; 750];
    let samples = ReferenceSamples { reference: &reference, feedforward: &feedforward };
    let task = task(&stage, samples, 0.0);
    let limits = Limits::new(0.0, 75.0).unwrap();
    let published = Controller::new(limits, Law::Pid(Pid::xu_li_2010().at(DT).unwrap()));
    let before = task.ready().unwrap().figures(&[published], NEVER).unwrap()[0];
    let plants = stage.loop_plants(0.0, 75.0).unwrap();
    let axis = SoughtController {
        sought: sought(1.56e-6),
        template: Template {
            base: Controller::new(limits, Law::None),
            dt: DT,
            period: None,
            sign: 1.0,
            structure: Structure::Pid,
        },
        plants: PlantSet::new(&plants, DT).unwrap(),
    };
    let tuning = Tuning {
        axes: vec![axis],
        tasks: vec![Judge::Axis(task)],
        stages: 1,
        required: required(),
        aim: Aim::Rms,
        tolerances: Vec::new(),
        effort: 0.0,
        particles: 24,
        iterations: 40,
        seed: 1,
        starts: Vec::new(),
    };
    let found = tuning.search(NEVER).unwrap();
    assert!(found.excess <= 1.0);
    assert!(found.cost < before.rms, "{:e} tuned, {:e} published", found.cost, before.rms);
    for plant in &plants {
        let exact = SampledLoop::of(plant, &found.controllers[0], DT).unwrap().margins();
        assert!(exact.stable && exact.sensitivity < 2.0 * 1.001, "{exact:?}");
        assert!(exact.gain.unwrap() > 2.0 * 0.999);
    }
    let again = tuning.search(NEVER).unwrap();
    assert_eq!(again.settings, found.settings);
}

/// A disturbance observer around a PID integrates twice: the grid begins 180 degrees behind.
#[test]
fn margins_with_two_integrators_are_the_exact_ones() {
    let dt = 1e-3;
    let plant = LoopPlant::mode(1.5e-6, 160.0, 0.2).unwrap();
    let limits = Limits::new(0.0, 75.0).unwrap();
    let structure = Structure::DisturbanceObserver(Nominal { gain: 1.5e-6, time: 1e-3 });
    let base = Controller::new(limits, Law::None);
    let template = Template { base, dt, period: None, structure, sign: 1.0 };
    let set = PlantSet::new(std::slice::from_ref(&plant), dt).unwrap();
    let (mut stable, mut unstable) = (0, 0);
    for cutoff in [0.3, 3.0, 30.0, 200.0] {
        for gain in [3e2, 3e3, 2e4, 1e5, 4e5] {
            let settings = [
                (Setting::Proportional, gain),
                (Setting::Integral, 0.1 * gain),
                (Setting::Observer, cutoff),
            ];
            let controller = template.controller(&settings).unwrap();
            let exact = SampledLoop::of(&plant, &controller, dt).unwrap().margins();
            let found = set.robustness(&controller);
            assert_eq!(found.unstable.value == 0.0, exact.stable, "{cutoff} {gain}: {exact:?}");
            if exact.stable && exact.sensitivity < 5.0 {
                let off = found.sensitivity.value / exact.sensitivity - 1.0;
                assert!(off.abs() < 0.01, "{cutoff} {gain}: {found:?} {exact:?}");
            }
            *(if exact.stable { &mut stable } else { &mut unstable }) += 1;
        }
    }
    assert!(stable > 4 && unstable > 2, "{stable} {unstable}");
}

/// The cost over two stages is that of the worse one, at any place of the box; and a low-pass with a
/// cutoff above two sampling rates is left out.
#[test]
fn the_worst_stage_counts_and_a_fast_low_pass_is_left_out() {
    let stages = [VirtualStage::xu_li_2010(1), VirtualStage::xu_li_2010(2)];
    let reference = reference(750);
    let feedforward = vec![0.0; 750];
    let samples = ReferenceSamples { reference: &reference, feedforward: &feedforward };
    let limits = Limits::new(0.0, 75.0).unwrap();
    let plants = stages[0].loop_plants(0.0, 75.0).unwrap();
    let cutoff = Sought { setting: Setting::Cutoff, low: 1.0, high: 200.0, logarithmic: true };
    let template = Template {
        base: Controller::new(limits, Law::None),
        dt: DT,
        period: None,
        sign: 1.0,
        structure: Structure::Pid,
    };
    let tuning = |chosen: &[usize]| {
        let judge = |i: &usize| Judge::Axis(task(&stages[*i], samples, 0.0));
        let axis = SoughtController {
            sought: [sought(1.56e-6), vec![cutoff]].concat(),
            template,
            plants: PlantSet::new(&plants, DT).unwrap(),
        };
        Tuning {
            axes: vec![axis],
            tasks: chosen.iter().map(judge).collect(),
            stages: chosen.len(),
            required: Requirements { largest_saturation: 1.0, ..required() },
            aim: Aim::Rms,
            tolerances: Vec::new(),
            effort: 0.0,
            particles: 8,
            iterations: 1,
            seed: 1,
            starts: Vec::new(),
        }
    };
    let places = [vec![0.7, 0.6, 0.3, 1.0], vec![0.6, 0.6, 0.3, 0.9], vec![0.65, 0.65, 0.2, 0.8]];
    let costs = |chosen: &[usize]| tuning(chosen).costs(&places, NEVER).unwrap();
    let (both, first, second) = (costs(&[0, 1]), costs(&[0]), costs(&[1]));
    for ((both, first), second) in both.iter().zip(&first).zip(&second) {
        assert!(both.0 <= 1.0 && first.1.is_finite());
        assert_eq!(both.1.to_bits(), first.1.max(second.1).to_bits());
        assert_ne!(first.1.to_bits(), second.1.to_bits());
    }
    let at = |cutoff| {
        let settings = [(Setting::Proportional, 1e5), (Setting::Cutoff, cutoff / DT)];
        template.controller(&settings).unwrap().filters[0].is_some()
    };
    assert!(at(1.99) && !at(2.01));
    assert!(Tuning { stages: 2, ..tuning(&[0]) }.costs(&places, NEVER).is_err());
    // Both as motions of one stage: rms over them, the second one's error ten times as dear.
    let motions = Tuning { stages: 1, ..tuning(&[0, 1]) };
    let alike = motions.costs(&places, NEVER).unwrap();
    let dear = Tuning { tolerances: vec![1e-6, 1e-7], ..motions.clone() };
    for (i, (_, cost)) in dear.costs(&places, NEVER).unwrap().iter().enumerate() {
        let (one, other) = (first[i].1, second[i].1);
        assert!((alike[i].1 - (0.5 * (one * one + other * other)).sqrt()).abs() < 1e-12 * one);
        let weighted = ((one * one + 100.0 * other * other) / 101.0).sqrt();
        assert!((cost - weighted).abs() < 1e-12 * one);
    }
    let few = Tuning { tolerances: vec![1e-6], ..motions };
    assert!(few.costs(&places, NEVER).unwrap_err().to_string().contains("tolerances"));
}

/// A response that is flat but for creep has no peaks: rounding would add thousands of places.
#[test]
fn a_flat_plant_has_a_short_grid() {
    let (fast, slow) = (1.0 / 0.0667, 1.0 / 5.0);
    let rates = [-fast, 0.0, 0.0, -slow];
    let creeping = LoopPlant::state_space(&rates, &[fast, slow], &[2.0e-6, 0.5e-6], 7e-6).unwrap();
    let ringing = LoopPlant::mode(7e-6, 40.0, 0.02).unwrap();
    let places =
        |plant: &LoopPlant| PlantSet::new(std::slice::from_ref(plant), 5e-3).unwrap().places();
    assert!(places(&creeping) <= 401);
    // A mode is still looked at closely.
    assert!(places(&ringing) > 430);
}
