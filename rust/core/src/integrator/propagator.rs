//! The linear part of a stage, `M x'' + D x' + K x = f`, solved exactly over a step.
//!
//! The force over a step is a cubic in time. Its response is exact: nothing here limits the
//! step, however stiff or however lightly damped the stage is.

use piezotrack_control::Number;

use crate::error::{Result, not_negative, positive};

/// Mass, damping and stiffness of a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanics {
    /// M, kg.
    pub mass: f64,
    /// D, N s/m.
    pub damping: f64,
    /// K, N/m.
    pub stiffness: f64,
}

impl Mechanics {
    /// Checks the three values.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] where mass or stiffness is not above 0 or damping is below 0.
    pub fn new(mass: f64, damping: f64, stiffness: f64) -> Result<Self> {
        Ok(Self {
            mass: positive("mass", mass, "kg")?,
            damping: not_negative("damping", damping, "N s/m")?,
            stiffness: positive("stiffness", stiffness, "N/m")?,
        })
    }

    /// Upper bound of the rates of the two modes, rad/s.
    #[must_use]
    pub fn rate(&self) -> f64 {
        let natural = libm::sqrt(self.stiffness / self.mass);
        natural.max(self.damping / self.mass)
    }

    /// Frequency of the damped oscillation, rad/s; 0 where the stage is overdamped.
    #[must_use]
    pub fn oscillation(&self) -> f64 {
        let decay = 0.5 * self.damping / self.mass;
        libm::sqrt((self.stiffness / self.mass - decay * decay).max(0.0))
    }
}

/// How often a step is halved before its power series is summed: see [`Propagator::new`].
///
/// Fixed for all the lanes of a search, so that they stay in lockstep.
#[must_use]
pub fn halvings(rate: f64, step: f64) -> u32 {
    let mut reach = rate * step;
    let mut count = 0;
    while reach > 0.5 && count < 60 {
        reach *= 0.5;
        count += 1;
    }
    count
}

/// Displacement and scaled velocity that a term of the force leaves at the end of a step.
#[derive(Clone, Copy, Debug)]
pub struct Column<N> {
    /// Displacement, m.
    pub x: N,
    /// Velocity times the step, m.
    pub w: N,
}

/// The exact step of the linear part, in `x` and `w = h x'`.
///
/// With the force `f(s) = f0 + f1 s + c2 s^2 + c3 s^3`, `s` from 0 to 1 over the step, and the
/// cubic given by what force and scaled slope at the end exceed `f0 + f1` and `f1`:
///
/// ```text
/// [x1 w1] = position x0 + velocity w0 + constant f0 + ramp f1 + excess df + bend dg
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Propagator<N> {
    /// Response to the displacement at the start.
    pub position: Column<N>,
    /// Response to the scaled velocity at the start.
    pub velocity: Column<N>,
    /// Response to a constant force.
    pub constant: Column<N>,
    /// Response to a force that rises from 0 to 1.
    pub ramp: Column<N>,
    /// Response to the cubic that ends at 1 with slope 0.
    pub excess: Column<N>,
    /// Response to the cubic that ends at 0 with slope 1.
    pub bend: Column<N>,
}

/// Moments of the impulse response, `integral of exp(A h (1 - s)) b s^k ds`, k = 0 to 3.
type Moments<N> = [[N; 2]; 4];

/// Terms of the power series: the next is below 0.5^17 / 17! = 2e-20.
const TERMS: usize = 16;

impl<N: Number> Propagator<N> {
    /// Builds the step for lanes of `1/M`, `D/M`, `K/M`.
    ///
    /// The power series of the matrix exponential is summed for `step / 2^halvings` and
    /// doubled back, which needs only sums and products and so gives the same bits for one
    /// stage and for lanes.
    #[inline(always)]
    pub fn new(inverse_mass: N, damping: N, stiffness: N, step: f64, halvings: u32) -> Self {
        let part = libm::ldexp(step, -i32::try_from(halvings).unwrap_or(0));
        let (mut change, mut moments) = series(inverse_mass, damping, stiffness, part);
        for _ in 0..halvings {
            (change, moments) = doubled(&change, &moments);
        }
        let h = inverse_mass.like(step);
        let column = |v: [N; 2]| Column { x: v[0], w: v[1] * h };
        let blend = |a: f64, b: f64| {
            let (a, b) = (h.like(a), h.like(b));
            let row = |i: usize| a.mul_add(moments[2][i], b * moments[3][i]);
            column([row(0), row(1)])
        };
        let back = h.like(1.0 / step);
        let one = h.like(1.0);
        let velocity = column([change[0][1] * back, (one + change[1][1]) * back]);
        Self {
            position: column([one + change[0][0], change[1][0]]),
            velocity,
            constant: column(moments[0]),
            ramp: column(moments[1]),
            excess: blend(3.0, -2.0),
            bend: blend(-1.0, 1.0),
        }
    }
}

/// Transition matrix less 1, and moments, over one short step, by their power series.
#[inline(always)]
fn series<N: Number>(
    inverse_mass: N,
    damping: N,
    stiffness: N,
    h: f64,
) -> ([[N; 2]; 2], Moments<N>) {
    let zero = damping.like(0.0);
    let one = damping.like(1.0);
    let step = damping.like(h);
    // v <- (A h) v for A = [0 1; -K/M -D/M]
    let advance = |v: [N; 2]| [step * v[1], -(step * stiffness.mul_add(v[0], damping * v[1]))];
    let mut columns = [[one, zero], [zero, one]];
    let mut change = [[zero; 2]; 2];
    let mut input = [zero, step * inverse_mass];
    let mut moments = [[zero; 2]; 4];
    let mut factorial = 1.0;
    for j in 0..TERMS {
        // b s^k contributes (A h)^j b k! / (k + j + 1)!
        let mut weight = 1.0 / (factorial * (count(j) + 1.0));
        for (k, moment) in moments.iter_mut().enumerate() {
            let share = damping.like(weight);
            for i in 0..2 {
                moment[i] = share.mul_add(input[i], moment[i]);
            }
            weight *= (count(k) + 1.0) / (count(k + j) + 2.0);
        }
        input = advance(input);
        factorial *= count(j) + 1.0;
        let share = damping.like(1.0 / factorial);
        for c in 0..2 {
            columns[c] = advance(columns[c]);
            for i in 0..2 {
                change[i][c] = share.mul_add(columns[c][i], change[i][c]);
            }
        }
    }
    (change, moments)
}

/// Transition matrix less 1, and moments, over two steps in a row.
///
/// Without the 1, so that a mode which hardly moves in a short step keeps all its digits:
/// (1 + E)^2 - 1 = E^2 + 2 E.
#[inline(always)]
fn doubled<N: Number>(e: &[[N; 2]; 2], moments: &Moments<N>) -> ([[N; 2]; 2], Moments<N>) {
    const BINOMIAL: [[f64; 4]; 4] =
        [[1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [1.0, 2.0, 1.0, 0.0], [1.0, 3.0, 3.0, 1.0]];
    let two = e[0][0].like(2.0);
    let product =
        |i: usize, j: usize| e[i][0].mul_add(e[0][j], e[i][1].mul_add(e[1][j], two * e[i][j]));
    let change = [[product(0, 0), product(0, 1)], [product(1, 0), product(1, 1)]];
    // First half: s^k is 2^-k of the half's own; second half: ((1 + s)/2)^k, expanded.
    let mut out = *moments;
    let mut scale = 1.0;
    for k in 0..4 {
        for i in 0..2 {
            let moved = e[i][0].mul_add(moments[k][0], e[i][1] * moments[k][1]);
            let mut sum = moments[k][i] + moved;
            for j in 0..=k {
                sum = sum.like(BINOMIAL[k][j]).mul_add(moments[j][i], sum);
            }
            out[k][i] = sum * sum.like(scale);
        }
        scale *= 0.5;
    }
    (change, out)
}

/// A small index as a number.
#[inline(always)]
fn count(n: usize) -> f64 {
    u32::try_from(n).map_or(f64::NAN, f64::from)
}
