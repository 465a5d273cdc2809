//! The second-order Dahl operator: displacement in, hysteresis force out.
//!
//! ```text
//! dV/dx = Ah V + Bh up,   Fh = Ch V,   V = [q1 q2]^T
//! Ah = [0 1; -a2  -sgn(x') a1],  Bh = [0; 1],  Ch = [b1 0]
//! ```
//!
//! Xu and Li 2010, equations (7) and (8), doi 10.1115/1.4001712, with b0 = 0. It is linear
//! with constant coefficients *in x*, one matrix for each direction of motion, so the force
//! along a monotone section is a power series in the distance, at any speed.

use super::Operator;
use crate::cast::{Cast, rounded};
use crate::error::Result;
use crate::unfused::Unfused;
use crate::{Number, Real};

/// Second-order Dahl operator with its output scaled to force, for b0 = 0.
///
/// `TERMS` terms of the power series in the distance d are summed. The first one omitted is
/// `(sqrt(a2) d)^TERMS / (TERMS + 1)!` of the change: with six terms it is below 1e-15 for
/// d = 0.01/sqrt(a2), which is 10 um with the published a2. For longer moves the integrator
/// controls the error by halving its steps until two results agree.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `a1` | a1 | 1/m | >= 0 |
/// | `a2` | a2 | 1/m^2 | >= 0 |
/// | `gain` | b1 up | N/m^2 | any |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dahl<N, const TERMS: usize = 6> {
    /// Decay along the path, 1/m.
    pub a1: N,
    /// Square of the spatial frequency, 1/m^2.
    pub a2: N,
    /// Curvature of the virgin branch at rest, b1 up, N/m^2.
    pub gain: N,
}

/// State of the operator: the force b1 q1 and its slope b1 q2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DahlState<N> {
    /// Hysteresis force b1 q1, N.
    pub force: N,
    /// Its slope along the path, b1 q2, N/m.
    pub slope: N,
}

crate::snapshot!([N: crate::Snapshot] DahlState<N> { force, slope });

/// Taylor coefficients of the force about the state where the branch begins.
#[derive(Clone, Copy, Debug)]
pub struct DahlBranch<N, const TERMS: usize> {
    force: N,
    /// Derivatives of the force with respect to x, in ascending order from the first.
    derivatives: [N; TERMS],
}

impl<const TERMS: usize> Cast for Dahl<Unfused, TERMS> {
    type In<T: Real> = Dahl<Unfused<T>, TERMS>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        Ok(Dahl {
            a1: Unfused(rounded("a1", self.a1.0, "1/m")?),
            a2: Unfused(rounded("a2", self.a2.0, "1/m^2")?),
            gain: Unfused(rounded("up", self.gain.0, "")?),
        })
    }
}

impl<N: Number, const TERMS: usize> Operator<N> for Dahl<N, TERMS> {
    type State = DahlState<N>;
    type Branch = DahlBranch<N, TERMS>;

    #[inline(always)]
    fn rest(&self) -> DahlState<N> {
        let zero = self.gain.like(0.0);
        DahlState { force: zero, slope: zero }
    }

    #[inline(always)]
    fn output(&self, state: &DahlState<N>) -> (N, N) {
        (state.force, state.slope)
    }

    #[inline(always)]
    fn branch(&self, state: &DahlState<N>, direction: N) -> DahlBranch<N, TERMS> {
        let decay = -(direction * self.a1);
        let spring = -self.a2;
        let mut derivatives = [state.slope; TERMS];
        derivatives[1] = spring.mul_add(state.force, decay.mul_add(state.slope, self.gain));
        for k in 2..TERMS {
            derivatives[k] = spring.mul_add(derivatives[k - 2], decay * derivatives[k - 1]);
        }
        DahlBranch { force: state.force, derivatives }
    }

    #[inline(always)]
    fn along(&self, branch: &DahlBranch<N, TERMS>, distance: N) -> DahlState<N> {
        let d = &branch.derivatives;
        let mut force = d[TERMS - 1];
        let mut slope = d[TERMS - 1];
        for k in (1..TERMS).rev() {
            force = (distance * distance.like(RECIPROCAL[k + 1])).mul_add(force, d[k - 1]);
            if k > 1 {
                slope = (distance * distance.like(RECIPROCAL[k])).mul_add(slope, d[k - 1]);
            }
        }
        DahlState {
            force: distance.mul_add(force, branch.force),
            slope: distance.mul_add(slope, d[0]),
        }
    }
}

/// 1/k for the Horner scheme.
const RECIPROCAL: [f64; 9] =
    [0.0, 1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0, 1.0 / 6.0, 1.0 / 7.0, 1.0 / 8.0];
