//! The virtual stage: a simulated piezo stage, with more effects than the models fitted to it.
//!
//! ```text
//! command -> amplifier -> v -> plays with dead zones -> y -> h = gain y
//!         -> d = h + sum_j c_j q_j,   tau_j q_j' = h - q_j                      creep
//!         -> x'' + 2 zeta wn x' + wn^2 x = wn^2 d                               mode
//!         -> sensor
//! ```
//!
//! The hysteresis is rate-independent and at the input, so the ringing of the mode does not go
//! through it. The plays follow Kuhnen 2003, doi 10.3166/ejc.9.407-418; relaxations whose time
//! constants are a decade apart make a creep that grows nearly with the logarithm of time.

use piezotrack_control::hysteresis::{Operator, Play, PlayState};

use super::amplifier::Amplifier;
use super::apparatus::{Apparatus, ApparatusState};
use super::open_loop::{OpenLoop, open_loop};
use super::sensor::Sensor;
use crate::error::{Error, Result, finite, not_negative, positive};
use crate::models::{
    Creep, Dynamics, MOST_RELAXATIONS, Plant, Relaxation, RelaxationFlow, RelaxationState,
};
use crate::signal::{Drive, Stop};

/// Plays of a virtual stage; those with weight 0 do nothing.
pub const PLAYS: usize = 10;

/// Dead zones of a virtual stage; those with bend 0 do nothing.
pub const DEAD_ZONES: usize = 2;

/// Relaxations of its creep; those with share 0 do nothing.
pub const RELAXATIONS: usize = 3;

/// Its hysteresis operator, voltage in, voltage out.
pub type StagePlay = Play<f64, PLAYS, DEAD_ZONES>;

/// Everything that makes a virtual stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualSettings {
    /// Amplifier between command and stage.
    pub amplifier: Amplifier,
    /// Hysteresis, V to V.
    pub play: StagePlay,
    /// Immediate displacement for 1 V out of the hysteresis, m/V.
    pub gain: f64,
    /// Creep.
    pub creep: [Creep; RELAXATIONS],
    /// Undamped frequency of the mode, wn / (2 pi), Hz.
    pub frequency: f64,
    /// Damping ratio of the mode, zeta.
    pub damping_ratio: f64,
    /// Sensor, with the seed of its noise.
    pub sensor: Sensor,
    /// Whether an experiment starts on the settled loop, with the sensor at 0 there.
    pub preconditioned: bool,
    /// Voltage up to which it is cycled for that, from 0 V, V.
    pub swing: f64,
    /// How long it then rests at 0 V before the sensor is set to 0, s.
    pub rest: f64,
    /// Longest step of the simulation, s.
    pub step: f64,
}

/// A stage to experiment on.
///
/// ```
/// use piezotrack_core::signal::{Drive, Hold, NEVER};
/// use piezotrack_core::simulate::VirtualStage;
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let stage = VirtualStage::xu_li_2010(1);
/// let drive = Drive::new(&[75.0; 1500], 2e-4, Hold::Zero)?;
/// let run = stage.simulate(&drive, NEVER)?.unwrap();
/// let end = run.displacement[1499];
/// assert!((end - 117.76e-6).abs() < 0.2e-6);
/// assert!((run.measured[1499] - end).abs() < 0.6e-6);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualStage {
    settings: VirtualSettings,
    /// Creep and mode.
    relaxation: Relaxation,
}

/// Memory of a virtual stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualState {
    /// Plays.
    pub play: PlayState<f64, PLAYS>,
    /// Creep and mode, with the displacement.
    pub relaxation: RelaxationState,
}

/// Cycles of the preconditioning: after 32 s a creep of 10 s has settled to 4 %.
const CYCLES: u32 = 8;

/// Their frequency, Hz: the one at which Xu and Li 2010 identify their stage.
const CYCLE_FREQUENCY: f64 = 0.25;

/// Steps of the preconditioning, s: the drive is slow, and each step is exact for a ramp.
const CYCLE_STEP: f64 = 1e-3;

/// Longest rest before an experiment, s: an hour.
const LONGEST_REST: f64 = 3600.0;

impl VirtualSettings {
    /// Xu and Li 2010, doi 10.1115/1.4001712, as far as published; the rest is chosen.
    ///
    /// Published: 75 V end at 117.7622 um, in a mode of 160 Hz with zeta = 0.065; the sensor's
    /// range of 2.5 mm in 16 bit, so a step of 0.038 um; its noise of 0.097 um rms, which the
    /// quantisation is a part of; limits of 0 V and 75 V.
    ///
    /// Chosen, because the paper does not say:
    ///
    /// - 10 plays of equal weight for 10 % hysteresis, and an asymmetry that adds a tenth to the
    ///   slope over the swing: 1.2 to 1.3 um/V after a reversal, up to 1.95 where all plays move.
    ///   With plays alone a Dahl model fits within 2 um; the asymmetry's sign and size were
    ///   chosen because they bring the fit to 3 um (published: about 5) and its inverse alone to
    ///   5.8 um (published: 5.69).
    /// - Creep of 0.4 % of the displacement with each of 0.1 s, 1 s and 10 s.
    /// - An amplifier of 225 Hz: with zeta = 0.065 the first peak of the step, published at
    ///   192.53 um, determines its lag. The second, published at 170.25 um, is then at 167 um: the
    ///   published peaks do not decay with the published zeta. Its slew limit hardly acts.
    /// - A noise bandwidth of 200 Hz.
    ///
    /// With the paper's PID gains, 0.2 Hz and 0 to 110 um, this gives a largest measured error of
    /// 3.6 to 3.8 um, a phase lag of 0.061 rad and a loop of 6.5 % of the travel, where the paper
    /// has 4.44 um, 0.063 rad and 6.24 %. Nothing was tuned for these: they follow from gains and
    /// static gain, and other plays and asymmetries hardly change them.
    ///
    /// At 50 Hz the mode rings 3.2 times between samples, so the loop's stability turns on small
    /// delays: it is stable up to 1 ms, not from 2 to 5 ms, again at 6 ms, and so on.
    #[must_use]
    pub fn xu_li_2010(seed: u64) -> Self {
        Self::like_xu_li_2010(0.10, 117.7622e-6, seed)
    }

    /// The other axis of the same stage, of which nothing is published but that the workspace is
    /// 117 um wide both ways, and that the axes are built alike.
    ///
    /// Chosen: 13 % hysteresis in place of 10 %, and 115 um for 75 V. Stacks of one batch differ
    /// by more; a larger difference in stroke would not be called 117 by 117 um. Amplifier, mode
    /// and sensor are those of x; the sensor's noise is another.
    #[must_use]
    pub fn xu_li_2010_y(seed: u64) -> Self {
        // Far from the seeds that a person counts up, so that no x has the noise of a y.
        Self::like_xu_li_2010(0.13, 115e-6, seed.wrapping_add(1 << 32))
    }

    /// With `share` of hysteresis, reaching `end` m at 75 V.
    fn like_xu_li_2010(share: f64, end: f64, seed: u64) -> Self {
        let play = spread_plays(share, 75.0);
        let mut settings = Self {
            amplifier: Amplifier { bandwidth: 225.0, slew: 1e5, low: 0.0, high: 75.0 },
            play,
            gain: 1.0,
            creep: [0.1, 1.0, 10.0].map(|time| Creep { share: 0.004, time }),
            frequency: 160.0,
            damping_ratio: 0.065,
            sensor: Sensor {
                noise: 0.0964e-6,
                bandwidth: 200.0,
                resolution: 2.5e-3 / 65536.0,
                range: 1.25e-3,
                seed,
            },
            preconditioned: true,
            swing: 75.0,
            rest: 0.0,
            step: 2e-5,
        };
        // The gain that takes a settled stage to the published end of the 75 V step, of which
        // the creep of the first tenths of a second is taken to be a part.
        let travel = travel(&play, 75.0);
        settings.gain = end / (travel * (1.0 + settings.creep[0].share));
        settings
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the setting, its value and unit.
    pub fn validate(&self) -> Result<()> {
        self.amplifier.validate()?;
        self.sensor.validate()?;
        self.validate_play()?;
        for (j, creep) in self.creep.iter().enumerate() {
            not_negative(&format!("creep_weights[{j}]"), creep.share, "")?;
            positive(&format!("creep_times[{j}]"), creep.time, "s")?;
        }
        positive("gain", self.gain, "m/V")?;
        positive("frequency", self.frequency, "Hz")?;
        not_negative("damping_ratio", self.damping_ratio, "")?;
        positive("swing", self.swing, "V")?;
        if not_negative("rest", self.rest, "s")? > LONGEST_REST {
            let most = format!("{LONGEST_REST} s at most");
            return Err(Error::parameter("rest", format!("{} s", self.rest), most));
        }
        positive("step", self.step, "s")?;
        Ok(())
    }

    fn validate_play(&self) -> Result<()> {
        let play = &self.play;
        positive("linear", play.linear, "")?;
        for i in 0..PLAYS {
            not_negative(&format!("thresholds[{i}]"), play.thresholds[i], "V")?;
            not_negative(&format!("weights[{i}]"), play.weights[i], "")?;
        }
        let mut slope = 1.0;
        let mut before = 0.0;
        for j in 0..DEAD_ZONES {
            let corner = not_negative(
                &format!("dead_zone_thresholds[{j}]"),
                play.dead_zone_thresholds[j],
                "V",
            )?;
            if corner < before {
                let expected = format!("{before} V or above: dead_zone_thresholds ascend");
                return Err(Error::parameter(
                    format!("dead_zone_thresholds[{j}]"),
                    format!("{corner} V"),
                    expected,
                ));
            }
            before = corner;
            slope += finite(&format!("dead_zone_weights[{j}]"), play.dead_zone_weights[j], "")?;
            if slope <= 0.0 {
                let expected =
                    "dead_zone_weights whose sums stay above -1, or the curve turns back";
                return Err(Error::parameter(
                    format!("dead_zone_weights[{j}]"),
                    play.dead_zone_weights[j],
                    expected,
                ));
            }
        }
        Ok(())
    }
}

/// What a settled hysteresis passes of a swing from 0 V, V.
fn travel(play: &StagePlay, swing: f64) -> f64 {
    let mut state = play.rest();
    for volts in [swing, 0.0] {
        play.follow(&mut state, volts);
    }
    -play.output(&state).0 + play.follow(&mut state, swing)
}

/// Plays of equal weight with thresholds spread evenly, and dead zones at a third and at two.
///
/// Before the dead zones the widest loop of a full swing from 0 to `swing`, V, is `share` of
/// the travel, and the mean slope is 1: equal weights of sum W make a loop `W / 4` wide, and
/// let half of W pass over the swing.
fn spread_plays(share: f64, swing: f64) -> StagePlay {
    let sum = 4.0 * share;
    let count = f64::from(u32::try_from(PLAYS).unwrap_or(1));
    let mut thresholds = [0.0; PLAYS];
    let mut place = 0.5;
    for threshold in &mut thresholds {
        *threshold = 0.5 * swing * place / count;
        place += 1.0;
    }
    StagePlay {
        linear: 1.0 - 0.5 * sum,
        thresholds,
        weights: [sum / count; PLAYS],
        dead_zone_thresholds: [swing / 3.0, 2.0 * swing / 3.0],
        dead_zone_weights: [0.05, 0.05],
    }
}

impl VirtualStage {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the setting that is out of its range.
    pub fn new(settings: &VirtualSettings) -> Result<Self> {
        settings.validate()?;
        Ok(Self::built(settings))
    }

    /// A stage like the one of Xu and Li 2010: see [`VirtualSettings::xu_li_2010`].
    #[must_use]
    pub fn xu_li_2010(seed: u64) -> Self {
        Self::built(&VirtualSettings::xu_li_2010(seed))
    }

    /// The other axis of that stage: see [`VirtualSettings::xu_li_2010_y`].
    #[must_use]
    pub fn xu_li_2010_y(seed: u64) -> Self {
        Self::built(&VirtualSettings::xu_li_2010_y(seed))
    }

    fn built(settings: &VirtualSettings) -> Self {
        let VirtualSettings { frequency, damping_ratio, .. } = *settings;
        let mut creep = [Creep { share: 0.0, time: 1.0 }; MOST_RELAXATIONS];
        creep[..RELAXATIONS].copy_from_slice(&settings.creep);
        let dynamics = Dynamics::Second { frequency, damping_ratio };
        let relaxation = Relaxation { creep, count: RELAXATIONS, dynamics };
        Self { settings: *settings, relaxation }
    }

    /// The settings.
    #[must_use]
    pub fn settings(&self) -> &VirtualSettings {
        &self.settings
    }

    /// The stage between its amplifier and its sensor.
    #[must_use]
    pub fn apparatus(&self) -> Apparatus<'_, Self> {
        let VirtualSettings { amplifier, sensor, step, .. } = self.settings;
        Apparatus { plant: self, amplifier, sensor, step }
    }

    /// Gains for small motions, m/V: just after a reversal, the mean over the swing of a settled
    /// stage, and where all plays move.
    #[must_use]
    pub fn gains(&self) -> [f64; 3] {
        let VirtualSettings { play, gain, swing, .. } = &self.settings;
        let moving: f64 = play.weights.iter().sum();
        let dead_zone_weights: f64 = play.dead_zone_weights.iter().sum();
        let mean = travel(play, *swing) / swing;
        [play.linear, mean, (play.linear + moving) * (1.0 + dead_zone_weights)]
            .map(|slope| slope * gain)
    }

    /// Where an experiment starts: preconditioned and zeroed as the settings say.
    ///
    /// The amplifier has no part in the preconditioning, which is slow: it brings the memory to
    /// where it would be.
    #[must_use]
    pub fn start(&self) -> ApparatusState<VirtualState> {
        let apparatus = self.apparatus();
        let mut state = apparatus.rest();
        if self.settings.preconditioned {
            self.cycle(&mut state.plant);
            self.wait(&mut state.plant);
            apparatus.sensor.set_zero(&mut state.sensor, state.plant.relaxation.x);
        }
        state
    }

    /// Drives the stage from its start: true and measured displacement, for a log.
    ///
    /// `None` where `stop` said so meanwhile.
    ///
    /// # Errors
    /// Those of [`open_loop`].
    pub fn simulate(
        &self,
        drive: &Drive<'_>,
        stop: Stop<'_>,
    ) -> Result<Option<OpenLoop<VirtualState>>> {
        open_loop(&self.apparatus(), self.start(), drive, stop)
    }

    /// Full cycles between 0 V and the swing, each `(1 - cos) / 2`.
    fn cycle(&self, state: &mut VirtualState) {
        let flow = self.flow(CYCLE_STEP);
        let turn = CYCLE_FREQUENCY * CYCLE_STEP;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "32000")]
        let steps = (f64::from(CYCLES) / turn).round() as u32;
        let mut before = 0.0;
        for k in 1..=steps {
            let phase = (f64::from(k) * turn).fract();
            let after =
                0.5 * self.settings.swing * (1.0 - libm::cos(core::f64::consts::TAU * phase));
            self.advance(&flow, state, before, after);
            before = after;
        }
    }

    /// Rest at 0 V, in one exact step: nothing moves the plays.
    fn wait(&self, state: &mut VirtualState) {
        if self.settings.rest > 0.0 {
            self.advance(&self.flow(self.settings.rest), state, 0.0, 0.0);
        }
    }
}

impl Plant for VirtualStage {
    type State = VirtualState;
    type Flow = RelaxationFlow;

    fn rest(&self) -> VirtualState {
        let relaxation = RelaxationState::default();
        VirtualState { play: self.settings.play.rest(), relaxation }
    }

    fn flow(&self, step: f64) -> RelaxationFlow {
        self.relaxation.flow(step)
    }

    #[inline(always)]
    fn advance(&self, flow: &RelaxationFlow, state: &mut VirtualState, from: f64, to: f64) {
        let Self { settings: VirtualSettings { play, gain, .. }, relaxation } = self;
        if (from - state.play.input).abs() > 0.0 {
            // The voltage has jumped, and with it the immediate part of the displacement.
            relaxation.jump(&mut state.relaxation, gain * play.follow(&mut state.play, from));
        }
        let input = gain * play.follow(&mut state.play, to);
        relaxation.step(flow, &mut state.relaxation, input);
    }

    #[inline(always)]
    fn displacement(&self, state: &VirtualState) -> f64 {
        state.relaxation.x
    }
}
