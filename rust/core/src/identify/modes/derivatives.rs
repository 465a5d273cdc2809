//! Derivatives of the response of modal terms, and the normal equations that follow from them.

use pulp::{Simd, WithSimd};

use super::products::{Columns, Products};
use super::responses::{CHUNK, ModalFit};
use super::terms::{ModalTerms, inverse};
use crate::error::Result;
use crate::math::{C, dispatch_fused, zeros};

/// The normal matrix of the unknowns, row by row, of which the part at and above the diagonal is
/// filled; and the negative gradient.
pub(super) struct NormalEquations {
    pub matrix: Vec<f64>,
    pub slope: Vec<f64>,
}

/// Number of unknowns.
pub(super) fn unknowns(terms: &ModalTerms) -> usize {
    let (drives, sensors) = (terms.drives, terms.sensors);
    terms.poles.len() * 2 * (1 + drives + sensors) + drives * sensors
}

/// Factors of the unknowns: the derivative of the response by an unknown is `R s + I t` with
/// constant real matrices R and I, and complex functions of frequency s and t.
///
/// The unknowns are logarithms of decays, angles, real and imaginary parts of c and of b, and D.
/// The functions are `f + g` and `i (f - g)` of each mode with `f = 1/(z - p)` and
/// `g = 1/(z - conj p)`, the same of their squares, and 1.
struct Derivatives {
    /// R of each unknown, entry by entry.
    real: Vec<Vec<f64>>,
    /// I of each unknown, entry by entry.
    imaginary: Vec<Vec<f64>>,
    /// Numbers of s and t.
    functions: Vec<[usize; 2]>,
}

impl Derivatives {
    fn of(terms: &ModalTerms) -> Self {
        let (modes, drives, sensors) = (terms.poles.len(), terms.drives, terms.sensors);
        let mut found = Self { real: Vec::new(), imaginary: Vec::new(), functions: Vec::new() };
        let decays = terms.decays();
        let squares = |mode: usize| [2 * modes + 2 * mode, 2 * modes + 2 * mode + 1];
        for (mode, decay) in decays.iter().enumerate() {
            let factor = terms.poles[mode] * -decay;
            found.push(terms.residue(mode).map(|entry| entry * factor), squares(mode));
        }
        for mode in 0..modes {
            let factor = terms.poles[mode] * C::i();
            found.push(terms.residue(mode).map(|entry| entry * factor), squares(mode));
        }
        let entries = || (0..sensors).flat_map(|i| (0..drives).map(move |j| (i, j)));
        let zero = C::new(0.0, 0.0);
        for unit in [C::new(1.0, 0.0), C::i()] {
            for (mode, row) in (0..modes).flat_map(|mode| (0..sensors).map(move |i| (mode, i))) {
                let b = terms.input(mode);
                let matrix = entries().map(|(i, j)| if i == row { unit * b[j] } else { zero });
                found.push(matrix, [2 * mode, 2 * mode + 1]);
            }
        }
        for unit in [C::new(1.0, 0.0), C::i()] {
            for (mode, column) in (0..modes).flat_map(|mode| (0..drives).map(move |j| (mode, j))) {
                let c = terms.output(mode);
                let matrix = entries().map(|(i, j)| if j == column { unit * c[i] } else { zero });
                found.push(matrix, [2 * mode, 2 * mode + 1]);
            }
        }
        for place in entries() {
            let matrix =
                entries().map(|entry| if entry == place { C::new(1.0, 0.0) } else { zero });
            found.push(matrix, [4 * modes; 2]);
        }
        found
    }

    fn push(&mut self, matrix: impl Iterator<Item = C>, functions: [usize; 2]) {
        let (real, imaginary) = matrix.map(|entry| (entry.re, entry.im)).unzip();
        self.real.push(real);
        self.imaginary.push(imaginary);
        self.functions.push(functions);
    }

    /// Inner products of R and I of all unknowns over some entries.
    fn overlaps(&self, entries: core::ops::Range<usize>) -> Result<Products> {
        let count = self.functions.len();
        let mut columns = Columns::new(entries.len(), 2 * count)?;
        for (unknown, (real, imaginary)) in self.real.iter().zip(&self.imaginary).enumerate() {
            for (part, values) in [real, imaginary].into_iter().enumerate() {
                for (slot, value) in
                    columns.column(2 * unknown + part).zip(&values[entries.clone()])
                {
                    *slot = *value;
                }
            }
        }
        let mut found = Products::new(&columns, &columns)?;
        dispatch_fused(Own { products: &mut found, columns: &columns });
        Ok(found)
    }

    /// Adds to a normal matrix what functions with some inner products make of overlaps.
    fn add(&self, matrix: &mut [f64], functions: &Products, overlaps: &Products) {
        let count = self.functions.len();
        // Inner products are known at and above the diagonal.
        let product = |a: usize, b: usize| functions.get(a.min(b), a.max(b));
        for (u, (row, &[s, t])) in matrix.chunks_exact_mut(count).zip(&self.functions).enumerate() {
            let later = row[u..].iter_mut().zip(&self.functions[u..]);
            for (v, (slot, &[other, turned])) in (u..).zip(later) {
                let (a, b) = (2 * u, 2 * v);
                *slot += overlaps.get(a, b) * product(s, other)
                    + overlaps.get(a, b + 1) * product(s, turned)
                    + overlaps.get(a + 1, b) * product(t, other)
                    + overlaps.get(a + 1, b + 1) * product(t, turned);
            }
        }
    }
}

struct Own<'a> {
    products: &'a mut Products,
    columns: &'a Columns,
}

impl WithSimd for Own<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        self.products.add_own(self.columns);
    }
}

impl ModalFit {
    /// Normal equations at some terms that leave an error, as of [`Self::misfit`].
    pub(super) fn normal_equations(
        &self,
        terms: &ModalTerms,
        error: &[f64],
    ) -> Result<NormalEquations> {
        let found = Derivatives::of(terms);
        let count = found.functions.len();
        let entries = terms.drives * terms.sensors;
        let functions = 4 * terms.poles.len() + 1;
        let products = self.function_products(terms, &self.roots, Some(error))?;
        let mut matrix = zeros("the normal equations", count.saturating_mul(count))?;
        found.add(&mut matrix, &products, &found.overlaps(0..entries)?);
        let mut slope = zeros("the gradient", count)?;
        let parts = found.real.iter().zip(&found.imaginary).zip(&found.functions);
        for (slot, ((real, imaginary), &[s, t])) in slope.iter_mut().zip(parts) {
            for (entry, (real, imaginary)) in real.iter().zip(imaginary).enumerate() {
                *slot += real * products.get(s, functions + entry)
                    + imaginary * products.get(t, functions + entry);
            }
        }
        Ok(NormalEquations { matrix, slope })
    }

    /// The matrix of the normal equations with a weight of each number, shape
    /// `lines x sensors x drives`, in place of those of the lines.
    pub(super) fn spread(&self, terms: &ModalTerms, weights: &[f64]) -> Result<Vec<f64>> {
        let found = Derivatives::of(terms);
        let count = found.functions.len();
        let entries = terms.drives * terms.sensors;
        let mut matrix = zeros("the normal equations", count.saturating_mul(count))?;
        for entry in 0..entries {
            let own = weights.iter().skip(entry).step_by(entries);
            let roots: Vec<f64> = own.map(|weight| libm::sqrt(*weight)).collect();
            let products = self.function_products(terms, &roots, None)?;
            found.add(&mut matrix, &products, &found.overlaps(entry..entry + 1)?);
        }
        Ok(matrix)
    }

    /// Inner products of the functions, and of the errors behind them, with roots of weights.
    fn function_products(
        &self,
        terms: &ModalTerms,
        roots: &[f64],
        error: Option<&[f64]>,
    ) -> Result<Products> {
        let functions = 4 * terms.poles.len() + 1;
        let entries = if error.is_some() { terms.drives * terms.sensors } else { 0 };
        let mut columns = Columns::new(2 * CHUNK, functions + entries)?;
        let mut products = Products::new(&columns, &columns)?;
        dispatch_fused(Sums {
            fit: self,
            terms,
            roots,
            error,
            columns: &mut columns,
            products: &mut products,
        });
        Ok(products)
    }
}

/// Sums of all inner products over the lines, some lines at a time.
struct Sums<'a> {
    fit: &'a ModalFit,
    terms: &'a ModalTerms,
    roots: &'a [f64],
    error: Option<&'a [f64]>,
    columns: &'a mut Columns,
    products: &'a mut Products,
}

impl WithSimd for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { fit, terms, roots, error, columns, products } = self;
        let modes = terms.poles.len();
        let lines = fit.lines();
        let mut first = 0;
        while first < lines {
            let count = CHUNK.min(lines - first);
            let roots = &roots[first..][..count];
            for (mode, pole) in terms.poles.iter().enumerate() {
                let mut values = [[0.0; CHUNK]; 8];
                for k in 0..count {
                    let z = [fit.z[0][first + k], fit.z[1][first + k]];
                    let (f, g) = (inverse(z, *pole), inverse(z, pole.conj()));
                    let (f2, g2) = (square(f), square(g));
                    let root = roots[k];
                    // Real and imaginary parts of f + g and i (f - g).
                    values[0][k] = root * (f[0] + g[0]);
                    values[1][k] = root * (f[1] + g[1]);
                    values[2][k] = root * (g[1] - f[1]);
                    values[3][k] = root * (f[0] - g[0]);
                    values[4][k] = root * (f2[0] + g2[0]);
                    values[5][k] = root * (f2[1] + g2[1]);
                    values[6][k] = root * (g2[1] - f2[1]);
                    values[7][k] = root * (f2[0] - g2[0]);
                }
                for (function, parts) in values.chunks_exact(2).enumerate() {
                    let place = 2 * mode + function % 2 + if function < 2 { 0 } else { 2 * modes };
                    let both = parts[0].iter().chain(&parts[1]);
                    for (slot, value) in columns.column(place).zip(both) {
                        *slot = *value;
                    }
                }
            }
            for (k, slot) in columns.column(4 * modes).take(CHUNK).enumerate() {
                *slot = roots.get(k).copied().unwrap_or(0.0);
            }
            if let Some(error) = error {
                for (entry, parts) in error.chunks_exact(2 * lines).enumerate() {
                    let mut column = columns.column(4 * modes + 1 + entry);
                    for part in parts.chunks_exact(lines) {
                        for (k, slot) in column.by_ref().take(CHUNK).enumerate() {
                            *slot = if k < count { roots[k] * part[first + k] } else { 0.0 };
                        }
                    }
                }
            }
            products.add_own(columns);
            first += count;
        }
    }
}

#[inline(always)]
fn square([x, y]: [f64; 2]) -> [f64; 2] {
    [x * x - y * y, 2.0 * x * y]
}
