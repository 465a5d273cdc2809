//! Simulation of a Dahl stage under a sampled drive, to a requested accuracy.

use piezotrack_control::hysteresis::DahlState;
use pulp::{Simd, WithSimd};

use super::dahl::{DahlStage, StageState, Trajectory};
use super::dahl_runge_kutta::{self, Rk4, Rk45};
use crate::error::{Error, Result, positive};
use crate::integrator::{
    Coupling, FEW_TERMS, FeedbackState, Friction, FrictionMemory, MOST_SUBSTEPS, March, Order,
    Propagator, Sink, Smooth, Stepping, TERMS, first_substeps, halvings, out_of_reach,
};
use crate::signal::{Drive, Stop, all_finite, index, largest_difference};

/// How a stage is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Linear part exact, hysteresis exact in the displacement, coupled to fourth order.
    Exponential,
    /// Classical Runge-Kutta of fourth order, in equal steps.
    Rk4,
    /// Dormand-Prince of order 5(4), adaptive.
    Rk45,
}

/// Simulates a stage so that a finer simulation moves no sample by more than `accuracy`.
///
/// Finer means twice the sub-steps or, for the adaptive method, a tenth of the tolerance. The
/// finer of the last two is returned. The exponential method is tried to second order first,
/// which is quicker and does for slow drives; the error is then a third of the difference, and
/// a fifteenth to fourth order. `None` where `stop` said so meanwhile.
///
/// # Errors
/// [`Error::Parameter`] where `accuracy` is not above 0; [`Error::Numerical`] where the motion
/// is not finite or the accuracy is out of reach.
pub fn simulate(
    stage: &DahlStage,
    drive: &Drive<'_>,
    initial: StageState,
    method: Method,
    accuracy: f64,
    stop: Stop<'_>,
) -> Result<Option<Trajectory>> {
    positive("accuracy", accuracy, "m")?;
    let mut level =
        if method == Method::Rk45 { 6 } else { first_substeps(&stage.mechanics, drive.dt) };
    let last = if method == Method::Rk45 { 14 } else { MOST_SUBSTEPS };
    if method != Method::Exponential && stage.has_friction() {
        let expected = "0 with a Runge-Kutta method, which steps over sticking (or \
                        method='exponential')";
        return Err(Error::parameter("b0", format!("{} N/m", stage.b0), expected));
    }
    if method == Method::Exponential
        && !stage.has_friction()
        && let Some(quick) = second_order(stage, drive, initial, level, stop)
        && quick.difference <= accuracy
    {
        return Ok(Some(quick));
    }
    let mut coarse: Option<Trajectory> = None;
    loop {
        let fine = at_level(stage, drive, initial, method, level, stop);
        if stop() {
            return Ok(None);
        }
        coarse = match (fine, coarse.take()) {
            (Ok(mut fine), Some(before)) => {
                fine.difference = largest_difference(&before.x, &fine.x);
                if fine.difference <= accuracy {
                    return Ok(Some(fine));
                }
                if level >= last {
                    return Err(out_of_reach(accuracy, fine.substeps, fine.difference));
                }
                Some(fine)
            }
            (Ok(fine), None) => Some(fine),
            // A Runge-Kutta method that is not stable may be so in shorter steps.
            (Err(error), _) if method == Method::Exponential || level >= last => return Err(error),
            (Err(_), _) => None,
        };
        level = if method == Method::Rk45 { level + 1 } else { 2 * level };
    }
}

/// Twice `substeps` to second order, and the difference from `substeps`.
fn second_order(
    stage: &DahlStage,
    drive: &Drive<'_>,
    initial: StageState,
    substeps: usize,
    stop: Stop<'_>,
) -> Option<Trajectory> {
    let run = |substeps| {
        let stepping = Stepping { order: Order::Second, substeps };
        stepped(Single { stage, drive, initial, stepping, few_terms: false, stop }).ok().flatten()
    };
    let (coarse, mut fine) = (run(substeps)?, run(2 * substeps)?);
    fine.difference = largest_difference(&coarse.x, &fine.x);
    Some(fine)
}

/// One simulation: `level` is the sub-steps or, for the adaptive method, the digits asked for.
fn at_level(
    stage: &DahlStage,
    drive: &Drive<'_>,
    initial: StageState,
    method: Method,
    level: usize,
    stop: Stop<'_>,
) -> Result<Trajectory> {
    let run = match method {
        Method::Exponential => {
            let stepping = Stepping { order: Order::Fourth, substeps: level };
            simulate_fixed(stage, drive, initial, stepping, stop)?
        }
        Method::Rk4 => {
            let mut crossing = Rk4 { stage, substeps: level };
            dahl_runge_kutta::march(stage, &mut crossing, drive, initial, stop)
        }
        Method::Rk45 => {
            let tolerance = libm::pow(10.0, -index(level));
            let mut crossing = Rk45::new(stage, drive, tolerance);
            dahl_runge_kutta::march(stage, &mut crossing, drive, initial, stop)
        }
    };
    run.ok_or_else(|| {
        Error::Numerical(
            "the simulated displacement does not stay finite: check that parameters and drive are \
             in SI units"
                .into(),
        )
    })
}

/// Simulates a stage as a search does, with given steps in each sampling interval.
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
    let few_terms = stepping.order == Order::Second;
    stepped(Single { stage, drive, initial, stepping, few_terms, stop })
}

fn stepped(single: Single<'_>) -> Result<Option<Trajectory>> {
    if single.stepping.substeps == 0 {
        return Err(Error::parameter("substeps", 0, "1 or more"));
    }
    let dt = single.drive.dt;
    let trajectory = pulp::Arch::new().dispatch(single);
    let Some(trajectory) = trajectory else { return Ok(None) };
    all_finite(&trajectory.x, dt)?;
    Ok(Some(trajectory))
}

/// One stage, all its samples kept.
struct Single<'a> {
    stage: &'a DahlStage,
    drive: &'a Drive<'a>,
    initial: StageState,
    stepping: Stepping,
    /// Whether the operator's series is cut as in the lanes of a search.
    few_terms: bool,
    stop: Stop<'a>,
}

impl WithSimd for Single<'_> {
    type Output = Option<Trajectory>;

    // One lane needs no vectors; the dispatch is for the fused multiply-add instruction.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        if self.stage.has_friction() {
            return self.with_friction();
        }
        match (self.stepping.order, self.few_terms) {
            (Order::Second, true) => self.smooth::<FEW_TERMS, false>(),
            (Order::Second, false) => self.smooth::<TERMS, false>(),
            (Order::Fourth, _) => self.smooth::<TERMS, true>(),
        }
    }
}

impl Single<'_> {
    #[inline(always)]
    fn smooth<const T: usize, const FOURTH: bool>(self) -> Option<Trajectory> {
        let (stage, initial, h) = (self.stage, self.initial, self.step());
        let mechanics = &stage.mechanics;
        let linear = Propagator::new(
            1.0 / mechanics.mass,
            mechanics.damping / mechanics.mass,
            mechanics.stiffness / mechanics.mass,
            h,
            halvings(mechanics.rate(), h),
        );
        let memory = stage.memory(&initial);
        let start = FeedbackState { x: initial.x, w: initial.v * h, memory };
        let coupling = Smooth::<_, _, FOURTH> { linear, operator: stage.operator::<T>() };
        let (mut out, end) = self.march(coupling, start)?;
        (out.last.q1, out.last.q2) = stage.states(&end.memory);
        Some(out)
    }

    #[inline(always)]
    fn with_friction(self) -> Option<Trajectory> {
        let (initial, h) = (self.initial, self.step());
        let halvings = halvings(self.stage.mechanics.rate(), h);
        let coupling = Friction::new(self.stage.friction(), h, halvings);
        let memory = DahlState { force: initial.q1, slope: initial.q2 };
        let start = coupling.start(initial.x, initial.v * h, memory);
        let (mut out, end) = self.march(coupling, start)?;
        (out.last.q1, out.last.q2) = (end.memory.operator.force, end.memory.operator.slope);
        out.well_posed = end.memory.doubt <= 0.0;
        Some(out)
    }

    /// Length of a sub-step, s.
    fn step(&self) -> f64 {
        self.drive.dt / index(self.stepping.substeps)
    }

    /// Leads the stage along its drive; what is peculiar to its memory is left to the caller.
    #[inline(always)]
    fn march<C: Coupling<f64, Memory: Force>>(
        self,
        coupling: C,
        start: FeedbackState<f64, C::Memory>,
    ) -> Option<(Trajectory, FeedbackState<f64, C::Memory>)> {
        let Self { drive, stepping, .. } = self;
        let (n, h) = (drive.u.len(), self.step());
        let out = Trajectory {
            x: Vec::with_capacity(n),
            v: Vec::with_capacity(n),
            hysteresis: Vec::with_capacity(n),
            last: self.initial,
            substeps: stepping.substeps,
            difference: 0.0,
            well_posed: true,
        };
        let mut keep = Keep { out, step: h, stop: self.stop };
        let march = March { coupling, gain: self.stage.piezo_coefficient };
        let end = march.run(drive, stepping.substeps, start, &mut keep)?;
        keep.out.last = StageState { x: end.x, v: end.w / h, ..self.initial };
        Some((keep.out, end))
    }
}

/// A memory that tells the hysteresis force, N.
trait Force {
    fn force(&self) -> f64;
}

impl Force for DahlState<f64> {
    #[inline(always)]
    fn force(&self) -> f64 {
        self.force
    }
}

impl Force for FrictionMemory<f64> {
    #[inline(always)]
    fn force(&self) -> f64 {
        self.force
    }
}

/// Keeps the states of one stage.
struct Keep<'a> {
    out: Trajectory,
    step: f64,
    stop: Stop<'a>,
}

impl<M: Force> Sink<f64, M> for Keep<'_> {
    #[inline(always)]
    fn sample(&mut self, _k: usize, state: &FeedbackState<f64, M>) {
        self.out.x.push(state.x);
        self.out.v.push(state.w / self.step);
        self.out.hysteresis.push(state.memory.force());
    }

    fn give_up(&mut self, _k: usize) -> bool {
        (self.stop)()
    }
}
