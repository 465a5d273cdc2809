//! Inverse of a stage whose displacement creeps: the creep first, then the stage's own inverse.
//!
//! ```text
//! x = xm + sum_j c_j q_j,   tau_j q_j' = xm - q_j
//! ```
//!
//! Displacement and velocity at the end of a step are linear in those of the mechanics there, as
//! xm is the cubic of [`CubicLag`]: two equations, solved once for all steps of a length.

use super::Inverse;
use crate::cast::{Cast, all_rounded, rounded};
use crate::creep::{Creep, CubicLag, cubic_lagged};
use crate::error::{Error, Result, not_negative, positive};
use crate::number::Real;
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
pub struct CreepingInverse<I, const N: usize, T = f64> {
    inverse: I,
    relaxations: [Relaxation<T>; N],
    /// How many of them are in use.
    count: usize,
    /// Displacement and scaled velocity at the end of a step, for those of the mechanics there.
    square: [[T; 2]; 2],
    dt: T,
}

/// A relaxation for one sampling interval.
#[derive(Clone, Copy, Debug)]
struct Relaxation<T> {
    /// c.
    share: T,
    /// Those of [`CubicLag`].
    weights: [T; 4],
    /// Sampling interval over the time constant.
    rate: T,
}

impl Relaxation<f64> {
    fn new(creep: &Creep, dt: f64) -> Self {
        let (weights, rate) = CubicLag::new(creep.time, dt).weights();
        Self { share: creep.share, weights, rate }
    }

    fn cast<T: Real>(&self) -> Result<Relaxation<T>> {
        Ok(Relaxation {
            share: rounded("creep_weights", self.share, "")?,
            weights: all_rounded("creep_times", &self.weights, "")?,
            rate: rounded("creep_times", self.rate, "")?,
        })
    }
}

impl<T: Real> Relaxation<T> {
    fn step(&self, output: T, start: [T; 2], end: [T; 2]) -> T {
        let (start, end) = (start.map(Unfused), end.map(Unfused));
        cubic_lagged(Unfused(output), start, end, self.weights.map(Unfused)).0
    }

    fn slope(&self, input: T, output: T) -> T {
        (input - output) * self.rate
    }
}

/// State of a [`CreepingInverse`]; `S` is the state of the inverse of the mechanics.
#[derive(Clone, Copy, Debug)]
pub struct CreepingInverseState<S, const N: usize, T = f64> {
    inner: S,
    /// Displacement of the mechanics and its velocity times the sampling interval, m.
    last: [T; 2],
    /// Output of each relaxation, q, m.
    reached: [T; N],
    /// Whether the first sample has been.
    begun: bool,
}

crate::snapshot!(
    [S: crate::Snapshot, const N: usize, T: Real]
    CreepingInverseState<S, N, T> { inner, last, reached, begun }
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
        let relaxations = used.map(|one| Relaxation::new(&one, dt));
        let mut square = [[1.0, 0.0], [0.0, 1.0]];
        for one in relaxations.iter().take(creep.len()) {
            for (column, end) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
                let reached = one.step(0.0, [0.0; 2], end);
                square[0][column] += one.share * reached;
                square[1][column] += one.share * one.slope(end[0], reached);
            }
        }
        Ok(Self { inverse, relaxations, count: creep.len(), square, dt })
    }
}

impl<I: Cast, const N: usize> Cast for CreepingInverse<I, N> {
    type In<T: Real> = CreepingInverse<I::In<T>, N, T>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        let unused = Relaxation { share: T::ZERO, weights: [T::ZERO; 4], rate: T::ZERO };
        let mut relaxations = [unused; N];
        for (slot, own) in relaxations.iter_mut().zip(&self.relaxations) {
            *slot = own.cast()?;
        }
        let [first, second] = &self.square;
        let name = "creep_weights";
        Ok(CreepingInverse {
            inverse: self.inverse.cast()?,
            relaxations,
            count: self.count,
            square: [all_rounded(name, first, "")?, all_rounded(name, second, "")?],
            dt: rounded("dt", self.dt, "s")?,
        })
    }
}

impl<I: Inverse<T>, const N: usize, T: Real> CreepingInverse<I, N, T> {
    /// The state for a stage whose mechanics have not moved, as the state `inner` has it.
    #[must_use]
    pub fn start(&self, inner: I::State) -> CreepingInverseState<I::State, N, T> {
        let (last, reached) = ([T::ZERO; 2], [T::ZERO; N]);
        CreepingInverseState { inner, last, reached, begun: false }
    }

    /// The inverse of the mechanics, where there is no relaxation behind it.
    #[must_use]
    pub fn without_creep(&self) -> Option<&I> {
        (self.count == 0).then_some(&self.inverse)
    }

    /// Relaxations in use.
    fn used(&self) -> impl Iterator<Item = &Relaxation<T>> {
        self.relaxations.iter().take(self.count)
    }

    /// Displacement and scaled velocity of the mechanics at the end of a step, and the outputs of
    /// the relaxations there.
    fn mechanical(
        &self,
        state: &CreepingInverseState<I::State, N, T>,
        x: T,
        w: T,
    ) -> ([T; 2], [T; N]) {
        let mut reached = state.reached;
        if !state.begun {
            // In equilibrium.
            let share = self.used().fold(T::of(1.0), |sum, one| sum + one.share);
            return ([x / share, w], [x / share; N]);
        }
        let mut right = [x, w];
        for (one, reached) in self.used().zip(&state.reached) {
            // What it puts out where the mechanics end at 0.
            let fixed = one.step(*reached, state.last, [T::ZERO; 2]);
            right[0] = right[0] - one.share * fixed;
            right[1] = right[1] - one.share * one.slope(T::ZERO, fixed);
        }
        let [[a, b], [c, d]] = self.square;
        let scale = T::of(1.0) / (a * d - b * c);
        let end = [scale * (d * right[0] - b * right[1]), scale * (a * right[1] - c * right[0])];
        for (reached, one) in reached.iter_mut().zip(self.used()) {
            *reached = one.step(*reached, state.last, end);
        }
        (end, reached)
    }
}

impl<I: Inverse<T>, const N: usize, T: Real> Inverse<T> for CreepingInverse<I, N, T> {
    type State = CreepingInverseState<I::State, N, T>;

    fn rest(&self) -> Self::State {
        self.start(self.inverse.rest())
    }

    /// The first sample is taken to be reached slowly.
    fn step(&self, state: &mut Self::State, x: T, v: T, a: T) -> T {
        if self.count == 0 {
            return self.inverse.step(&mut state.inner, x, v, a);
        }
        if !(x.is_usable() && v.is_usable() && a.is_usable()) {
            return T::NAN;
        }
        let (last, reached) = self.mechanical(state, x, v * self.dt);
        let curved = self.used().zip(&reached).fold(a, |a, (one, &reached)| {
            let change = last[1] - one.slope(last[0], reached);
            a - one.share * one.slope(change, T::ZERO) / (self.dt * self.dt)
        });
        let input = self.inverse.step(&mut state.inner, last[0], last[1] / self.dt, curved);
        if !input.is_nan() {
            *state = CreepingInverseState { last, reached, begun: true, ..*state };
        }
        input
    }
}
