//! Normal equations about a candidate, of one record and of all.
//!
//! The weights of the creep are linear: they enter as coordinates, and are eliminated (Kaufman 1975,
//! doi 10.1007/BF01932995).

use nalgebra::{DMatrix, DVector};

use crate::identify::cost::journal::Answer;
use crate::identify::cost::several_records::Member;
use crate::identify::parameters::drift::Drift;
use crate::identify::records::creep_weights::{CreepWeights, LEAST_PIVOT};
use crate::signal::index;

/// Steps along which the curvature is found at a place.
pub(in crate::identify) const STEPS: usize = 3;

/// Normal equations about a candidate, in coordinates of the unit box.
pub(in crate::identify) struct Normal {
    /// J^T J.
    pub square: DMatrix<f64>,
    /// J^T r, r being measured less simulated.
    pub slope: DVector<f64>,
    /// `J^T x_vv` with the second derivative of the displacement x along each step that was asked for;
    /// none of a step that could not be simulated.
    pub bends: [Option<DVector<f64>>; STEPS],
}

impl Normal {
    /// Takes a coordinate out, which then stays as it is.
    pub fn hold(&mut self, coordinate: usize) {
        self.square.fill_row(coordinate, 0.0);
        self.square.fill_column(coordinate, 0.0);
        self.slope[coordinate] = 0.0;
    }
}

/// Where normal equations are asked for.
pub(in crate::identify) struct Spot {
    pub place: Vec<f64>,
    pub creep_weights: CreepWeights,
    /// Dampings of the steps along which the curvature is asked for.
    pub dampings: [f64; STEPS],
    /// Coordinate that stays as it is.
    pub held: Option<usize>,
}

/// First 1, or -1 where a neighbour could not be simulated; NaN for bends that there are not.
impl Answer for Option<Normal> {
    fn length(coordinates: usize) -> usize {
        1 + coordinates * (1 + coordinates + STEPS)
    }

    fn write(&self, numbers: &mut Vec<f64>, coordinates: usize) {
        if let Some(Normal { square, slope, bends }) = self {
            numbers.push(1.0);
            numbers.extend(slope.iter());
            numbers.extend(square.iter());
            let none = DVector::from_element(coordinates, f64::NAN);
            for bend in bends {
                numbers.extend(bend.as_ref().unwrap_or(&none).iter());
            }
        } else {
            numbers.push(-1.0);
            numbers.resize(numbers.len() + Self::length(coordinates) - 1, 0.0);
        }
    }

    fn read(numbers: &[f64], coordinates: usize) -> Self {
        let (&first, rest) = numbers.split_first()?;
        let (slope, rest) = rest.split_at_checked(coordinates)?;
        let (square, bends) = rest.split_at_checked(coordinates * coordinates)?;
        let bend = |i: usize| {
            let bend = bends.get(i * coordinates..(i + 1) * coordinates)?;
            (!bend.iter().any(|value| value.is_nan())).then(|| DVector::from_column_slice(bend))
        };
        if first < 0.0 {
            return None;
        }
        Some(Normal {
            square: DMatrix::from_column_slice(coordinates, coordinates, square),
            slope: DVector::from_column_slice(slope),
            bends: core::array::from_fn(bend),
        })
    }
}

/// Block that one record adds to them, in its own coordinates and after them the directions of the
/// weights.
pub(in crate::identify) struct Block {
    pub square: DMatrix<f64>,
    pub slope: DVector<f64>,
    /// The Jacobian, column by column, less what offset and drift can take of it.
    pub columns: Vec<Vec<f64>>,
    /// Reading at the place, without drift.
    pub read: Vec<f64>,
    /// The drift that suits the place best.
    pub drift: Option<Drift>,
    /// Rows whose displacement counts.
    pub rows: usize,
    /// Samples of the window to a row.
    pub stride: usize,
    /// Columns that are of weights.
    pub directions: usize,
    /// Sum of r^2.
    pub squares: f64,
}

/// The equations of all records, each as much as its share, with the directions of the weights.
pub(in crate::identify) struct Extended {
    square: DMatrix<f64>,
    pub slope: DVector<f64>,
    /// Sum of r^2.
    pub squares: f64,
    /// Samples that entered.
    rows: usize,
    /// Coordinates without the directions.
    count: usize,
}

impl Extended {
    /// Of the blocks of records, with so many coordinates.
    pub fn of(members: &[Member<'_>], blocks: &[Block], count: usize) -> Self {
        let rows = blocks.iter().map(|block| block.rows).sum();
        let size = count + blocks.first().map_or(0, |block| block.directions);
        let (square, slope) = (DMatrix::zeros(size, size), DVector::zeros(size));
        let mut all = Self { square, slope, squares: 0.0, rows, count };
        for (one, block) in members.iter().zip(blocks) {
            let (scale, slots) = (all.scale_of(one, block), all.slots_of(one));
            for (i, &row) in slots.iter().enumerate() {
                all.slope[row] += scale * block.slope[i];
                for (j, &column) in slots.iter().enumerate() {
                    all.square[(row, column)] += scale * block.square[(i, j)];
                }
            }
            all.squares += scale * block.squares;
        }
        all
    }

    /// The square and a right side about the best weights.
    pub fn eliminated(&self, right: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let (mut square, mut right) = (self.square.clone(), right.clone());
        for last in (self.count..self.size()).rev() {
            let pivot = square[(last, last)];
            // Those that are combinations of others stay where they are.
            if pivot.is_nan() || pivot <= LEAST_PIVOT * self.square[(last, last)] {
                continue;
            }
            for row in 0..last {
                let factor = square[(row, last)] / pivot;
                right[row] -= factor * right[last];
                for column in 0..last {
                    square[(row, column)] -= factor * square[(last, column)];
                }
            }
        }
        let right = right.rows(0, self.count).into_owned();
        (square.resize(self.count, self.count, 0.0), right)
    }

    /// How much a block of a record counts.
    pub fn scale_of(&self, one: &Member<'_>, block: &Block) -> f64 {
        one.share * index(self.rows) / index(block.rows)
    }

    /// Where the columns of a block of a record are among all.
    pub fn slots_of(&self, one: &Member<'_>) -> Vec<usize> {
        one.slots().iter().copied().chain(self.count..self.size()).collect()
    }

    /// Coordinates with the directions.
    pub fn size(&self) -> usize {
        self.slope.len()
    }
}
