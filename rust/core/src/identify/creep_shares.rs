//! Shares of the creep, by least squares within the cost of a candidate.
//!
//! ```text
//! y = xm + sum_j c_j q_j + offset + e,   c_j >= 0,   sum_j c_j <= 1/2
//! ```
//!
//! With given time constants the displacement is linear in the shares c, so their best values
//! follow for each candidate from sums over the records, and no swarm searches them: variable
//! projection, Golub and Pereyra 1973, doi 10.1137/0710036.

use super::record::Record;
use crate::error::{Error, Result, positive};
use crate::signal::{index, range, turns};

/// Most relaxations of the creep in a search.
pub const MOST_SHARES: usize = 3;

/// Largest sum of the shares: creep that adds more is no creep.
pub const MOST_CREEP: f64 = 0.5;

/// A pivot below this part of its diagonal is 0: the column is a combination of the others.
pub(super) const LEAST_PIVOT: f64 = 1e-12;

/// What a column that is a combination of others, but for [`LEAST_PIVOT`], can still move.
pub(super) const SLACK: f64 = 1e-6;

/// Shares of the relaxations; 0 for those that there are not.
pub type Shares = [f64; MOST_SHARES];

/// Sums over samples of the deviation r of the mechanics and the outputs g of the relaxations.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ShareSums {
    /// Of r, and of its square.
    pub deviation: [f64; 2],
    /// Of g.
    pub outputs: Shares,
    /// Of g r.
    pub cross: Shares,
    /// Of products of g, the lower triangle.
    pub products: [Shares; MOST_SHARES],
}

/// Mean square of what is left as a function of the shares c, m^2: `square - 2 slope c + c matrix c`,
/// with the best offset where one is fitted.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ShareCost {
    square: f64,
    slope: Shares,
    matrix: [Shares; MOST_SHARES],
}

impl ShareSums {
    /// What they say of the shares over so many samples, with a free offset or none.
    pub fn cost(&self, samples: usize, offset: bool) -> ShareCost {
        let n = index(samples);
        let [mean, mut square] = self.deviation.map(|sum| sum / n);
        let means = self.outputs.map(|sum| sum / n);
        let mut slope = self.cross.map(|sum| sum / n);
        let mut matrix = [[0.0; MOST_SHARES]; MOST_SHARES];
        for j in 0..MOST_SHARES {
            for i in 0..=j {
                matrix[j][i] = self.products[j][i] / n;
                if offset {
                    matrix[j][i] -= means[j] * means[i];
                }
                matrix[i][j] = matrix[j][i];
            }
            if offset {
                slope[j] -= means[j] * mean;
            }
        }
        if offset {
            square -= mean * mean;
        }
        ShareCost { square, slope, matrix }
    }

    /// Mean of what is left with these shares, m, before an offset is taken off.
    pub fn mean(&self, samples: usize, shares: &Shares) -> f64 {
        let n = index(samples);
        let outputs = self.outputs.iter().zip(shares);
        outputs.fold(self.deviation[0] / n, |mean, (sum, c)| mean - c * (sum / n))
    }
}

impl ShareCost {
    /// Adds that of another record, as much as its share of the samples of all.
    pub fn add(&mut self, other: &Self, part: f64) {
        self.square += part * other.square;
        for j in 0..MOST_SHARES {
            self.slope[j] += part * other.slope[j];
            for (sum, one) in self.matrix[j].iter_mut().zip(other.matrix[j]) {
                *sum += part * one;
            }
        }
    }

    /// The best of `count` shares.
    pub fn best(&self, count: usize) -> Shares {
        let mut best = ([0.0; MOST_SHARES], self.square);
        // The minimum lies on a face of the simplex, and is the minimum of that face's plane.
        for face in 1..1_usize << count {
            for full in [false, true] {
                let Some(shares) = on_face(&self.matrix, &self.slope, face, full) else { continue };
                let total: f64 = shares.iter().sum();
                let inside = shares.iter().all(|c| *c >= 0.0) && (full || total <= MOST_CREEP);
                let left = self.at(&shares);
                if inside && left < best.1 {
                    best = (shares, left);
                }
            }
        }
        best.0
    }

    /// Mean square that is left with these shares, m^2.
    pub fn at(&self, shares: &Shares) -> f64 {
        let mut left = self.square;
        for j in 0..MOST_SHARES {
            let along: f64 = (0..MOST_SHARES).map(|i| self.matrix[j][i] * shares[i]).sum();
            left += shares[j] * (along - 2.0 * self.slope[j]);
        }
        left
    }

    /// Largest rms of an output, m.
    pub fn size(&self) -> f64 {
        let diagonal = [0, 1, 2].map(|j: usize| self.matrix[j][j]);
        libm::sqrt(diagonal.iter().fold(0.0, |most: f64, d| most.max(*d)))
    }
}

/// Directions in which the shares can move to both sides: those above 0, against each other only
/// where their sum is the largest.
pub(super) fn directions(shares: &Shares) -> Vec<Shares> {
    let mut free = (0..MOST_SHARES).filter(|&j| shares[j] > 0.0);
    let full = shares.iter().sum::<f64>() >= MOST_CREEP * (1.0 - LEAST_PIVOT);
    let against = if full { free.next() } else { None };
    let direction = |j: usize| {
        let mut direction = [0.0; MOST_SHARES];
        direction[j] = 1.0;
        if let Some(other) = against {
            direction[other] = -1.0;
        }
        direction
    };
    free.map(direction).collect()
}

/// The best shares of those in `face` (bit j for share j), the others 0; where it is `full`, with
/// the largest sum. `None` where the outputs depend on each other.
fn on_face(matrix: &[Shares; 3], slope: &Shares, face: usize, full: bool) -> Option<Shares> {
    let free = solve(matrix, face, slope)?;
    if !full {
        return Some(free);
    }
    let ones = solve(matrix, face, &[1.0; MOST_SHARES])?;
    let part = (free.iter().sum::<f64>() - MOST_CREEP) / ones.iter().sum::<f64>();
    Some(core::array::from_fn(|j| free[j] - part * ones[j]))
}

/// Solves the rows and columns of `face`; 0 in the others.
fn solve(matrix: &[Shares; 3], face: usize, right: &Shares) -> Option<Shares> {
    let (mut a, mut b) = (*matrix, *right);
    let used = |j: &usize| face >> j & 1 == 1;
    for p in (0..MOST_SHARES).filter(used) {
        let pivots = a[p];
        if pivots[p].is_nan() || pivots[p] <= LEAST_PIVOT * matrix[p][p] {
            return None;
        }
        for row in (p + 1..MOST_SHARES).filter(used) {
            let factor = a[row][p] / pivots[p];
            for (slot, pivot) in a[row].iter_mut().zip(pivots).skip(p) {
                *slot -= factor * pivot;
            }
            b[row] -= factor * b[p];
        }
    }
    let mut found = [0.0; MOST_SHARES];
    for p in (0..MOST_SHARES).rev().filter(used) {
        let rest: f64 = (p + 1..MOST_SHARES).map(|column| a[p][column] * found[column]).sum();
        found[p] = (b[p] - rest) / a[p][p];
    }
    Some(found)
}

/// Refuses time constants that a search cannot use.
pub(super) fn check_times(times: &[f64]) -> Result<()> {
    if times.len() > MOST_SHARES {
        let expected = format!("{MOST_SHARES} time constants at most");
        return Err(Error::parameter("creep", format!("{} entries", times.len()), expected));
    }
    for (j, &time) in times.iter().enumerate() {
        positive(&format!("creep[{j}]"), time, "s")?;
    }
    Ok(())
}

/// Smallest reversal of the drive that counts for its period, as a share of its range.
const LEAST_TURN: f64 = 0.1;

/// Fewest reversals that make a period.
const FEWEST_TURNS: usize = 3;

/// Fewest samples of a window with creep.
const FEWEST_SAMPLES: usize = 400;

/// How far apart the shortest and the longest time constant of several records may be without one
/// between them.
const APART: f64 = 100.0;

/// Time constants for records, s. Of one record the drive's period and half of the window, at least
/// three apart; where the drive does not swing, a fiftieth of the window and half of it. Of several
/// the shortest and the longest of these, and where they are a hundred apart their geometric mean.
///
/// What relaxes within a period widens the loop, as damping and hysteresis do: one record does
/// not tell them apart.
///
/// # Errors
/// [`Error::Data`] where a window is too short, with the record's label.
pub fn creep_times(records: &[&Record<'_>]) -> Result<Vec<f64>> {
    let (mut shortest, mut longest) = (f64::INFINITY, 0.0_f64);
    for record in records {
        let [short, long] = two_times(record).map_err(|error| record.named(error))?;
        (shortest, longest) = (shortest.min(short), longest.max(long));
    }
    let mut times = vec![shortest, longest];
    if records.len() > 1 && longest > APART * shortest {
        times.insert(1, libm::sqrt(shortest * longest));
    }
    Ok(times)
}

fn two_times(record: &Record<'_>) -> Result<[f64; 2]> {
    let u = &record.drive.u[record.window.clone()];
    let window = record.drive.dt * index(u.len());
    if u.len() < FEWEST_SAMPLES {
        return Err(Error::Data(format!(
            "the window has {} samples: expected at least {FEWEST_SAMPLES} to show creep, or time \
             constants in creep=",
            u.len()
        )));
    }
    let (low, high) = range(u);
    let reversals = turns(u, LEAST_TURN * (high - low)).len();
    let shortest = if reversals < FEWEST_TURNS {
        window / 50.0
    } else {
        (2.0 * window / index(reversals)).max(10.0 * record.drive.dt)
    };
    let longest = 0.5 * window;
    Ok([shortest.min(longest / 3.0), longest])
}
