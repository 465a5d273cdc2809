//! Modes found one after the other, all of them refined after each.

use pulp::{Simd, WithSimd};

use super::products::{Columns, Products};
use super::refine::{Descent, Refined};
use super::responses::{CHUNK, ModalFit};
use super::terms::{ModalTerms, angle, inverse, length, pole, size};
use crate::error::{Error, Result};
use crate::math::{C, dispatch_fused, room, zeros};
use crate::signal::{Stop, index};

/// Decays of the candidates, in distances of the lines: the least, their ratio, the largest per
/// sample; and their distances, in decays.
const NARROW: f64 = 1.0;
const RATIO: f64 = 2.0;
const WIDE: f64 = 1.5;
const APART: f64 = 1.5;

/// Most candidates times lines.
const MOST_ENTRIES: f64 = 12e6;

/// Candidates that are judged at once.
const BATCH: usize = 16;

/// Steps after each new mode.
const STEPS: Descent = Descent { steps: 4, tolerance: 1e-3, held: 0.0 };

/// Reduction of the criterion for each unknown, in logarithms of the count of numbers; mean squared
/// residual, in variances, below which nothing is gained; and modes without a gain after which
/// the search ends.
const PENALTY: f64 = 2.0;
const GAINED: f64 = 0.1;
const PATIENCE: usize = 3;

/// Squarings after which a matrix is a projection on its largest direction.
const SQUARINGS: usize = 40;

/// A mode that takes from an error.
struct Candidate {
    pole: C,
    input: Vec<C>,
    output: Vec<C>,
}

impl ModalFit {
    /// Finds modes one after the other.
    ///
    /// Each new mode is the one of many poles whose matrix of rank one takes most from the error
    /// that the others leave (orthogonal matching pursuit: Pati, Rezaiifar and Krishnaprasad 1993,
    /// doi 10.1109/ACSSC.1993.342465); all modes are refined together after each. `expected` is
    /// the weighted sum of squared errors that noise and distortion explain. There are `most`
    /// modes where the number is `fixed`, or as many as make the criterion of Schwarz least, with
    /// twice its penalty. Where `stop` says so, it ends early.
    ///
    /// # Errors
    /// [`Error::Parameter`] where `expected` or `most` is not above 0; [`Error::Numerical`] where
    /// the responses are constant; [`Error::Memory`].
    pub fn pursue(
        &self,
        expected: f64,
        most: usize,
        fixed: bool,
        stop: Stop<'_>,
    ) -> Result<ModalTerms> {
        if !(expected > 0.0 && expected.is_finite()) {
            return Err(Error::parameter("expected", expected, "a finite number above 0"));
        }
        if most == 0 {
            return Err(Error::parameter("most", most, "1 or more"));
        }
        let poles = self.candidates()?;
        let numbers = index(self.value.len());
        let start = self.constant();
        let (misfit, error) = self.rest(&start)?;
        let mut at = Refined { terms: start, misfit, error };
        let mut best = at.terms.clone();
        let (mut least, mut place) = (f64::INFINITY, 0);
        for number in 1..=most {
            if stop() {
                break;
            }
            let Some(Candidate { pole, input, output }) = self.next(&poles, &at.error)? else {
                break;
            };
            let pole = apart(pole, &at.terms.poles);
            at = self.refined(&at.terms.with(pole, &input, &output), STEPS, stop)?;
            let unknowns =
                index(number * 2 * (self.drives + self.sensors) + self.drives * self.sensors);
            let criterion = numbers * libm::log(at.misfit / expected + GAINED)
                + PENALTY * unknowns * libm::log(numbers);
            let lower = criterion <= least;
            if lower {
                (least, place) = (criterion, number);
            }
            if fixed || lower {
                best = at.terms.clone();
            } else if number - place >= PATIENCE {
                break;
            }
        }
        if best.poles.is_empty() && !stop() {
            return Err(Error::Numerical(
                "the responses show no mode: expected some that change with the frequency".into(),
            ));
        }
        let found = self.refined(&best, Descent::last(0.0)?, stop)?.terms;
        let far: Vec<f64> = (found.poles.iter())
            .map(|pole| libm::hypot(libm::log(size(*pole)), angle(*pole)))
            .collect();
        let mut order: Vec<usize> = (0..far.len()).collect();
        order.sort_by(|&a, &b| far[a].total_cmp(&far[b]));
        Ok(found.sorted(&order))
    }

    /// No modes, and the weighted mean of the responses.
    fn constant(&self) -> ModalTerms {
        let total: f64 = self.weights.iter().sum();
        let mean = |real: &[f64]| {
            let sum: f64 =
                self.weights.iter().zip(real).map(|(weight, value)| weight * value).sum();
            if total > 0.0 { sum / total } else { 0.0 }
        };
        ModalTerms {
            drives: self.drives,
            sensors: self.sensors,
            poles: Vec::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            direct: self.value.chunks_exact(2 * self.lines()).map(mean).collect(),
        }
    }

    /// Poles of several decays all over the band.
    fn candidates(&self) -> Result<Vec<C>> {
        let (first, last) = (self.angles[0], self.angles[self.lines() - 1]);
        // The poles of the narrowest are about as many as all others together.
        let fewest = 2.0 * (last - first) / APART * index(self.lines()) / MOST_ENTRIES;
        let mut decay = (NARROW * self.distance).max(fewest);
        let mut found = room("the candidates", 0)?;
        while decay < WIDE {
            let reach = (last + decay).min(0.999 * core::f64::consts::PI);
            let begin = first.max(0.5 * decay);
            for k in 0.. {
                let angle = begin + index(k) * (APART * decay);
                if angle >= reach {
                    break;
                }
                found.push(pole(decay, angle));
            }
            decay *= RATIO;
        }
        Ok(found)
    }

    /// The candidate that takes most from an error; none where nothing is left to take.
    fn next(&self, poles: &[C], error: &[f64]) -> Result<Option<Candidate>> {
        let entries = self.drives * self.sensors;
        let mut right = room("the errors", self.lines().div_ceil(CHUNK))?;
        for first in (0..self.lines()).step_by(CHUNK) {
            let count = CHUNK.min(self.lines() - first);
            let mut columns = Columns::new(2 * CHUNK, 2 * entries)?;
            for (entry, parts) in error.chunks_exact(2 * self.lines()).enumerate() {
                let (real, imaginary) = parts.split_at(self.lines());
                let weights = &self.weights[first..][..count];
                // The error, and the error by -i.
                for (turn, [one, other], sign) in
                    [(0, [real, imaginary], 1.0), (1, [imaginary, real], -1.0)]
                {
                    let mut column = columns.column(2 * entry + turn);
                    for (part, sign) in [(one, 1.0), (other, sign)] {
                        let own = weights.iter().zip(&part[first..]).map(|(w, e)| sign * w * e);
                        let own = own.chain(core::iter::repeat(0.0)).take(CHUNK);
                        for (value, slot) in own.zip(column.by_ref()) {
                            *slot = value;
                        }
                    }
                }
            }
            right.push(columns);
        }
        let mut left = Columns::new(2 * CHUNK, BATCH)?;
        let Some(one) = right.first() else { return Ok(None) };
        let mut products = Products::new(&left, one)?;
        let mut sizes = zeros("the sizes", BATCH)?;
        let mut taken = 0.0;
        let mut found = None;
        let mut share = vec![C::new(0.0, 0.0); entries];
        for poles in poles.chunks(BATCH) {
            sizes.fill(0.0);
            products.clear();
            dispatch_fused(Shares {
                fit: self,
                poles,
                right: &right,
                left: &mut left,
                products: &mut products,
                sizes: &mut sizes,
            });
            for (k, (pole, size)) in poles.iter().zip(&sizes).enumerate() {
                for (entry, slot) in share.iter_mut().enumerate() {
                    *slot = C::new(products.get(k, 2 * entry), products.get(k, 2 * entry + 1));
                }
                // The largest singular value is not above the root of the sum of all squares.
                let all: f64 = share.iter().map(C::norm_sqr).sum();
                if all > taken * size {
                    let (input, output) = leading(&share, self.drives);
                    let own = output.iter().map(C::norm_sqr).sum::<f64>();
                    if own > taken * size {
                        taken = own / size;
                        let output = output.iter().map(|c| c / *size).collect();
                        found = Some(Candidate { pole: *pole, input, output });
                    }
                }
            }
        }
        Ok(found)
    }
}

/// Inner products of `1/(z - p)` of some poles with errors, and with themselves.
struct Shares<'a> {
    fit: &'a ModalFit,
    poles: &'a [C],
    right: &'a [Columns],
    left: &'a mut Columns,
    products: &'a mut Products,
    sizes: &'a mut [f64],
}

impl WithSimd for Shares<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { fit, poles, right, left, products, sizes } = self;
        for (part, right) in right.iter().enumerate() {
            let first = part * CHUNK;
            let count = CHUNK.min(fit.lines() - first);
            for ((k, pole), size) in poles.iter().enumerate().zip(sizes.iter_mut()) {
                let mut values = [0.0; 2 * CHUNK];
                let (real, imaginary) = values.split_at_mut(CHUNK);
                let mut sizes = [0.0; CHUNK];
                for i in 0..count {
                    let z = [fit.z[0][first + i], fit.z[1][first + i]];
                    let [x, y] = inverse(z, *pole);
                    (real[i], imaginary[i]) = (x, y);
                    sizes[i] = fit.weights[first + i] * (x * x + y * y);
                }
                for own in sizes {
                    *size += own;
                }
                for (slot, value) in left.column(k).zip(&values) {
                    *slot = *value;
                }
            }
            products.add(left, right);
        }
    }
}

/// The largest direction of a matrix, row by row: the conjugate of the right singular vector, and
/// the left one times the singular value.
///
/// The product of the matrix with its adjoint is squared until it is a projection.
fn leading(matrix: &[C], width: usize) -> (Vec<C>, Vec<C>) {
    let zero = C::new(0.0, 0.0);
    let rows = || matrix.chunks_exact(width);
    let mut power = vec![zero; width * width];
    for (a, row) in power.chunks_exact_mut(width).enumerate() {
        for (b, slot) in row.iter_mut().enumerate() {
            *slot = rows().map(|row| row[a].conj() * row[b]).sum();
        }
    }
    for _ in 0..SQUARINGS {
        let trace: f64 = power.iter().step_by(width + 1).map(|entry| entry.re).sum();
        if !(trace > 0.0 && trace < f64::INFINITY) {
            break;
        }
        let even: Vec<C> = power.iter().map(|entry| entry / trace).collect();
        for (a, row) in power.chunks_exact_mut(width).enumerate() {
            for (b, slot) in row.iter_mut().enumerate() {
                *slot = (0..width).map(|k| even[a * width + k] * even[k * width + b]).sum();
            }
        }
    }
    let mut place = 0;
    for k in 0..width {
        if power[k * width + k].re > power[place * width + place].re {
            place = k;
        }
    }
    let column: Vec<C> = (0..width).map(|k| power[k * width + place]).collect();
    let long = length(&column);
    let right: Vec<C> = column.iter().map(|entry| entry / long).collect();
    let left = rows().map(|row| row.iter().zip(&right).map(|(a, v)| a * v).sum()).collect();
    (right.iter().map(C::conj).collect(), left)
}

/// A pole that is none of the others, with which it could not be told apart.
fn apart(mut found: C, others: &[C]) -> C {
    let near = |found: C| others.iter().any(|other| size(other - found) < 1e-9);
    while near(found) {
        let (sine, cosine) = libm::sincos(1e-4);
        found *= C::new(cosine, sine);
    }
    found
}
