//! Every law and every inverse that runs in single precision, in one step of one function: what that
//! reaches is what they call.

use piezotrack_control::disturbance_observer::Observed;
use piezotrack_control::hysteresis::{
    AsymmetricBoucWen, AsymmetricPlay, BoucWen, Dahl, LuGre, Play, PlayFamily,
};
use piezotrack_control::inverse::{NetworkNumbers, NeuralNetworkInverse};
use piezotrack_control::unfused::Unfused;
use piezotrack_control::{
    AsymmetricBoucWenInverse, AsymmetricPlayInverse, BoucWenInverse, Cast, Creep, CreepingInverse,
    DahlInverse, Damped, DisturbanceObserver, Dynamics, Feedback, FeedbackSample,
    FirstOrderDahlInverse, HysteresisObserved, HysteresisObserver, InputInverse,
    IntegralResonantControl, Inverse, LeadLag, Limits, LuGreInverse, OnlineFeedforward,
    OnlineFeedforwardState, OscillatorInverse, ParallelDahlInverse, Pid, PrandtlIshlinskiiInverse,
    ReferenceSample, Result, SampledDahlInverse, SampledPid, SampledSlidingMode, ScheduledPid,
    SlidingMode, StateSpace,
};

const DT: f64 = 1e-3;

/// A law with its state.
struct Law<F: Feedback<f32>> {
    law: F,
    state: F::State,
}

impl<F: Feedback<f32>> Law<F> {
    fn new(law: F) -> Self {
        let state = law.rest();
        Self { law, state }
    }

    fn step(&mut self, sample: &FeedbackSample<f32>) -> f32 {
        self.law.step(&mut self.state, sample)
    }
}

/// An inverse with its state, fed from displacements, of which the limits clip the drive.
struct Ahead<I: Inverse<f32>> {
    feedforward: OnlineFeedforward<I, f32>,
    state: OnlineFeedforwardState<I::State, f32>,
}

impl<I: Inverse<f32>> Ahead<I> {
    fn new<F: Inverse + Cast<In<f32> = I>>(inverse: F) -> Result<Self> {
        let feedforward = OnlineFeedforward::new(inverse, DT, 0.0, 1e-4)?.cast::<f32>()?;
        let state = feedforward.rest();
        Ok(Self { feedforward, state })
    }

    fn step(&mut self, sample: &ReferenceSample<f32>, limits: &Limits<f32>) -> f32 {
        self.feedforward.step_within(&mut self.state, sample, limits)
    }
}

type Single = Unfused<f32>;

struct Parts {
    limits: Limits<f32>,
    pid: Law<SampledPid<f32>>,
    scheduled: Law<ScheduledPid<f32>>,
    sliding: Law<SampledSlidingMode<f32>>,
    state_space: Law<StateSpace<2, f32>>,
    observed: Law<Observed<SampledSlidingMode<f32>, f32>>,
    damped: Law<Damped<SampledPid<f32>, f32>>,
    dahl_observed: Law<HysteresisObserved<Dahl<Single>, SampledPid<f32>, f32>>,
    bouc_wen_observed: Law<HysteresisObserved<BoucWen<Single>, SampledPid<f32>, f32>>,
    plays: Ahead<PrandtlIshlinskiiInverse<2, 1, 1, f32>>,
    asymmetric_plays: Ahead<InputInverse<AsymmetricPlayInverse<2, f32>, 0, f32>>,
    creeping: Ahead<CreepingInverse<SampledDahlInverse<f32>, 1, f32>>,
    friction: Ahead<FirstOrderDahlInverse<f32>>,
    parallel: Ahead<ParallelDahlInverse<f32>>,
    oscillator: Ahead<OscillatorInverse<f32>>,
    lugre: Ahead<LuGreInverse<f32>>,
    bouc_wen: Ahead<BoucWenInverse<BoucWen<Single>, Single>>,
    asymmetric: Ahead<BoucWenInverse<AsymmetricBoucWen<Single>, Single>>,
    network: Ahead<NeuralNetworkInverse<f32>>,
}

fn parts() -> Result<Parts> {
    let pid = Pid::new(0.05e6, 0.01, 4e-4, None)?;
    let sampled = pid.at(DT)?;
    let scheduled = ScheduledPid::new(&[1e-6, 1e-5], &[1.0], &[pid, pid], (1e-6, 1.0), DT)?;
    let sliding = SlidingMode::new(5.0, 20e-6, 0.02, 0.001, 0.002)?.at(DT)?;
    let lead_lag: StateSpace<2> = LeadLag::new(2e5, 0.001, 0.002)?.at(DT)?;
    let observer = DisturbanceObserver::new(1.3e-6, 2e-3, 20.0)?;
    let resonant = IntegralResonantControl::new(1e8, 2e-5)?;
    let dahl = Dahl { a1: 1e3, a2: 1e6, gain: 2e9 };
    let family = PlayFamily { thresholds: [2.0, 6.0], weights: [0.06e-6, 0.03e-6], count: 2 };
    let bouc_wen = BoucWen { rise: 0.1, beta: 0.04, gamma: 0.03, exponent: 1.5 };
    let play = Play {
        linear: 1e-6,
        thresholds: [5.0, 15.0],
        weights: [0.2e-6, 0.1e-6],
        dead_zone_thresholds: [30e-6],
        dead_zone_weights: [0.1],
    };
    let creep = [Creep { share: 0.01, time: 0.5 }];
    let dynamics = Dynamics::Second { frequency: 160.0, damping_ratio: 0.05 };
    let stage = (0.18, 50.0, 2.6e4, 0.0468);
    let lugre = LuGre {
        rest_stiffness: 1e4,
        micro_damping: 5.0,
        coulomb_force: 0.05,
        static_force: 0.07,
        stribeck_velocity: 1e-3,
    };
    let network = NeuralNetworkInverse::new(&NetworkNumbers {
        centre: 0.0,
        scales: [1e-6, 1.0, 1.0],
        thresholds: &[],
        hidden: &[1.0, 0.0, 0.0],
        biases: &[0.0],
        outputs: &[3.0],
        direct: &[2.0, 0.0, 0.0],
        offset: 0.0,
    })?;
    Ok(Parts {
        limits: Limits::new(0.0, 75.0)?.cast()?,
        pid: Law::new(sampled.cast()?),
        scheduled: Law::new(scheduled.cast()?),
        sliding: Law::new(sliding.cast()?),
        state_space: Law::new(lead_lag.cast()?),
        observed: Law::new(observer.around(sliding, DT)?.cast()?),
        damped: Law::new(resonant.around(sampled, DT)?.cast()?),
        dahl_observed: Law::new(
            HysteresisObserver::new(dahl, 1.3e-6, 2e-3, 0.1, 1e-4)?.around(sampled, DT)?.cast()?,
        ),
        bouc_wen_observed: Law::new(
            HysteresisObserver::new(bouc_wen, 1.3e-6, 2e-3, 0.1, 1e-4)?
                .around(sampled, DT)?
                .cast()?,
        ),
        asymmetric_plays: Ahead::new(InputInverse::<_, 0>::with(
            AsymmetricPlayInverse(AsymmetricPlay {
                linear: 1e-6,
                range: (0.0, 75.0),
                families: [family; 3],
            }),
            0.0,
            &[],
            Dynamics::None,
            DT,
        )?)?,
        plays: Ahead::new(PrandtlIshlinskiiInverse::<2, 1, 1>::new(&play, &creep, dynamics, DT)?)?,
        creeping: Ahead::new(CreepingInverse::<_, 1>::new(
            DahlInverse::xu_li_2010().at(DT)?,
            &creep,
            DT,
        )?)?,
        friction: Ahead::new(FirstOrderDahlInverse::new(
            stage.0,
            stage.1,
            stage.2,
            stage.3,
            (1e4, 0.05, 1.5),
            DT,
        )?)?,
        parallel: Ahead::new(ParallelDahlInverse::new(
            stage.0,
            stage.1,
            stage.2,
            stage.3,
            ([3e3, 2e3, 1e3], 2e-6, 4.0),
            DT,
        )?)?,
        oscillator: Ahead::new(OscillatorInverse::new(
            stage.0,
            stage.1,
            stage.2,
            (2e4, 6e4, 4e4, 1.6),
            DT,
        )?)?,
        lugre: Ahead::new(LuGreInverse::new([stage.0, stage.1, stage.2], stage.3, &lugre, DT)?)?,
        bouc_wen: Ahead::new(BoucWenInverse::new(0.01, 5.0, 1e5, 1e-6, 0.3, 0.06, 0.04, 1.5)?)?,
        asymmetric: Ahead::new(AsymmetricBoucWenInverse::asymmetric(
            [0.01, 5.0, 1e5, 1e-6],
            0.3,
            [0.06, 0.04, 0.01, 0.005],
        )?)?,
        network: Ahead::new(network)?,
    })
}

static mut PARTS: Option<Parts> = None;

/// Makes the parts; 0 where that cannot be.
#[unsafe(no_mangle)]
pub extern "C" fn parts_begin() -> i32 {
    let parts = parts().ok();
    let begun = i32::from(parts.is_some());
    // SAFETY: one context calls the functions of this file.
    unsafe { PARTS = parts };
    begun
}

/// The sum of what all of them give; NaN before the beginning.
#[unsafe(no_mangle)]
pub extern "C" fn parts_volts(reference: f32, measured: f32) -> f32 {
    // SAFETY: as above; no function keeps the reference.
    let Some(parts) = (unsafe { (*(&raw mut PARTS)).as_mut() }) else { return f32::NAN };
    let error = reference - measured;
    let sample = FeedbackSample { reference, measured, ..FeedbackSample::new(error) };
    let (ahead, limits) = (ReferenceSample::new(reference), &parts.limits);
    let laws = parts.pid.step(&sample)
        + parts.scheduled.step(&sample)
        + parts.sliding.step(&sample)
        + parts.state_space.step(&sample)
        + parts.observed.step(&sample)
        + parts.damped.step(&sample)
        + parts.dahl_observed.step(&sample)
        + parts.bouc_wen_observed.step(&sample);
    laws + parts.plays.step(&ahead, limits)
        + parts.asymmetric_plays.step(&ahead, limits)
        + parts.creeping.step(&ahead, limits)
        + parts.friction.step(&ahead, limits)
        + parts.parallel.step(&ahead, limits)
        + parts.oscillator.step(&ahead, limits)
        + parts.lugre.step(&ahead, limits)
        + parts.bouc_wen.step(&ahead, limits)
        + parts.asymmetric.step(&ahead, limits)
        + parts.network.step(&ahead, limits)
}
