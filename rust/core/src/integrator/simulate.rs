//! Simulation of one stage under a sampled drive, to a requested accuracy.

use pulp::{Simd, WithSimd};

use super::accuracy::{MOST_SUBSTEPS, agrees, first_substeps, out_of_reach};
use super::propagator::{Mechanics, halvings};
use super::stepping_loop::{Observer, SteppingLoop, Substeps};
use super::traits::{FeedbackState, Kernel, Memory, Parameters};
use crate::error::{Error, Result, positive};
use crate::math::{dispatch_fused, room};
use crate::signal::{Drive, Stop, all_finite, index, largest_difference};

/// Accuracy, as a share of the displacement, that rounding limits.
const ROUNDING: f64 = 1e-16;

/// Most steps of one simulation, beyond [`FEW_SUBSTEPS`] in an interval: some ten seconds.
const MOST_STEPS: usize = 100_000_000;
const FEW_SUBSTEPS: usize = 64;

/// Displacement, velocity and memory at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant<M> {
    /// Displacement, m.
    pub x: f64,
    /// Velocity, m/s.
    pub v: f64,
    /// State of the hysteresis.
    pub memory: M,
}

/// Motion of a stage at the samples of its drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion<M> {
    /// Displacement, m.
    pub x: Vec<f64>,
    /// Velocity, m/s.
    pub v: Vec<f64>,
    /// Hysteresis force, N.
    pub hysteresis: Vec<f64>,
    /// State at the last sample.
    pub last: Instant<M>,
    /// Steps in each sampling interval.
    pub substeps: usize,
    /// Largest difference in displacement from half the sub-steps, m; 0 where there was none.
    pub error_estimate: f64,
}

/// A stage of lumped mass, damping and stiffness: its kernel and its parameters.
#[derive(Clone, Copy, Debug)]
pub struct LumpedStage<K> {
    /// How it steps.
    pub kernel: K,
    /// Its parameters, SI.
    pub parameters: Parameters<f64>,
}

impl<K: Kernel> LumpedStage<K> {
    /// The state before any motion.
    #[must_use]
    pub fn rest(&self) -> Instant<Memory<K, f64>> {
        Instant { x: 0.0, v: 0.0, memory: self.kernel.rest(&self.parameters) }
    }

    /// Equilibrium after a slow visit to each voltage in turn, from rest; rest where there is none.
    #[must_use]
    pub fn equilibrium(&self, voltages: &[f64]) -> Instant<Memory<K, f64>> {
        let (kernel, parameters) = (&self.kernel, &self.parameters);
        let start = (0.0, kernel.rest(parameters));
        let approach = |from, &volts: &f64| kernel.approach(parameters, from, volts);
        let (x, memory) = voltages.iter().fold(start, approach);
        Instant { x, v: 0.0, memory }
    }

    /// Mass, damping and stiffness.
    #[must_use]
    pub fn mechanics(&self) -> Mechanics {
        let [mass, damping, stiffness, ..] = self.parameters;
        Mechanics { mass, damping, stiffness }
    }

    /// Simulates with given steps in each sampling interval; `None` where `stop` said so.
    ///
    /// # Errors
    /// [`Error::Parameter`] where `substeps` is 0; [`Error::Numerical`] where the motion is not
    /// finite.
    pub fn simulate_fixed(
        &self,
        drive: &Drive<'_>,
        start: Instant<Memory<K, f64>>,
        substeps: Substeps,
        stop: Stop<'_>,
    ) -> Result<Option<Motion<Memory<K, f64>>>> {
        if substeps.usual == 0 || substeps.at_jumps == 0 {
            return Err(Error::parameter("substeps", 0, "1 or more"));
        }
        let columns = columns(drive.u.len())?;
        let run = Run { of: *self, drive, start, substeps, columns, stop };
        let Some(motion) = dispatch_fused(run) else { return Ok(None) };
        for values in [&motion.x, &motion.v, &motion.hysteresis] {
            all_finite(values, drive.dt)?;
        }
        Ok(Some(motion))
    }

    /// Simulates with the fewest sub-steps that the oscillation needs and with twice as many,
    /// and returns the finer motion with its difference from the coarser.
    ///
    /// # Errors
    /// [`Error::Numerical`] where the motion is not finite.
    pub fn simulate_once(
        &self,
        drive: &Drive<'_>,
        start: Instant<Memory<K, f64>>,
        stop: Stop<'_>,
    ) -> Result<Option<Motion<Memory<K, f64>>>> {
        let substeps = Substeps::even(first_substeps(&self.mechanics(), drive.dt));
        let Some(coarse) = self.simulate_fixed(drive, start, substeps, stop)? else {
            return Ok(None);
        };
        let fine = self.simulate_fixed(drive, start, substeps.doubled(), stop)?;
        Ok(fine.map(|mut fine| {
            fine.error_estimate = largest_difference(&coarse.x, &fine.x);
            fine
        }))
    }

    /// Simulates so that twice the sub-steps moved no sample by more than `accuracy`, m, as the
    /// difference before promised, and returns the finest; `None` where `stop` said so.
    ///
    /// # Errors
    /// [`Error::Parameter`] where `accuracy` is not above 0; [`Error::Numerical`] where the
    /// motion is not finite or the accuracy is out of reach.
    pub fn simulate(
        &self,
        drive: &Drive<'_>,
        start: Instant<Memory<K, f64>>,
        accuracy: f64,
        stop: Stop<'_>,
    ) -> Result<Option<Motion<Memory<K, f64>>>> {
        positive("accuracy", accuracy, "m")?;
        let limit = (MOST_STEPS / drive.u.len().max(1)).clamp(FEW_SUBSTEPS, MOST_SUBSTEPS);
        let mut substeps = first_substeps(&self.mechanics(), drive.dt).min(limit / 2);
        let Some(mut coarse) = self.simulate_fixed(drive, start, Substeps::even(substeps), stop)?
        else {
            return Ok(None);
        };
        let mut before = f64::INFINITY;
        loop {
            substeps *= 2;
            let Some(mut fine) =
                self.simulate_fixed(drive, start, Substeps::even(substeps), stop)?
            else {
                return Ok(None);
            };
            fine.error_estimate = largest_difference(&coarse.x, &fine.x);
            if agrees(before, fine.error_estimate, accuracy) {
                return Ok(Some(fine));
            }
            before = fine.error_estimate;
            let most = fine.x.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            if substeps > limit / 2 || accuracy < ROUNDING * most {
                return Err(out_of_reach(accuracy, substeps, fine.error_estimate));
            }
            coarse = fine;
        }
    }
}

/// Room for the displacement, the velocity and the hysteresis force at so many samples.
///
/// # Errors
/// [`Error::Memory`] where there is none.
pub(crate) fn columns(samples: usize) -> Result<[Vec<f64>; 3]> {
    let what = "the simulated motion";
    Ok([room(what, samples)?, room(what, samples)?, room(what, samples)?])
}

/// One simulation.
struct Run<'a, K: Kernel> {
    of: LumpedStage<K>,
    drive: &'a Drive<'a>,
    start: Instant<Memory<K, f64>>,
    substeps: Substeps,
    columns: [Vec<f64>; 3],
    stop: Stop<'a>,
}

impl<K: Kernel> WithSimd for Run<'_, K> {
    type Output = Option<Motion<Memory<K, f64>>>;

    // One lane needs no vectors; the dispatch is for the fused multiply-add instruction.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let Self { of, drive, start, substeps, columns: [x, v, hysteresis], stop } = self;
        let h = drive.dt / index(substeps.usual);
        let halvings = halvings(of.mechanics().rate(), h);
        let mut samples = Samples { of, x, v, hysteresis, step: h, stop };
        let stepping = SteppingLoop::new(&of.kernel, &of.parameters, drive.dt, substeps, halvings);
        let from = FeedbackState { x: start.x, w: start.v * h, memory: start.memory };
        let end = stepping.run(drive, from, &mut samples)?;
        let last = Instant { x: end.x, v: end.w / h, memory: end.memory };
        let Samples { x, v, hysteresis, .. } = samples;
        let substeps = substeps.usual;
        Some(Motion { x, v, hysteresis, last, substeps, error_estimate: 0.0 })
    }
}

/// Stores the state at each sample.
struct Samples<'a, K> {
    of: LumpedStage<K>,
    x: Vec<f64>,
    v: Vec<f64>,
    hysteresis: Vec<f64>,
    step: f64,
    stop: Stop<'a>,
}

impl<K: Kernel> Observer<f64, Memory<K, f64>> for Samples<'_, K> {
    #[inline(always)]
    fn sample(&mut self, _k: usize, state: &FeedbackState<f64, Memory<K, f64>>) {
        self.x.push(state.x);
        self.v.push(state.w / self.step);
        self.hysteresis.push(self.of.kernel.force(&self.of.parameters, &state.memory));
    }

    fn give_up(&mut self, _k: usize) -> bool {
        (self.stop)()
    }
}
