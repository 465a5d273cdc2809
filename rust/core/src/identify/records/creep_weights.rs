//! Weights of the creep, by least squares within the cost of a candidate.
//!
//! ```text
//! y = xm + sum_j c_j q_j + offset + e,   c_j >= 0,   sum_j c_j <= 1/2
//! ```
//!
//! With given time constants the displacement is linear in the weights c, so their best values
//! follow for each candidate from sums over the records, and no swarm searches them: variable
//! projection, Golub and Pereyra 1973, doi 10.1137/0710036.

use super::record::Record;
use crate::error::{Error, Result, positive};
use crate::signal::{index, range, turns};

/// Most relaxations of the creep in a search.
pub const MOST_CREEP_WEIGHTS: usize = 3;

/// Largest sum of the weights: creep that adds more is no creep.
pub const MOST_CREEP: f64 = 0.5;

/// A pivot below this part of its diagonal is 0: the column is a combination of the others.
pub(in crate::identify) const LEAST_PIVOT: f64 = 1e-12;

/// Movement left to a column that is a combination of others, but for [`LEAST_PIVOT`].
pub(in crate::identify) const SLACK: f64 = 1e-6;

/// Weights of the relaxations; 0 for those that there are not.
pub type CreepWeights = [f64; MOST_CREEP_WEIGHTS];

/// Directions in which the weights can move to both sides: those above 0, against each other only
/// where their sum is the largest.
pub(in crate::identify) fn directions(creep_weights: &CreepWeights) -> Vec<CreepWeights> {
    let mut free = (0..MOST_CREEP_WEIGHTS).filter(|&j| creep_weights[j] > 0.0);
    let full = creep_weights.iter().sum::<f64>() >= MOST_CREEP * (1.0 - LEAST_PIVOT);
    let against = if full { free.next() } else { None };
    let direction = |j: usize| {
        let mut direction = [0.0; MOST_CREEP_WEIGHTS];
        direction[j] = 1.0;
        if let Some(other) = against {
            direction[other] = -1.0;
        }
        direction
    };
    free.map(direction).collect()
}

/// Refuses time constants that a search cannot use.
pub(in crate::identify) fn check_times(times: &[f64]) -> Result<()> {
    if times.len() > MOST_CREEP_WEIGHTS {
        let expected = format!("{MOST_CREEP_WEIGHTS} time constants at most");
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
