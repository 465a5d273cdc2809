//! Inverse of a stage whose displacement creeps: the creep first, then the stage's own inverse.
//!
//! ```text
//! x = xm + sum_j c_j q_j,   tau_j q_j' = xm - q_j
//! ```
//!
//! Displacement and velocity at the end of a step are linear in those of the mechanics there, as
//! xm is the cubic of [`CubicLag`]: two equations, solved once for all steps of a length.

use super::Inverse;
use crate::creep::{Creep, CubicLag};
use crate::error::{Error, Result, not_negative, positive, usable};
use crate::unfused::Unfused;

/// Inverse of up to `N` relaxations in front of the inverse of the mechanics.
///
/// ```
/// use piezotrack_control::{Creep, CreepingInverse, DahlInverse, Inverse};
///
/// let stage = DahlInverse::xu_li_2010().at(1e-3)?;
/// let creep = [Creep { share: 0.02, time: 0.1 }];
/// let inverse = CreepingInverse::<_, 1>::new(stage, &creep, 1e-3)?;
/// let mut state = inverse.rest();
/// // The stage begins in equilibrium: a share of the displacement is creep.
/// let volts = inverse.step(&mut state, 10.2e-6, 0.0, 0.0);
/// let mut at_rest = stage.rest();
/// assert!((volts - stage.step(&mut at_rest, 10e-6, 0.0, 0.0)).abs() < 1e-9);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct CreepingInverse<I, const N: usize> {
    inverse: I,
    creep: [Creep; N],
    lags: [CubicLag; N],
    /// How many of them are in use.
    count: usize,
    /// Displacement and scaled velocity at the end of a step, for those of the mechanics there.
    square: [[f64; 2]; 2],
    dt: f64,
}

/// State of a [`CreepingInverse`]; `S` is the state of the inverse of the mechanics.
#[derive(Clone, Copy, Debug)]
pub struct CreepingInverseState<S, const N: usize> {
    inner: S,
    /// Displacement of the mechanics and its velocity times the sampling interval, m.
    last: [f64; 2],
    /// Output of each relaxation, q, m.
    reached: [f64; N],
    /// Whether the first sample has been.
    begun: bool,
}

crate::snapshot!(
    [S: crate::Snapshot, const N: usize]
    CreepingInverseState<S, N> { inner, last, reached, begun }
);

impl<I: Inverse, const N: usize> CreepingInverse<I, N> {
    /// The inverse of these relaxations of a stage, for samples every `dt` seconds.
    ///
    /// # Errors
    /// Names `creep` where there are more than `N`; `creep_weights`, `creep_times` or `dt` where
    /// one is out of its range.
    pub fn new(inverse: I, creep: &[Creep], dt: f64) -> Result<Self> {
        positive("dt", dt, "s")?;
        if creep.len() > N {
            let value = u32::try_from(creep.len()).map_or(f64::INFINITY, f64::from);
            let expected = "at most as many relaxations as the inverse has room for";
            return Err(Error { name: "creep", value, unit: "entries", expected });
        }
        let mut used = [Creep { share: 0.0, time: 1.0 }; N];
        for (slot, one) in used.iter_mut().zip(creep) {
            slot.share = not_negative("creep_weights", one.share, "")?;
            slot.time = positive("creep_times", one.time, "s")?;
        }
        let lags = used.map(|one| CubicLag::new(one.time, dt));
        let mut square = [[1.0, 0.0], [0.0, 1.0]];
        for (one, lag) in used.iter().zip(&lags).take(creep.len()) {
            for (column, end) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
                let reached = step(lag, 0.0, [0.0; 2], end);
                square[0][column] += one.share * reached;
                square[1][column] += one.share * slope(lag, end[0], reached);
            }
        }
        Ok(Self { inverse, creep: used, lags, count: creep.len(), square, dt })
    }

    /// The state for a stage whose mechanics have not moved, as the state `inner` has it.
    #[must_use]
    pub fn start(&self, inner: I::State) -> CreepingInverseState<I::State, N> {
        CreepingInverseState { inner, last: [0.0; 2], reached: [0.0; N], begun: false }
    }

    /// The inverse of the mechanics, where there is no relaxation behind it.
    #[must_use]
    pub fn without_creep(&self) -> Option<&I> {
        (self.count == 0).then_some(&self.inverse)
    }

    /// Relaxations in use, with their lags.
    fn used(&self) -> impl Iterator<Item = (&Creep, &CubicLag)> {
        self.creep.iter().zip(&self.lags).take(self.count)
    }

    /// Displacement and scaled velocity of the mechanics at the end of a step, and the outputs of
    /// the relaxations there.
    fn mechanical(
        &self,
        state: &CreepingInverseState<I::State, N>,
        x: f64,
        w: f64,
    ) -> ([f64; 2], [f64; N]) {
        let mut reached = state.reached;
        if !state.begun {
            // In equilibrium.
            let share = self.used().fold(1.0, |sum, (creep, _)| sum + creep.share);
            return ([x / share, w], [x / share; N]);
        }
        let mut right = [x, w];
        for ((creep, lag), reached) in self.used().zip(&state.reached) {
            // What it puts out where the mechanics end at 0.
            let fixed = step(lag, *reached, state.last, [0.0; 2]);
            right[0] -= creep.share * fixed;
            right[1] -= creep.share * slope(lag, 0.0, fixed);
        }
        let [[a, b], [c, d]] = self.square;
        let scale = 1.0 / (a * d - b * c);
        let end = [scale * (d * right[0] - b * right[1]), scale * (a * right[1] - c * right[0])];
        for (reached, lag) in reached.iter_mut().zip(&self.lags).take(self.count) {
            *reached = step(lag, *reached, state.last, end);
        }
        (end, reached)
    }
}

fn step(lag: &CubicLag, output: f64, start: [f64; 2], end: [f64; 2]) -> f64 {
    lag.step(Unfused(output), start.map(Unfused), end.map(Unfused)).0
}

fn slope(lag: &CubicLag, input: f64, output: f64) -> f64 {
    lag.slope(Unfused(input), Unfused(output)).0
}

impl<I: Inverse, const N: usize> Inverse for CreepingInverse<I, N> {
    type State = CreepingInverseState<I::State, N>;

    fn rest(&self) -> Self::State {
        self.start(self.inverse.rest())
    }

    /// The first sample is taken to be reached slowly.
    fn step(&self, state: &mut Self::State, x: f64, v: f64, a: f64) -> f64 {
        if self.count == 0 {
            return self.inverse.step(&mut state.inner, x, v, a);
        }
        if !(usable(x) && usable(v) && usable(a)) {
            return f64::NAN;
        }
        let (last, reached) = self.mechanical(state, x, v * self.dt);
        let curved = self.used().zip(&reached).fold(a, |a, ((creep, lag), &reached)| {
            let change = last[1] - slope(lag, last[0], reached);
            a - creep.share * slope(lag, change, 0.0) / (self.dt * self.dt)
        });
        let input = self.inverse.step(&mut state.inner, last[0], last[1] / self.dt, curved);
        if !input.is_nan() {
            *state = CreepingInverseState { last, reached, begun: true, ..*state };
        }
        input
    }
}
