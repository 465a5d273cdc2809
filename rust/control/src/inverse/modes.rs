//! The inverse of modes in parallel: displacement and its derivatives in, static displacement out.
//!
//! ```text
//! x = sum_k g_k x_k,   x_k'' + 2 z_k w_k x_k' + w_k^2 x_k = w_k^2 d
//! W d = x'' + sum_k g_k (w_k^2 x_k + 2 z_k w_k x_k'),   W = sum_k g_k w_k^2
//! ```
//!
//! With the main mode expressed by x and the others, these others follow a linear system whose
//! poles are the zeros of the sum. Where all of them are in the left half plane the inverse is
//! stable, and is stepped exactly for x, x' and x'' that are linear from sample to sample.

use core::f64::consts::TAU;

use crate::cast::{Cast, all_rounded, rounded};
use crate::dynamics::{MOST_MODES, Mode, Modes};
use crate::error::{Error, Result, positive};
use crate::number::Real;

/// States of the filter: displacement and scaled velocity of each mode beside the main one.
const STATES: usize = 2 * (MOST_MODES - 1);
/// Room for its input and the rise of that over a step.
const SIZE: usize = STATES + 2;
/// Terms of the power series of the matrix exponential, for a norm of 0.5 at most.
const TERMS: u32 = 18;

type Matrix = [[f64; SIZE]; SIZE];

/// Inverse of several modes for samples of one length.
///
/// ```
/// use piezotrack_control::inverse::ModesInverse;
/// use piezotrack_control::{Mode, Modes};
///
/// let second = Mode { weight: 0.3, frequency: 400.0, damping_ratio: 0.02 };
/// let modes = Modes::new(150.0, 0.05, &[second])?;
/// let inverse = ModesInverse::new(&modes, 1e-4)?;
/// let mut state = inverse.begin(1e-6, 0.0, 0.0);
/// // At rest the static displacement is the displacement.
/// assert!((inverse.output(&state) - 1e-6).abs() < 1e-20);
/// inverse.step(&mut state, 1e-6, 0.0, 0.0);
/// assert!((inverse.output(&state) - 1e-6).abs() < 1e-18);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModesInverse<T = f64> {
    /// Rows of the step of the state: of the state, the old input and its rise.
    step: [[T; SIZE]; STATES],
    /// Share of each state in the output.
    output: [T; STATES],
    /// Share of the input in it.
    direct: T,
    /// Share of the velocity in the input, s.
    velocity: T,
    /// Share of the acceleration in the input, s^2.
    acceleration: T,
    /// Velocity scales of the modes, s.
    scales: [T; STATES],
}

/// State of a [`ModesInverse`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ModesInverseState<T = f64> {
    /// Displacement and scaled velocity of each mode beside the main one, m.
    modes: [T; STATES],
    /// The input at the last sample, m.
    input: T,
}

crate::snapshot!([T: Real] ModesInverseState<T> { modes, input });

impl ModesInverse {
    /// The inverse for samples every `dt` seconds.
    ///
    /// # Errors
    /// Names `mode_weights` where the sum of the modes has a zero that is not in the left half
    /// plane, so that its inverse is not stable; names `dt` where it is not above 0.
    pub fn new(modes: &Modes, dt: f64) -> Result<Self> {
        positive("dt", dt, "s")?;
        let first = modes.further().first().map_or(0.0, |mode| mode.weight);
        if !stable(&zeros(modes), 2 * modes.further().len()) {
            return Err(Error {
                name: "mode_weights",
                value: first,
                unit: "",
                expected: "modes whose sum has its zeros in the left half plane; there is no \
                           stable inverse with one in the right half plane or on its edge",
            });
        }
        let rate = |mode: &Mode| TAU * mode.frequency;
        let [main, ..] = modes.all();
        let natural = rate(main);
        let high: f64 = modes.used().iter().map(|m| m.weight * rate(m) * rate(m)).sum();
        let direct = natural * natural / high;
        let mut output = [0.0; STATES];
        let mut scales = [1.0; STATES];
        for (k, mode) in modes.further().iter().enumerate() {
            let own = rate(mode);
            output[2 * k] = mode.weight * (own * own - natural * natural) / high;
            let damping = mode.damping_ratio * own - main.damping_ratio * natural;
            // The velocity is scaled by its mode's rate.
            output[2 * k + 1] = 2.0 * mode.weight * damping * own / high;
            scales[2 * k + 1] = 1.0 / own;
        }
        // Modes, input, rise of the input: all derivatives times the step.
        let mut system: Matrix = [[0.0; SIZE]; SIZE];
        for (k, mode) in modes.further().iter().enumerate() {
            let reach = rate(mode) * dt;
            system[2 * k][2 * k + 1] = reach;
            let row = &mut system[2 * k + 1];
            for (entry, share) in row.iter_mut().zip(&output) {
                *entry = reach * share;
            }
            row[STATES] = reach * direct;
            row[2 * k] -= reach;
            row[2 * k + 1] -= 2.0 * mode.damping_ratio * reach;
        }
        system[STATES][STATES + 1] = 1.0;
        let whole = exponential(&system);
        let mut step = [[0.0; SIZE]; STATES];
        step.copy_from_slice(whole.get(..STATES).unwrap_or_default());
        let velocity = 2.0 * main.damping_ratio / natural;
        let acceleration = 1.0 / (natural * natural);
        Ok(Self { step, output, direct, velocity, acceleration, scales })
    }
}

impl Cast for ModesInverse {
    type In<T: Real> = ModesInverse<T>;

    fn cast<T: Real>(&self) -> Result<ModesInverse<T>> {
        let mut step = [[T::ZERO; SIZE]; STATES];
        for (row, own) in step.iter_mut().zip(&self.step) {
            *row = all_rounded("mode_frequencies", own, "")?;
        }
        Ok(ModesInverse {
            step,
            output: all_rounded("mode_weights", &self.output, "")?,
            direct: rounded("mode_weights", self.direct, "")?,
            velocity: rounded("frequency", self.velocity, "s")?,
            acceleration: rounded("frequency", self.acceleration, "s^2")?,
            scales: all_rounded("mode_frequencies", &self.scales, "s")?,
        })
    }
}

impl<T: Real> ModesInverse<T> {
    fn input(&self, x: T, v: T, a: T) -> T {
        x + self.velocity * v + self.acceleration * a
    }

    /// The state where all modes move together, with displacement `x` (m), velocity `v` (m/s) and
    /// acceleration `a` (m/s^2).
    #[must_use]
    pub fn begin(&self, x: T, v: T, a: T) -> ModesInverseState<T> {
        let mut modes = self.scales;
        for pair in modes.chunks_exact_mut(2) {
            if let [place, speed] = pair {
                (*place, *speed) = (x, *speed * v);
            }
        }
        ModesInverseState { modes, input: self.input(x, v, a) }
    }

    /// One sample on, to displacement `x` (m), velocity `v` (m/s) and acceleration `a` (m/s^2).
    #[inline]
    pub fn step(&self, state: &mut ModesInverseState<T>, x: T, v: T, a: T) {
        let input = self.input(x, v, a);
        let rise = input - state.input;
        let before = state.modes;
        for (row, next) in self.step.iter().zip(&mut state.modes) {
            let shares = row.iter().zip(&before);
            let moved = shares.fold(-T::ZERO, |sum, (share, mode)| sum + *share * *mode);
            *next = moved + row[STATES] * state.input + row[STATES + 1] * rise;
        }
        state.input = input;
    }

    /// The static displacement d, m.
    #[must_use]
    #[inline]
    pub fn output(&self, state: &ModesInverseState<T>) -> T {
        let modes = self.output.iter().zip(&state.modes);
        modes.fold(self.direct * state.input, |sum, (share, mode)| sum + *share * *mode)
    }
}

/// Coefficients of the polynomial whose roots are the zeros of the sum, from the constant one up,
/// with the main mode's rate as the unit.
fn zeros(modes: &Modes) -> [f64; STATES + 1] {
    let [main, ..] = modes.all();
    let mut sum = [0.0; STATES + 1];
    for (k, mode) in modes.used().iter().enumerate() {
        let ratio = mode.frequency / main.frequency;
        let mut product = [0.0; STATES + 1];
        product[0] = mode.weight * ratio * ratio;
        for (j, other) in modes.used().iter().enumerate() {
            if j == k {
                continue;
            }
            let ratio = other.frequency / main.frequency;
            let (damping, stiffness) = (2.0 * other.damping_ratio * ratio, ratio * ratio);
            let (mut one, mut two) = (0.0, 0.0);
            for entry in &mut product {
                let old = *entry;
                *entry = stiffness * old + damping * one + two;
                (two, one) = (one, old);
            }
        }
        for (total, entry) in sum.iter_mut().zip(&product) {
            *total += entry;
        }
    }
    sum
}

/// Whether all roots of a polynomial are in the left half plane: Routh's criterion.
///
/// A leading coefficient that is small beside the rounding of the others counts as 0, and so as
/// one of the wrong sign.
fn stable(coefficients: &[f64; STATES + 1], degree: usize) -> bool {
    let least = 1e-12 * coefficients.iter().fold(0.0, |most: f64, entry| most.max(entry.abs()));
    let sign = coefficients[degree].signum();
    // Rows of the scheme, from the highest power down.
    let (mut above, mut below) = ([0.0; STATES + 2], [0.0; STATES + 2]);
    for i in 0..=degree {
        let row = if i % 2 == 0 { &mut above } else { &mut below };
        row[i / 2] = sign * coefficients[degree - i];
    }
    for _ in 0..degree {
        if !(above[0] > 0.0 && below[0] > 0.0) {
            return false;
        }
        let ratio = above[0] / below[0];
        let mut next = [0.0; STATES + 2];
        let shifted = above.iter().zip(&below).skip(1);
        for (entry, (first, second)) in next.iter_mut().zip(shifted) {
            *entry = first - ratio * second;
        }
        (above, below) = (below, next);
    }
    coefficients[degree].abs() > least
}

/// The matrix exponential, by its power series, halved and squared.
fn exponential(of: &Matrix) -> Matrix {
    let norm = of.iter().map(|row| row.iter().map(|entry| entry.abs()).sum()).fold(0.0, f64::max);
    let (mut scale, mut halved) = (1.0, 0);
    while norm * scale > 0.5 && halved < 60 {
        (scale, halved) = (0.5 * scale, halved + 1);
    }
    let mut sum: Matrix = [[0.0; SIZE]; SIZE];
    for (i, row) in sum.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    let mut term = sum;
    for k in 1..=TERMS {
        term = product(&term, of, scale / f64::from(k));
        for (row, more) in sum.iter_mut().zip(&term) {
            for (entry, more) in row.iter_mut().zip(more) {
                *entry += more;
            }
        }
    }
    for _ in 0..halved {
        sum = product(&sum, &sum, 1.0);
    }
    sum
}

/// The product of two matrices and a number.
fn product(left: &Matrix, right: &Matrix, factor: f64) -> Matrix {
    let mut out: Matrix = [[0.0; SIZE]; SIZE];
    for (into, from) in out.iter_mut().zip(left) {
        for (share, row) in from.iter().zip(right) {
            for (entry, other) in into.iter_mut().zip(row) {
                *entry += factor * share * other;
            }
        }
    }
    out
}
