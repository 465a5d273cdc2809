//! Linear dynamics from sample to sample, behind any signals.

use crate::models::{Dynamics, Relaxation, RelaxationState};
use crate::signal::{Drive, Hold};

/// Dynamics from sample to sample: the columns of the step's matrix.
pub(super) struct Steps {
    x: [f64; 4],
    v: [f64; 4],
}

impl Steps {
    pub fn new(dynamics: Dynamics, drive: &Drive<'_>) -> Option<Self> {
        let part = Relaxation::new(&[], &[], dynamics).ok()?;
        let flow = part.flow(drive.dt);
        let rate = 1.0 / drive.dt;
        let probe = |x: f64, w: f64, from: f64, to: f64| {
            let mut state = RelaxationState { input: from, x, v: w * rate, ..Default::default() };
            part.step(&flow, &mut state, to);
            (state.x, state.v / rate)
        };
        // Position, velocity times dt, input before, input after.
        let columns = [
            probe(1.0, 0.0, 0.0, 0.0),
            probe(0.0, 1.0, 0.0, 0.0),
            probe(0.0, 0.0, 1.0, 0.0),
            probe(0.0, 0.0, 0.0, 1.0),
        ];
        Some(match drive.hold {
            Hold::First | Hold::Jump => {
                Self { x: columns.map(|one| one.0), v: columns.map(|one| one.1) }
            }
            Hold::Zero => {
                let held = probe(0.0, 0.0, 1.0, 1.0);
                let of = |each: fn((f64, f64)) -> f64| {
                    [each(columns[0]), each(columns[1]), each(held), 0.0]
                };
                Self { x: of(|one| one.0), v: of(|one| one.1) }
            }
        })
    }

    /// Responses of the dynamics to some signals, from rest: side by side, as each sample waits for
    /// the one before.
    pub fn of<const N: usize>(&self, inputs: [&[f64]; N]) -> [Vec<f64>; N] {
        let mut before = inputs.map(|one| one.first().copied().unwrap_or(0.0));
        let (mut x, mut w) = (before, [0.0; N]);
        let mut all = inputs.map(|one| Vec::with_capacity(one.len()));
        for (all, x) in all.iter_mut().zip(x) {
            all.push(x);
        }
        let samples = inputs.iter().map(|one| one.len()).min().unwrap_or(0);
        for k in 1..samples {
            for (j, input) in inputs.iter().map(|one| one[k]).enumerate() {
                let at = [x[j], w[j], before[j], input];
                (x[j], w[j]) = (dot(&self.x, &at), dot(&self.v, &at));
                before[j] = input;
            }
            for (all, x) in all.iter_mut().zip(x) {
                all.push(x);
            }
        }
        all
    }
}

#[inline(always)]
fn dot(row: &[f64; 4], at: &[f64; 4]) -> f64 {
    row[0] * at[0] + row[1] * at[1] + row[2] * at[2] + row[3] * at[3]
}
