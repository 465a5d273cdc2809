//! Classical Runge-Kutta methods on the Dahl stage, for comparison.
//!
//! They take the whole stage, stiff linear part included, as one system of four first-order
//! equations in x, x', Fh and dFh/dx. RK4 is stable only for steps below 2.785 M/D, which at
//! 5 kHz excludes the published stage. The adaptive pair is that of Dormand and Prince 1980,
//! doi 10.1016/0771-050X(80)90013-3, behind the solver that Xu and Li used.

use piezotrack_control::hysteresis::DahlState;

use super::stage::{DahlStage, DahlStageState, STATE};
use crate::error::{Error, Result};
use crate::integrator::{MOST_SUBSTEPS, columns, first_substeps, out_of_reach};
use crate::models::parameters::values::Values;
use crate::models::traits::{Experiment, Method, Response};
use crate::signal::{Drive, Stop, index, largest_difference};

/// x, x', Fh, dFh/dx.
type State = [f64; 4];

/// Right-hand side of the stage under a voltage.
fn slope(stage: &DahlStage, state: &State, u: f64) -> State {
    let [x, v, force, stiffness] = *state;
    let m = &stage.mechanics;
    let acceleration =
        (stage.piezo_coefficient * u - force - m.damping * v - m.stiffness * x) / m.mass;
    let decay = if v < 0.0 { -stage.a1 } else { stage.a1 };
    let bend = stage.b1 * stage.up - stage.a2 * force - decay * stiffness;
    [v, acceleration, stiffness * v, bend * v]
}

/// `state + h * sum(weights * slopes)`.
fn moved(state: &State, h: f64, weights: &[f64], slopes: &[State]) -> State {
    let mut out = *state;
    for (weight, slope) in weights.iter().zip(slopes) {
        for (value, change) in out.iter_mut().zip(slope) {
            *value += h * weight * change;
        }
    }
    out
}

/// A method that integrates over an interval of the drive.
trait IntervalSolver {
    /// The state at the end of an interval of length `dt` with the drive from `u` to
    /// `u + change`; `None` where it does not stay finite.
    fn cross(&mut self, state: State, u: f64, change: f64, dt: f64) -> Option<State>;

    /// Most steps that an interval took.
    fn steps(&self) -> usize;
}

/// RK4 with a fixed number of steps in each interval.
struct Rk4<'a> {
    stage: &'a DahlStage,
    substeps: usize,
}

impl IntervalSolver for Rk4<'_> {
    fn cross(&mut self, mut state: State, u: f64, change: f64, dt: f64) -> Option<State> {
        let part = 1.0 / index(self.substeps);
        let h = dt * part;
        for j in 0..self.substeps {
            let drive = |s: f64| u + change * (index(j) + s) * part;
            let k1 = slope(self.stage, &state, drive(0.0));
            let k2 = slope(self.stage, &moved(&state, h, &[0.5], &[k1]), drive(0.5));
            let k3 = slope(self.stage, &moved(&state, h, &[0.5], &[k2]), drive(0.5));
            let k4 = slope(self.stage, &moved(&state, h, &[1.0], &[k3]), drive(1.0));
            let weights = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];
            state = moved(&state, h, &weights, &[k1, k2, k3, k4]);
        }
        state[0].is_finite().then_some(state)
    }

    fn steps(&self) -> usize {
        self.substeps
    }
}

/// Nodes of the Dormand-Prince pair.
const NODES: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
/// Its stages; the last row is the solution of fifth order.
const STAGES: [&[f64]; 6] = [
    &[0.2],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// Fifth less fourth order.
const DIFFERENCE: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Dormand-Prince with steps chosen for a relative tolerance.
struct Rk45<'a> {
    stage: &'a DahlStage,
    tolerance: f64,
    /// Scale against which errors of small values are measured.
    size: State,
    /// Step carried from one interval to the next, s.
    step: f64,
    most: usize,
}

impl<'a> Rk45<'a> {
    fn new(stage: &'a DahlStage, drive: &Drive<'_>, tolerance: f64) -> Self {
        let m = &stage.mechanics;
        let most = drive.u.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
        let x = (stage.piezo_coefficient * most / m.stiffness).abs().max(1e-12);
        let bend = (stage.b1 * stage.up).abs();
        let size = [x, x * libm::sqrt(m.stiffness / m.mass), 0.5 * bend * x * x, bend * x];
        Self { stage, tolerance, size, step: 1e-3 * drive.dt, most: 0 }
    }
}

impl IntervalSolver for Rk45<'_> {
    fn cross(&mut self, mut state: State, u: f64, change: f64, dt: f64) -> Option<State> {
        let mut at = 0.0;
        let mut steps = 0;
        while at < dt {
            let rest = dt - at;
            let last = self.step >= rest * (1.0 - 1e-12);
            let h = if last { rest } else { self.step };
            let mut slopes = [[0.0; 4]; 7];
            slopes[0] = slope(self.stage, &state, u + change * at / dt);
            let mut next = state;
            for (i, weights) in STAGES.iter().enumerate() {
                next = moved(&state, h, weights, &slopes);
                let now = u + change * (at + NODES[i + 1] * h) / dt;
                slopes[i + 1] = slope(self.stage, &next, now);
            }
            let errors = moved(&[0.0; 4], h, &DIFFERENCE, &slopes);
            let mut worst = 0.0_f64;
            for ((error, value), size) in errors.iter().zip(&next).zip(&self.size) {
                let scale = self.tolerance * value.abs().max(*size);
                let ratio = error.abs() / scale.max(f64::MIN_POSITIVE);
                worst = if ratio.is_nan() { f64::INFINITY } else { worst.max(ratio) };
            }
            let factor = 0.9 * libm::pow(worst.max(1e-10), -0.2);
            if worst <= 1.0 {
                state = next;
                at = if last { dt } else { at + h };
            }
            // The last step of an interval was cut: it says nothing against a longer one.
            if worst > 1.0 || !last {
                self.step = h * factor.clamp(0.1, 5.0);
            }
            steps += 1;
            if steps > 1_000_000 || self.step < 1e-15 * dt {
                return None;
            }
        }
        self.most = self.most.max(steps);
        Some(state)
    }

    fn steps(&self) -> usize {
        self.most
    }
}

/// Digits of the relative tolerance that the adaptive method begins and ends with.
const DIGITS: (usize, usize) = (6, 14);

/// Simulates so that half the step, or a tenth of the tolerance, moves no sample by more than the
/// accuracy; `None` where it was stopped.
pub(super) fn simulate(
    stage: &DahlStage,
    experiment: &Experiment<'_>,
    from: DahlStageState,
) -> Result<Option<Response>> {
    let Experiment { drive, method, accuracy, stop, .. } = *experiment;
    if stage.has_friction() {
        let expected = "0 with a Runge-Kutta method, which steps over sticking (or \
                        method='exponential')";
        return Err(Error::parameter("b0", format!("{} N/m", stage.b0), expected));
    }
    let adaptive = method == Method::Rk45;
    let (mut level, last) =
        if adaptive { DIGITS } else { (first_substeps(&stage.mechanics, drive.dt), MOST_SUBSTEPS) };
    let mut coarse: Option<Response> = None;
    loop {
        let room = columns(drive.u.len())?;
        let fine = if adaptive {
            let mut crossing = Rk45::new(stage, drive, libm::pow(10.0, -index(level)));
            along(stage, &mut crossing, drive, from, room, stop)
        } else {
            along(stage, &mut Rk4 { stage, substeps: level }, drive, from, room, stop)
        };
        if stop() {
            return Ok(None);
        }
        coarse = match (fine, coarse.take()) {
            (Some(mut fine), Some(before)) => {
                fine.error_estimate = largest_difference(&before.x, &fine.x);
                if fine.error_estimate <= accuracy {
                    return Ok(Some(fine));
                }
                if level >= last {
                    return Err(out_of_reach(accuracy, fine.substeps, fine.error_estimate));
                }
                Some(fine)
            }
            (Some(fine), None) => Some(fine),
            (None, _) if level >= last => {
                return Err(Error::Numerical(
                    "the simulated displacement does not stay finite: check that parameters and \
                     drive are in SI units"
                        .into(),
                ));
            }
            // A Runge-Kutta method that is not stable may be so in shorter steps.
            (None, _) => None,
        };
        level = if adaptive { level + 1 } else { 2 * level };
    }
}

/// Motion under a drive; `None` where it does not stay finite or `stop` says so.
fn along(
    stage: &DahlStage,
    crossing: &mut impl IntervalSolver,
    drive: &Drive<'_>,
    initial: DahlStageState,
    mut columns: [Vec<f64>; 3],
    stop: Stop<'_>,
) -> Option<Response> {
    let n = drive.u.len();
    let memory = stage.memory(&initial);
    let mut state = [initial.x, initial.v, memory.force, memory.slope];
    for k in 0..n {
        if k > 0 {
            let (u, change) = drive.interval(k - 1);
            state = crossing.cross(state, u, change, drive.dt)?;
            // An interval of many steps is as long as many of few.
            if (k % 64 == 0 || crossing.steps() > 64) && stop() {
                return None;
            }
        }
        for (column, value) in columns.iter_mut().zip(state) {
            column.push(value);
        }
    }
    let [end, velocity, force, slope] = state;
    let (q1, q2) = stage.states(&DahlState { force, slope });
    let [x, v, hysteresis] = columns;
    Some(Response {
        x,
        v,
        hysteresis,
        last: Values::scalars(STATE, &[end, velocity, q1, q2]),
        substeps: crossing.steps(),
        error_estimate: 0.0,
        unique: true,
    })
}
