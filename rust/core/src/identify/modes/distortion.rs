//! Distortion of modes: regressors that act on them, chosen by what they explain of a residual.

use pulp::{Simd, WithSimd};

use super::factors::Factors;
use super::products::{Columns, Products};
use super::responses::CHUNK;
use super::terms::{ModalTerms, inverse};
use crate::error::{Error, Result};
use crate::math::{C, dispatch_fused, on_all_threads, room, zeros};
use crate::signal::{Stop, index};

/// Share of the diagonal that is added to the normal equations at the end.
const RIDGE: f64 = 1e-3;

/// Share of a column below which it depends on those that are chosen.
const DEPENDENT: f64 = 1e-6;

/// Most pairs of a mode and a regressor.
const MOST: usize = 600;

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
}

/// Inputs that act on modes beside the drives, for several levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Distortion {
    /// Pairs of a mode and an input that were chosen, the best first.
    pub pairs: Vec<[usize; 2]>,
    /// e of each level, mode by mode, of all inputs; 0 where a pair was not chosen.
    pub forces: Vec<Vec<[f64; 2]>>,
    /// Weighted squares of the residual of each level that are left, as a share of all.
    pub left: Vec<f64>,
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
        let numbers = self.residual.iter().chain(self.inputs).flatten().chain(self.weights);
        if let Some(value) = numbers.into_iter().find(|value| !value.is_finite()) {
            return Err(Error::parameter("inputs, residual or weights", value, "finite numbers"));
        }
        if drives > inputs {
            return Err(Error::parameter("drives", drives, format!("{inputs} at most")));
        }
        Ok(inputs)
    }
}

/// Chooses pairs of a mode and an input, the same at all levels, by forward selection.
///
/// Modes answer to the inputs by vectors e of their own. Those of the drives, the first inputs, are
/// always there, so that what is chosen has no part that is linear in the drives. A pair is added
/// while it lowers the criterion of Schwarz (1978, doi 10.1214/aos/1176344136) with twice its
/// penalty, summed over the levels.
///
/// # Errors
/// [`Error::Shape`] where lists do not fit each other; [`Error::Memory`].
pub fn choose_distortion(
    records: &[DistortionRecord<'_>],
    drives: usize,
    stop: Stop<'_>,
) -> Result<Distortion> {
    let made = on_all_threads(records, &|record| Level::new(record, drives, stop));
    let mut levels = made.into_iter().collect::<Result<Vec<Level>>>()?;
    let mut found =
        Distortion { pairs: Vec::new(), forces: Vec::new(), left: vec![1.0; levels.len()] };
    let Some(first) = levels.first() else { return Ok(found) };
    let (modes, inputs) = (first.modes, first.inputs);
    if levels.iter().any(|one| (one.modes, one.inputs) != (modes, inputs)) {
        return Err(Error::Shape {
            name: "records".into(),
            found: "levels of different modes or inputs".into(),
            expected: "the same at all levels".into(),
        });
    }
    let penalty: f64 = levels.iter().map(|one| 4.0 * libm::log(one.numbers)).sum();
    let mut free = vec![true; modes * inputs];
    while found.pairs.len() < MOST && !stop() {
        let mut best = (penalty, None);
        for mode in 0..modes {
            for input in drives..inputs {
                if free[mode * inputs + input] {
                    let gain: f64 = levels.iter().map(|one| one.gain(mode, input)).sum();
                    if gain > best.0 {
                        best = (gain, Some([mode, input]));
                    }
                }
            }
        }
        let (_, Some([mode, input])) = best else { break };
        free[mode * inputs + input] = false;
        for level in &mut levels {
            level.eliminate(2 * mode, input)?;
            level.eliminate(2 * mode + 1, input)?;
        }
        found.pairs.push([mode, input]);
    }
    found.left = levels.iter().map(|one| one.left / one.size).collect();
    for level in &levels {
        found.forces.push(level.solve(drives, &found.pairs)?);
    }
    Ok(found)
}

/// Normal equations of one level, scaled to a diagonal of 1, and what is eliminated of them.
struct Level {
    modes: usize,
    inputs: usize,
    /// Real numbers of the residual.
    numbers: f64,
    /// Weighted squares of the residual.
    size: f64,
    matrix: Vec<f64>,
    right: Vec<f64>,
    scale: Vec<f64>,
    /// Rows of Cholesky's factor of what is eliminated.
    rows: Vec<Vec<f64>>,
    /// The right side, the diagonal, and the entry between both columns of a pair, that are left.
    slope: Vec<f64>,
    diagonal: Vec<f64>,
    between: Vec<f64>,
    /// Squares that are left.
    left: f64,
}

impl Level {
    fn new(record: &DistortionRecord<'_>, drives: usize, stop: Stop<'_>) -> Result<Self> {
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
        let mut scale = room("the scales", count)?;
        scale.extend((0..count).map(|k| {
            let size = libm::sqrt(matrix[k * count + k]);
            if size > 0.0 { size } else { 1.0 }
        }));
        for (row, own) in matrix.chunks_exact_mut(count).zip(&scale) {
            for (entry, other) in row.iter_mut().zip(&scale) {
                *entry /= own * other;
            }
        }
        let right: Vec<f64> = sums.slope.iter().zip(&scale).map(|(g, scale)| g / scale).collect();
        let diagonal = (0..count).map(|k| matrix[k * count + k]).collect();
        let between = (0..modes * inputs)
            .map(|pair| {
                let (mode, input) = (pair / inputs, pair % inputs);
                matrix[(2 * mode * inputs + input) * count + (2 * mode + 1) * inputs + input]
            })
            .collect();
        let numbers = index(2 * record.residual.len());
        let mut found = Self {
            modes,
            inputs,
            numbers,
            size: sums.size.max(f64::MIN_POSITIVE),
            slope: right.clone(),
            matrix,
            right,
            scale,
            rows: Vec::new(),
            diagonal,
            between,
            left: sums.size,
        };
        for column in 0..columns {
            for input in 0..drives {
                found.eliminate(column, input)?;
            }
        }
        Ok(found)
    }

    /// Reduction of the criterion by a pair, without its penalty.
    fn gain(&self, mode: usize, input: usize) -> f64 {
        let (i, j) = (2 * mode * self.inputs + input, (2 * mode + 1) * self.inputs + input);
        let (a, b) = (self.diagonal[i], self.diagonal[j]);
        let c = self.between[mode * self.inputs + input];
        let size = a * b - c * c;
        if a < DEPENDENT || b < DEPENDENT || size < DEPENDENT * a * b || self.left <= 0.0 {
            return 0.0;
        }
        let (g, h) = (self.slope[i], self.slope[j]);
        let squares = (b * g * g - 2.0 * c * g * h + a * h * h) / size;
        // Squares that nothing is left of would count without limit.
        let share = (squares / self.left).clamp(0.0, 1.0 - DEPENDENT);
        -self.numbers * libm::log(1.0 - share)
    }

    /// Eliminates the column of a function and an input.
    fn eliminate(&mut self, column: usize, input: usize) -> Result<()> {
        let count = self.slope.len();
        let place = column * self.inputs + input;
        let pivot = self.diagonal[place];
        if pivot.is_nan() || pivot < DEPENDENT {
            return Ok(());
        }
        let mut row = room("the factors", count)?;
        row.extend_from_slice(&self.matrix[place * count..][..count]);
        dispatch_fused(Elimination { row: &mut row, place, pivot, done: &self.rows });
        let part = self.slope[place] / libm::sqrt(pivot);
        for ((slope, diagonal), entry) in self.slope.iter_mut().zip(&mut self.diagonal).zip(&row) {
            *slope -= part * entry;
            *diagonal -= entry * entry;
        }
        for (pair, between) in self.between.iter_mut().enumerate() {
            let (mode, input) = (pair / self.inputs, pair % self.inputs);
            let first = 2 * mode * self.inputs + input;
            *between -= row[first] * row[first + self.inputs];
        }
        self.left -= part * part;
        self.rows.push(row);
        Ok(())
    }

    /// e mode by mode of all inputs, of the drives and of some pairs.
    fn solve(&self, drives: usize, pairs: &[[usize; 2]]) -> Result<Vec<[f64; 2]>> {
        let count = self.slope.len();
        let columns = 2 * self.modes;
        let mut used: Vec<usize> = (0..columns)
            .flat_map(|m| (0..drives).map(move |x| (m, x)))
            .map(|(m, x)| m * self.inputs + x)
            .collect();
        for &[mode, input] in pairs {
            let first = 2 * mode * self.inputs + input;
            used.extend([first, first + self.inputs]);
        }
        let mut matrix = room("the normal equations", used.len().saturating_mul(used.len()))?;
        for &row in &used {
            for &column in &used {
                let entry = self.matrix[row * count + column];
                matrix.push(if row == column { entry * (1.0 + RIDGE) } else { entry });
            }
        }
        let right: Vec<f64> = used.iter().map(|&place| self.right[place]).collect();
        let found = Factors::new(&matrix, used.len(), 0.0)?.solve(&right);
        let mut forces = vec![[0.0; 2]; self.modes * self.inputs];
        for (&place, value) in used.iter().zip(&found) {
            let (column, input) = (place / self.inputs, place % self.inputs);
            forces[column / 2 * self.inputs + input][column % 2] = value / self.scale[place];
        }
        Ok(forces)
    }
}

/// The row of Cholesky's factor of a column behind those that are done.
struct Elimination<'a> {
    row: &'a mut [f64],
    place: usize,
    pivot: f64,
    done: &'a [Vec<f64>],
}

impl WithSimd for Elimination<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for before in self.done {
            let factor = -before[self.place];
            for (entry, by) in self.row.iter_mut().zip(before) {
                *entry = factor.mul_add(*by, *entry);
            }
        }
        let root = libm::sqrt(self.pivot);
        for entry in self.row.iter_mut() {
            *entry /= root;
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
