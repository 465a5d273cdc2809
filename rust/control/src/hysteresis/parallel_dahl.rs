//! First-order Dahl elements in parallel: displacement in, the sum of their forces out.
//!
//! ```text
//! F = sum F_j,   dF_j/dx = sigma_j (1 - F_j sgn(x')/Fc_j)
//! ```
//!
//! Each element is that of Dahl 1976, doi 10.2514/3.61511, with exponent 1. Elements that slide at
//! different displacements are the generalised Maxwell-slip arrangement (Al-Bender, Lampaert and
//! Swevers 2005, doi 10.1109/TAC.2005.858676); here each has the smooth transition of Dahl's, so
//! that the tips of a loop are smooth too. With p the length of the path and `l_j = Fc_j/sigma_j`
//!
//! ```text
//! F_j = Fc_j - (Fc_j - F_j(0)) exp(-p/l_j)
//! ```
//!
//! along the direction of motion. The force stays within the sum of the `Fc_j`, and loops close.

use super::decay::decay;
use super::{NonsmoothOperator, Operator};
use crate::cast::{Cast, rounded};
use crate::error::Result;
use crate::unfused::Unfused;
use crate::{Number, Real};

/// How many elements there are.
pub const FRICTION_ELEMENTS: usize = 3;

/// First-order Dahl elements in parallel.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `coulomb_forces` | `Fc_j` | N | >= 0 |
/// | `rates` | `1/l_j` | 1/m | > 0 |
///
/// ```
/// use piezotrack_control::hysteresis::{Operator, ParallelDahl};
///
/// let friction = ParallelDahl::geometric([2.0_f64, 1.0, 0.5], 2.0, 4.0);
/// assert_eq!(friction.coulomb_forces, [4.0, 8.0, 16.0]);
/// let up = friction.branch(&friction.rest(), 1.0);
/// let (force, slope) = friction.output(&friction.along(&up, 1000.0));
/// assert!((force - 28.0).abs() < 1e-12 && slope.abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParallelDahl<N> {
    /// Coulomb force Fc of each element, reached after a long path in one direction.
    pub coulomb_forces: [N; FRICTION_ELEMENTS],
    /// 1/l of each element: the slope where its force is 0, over its Coulomb force.
    pub rates: [N; FRICTION_ELEMENTS],
}

/// State of the elements: their forces, and the slope of the sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParallelDahlState<N> {
    /// Force of each element.
    pub forces: [N; FRICTION_ELEMENTS],
    /// Slope of the sum along the last section of the path.
    pub slope: N,
}

crate::snapshot!([N: crate::Snapshot] ParallelDahlState<N> { forces, slope });

/// A state about to be left in one direction.
#[derive(Clone, Copy, Debug)]
pub struct ParallelDahlBranch<N> {
    /// Forces counted along the direction.
    along: [N; FRICTION_ELEMENTS],
    direction: N,
}

impl Cast for ParallelDahl<Unfused> {
    type In<T: Real> = ParallelDahl<Unfused<T>>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        let zero = [Unfused(T::ZERO); FRICTION_ELEMENTS];
        let mut out = ParallelDahl { coulomb_forces: zero, rates: zero };
        for j in 0..FRICTION_ELEMENTS {
            let force = rounded("rest_stiffnesses", self.coulomb_forces[j].0, "N")?;
            let rate = rounded("yield_path", self.rates[j].0, "1/m")?;
            (out.coulomb_forces[j], out.rates[j]) = (Unfused(force), Unfused(rate));
        }
        Ok(out)
    }
}

impl<N: Number> ParallelDahl<N> {
    /// Elements with these slopes at F = 0 whose paths l are a geometric sequence: the first is
    /// `yield_path`, each of the others `path_ratio` times the one before.
    #[inline(always)]
    pub fn geometric(
        rest_stiffnesses: [N; FRICTION_ELEMENTS],
        yield_path: N,
        path_ratio: N,
    ) -> Self {
        let second = yield_path * path_ratio;
        let third = second * path_ratio;
        let one = yield_path.like(1.0);
        Self {
            coulomb_forces: product(rest_stiffnesses, [yield_path, second, third]),
            rates: [one / yield_path, one / second, one / third],
        }
    }

    /// dF/dx of the sum at forces counted along the direction of motion.
    #[inline(always)]
    fn slope(&self, along: &[N; FRICTION_ELEMENTS]) -> N {
        let [a, b, c] = self.coulomb_forces;
        let [d, e, f] = *along;
        let [first, second, third] = product([a - d, b - e, c - f], self.rates);
        first + second + third
    }
}

// Closures, as of `map`, would not be compiled for the vector instructions of their caller.

/// Element by element.
#[inline(always)]
fn product<N: Number>(
    [a, b, c]: [N; FRICTION_ELEMENTS],
    [d, e, f]: [N; FRICTION_ELEMENTS],
) -> [N; FRICTION_ELEMENTS] {
    [a * d, b * e, c * f]
}

impl<N: Number> Operator<N> for ParallelDahl<N> {
    type State = ParallelDahlState<N>;
    type Branch = ParallelDahlBranch<N>;

    #[inline(always)]
    fn rest(&self) -> ParallelDahlState<N> {
        let forces = [self.rates[0].like(0.0); FRICTION_ELEMENTS];
        ParallelDahlState { forces, slope: self.slope(&forces) }
    }

    #[inline(always)]
    fn output(&self, state: &ParallelDahlState<N>) -> (N, N) {
        let [first, second, third] = state.forces;
        (first + second + third, state.slope)
    }

    #[inline(always)]
    fn branch(&self, state: &ParallelDahlState<N>, direction: N) -> ParallelDahlBranch<N> {
        let along = product([direction; FRICTION_ELEMENTS], state.forces);
        ParallelDahlBranch { along, direction }
    }

    #[inline(always)]
    fn along(&self, branch: &ParallelDahlBranch<N>, distance: N) -> ParallelDahlState<N> {
        let ParallelDahlBranch { along, direction } = branch;
        let length = *direction * distance;
        let mut there = *along;
        for (j, force) in there.iter_mut().enumerate() {
            let change = decay(self.rates[j] * length);
            *force = (*force - self.coulomb_forces[j]).mul_add(change, *force);
        }
        let slope = self.slope(&there);
        ParallelDahlState { forces: product([*direction; FRICTION_ELEMENTS], there), slope }
    }
}

impl<N: Number> NonsmoothOperator<N> for ParallelDahl<N> {
    #[inline(always)]
    fn leaving(&self, state: &ParallelDahlState<N>, _distance: N, direction: N) -> Self::State {
        let slope = self.slope(&product([direction; FRICTION_ELEMENTS], state.forces));
        ParallelDahlState { slope, ..*state }
    }
}
