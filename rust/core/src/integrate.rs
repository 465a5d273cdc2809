//! Simulation of a stage under a sampled drive, to a stated accuracy.

use piezotrack_control::operator::DahlState;
use pulp::{Simd, WithSimd};

use crate::error::{Error, Result, positive};
use crate::march::{FEW_TERMS, March, Order, Sink, Stepping, TERMS};
use crate::mechanics::{Propagator, halvings};
use crate::stage::feedback::FeedbackState;
use crate::stage::{DahlStage, StageState};

/// Asked now and then whether to give up; answers at once.
pub type Stop<'a> = &'a (dyn Fn() -> bool + Sync);

/// Never gives up.
pub const NEVER: Stop<'static> = &|| false;

/// What the drive does between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// First order: a straight line from sample to sample.
    First,
    /// Zero order: each value is held until the next.
    Zero,
}

/// A drive voltage, sampled evenly.
#[derive(Clone, Copy, Debug)]
pub struct Drive<'a> {
    /// Voltage at the samples, V.
    pub u: &'a [f64],
    /// Sampling interval, s.
    pub dt: f64,
    /// What happens between the samples.
    pub hold: Hold,
}

impl<'a> Drive<'a> {
    /// Checks the interval and the samples.
    ///
    /// # Errors
    /// [`Error::Parameter`] where `dt` is not above 0, [`Error::Shape`] where `u` is empty.
    pub fn new(u: &'a [f64], dt: f64, hold: Hold) -> Result<Self> {
        positive("dt", dt, "s")?;
        if u.is_empty() {
            return Err(Error::Shape {
                name: "u".into(),
                found: "0 samples".into(),
                expected: "at least 1".into(),
            });
        }
        Ok(Self { u, dt, hold })
    }

    /// Value at the start of the interval that begins at sample `k`, and its change over it.
    #[inline(always)]
    #[must_use]
    pub fn interval(&self, k: usize) -> (f64, f64) {
        let change = if self.hold == Hold::First { self.u[k + 1] - self.u[k] } else { 0.0 };
        (self.u[k], change)
    }
}

/// Motion of a stage at the samples of its drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Displacement, m.
    pub x: Vec<f64>,
    /// Velocity, m/s.
    pub v: Vec<f64>,
    /// Hysteresis force, N.
    pub hysteresis: Vec<f64>,
    /// State at the last sample.
    pub last: StageState,
    /// Steps of the integrator in each sampling interval.
    pub substeps: usize,
    /// Largest difference in displacement from half as many sub-steps, m; 0 where it was not
    /// asked for.
    pub difference: f64,
}

/// Most sub-steps in one sampling interval that are tried.
const MOST_SUBSTEPS: usize = 1 << 17;

/// Simulates a stage so that halving the sub-steps moves no sample by more than `accuracy`.
///
/// The scheme is of fourth order, so the error of what is returned is about a fifteenth of
/// that. `None` where `stop` said so meanwhile.
///
/// # Errors
/// [`Error::Parameter`] where `accuracy` is not above 0; [`Error::Numerical`] where the motion
/// is not finite or the accuracy is out of reach.
pub fn simulate(
    stage: &DahlStage,
    drive: &Drive<'_>,
    initial: StageState,
    accuracy: f64,
    stop: Stop<'_>,
) -> Result<Option<Trajectory>> {
    positive("accuracy", accuracy, "m")?;
    let mut substeps = first_substeps(stage, drive.dt);
    let run = |substeps| {
        let stepping = Stepping { order: Order::Fourth, substeps };
        simulate_fixed(stage, drive, initial, stepping, stop)
    };
    let Some(mut coarse) = run(substeps)? else {
        return Ok(None);
    };
    loop {
        substeps *= 2;
        let Some(mut fine) = run(substeps)? else {
            return Ok(None);
        };
        fine.difference = largest_difference(&coarse.x, &fine.x);
        if fine.difference <= accuracy {
            return Ok(Some(fine));
        }
        if substeps >= MOST_SUBSTEPS {
            return Err(Error::Numerical(format!(
                "accuracy {accuracy} m is out of reach: {substeps} sub-steps a sample differ \
                 from half as many by {:.3e} m; ask for less with accuracy=, or check that \
                 the parameters are in SI units",
                fine.difference
            )));
        }
        coarse = fine;
    }
}

/// Fewest sub-steps, by powers of two, from which twice as many differ by at most `accuracy`,
/// and the displacement with them.
///
/// `None` where the motion is not finite, where more than `most` would be needed, and where
/// `stop` said so meanwhile.
#[must_use]
pub fn steps_for(
    stage: &DahlStage,
    drive: &Drive<'_>,
    order: Order,
    accuracy: f64,
    most: usize,
    stop: Stop<'_>,
) -> Option<(usize, Vec<f64>)> {
    let run = |substeps| {
        let rest = StageState::default();
        let stepping = Stepping { order, substeps };
        simulate_fixed(stage, drive, rest, stepping, stop).ok().flatten().map(|run| run.x)
    };
    let mut substeps = first_substeps(stage, drive.dt);
    let mut coarse = run(substeps)?;
    while substeps <= most {
        let fine = run(2 * substeps)?;
        if largest_difference(&coarse, &fine) <= accuracy {
            return Some((substeps, fine));
        }
        substeps *= 2;
        coarse = fine;
    }
    None
}

/// Simulates a stage with given steps in each sampling interval.
///
/// `None` where `stop` said so meanwhile.
///
/// # Errors
/// [`Error::Parameter`] where `substeps` is 0; [`Error::Numerical`] where the motion is not
/// finite.
pub fn simulate_fixed(
    stage: &DahlStage,
    drive: &Drive<'_>,
    initial: StageState,
    stepping: Stepping,
    stop: Stop<'_>,
) -> Result<Option<Trajectory>> {
    if stepping.substeps == 0 {
        return Err(Error::parameter("substeps", 0, "1 or more"));
    }
    let trajectory = pulp::Arch::new().dispatch(Single { stage, drive, initial, stepping, stop });
    let Some(trajectory) = trajectory else {
        return Ok(None);
    };
    match trajectory.x.iter().position(|x| !x.is_finite()) {
        None => Ok(Some(trajectory)),
        Some(k) => Err(Error::Numerical(format!(
            "the simulated displacement is not finite from sample {k} on ({:.6} s): check that \
             the parameters are in SI units",
            drive.dt * index(k)
        ))),
    }
}

/// One stage, all its samples kept.
struct Single<'a> {
    stage: &'a DahlStage,
    drive: &'a Drive<'a>,
    initial: StageState,
    stepping: Stepping,
    stop: Stop<'a>,
}

impl WithSimd for Single<'_> {
    type Output = Option<Trajectory>;

    // One lane needs no vectors; the dispatch is for the fused multiply-add instruction.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        match self.stepping.order {
            Order::Second => self.run::<FEW_TERMS, false>(),
            Order::Fourth => self.run::<TERMS, true>(),
        }
    }
}

impl Single<'_> {
    #[inline(always)]
    fn run<const T: usize, const FOURTH: bool>(self) -> Option<Trajectory> {
        let Self { stage, drive, initial, stepping, stop } = self;
        let substeps = stepping.substeps;
        let h = drive.dt / index(substeps);
        let mechanics = &stage.mechanics;
        let linear = Propagator::new(
            1.0 / mechanics.mass,
            mechanics.damping / mechanics.mass,
            mechanics.stiffness / mechanics.mass,
            h,
            halvings(mechanics.rate(), h),
        );
        let n = drive.u.len();
        let out = Trajectory {
            x: Vec::with_capacity(n),
            v: Vec::with_capacity(n),
            hysteresis: Vec::with_capacity(n),
            last: initial,
            substeps,
            difference: 0.0,
        };
        let mut keep = Keep { out, step: h, stop };
        let start = FeedbackState { x: initial.x, w: initial.v * h, memory: initial.into() };
        let operator = stage.operator::<T>();
        let march = March { linear, operator, gain: stage.piezo_coefficient };
        let end = march.run::<FOURTH>(drive, substeps, start, &mut keep)?;
        keep.out.last = StageState {
            x: end.x,
            v: end.w / h,
            hysteresis: end.memory.force,
            hysteresis_slope: end.memory.slope,
        };
        Some(keep.out)
    }
}

/// Keeps the states of one stage.
struct Keep<'a> {
    out: Trajectory,
    step: f64,
    stop: Stop<'a>,
}

impl Sink<f64, DahlState<f64>> for Keep<'_> {
    #[inline(always)]
    fn sample(&mut self, _k: usize, state: &FeedbackState<f64, DahlState<f64>>) {
        self.out.x.push(state.x);
        self.out.v.push(state.w / self.step);
        self.out.hysteresis.push(state.memory.force);
    }

    fn give_up(&mut self, _k: usize) -> bool {
        (self.stop)()
    }
}

/// Where the search for sub-steps begins: a radian of the oscillation in each.
///
/// Coarser steps could agree with each other by chance, both blind to the oscillation.
fn first_substeps(stage: &DahlStage, dt: f64) -> usize {
    let radians = stage.mechanics.oscillation() * dt;
    let mut substeps = 1;
    while index(substeps) < radians && substeps < MOST_SUBSTEPS / 2 {
        substeps *= 2;
    }
    substeps
}

/// A number of samples as a factor; exact below 2^53.
#[expect(clippy::cast_precision_loss, reason = "no array has 2^53 entries")]
#[inline(always)]
pub(crate) fn index(n: usize) -> f64 {
    n as f64
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |most, (a, b)| f64::max(most, (a - b).abs()))
}
