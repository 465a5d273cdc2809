//! Distortion of modes: regressors that act on them, chosen by what they explain of a residual.

use super::factors::Factors;
use super::normal_equations::{DistortionRecord, NormalEquations, Rest};
use crate::error::{Error, Result};
use crate::math::{on_all_threads, room};
use crate::signal::Stop;

/// Share of the diagonal that is added to the normal equations at the end.
const RIDGE: f64 = 1e-3;

/// Share of a column below which it depends on those that are chosen, and of the determinant of a
/// pair.
const DEPENDENT: [f64; 2] = [1e-3, 1e-4];

/// Force on a mode: that of an input, times a power of the level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModalForce {
    /// The mode.
    pub mode: usize,
    /// The input.
    pub input: usize,
    /// Which power.
    pub power: usize,
    /// Real and imaginary part of the force.
    pub force: [f64; 2],
}

/// Inputs that act on modes beside the drives, the same at several levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Distortion {
    /// Those that were chosen, the best first.
    pub forces: Vec<ModalForce>,
    /// e of the drives at each level, mode by mode, so that no part linear in them is left.
    pub linear: Vec<Vec<[f64; 2]>>,
    /// Weighted squares of the residual of each level that are left, as a share of all.
    pub left: Vec<f64>,
}

/// Chooses pairs of a mode and an input, with a power of the level, by forward selection.
///
/// Modes answer to the drives, the first inputs, by vectors e of each level, so that what is chosen
/// has no part that is linear in them. A pair has one force for all levels. One is added while that
/// lowers the criterion of Schwarz (1978, doi 10.1214/aos/1176344136) with twice its penalty, up to
/// `most` of them.
///
/// # Errors
/// [`Error::Shape`] where lists do not fit each other; [`Error::Memory`].
pub fn choose_distortion(
    records: &[DistortionRecord<'_>],
    drives: usize,
    most: usize,
    stop: Stop<'_>,
) -> Result<Distortion> {
    let made = on_all_threads(records, &|record| NormalEquations::new(record, drives, stop));
    let levels = made.into_iter().collect::<Result<Vec<NormalEquations>>>()?;
    let powers: Vec<&[f64]> = records.iter().map(|one| one.powers).collect();
    let sizes = |k: usize| (levels[k].modes, levels[k].inputs, powers[k].len());
    if (1..levels.len()).any(|k| sizes(k) != sizes(0)) {
        return Err(Error::Shape {
            name: "records".into(),
            found: "levels of different modes, inputs or powers".into(),
            expected: "the same at all levels".into(),
        });
    }
    let mut choice = Choice::new(&levels, &powers);
    while choice.pairs.len() < most && !stop() {
        let Some(best) = choice.best(drives) else { break };
        choice.add(best)?;
    }
    let forces = choice.solve()?;
    let (mut linear, mut left) = (Vec::new(), Vec::new());
    for (level, powers) in levels.iter().zip(&powers) {
        let others: Vec<(usize, f64)> = forces
            .iter()
            .flat_map(|one| {
                let force = one.force.map(|part| powers[one.power] * part);
                let places = level.places(one.mode, one.input);
                [(places[0], force[0]), (places[1], force[1])]
            })
            .collect();
        let (own, squares) = level.solve(&others)?;
        linear.push(own);
        left.push(squares / level.size);
    }
    Ok(Distortion { forces, linear, left })
}

/// Forward selection over all levels; columns of each power stand after each other.
struct Choice<'a> {
    levels: &'a [NormalEquations],
    powers: &'a [&'a [f64]],
    /// Columns of one power.
    count: usize,
    /// Real numbers of all residuals.
    numbers: f64,
    /// Mode, input and power of what is chosen.
    pairs: Vec<[usize; 3]>,
    taken: Vec<bool>,
    /// Places of their columns, the normal equations among them up to the diagonal, the right side.
    places: Vec<usize>,
    normal: Vec<Vec<f64>>,
    right: Vec<f64>,
    /// The diagonal at first.
    first: Vec<f64>,
    rest: Rest,
}

impl<'a> Choice<'a> {
    fn new(levels: &'a [NormalEquations], powers: &'a [&'a [f64]]) -> Self {
        let count = levels.first().map_or(0, |one| one.rest.slope.len());
        let all = powers.first().map_or(0, |one| one.len()) * count;
        let summed = |of: &dyn Fn(&NormalEquations, usize) -> f64, power: i32| -> Vec<f64> {
            let sum = |place: usize| -> f64 {
                let parts = levels.iter().zip(powers).map(|(level, powers)| {
                    of(level, place % count) * powers[place / count].powi(power)
                });
                parts.sum()
            };
            (0..all).map(sum).collect()
        };
        let diagonal = summed(&|level, place| level.rest.diagonal[place], 2);
        let slope = summed(&|level, place| level.rest.slope[place], 1);
        let between = summed(&|level, place| level.rest.between[place], 2);
        let left = levels.iter().map(|one| one.rest.left).sum();
        let inputs = levels.first().map_or(0, |one| one.inputs);
        Self {
            levels,
            powers,
            count,
            numbers: levels.iter().map(|one| one.numbers).sum(),
            pairs: Vec::new(),
            taken: vec![false; all],
            places: Vec::new(),
            normal: Vec::new(),
            right: slope.clone(),
            first: diagonal.clone(),
            rest: Rest::new(inputs, [slope, diagonal, between], left),
        }
    }

    /// The pair that lowers the criterion most.
    fn best(&self, drives: usize) -> Option<[usize; 3]> {
        let one = self.levels.first()?;
        let mut best = (4.0 * libm::log(self.numbers), None);
        for power in 0..self.first.len() / self.count.max(1) {
            for mode in 0..one.modes {
                for input in drives..one.inputs {
                    let places = one.places(mode, input).map(|place| power * self.count + place);
                    let gain = if self.taken[places[0]] { 0.0 } else { self.gain(places) };
                    if gain > best.0 {
                        best = (gain, Some([mode, input, power]));
                    }
                }
            }
        }
        best.1
    }

    /// Reduction of the criterion by two columns, without its penalty.
    fn gain(&self, [i, j]: [usize; 2]) -> f64 {
        let (a, b, c) = (self.rest.diagonal[i], self.rest.diagonal[j], self.rest.between[i]);
        let size = a * b - c * c;
        let [share, pair] = DEPENDENT;
        let apart = a > share * self.first[i] && b > share * self.first[j] && size > pair * a * b;
        if !apart || self.rest.left <= 0.0 {
            return 0.0;
        }
        let (g, h) = (self.rest.slope[i], self.rest.slope[j]);
        let squares = (b * g * g - 2.0 * c * g * h + a * h * h) / size;
        // Squares that nothing is left of would count without limit.
        let share = (squares / self.rest.left).clamp(0.0, 1.0 - f64::EPSILON);
        -self.numbers * libm::log(1.0 - share)
    }

    /// Adds a pair.
    fn add(&mut self, pair: [usize; 3]) -> Result<()> {
        let [mode, input, power] = pair;
        let places = self.levels[0].places(mode, input).map(|place| power * self.count + place);
        for place in places {
            self.taken[place] = true;
            self.places.push(place);
            let mut row = self.row(place)?;
            self.normal.push(self.places.iter().map(|&other| row[other]).collect());
            self.rest.reduce(&mut row, place);
            self.rest.eliminate(row, place);
        }
        self.pairs.push(pair);
        Ok(())
    }

    /// The row of a column over all levels and powers.
    fn row(&self, place: usize) -> Result<Vec<f64>> {
        let (power, own) = (place / self.count, place % self.count);
        let mut row = room("the factors", self.first.len())?;
        row.resize(self.first.len(), 0.0);
        for (level, powers) in self.levels.iter().zip(self.powers) {
            let part = level.row(own)?;
            for (slots, other) in row.chunks_exact_mut(self.count).zip(*powers) {
                let factor = powers[power] * other;
                for (slot, entry) in slots.iter_mut().zip(&part) {
                    *slot += factor * entry;
                }
            }
        }
        Ok(row)
    }

    /// The forces of what is chosen.
    fn solve(&self) -> Result<Vec<ModalForce>> {
        let size = self.places.len();
        let scale: Vec<f64> =
            self.normal.iter().enumerate().map(|(k, row)| libm::sqrt(row[k])).collect();
        let mut matrix = room("the normal equations", size.saturating_mul(size))?;
        for row in 0..size {
            for column in 0..size {
                let entry = self.normal[row.max(column)][row.min(column)];
                let entry = entry / (scale[row] * scale[column]);
                matrix.push(if row == column { entry + RIDGE } else { entry });
            }
        }
        let right: Vec<f64> =
            self.places.iter().zip(&scale).map(|(&place, by)| self.right[place] / by).collect();
        let found = Factors::new(&matrix, size, 0.0)?.solve(&right);
        let forces = self.pairs.iter().zip(found.chunks_exact(2).zip(scale.chunks_exact(2)));
        Ok(forces
            .map(|(&[mode, input, power], (value, by))| ModalForce {
                mode,
                input,
                power,
                force: [value[0] / by[0], value[1] / by[1]],
            })
            .collect())
    }
}
