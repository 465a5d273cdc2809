//! Damped steps of the Gauss-Newton method in the unit box, with and without acceleration.
//!
//! ```text
//! (S + mu diag S) v = g,   (S + mu diag S) a = -J^T x_vv,   z + v + a / 2
//! ```
//!
//! v is the step of Levenberg and Marquardt (Marquardt 1963, doi 10.1137/0111030) and a its
//! acceleration: the step follows a valley that bends. With J the Jacobian of the displacement x and
//! `x_vv` its second derivative along v: Transtrum and Sethna 2012, doi 10.48550/arXiv.1201.5885.

use nalgebra::{DMatrix, DVector};

use super::normal::Normal;

/// Largest acceleration that is taken, over the step, both in the metric of the Jacobian: beyond it
/// the orders that are left out count too.
const MOST_BEND: f64 = 0.75;

/// A damped step that stays in the box.
pub(in crate::identify) struct DampedStep {
    /// Change of each coordinate.
    pub change: DVector<f64>,
    /// Coordinates that do not end on a bound because of it.
    moving: Vec<usize>,
    damping: f64,
}

impl DampedStep {
    /// The step at a place; `None` where nothing can move.
    ///
    /// A coordinate whose step would cross a bound goes to the bound, and the others take the step
    /// that is best with it there.
    pub fn new(normal: &Normal, place: &[f64], damping: f64) -> Option<Self> {
        let presses = |d: usize, z: f64| {
            (z <= 0.0 && normal.slope[d] < 0.0) || (z >= 1.0 && normal.slope[d] > 0.0)
        };
        let mut moving: Vec<usize> = (0..place.len())
            .filter(|&d| normal.square[(d, d)] > 0.0 && !presses(d, place[d]))
            .collect();
        let mut change = DVector::zeros(place.len());
        while !moving.is_empty() {
            // What those at their bounds leave of the slope.
            let left = &normal.slope - &normal.square * &change;
            let found = solved(normal, &moving, damping, &left)?;
            let mut inside = Vec::with_capacity(moving.len());
            for (&d, found) in moving.iter().zip(found.iter()) {
                let z = place[d] + found;
                if (0.0..=1.0).contains(&z) {
                    inside.push((d, *found));
                } else {
                    change[d] = z.clamp(0.0, 1.0) - place[d];
                }
            }
            if inside.len() == moving.len() {
                for (d, found) in inside {
                    change[d] = found;
                }
                break;
            }
            moving = inside.into_iter().map(|(d, _)| d).collect();
        }
        Some(Self { change, moving, damping })
    }

    /// Where it leads to; `None` where nothing moves.
    pub fn end(&self, place: &[f64]) -> Option<Vec<f64>> {
        moved(place, &self.change)
    }

    /// Where it leads to with its acceleration, which follows from `bend`, `J^T x_vv`; without where
    /// that is too large to be believed.
    pub fn bent_end(
        &self,
        normal: &Normal,
        place: &[f64],
        bend: &DVector<f64>,
    ) -> Option<Vec<f64>> {
        let Some(found) = solved(normal, &self.moving, self.damping, bend) else {
            return self.end(place);
        };
        let mut half = DVector::zeros(place.len());
        for (&d, found) in self.moving.iter().zip(found.iter()) {
            half[d] = -0.5 * found;
        }
        let size = |change: &DVector<f64>| {
            let parts = change.iter().enumerate();
            parts.map(|(d, part)| normal.square[(d, d)] * part * part).sum::<f64>()
        };
        let believed = size(&half) <= MOST_BEND * MOST_BEND * size(&self.change);
        if believed { moved(place, &(&self.change + half)) } else { self.end(place) }
    }
}

/// Solves the damped equations of some coordinates; `None` where they are singular.
fn solved(
    normal: &Normal,
    moving: &[usize],
    damping: f64,
    right: &DVector<f64>,
) -> Option<DVector<f64>> {
    let square = DMatrix::from_fn(moving.len(), moving.len(), |i, j| {
        let value = normal.square[(moving[i], moving[j])];
        if i == j { value * (1.0 + damping) } else { value }
    });
    let right = DVector::from_fn(moving.len(), |i, _| right[moving[i]]);
    Some(square.cholesky()?.solve(&right))
}

/// A place moved, within the box; `None` where that changes nothing.
fn moved(place: &[f64], change: &DVector<f64>) -> Option<Vec<f64>> {
    let next: Vec<f64> =
        place.iter().zip(change.iter()).map(|(z, change)| (z + change).clamp(0.0, 1.0)).collect();
    (next != place && next.iter().all(|z| z.is_finite())).then_some(next)
}
