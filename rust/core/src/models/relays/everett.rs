//! The Everett function of a Preisach operator: what switches between two reversals.
//!
//! ```text
//! E(a, b) = mass of the relays that switch up at a or below and down at b or above,  a >= b
//! ```
//!
//! Everett 1955, Transactions of the Faraday Society 51, 1551-1557, doi 10.1039/tf9555101551. Here
//! levels divide the plane of the relays into cells: squares, and triangles on the diagonal. E is
//! known at the nodes, as sums of the cells' masses, bilinear in the squares and linear in
//! the triangles. So the mass of a square is spread evenly over it, and that of a triangle lies on
//! the diagonal, where relays have no memory: along a branch, where one of the two is fixed, E is
//! straight between levels.

use crate::error::{Error, Result, finite};
use crate::models::plays::prandtl_ishlinskii::along;

/// Most levels of the plane of relays.
pub const MOST_LEVELS: usize = 17;

/// Most nodes with a above b, or the two equal.
const NODES: usize = MOST_LEVELS * (MOST_LEVELS + 1) / 2;

/// Cells between so many levels.
pub(in crate::models) const fn cells(levels: usize) -> usize {
    levels * levels.saturating_sub(1) / 2
}

/// Place of an entry in the rows of a triangle: row i has i + 1 entries.
pub(in crate::models) const fn entry(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// The Everett function on levels (V), m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Everett {
    levels: [f64; MOST_LEVELS],
    /// Levels that are used, 2 at least.
    count: usize,
    /// E at the nodes, in rows of the upper level.
    nodes: [f64; NODES],
}

impl Everett {
    /// From the levels (V) and the masses (m) of the cells: in rows of the interval in which their
    /// relays switch up, each from the lowest interval in which they switch down to the same one.
    /// The masses have the sign given, or are 0.
    ///
    /// # Errors
    /// [`Error::Shape`] where there are too few or too many, [`Error::Parameter`] where levels do
    /// not ascend or a mass has the other sign.
    pub(in crate::models) fn new(levels: &[f64], masses: &[f64], sign: f64) -> Result<Self> {
        let count = levels.len();
        let mut everett = Self::of_levels(levels)?;
        if masses.len() != cells(count) {
            return Err(Error::Shape {
                name: "masses".into(),
                found: format!("{} entries", masses.len()),
                expected: format!("{}, the cells between {count} levels", cells(count)),
            });
        }
        for (k, mass) in masses.iter().enumerate() {
            along(&format!("masses[{k}]"), *mass, "m", sign)?;
        }
        // E(i + 1, j) is what E(i, j) has and the cells of row i from column j on.
        for i in 0..count - 1 {
            let mut row = 0.0;
            for j in (0..=i).rev() {
                row += masses[entry(i, j)];
                everett.nodes[entry(i + 1, j)] = everett.nodes[entry(i, j)] + row;
            }
        }
        Ok(everett)
    }

    /// On levels (V), without any mass.
    ///
    /// # Errors
    /// [`Error::Shape`] where there are too few or too many, [`Error::Parameter`] where they do not
    /// ascend.
    pub(in crate::models) fn of_levels(levels: &[f64]) -> Result<Self> {
        let count = levels.len();
        if !(2..=MOST_LEVELS).contains(&count) {
            return Err(Error::Shape {
                name: "levels".into(),
                found: format!("{count} entries"),
                expected: format!("2 to {MOST_LEVELS}"),
            });
        }
        let mut everett = Self { count, ..Self::empty() };
        for (i, level) in levels.iter().enumerate() {
            let name = format!("levels[{i}]");
            everett.levels[i] = finite(&name, *level, "V")?;
            if i > 0 && *level <= levels[i - 1] {
                let expected = format!("above {} V: they ascend", levels[i - 1]);
                return Err(Error::parameter(name, format!("{level} V"), expected));
            }
        }
        Ok(everett)
    }

    /// Of one cell from 0 V to 1 V, without mass.
    pub(in crate::models) fn empty() -> Self {
        let mut levels = [0.0; MOST_LEVELS];
        levels[1] = 1.0;
        Self { levels, count: 2, nodes: [0.0; NODES] }
    }

    /// Its levels, V.
    #[must_use]
    pub fn levels(&self) -> &[f64] {
        &self.levels[..self.count]
    }

    /// The lowest level, and the highest one.
    #[inline]
    pub(in crate::models) fn ends(&self) -> (f64, f64) {
        (self.levels[0], self.levels[self.count - 1])
    }

    /// The interval between levels that `volts` lies in: where it is a level, the interval that
    /// begins there; the first and the last one extend beyond the levels.
    #[inline]
    pub(in crate::models) fn interval(&self, volts: f64) -> usize {
        let levels = &self.levels[1..self.count - 1];
        levels.iter().take_while(|level| **level <= volts).count()
    }

    /// The interval that `volts` lies in, and the share of it that is below.
    #[inline]
    fn place(&self, volts: f64) -> (usize, f64) {
        let i = self.interval(volts);
        let (low, high) = (self.levels[i], self.levels[i + 1]);
        (i, (volts - low) / (high - low))
    }

    /// Its value for a rise from `from` to `to`, and the negative of it for a fall, both within
    /// the levels.
    #[inline]
    pub(in crate::models) fn stroke(&self, from: f64, to: f64) -> f64 {
        let (high, low, sign) = if to < from { (from, to, -1.0) } else { (to, from, 1.0) };
        let ((i, above), (j, below)) = (self.place(high), self.place(low));
        let node = |i: usize, j: usize| self.nodes[entry(i, j)];
        if i == j {
            return sign * (above - below) * node(i + 1, i);
        }
        let left = node(i, j) + below * (node(i, j + 1) - node(i, j));
        let right = node(i + 1, j) + below * (node(i + 1, j + 1) - node(i + 1, j));
        sign * (left + above * (right - left))
    }

    /// The straight part of a branch from the reversal `from` that `volts` lies in: its slope
    /// there, m/V, on the side that `from` lies on where `volts` is a level.
    #[inline]
    pub(in crate::models) fn slope(&self, from: f64, volts: f64) -> f64 {
        let i = self.interval(volts);
        let (low, high) = (self.levels[i], self.levels[i + 1]);
        // A rise to a level ended in the interval below it.
        let behind = from < volts && volts <= low && i > 0;
        let (low, high) = if behind { (self.levels[i - 1], low) } else { (low, high) };
        let (low, high) = if from < volts { (low.max(from), high) } else { (low, high.min(from)) };
        // Nothing is behind the reversal itself.
        if low < high {
            (self.stroke(from, high) - self.stroke(from, low)) / (high - low)
        } else {
            0.0
        }
    }

    /// Adds to the shares of the cells that are switched on those of a rise, or takes off those of
    /// a fall.
    pub(in crate::models) fn add_shares(&self, from: f64, to: f64, shares: &mut [f64]) {
        let (high, low, sign) = if to < from { (from, to, -1.0) } else { (to, from, 1.0) };
        let below = |i: usize, volts: f64| {
            let (start, end) = (self.levels[i], self.levels[i + 1]);
            ((volts - start) / (end - start)).clamp(0.0, 1.0)
        };
        for i in 0..self.count - 1 {
            let up = below(i, high);
            for j in 0..i {
                shares[entry(i, j)] += sign * up * (1.0 - below(j, low));
            }
            shares[entry(i, i)] += sign * (up - below(i, low));
        }
    }

    /// Bound of the slopes of all branches, m/V.
    pub(in crate::models) fn steepest(&self) -> f64 {
        // From the lowest level, or the highest one, all cells of an interval take part.
        let (low, high) = self.ends();
        let interval = |pair: &[f64]| {
            let up = self.stroke(low, pair[1]) - self.stroke(low, pair[0]);
            let down = self.stroke(high, pair[0]) - self.stroke(high, pair[1]);
            up.abs().max(down.abs()) / (pair[1] - pair[0])
        };
        self.levels().windows(2).map(interval).fold(0.0, f64::max)
    }
}
