//! Normal equations of what acts on modes at one level, with the drives eliminated.

use pulp::{Simd, WithSimd};

use super::factors::{Factors, scale_matrix};
use super::products::{Columns, Products};
use super::responses::CHUNK;
use super::terms::{ModalTerms, inverse};
use crate::error::{Error, Result};
use crate::math::{C, dispatch_fused, room, zeros};
use crate::signal::{Stop, index};

/// Share of a column below which it depends on those of the drives.
const DEPENDENT: f64 = 1e-6;

/// Lines of the residual of the modes at one level, and of inputs that may explain it.
///
/// Complex numbers are real and imaginary part.
#[derive(Clone, Copy, Debug)]
pub struct DistortionRecord<'a> {
    /// The modes.
    pub terms: &'a ModalTerms,
    /// Angle of each line per sample.
    pub angles: &'a [f64],
    /// Inputs, line by line and input by input, of all realisations; the drives come first.
    pub inputs: &'a [[f64; 2]],
    /// Residual of the modes, line by line and sensor by sensor, of all realisations.
    pub residual: &'a [[f64; 2]],
    /// Weights, line by line, of the sensors.
    pub weights: &'a [f64],
    /// The level to each of some powers, the same powers at all levels.
    pub powers: &'a [f64],
}

impl DistortionRecord<'_> {
    fn realisations(&self) -> usize {
        self.residual.len() / (self.angles.len() * self.terms.sensors).max(1)
    }

    /// Number of inputs, where all lists fit each other.
    fn checked(&self, drives: usize) -> Result<usize> {
        let (lines, sensors) = (self.angles.len(), self.terms.sensors);
        let realisations = self.realisations();
        let inputs = self.inputs.len() / (lines * realisations).max(1);
        let expected = [
            ("residual", self.residual.len(), lines * sensors * realisations),
            ("inputs", self.inputs.len(), lines * inputs * realisations),
            ("weights", self.weights.len(), lines * sensors),
        ];
        for (name, found, expected) in expected {
            if found != expected || found == 0 {
                return Err(Error::Shape {
                    name: name.into(),
                    found: format!("{found} entries"),
                    expected: format!("{} of {lines} lines", expected.max(1)),
                });
            }
        }
        let numbers = self.residual.iter().chain(self.inputs).flatten();
        let numbers = numbers.chain(self.weights).chain(self.powers);
        if let Some(value) = numbers.into_iter().find(|value| !value.is_finite()) {
            return Err(Error::parameter(
                "inputs, residual, weights or powers",
                value,
                "finite numbers",
            ));
        }
        if drives > inputs {
            return Err(Error::parameter("drives", drives, format!("{inputs} at most")));
        }
        Ok(inputs)
    }
}

/// Normal equations of one level, of real and imaginary part of e of each mode and input.
///
/// Column `2 mode` is the real, `2 mode + 1` the imaginary part; the place of a column and an input is
/// `column * inputs + input`.
pub(super) struct NormalEquations {
    pub modes: usize,
    pub inputs: usize,
    drives: usize,
    /// Real numbers of the residual.
    pub numbers: f64,
    /// Weighted squares of the residual.
    pub size: f64,
    matrix: Vec<f64>,
    right: Vec<f64>,
    /// The rest behind the drives.
    pub rest: Rest,
}

/// The rest of normal equations behind columns that are eliminated.
pub(super) struct Rest {
    inputs: usize,
    /// Rows of Cholesky's factor.
    rows: Vec<Vec<f64>>,
    /// The right side and the diagonal.
    pub slope: Vec<f64>,
    pub diagonal: Vec<f64>,
    /// At the place of each real part the entry beside that of the imaginary part.
    pub between: Vec<f64>,
    /// Squares of the residual.
    pub left: f64,
}

impl Rest {
    /// The whole equations of a right side, a diagonal, entries between the parts, and squares.
    pub fn new(inputs: usize, parts: [Vec<f64>; 3], left: f64) -> Self {
        let [slope, diagonal, between] = parts;
        Self { inputs, rows: Vec::new(), slope, diagonal, between, left }
    }

    /// Takes from the row of a place what the eliminated columns explain.
    pub fn reduce(&self, row: &mut [f64], place: usize) {
        dispatch_fused(Reduction { row, place, done: &self.rows });
    }

    /// Eliminates the column of a place, whose row is given behind the others.
    pub fn eliminate(&mut self, mut row: Vec<f64>, place: usize) {
        let root = libm::sqrt(self.diagonal[place]);
        for entry in &mut row {
            *entry /= root;
        }
        let part = self.slope[place] / root;
        for ((slope, diagonal), entry) in self.slope.iter_mut().zip(&mut self.diagonal).zip(&row) {
            *slope -= part * entry;
            *diagonal -= entry * entry;
        }
        let pairs = self.between.chunks_exact_mut(2 * self.inputs);
        for (slots, entries) in pairs.zip(row.chunks_exact(2 * self.inputs)) {
            let (real, imaginary) = entries.split_at(self.inputs);
            for ((slot, a), b) in slots.iter_mut().zip(real).zip(imaginary) {
                *slot -= a * b;
            }
        }
        self.left -= part * part;
        self.rows.push(row);
    }
}

impl NormalEquations {
    /// The equations of a record, whose first inputs are the drives.
    pub fn new(record: &DistortionRecord<'_>, drives: usize, stop: Stop<'_>) -> Result<Self> {
        let inputs = record.checked(drives)?;
        let modes = record.terms.poles.len();
        let columns = 2 * modes;
        let count = columns * inputs;
        let pairs = columns * (columns + 1) / 2;
        let mut sums = Sums {
            record,
            inputs,
            left: Columns::new(2 * CHUNK, pairs)?,
            right: Columns::new(2 * CHUNK, inputs.saturating_mul(inputs))?,
            slope: zeros("the gradient", count)?,
            size: 0.0,
            first: 0,
        };
        let mut products = Products::new(&sums.left, &sums.right)?;
        while sums.first < record.angles.len() && !stop() {
            dispatch_fused(Chunk { sums: &mut sums, products: &mut products });
        }
        let mut matrix = zeros("the normal equations", count.saturating_mul(count))?;
        let mut pair = 0;
        for m in 0..columns {
            for n in m..columns {
                for (x, y) in (0..inputs).flat_map(|x| (0..inputs).map(move |y| (x, y))) {
                    let value = products.get(pair, x * inputs + y);
                    matrix[(m * inputs + x) * count + n * inputs + y] = value;
                    matrix[(n * inputs + y) * count + m * inputs + x] = value;
                }
                pair += 1;
            }
        }
        let apart = |k: usize, by: usize| matrix.get(k * count + k + by).copied().unwrap_or(0.0);
        let diagonal = (0..count).map(|k| apart(k, 0)).collect();
        let between = (0..count).map(|k| apart(k, inputs)).collect();
        let mut found = Self {
            modes,
            inputs,
            drives,
            numbers: index(2 * record.residual.len()),
            size: sums.size.max(f64::MIN_POSITIVE),
            rest: Rest::new(inputs, [sums.slope.clone(), diagonal, between], sums.size),
            matrix,
            right: sums.slope,
        };
        for column in 0..columns {
            for input in 0..drives {
                let place = column * inputs + input;
                let pivot = found.rest.diagonal[place];
                if pivot > DEPENDENT * found.matrix[place * count + place] {
                    found.rest.eliminate(found.row(place)?, place);
                }
            }
        }
        Ok(found)
    }

    /// The row of a place behind the drives.
    pub fn row(&self, place: usize) -> Result<Vec<f64>> {
        let count = self.right.len();
        let mut row = room("the factors", count)?;
        row.extend_from_slice(&self.matrix[place * count..][..count]);
        self.rest.reduce(&mut row, place);
        Ok(row)
    }

    /// Places of real and imaginary part of a mode and an input.
    pub fn places(&self, mode: usize, input: usize) -> [usize; 2] {
        let first = 2 * mode * self.inputs + input;
        [first, first + self.inputs]
    }

    /// e of the drives, mode by mode, beside values at other places, and the squares that are left.
    pub fn solve(&self, others: &[(usize, f64)]) -> Result<(Vec<[f64; 2]>, f64)> {
        let count = self.right.len();
        let columns = 2 * self.modes;
        let entry = |row: usize, column: usize| self.matrix[row * count + column];
        let places: Vec<usize> =
            (0..columns).flat_map(|m| (0..self.drives).map(move |x| m * self.inputs + x)).collect();
        let mut matrix = room("the normal equations", places.len() * places.len())?;
        for &row in &places {
            matrix.extend(places.iter().map(|&column| entry(row, column)));
        }
        let scale: Vec<f64> = places.iter().map(|&k| libm::sqrt(entry(k, k)).max(1e-300)).collect();
        scale_matrix(&mut matrix, &scale);
        let behind = |row: usize| -> f64 {
            let taken = others.iter().map(|&(column, value)| entry(row, column) * value);
            self.right[row] - taken.sum::<f64>()
        };
        let right: Vec<f64> = places.iter().zip(&scale).map(|(&k, by)| behind(k) / by).collect();
        let found = Factors::new(&matrix, places.len(), DEPENDENT)?.solve(&right);
        let mut forces = vec![[0.0; 2]; self.modes * self.drives];
        let mut left = self.size;
        for ((&place, value), by) in places.iter().zip(&found).zip(&scale) {
            let (column, drive) = (place / self.inputs, place % self.inputs);
            forces[column / 2 * self.drives + drive][column % 2] = value / by;
            left -= value / by * (behind(place));
        }
        for &(place, value) in others {
            left -= value * (self.right[place] + behind(place));
        }
        Ok((forces, left.max(0.0)))
    }
}

struct Reduction<'a> {
    row: &'a mut [f64],
    place: usize,
    done: &'a [Vec<f64>],
}

impl WithSimd for Reduction<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for before in self.done {
            let factor = -before[self.place];
            for (entry, by) in self.row.iter_mut().zip(before) {
                *entry = factor.mul_add(*by, *entry);
            }
        }
    }
}

/// Sums over the lines, some lines at a time.
struct Sums<'a> {
    record: &'a DistortionRecord<'a>,
    inputs: usize,
    /// Products of two functions of modes, over the sensors.
    left: Columns,
    /// Products of two inputs, over the realisations.
    right: Columns,
    slope: Vec<f64>,
    size: f64,
    /// The first line that was not summed.
    first: usize,
}

struct Chunk<'a, 'b> {
    sums: &'a mut Sums<'b>,
    products: &'a mut Products,
}

impl WithSimd for Chunk<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { sums, products } = self;
        let record = sums.record;
        let (sensors, realisations) = (record.terms.sensors, record.realisations());
        let count = CHUNK.min(record.angles.len() - sums.first);
        let mut lines = Vec::with_capacity(count);
        for line in sums.first..sums.first + count {
            let functions = functions(record.terms, record.angles[line]);
            let of = |numbers: &[[f64; 2]], width: usize| -> Vec<C> {
                let width = width * realisations;
                let own = &numbers[line * width..][..width];
                own.iter().map(|&[real, imaginary]| C::new(real, imaginary)).collect()
            };
            let (inputs, residual) = (of(record.inputs, sums.inputs), of(record.residual, sensors));
            let weights = &record.weights[line * sensors..][..sensors];
            sums.slopes(&functions, &inputs, &residual, weights);
            lines.push((functions, inputs, weights));
        }
        let columns = 2 * record.terms.poles.len();
        let mut pair = 0;
        for m in 0..columns {
            for n in m..columns {
                let mut values = [C::new(0.0, 0.0); CHUNK];
                for (value, (functions, _, weights)) in values.iter_mut().zip(&lines) {
                    for (sensor, weight) in weights.iter().enumerate() {
                        let (a, b) =
                            (functions[m * sensors + sensor], functions[n * sensors + sensor]);
                        *value += a.conj() * b * *weight;
                    }
                }
                let parts = values.iter().map(|value| value.re);
                let parts = parts.chain(values.iter().map(|value| -value.im));
                for (slot, part) in sums.left.column(pair).zip(parts) {
                    *slot = part;
                }
                pair += 1;
            }
        }
        for x in 0..sums.inputs {
            for y in x..sums.inputs {
                let mut values = [C::new(0.0, 0.0); CHUNK];
                for (value, (_, inputs, _)) in values.iter_mut().zip(&lines) {
                    let of = |input: usize| &inputs[input * realisations..][..realisations];
                    for (a, b) in of(x).iter().zip(of(y)) {
                        *value += a.conj() * b;
                    }
                }
                for (place, sign) in [(x * sums.inputs + y, 1.0), (y * sums.inputs + x, -1.0)] {
                    let parts = values.iter().map(|value| value.re);
                    let parts = parts.chain(values.iter().map(|value| sign * value.im));
                    for (slot, part) in sums.right.column(place).zip(parts) {
                        *slot = part;
                    }
                }
            }
        }
        products.add(&sums.left, &sums.right);
        sums.first += count;
    }
}

impl Sums<'_> {
    /// Adds a line to the gradient and to the squares.
    #[inline(always)]
    fn slopes(&mut self, functions: &[C], inputs: &[C], residual: &[C], weights: &[f64]) {
        let (sensors, realisations) = (weights.len(), residual.len() / weights.len());
        for (sensor, weight) in weights.iter().enumerate() {
            let own = &residual[sensor * realisations..][..realisations];
            self.size += weight * own.iter().map(C::norm_sqr).sum::<f64>();
            for (input, values) in inputs.chunks_exact(realisations).enumerate() {
                let mut overlap = C::new(0.0, 0.0);
                for (a, b) in own.iter().zip(values) {
                    overlap += a * b.conj();
                }
                let slots = self.slope.iter_mut().skip(input).step_by(self.inputs);
                for (slot, function) in slots.zip(functions.iter().skip(sensor).step_by(sensors)) {
                    *slot += weight * (function.re * overlap.re + function.im * overlap.im);
                }
            }
        }
    }
}

/// Factors of real and imaginary part of e of each mode at a line: `c f + conj(c) g` and
/// `i (c f - conj(c) g)` with `f = 1/(z - p)` and `g = 1/(z - conj p)`, sensor by sensor.
#[inline(always)]
fn functions(terms: &ModalTerms, angle: f64) -> Vec<C> {
    let (sine, cosine) = libm::sincos(angle);
    let mut found = Vec::with_capacity(2 * terms.outputs.len());
    for (mode, pole) in terms.poles.iter().enumerate() {
        let of = |pole: C| {
            let [real, imaginary] = inverse([cosine, sine], pole);
            C::new(real, imaginary)
        };
        let (f, g) = (of(*pole), of(pole.conj()));
        let c = terms.output(mode);
        found.extend(c.iter().map(|c| c * f + c.conj() * g));
        found.extend(c.iter().map(|c| C::i() * (c * f - c.conj() * g)));
    }
    found
}
