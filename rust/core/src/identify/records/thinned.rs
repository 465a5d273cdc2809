//! Records that are sampled far above what their drive moves, thinned for choices and descents.

use crate::models::Measures;
use crate::signal::{Drive, index};

/// Longest interval of a thinned record, as a phase of the drive, rad: its peaks are then known to
/// a thousandth of the travel.
const LONGEST_PHASE: f64 = 0.06;

/// Every how many samples a record is thinned to: where its drive is slow all the time, as many as
/// leave about so many rows, or as its motion allows; else 1.
pub(in crate::identify) fn thinning(of: &Measures, dt: f64, samples: usize, rows: usize) -> usize {
    if of.excited().is_some() {
        return 1;
    }
    let most = LONGEST_PHASE / (of.frequency * dt);
    (1..=samples / rows).rev().find(|every| index(*every) < most).unwrap_or(1)
}

/// Every so many of the samples of a record.
pub(in crate::identify) struct Thinned {
    pub every: usize,
    u: Vec<f64>,
    pub y: Vec<f64>,
    pub left_out: Vec<bool>,
}

impl Thinned {
    pub fn of(drive: &Drive<'_>, y: &[f64], left_out: &[bool], every: usize) -> Self {
        let thin = |values: &[f64]| values.iter().copied().step_by(every).collect::<Vec<f64>>();
        let left_out = left_out.iter().copied().step_by(every).collect();
        Self { every, u: thin(drive.u), y: thin(y), left_out }
    }

    /// Its drive, of a record with this one.
    pub fn drive(&self, of: &Drive<'_>) -> Drive<'_> {
        // The first interval that is left has more than the jump in it.
        let hold = if self.every > 1 { of.hold.until(0) } else { of.hold };
        Drive { u: &self.u, dt: of.dt * index(self.every), hold }
    }

    /// A sample of the record in the thinned one, or the next one that is there.
    pub fn place(&self, sample: usize) -> usize {
        sample.div_ceil(self.every)
    }
}

#[cfg(test)]
mod tests {
    use super::{LONGEST_PHASE, thinning};
    use crate::models::Measures;
    use crate::signal::{Drive, Hold, index};

    #[test]
    fn a_slow_record_is_thinned_as_far_as_its_motion_allows() {
        let (dt, rate) = (1e-3, core::f64::consts::PI);
        let u: Vec<f64> =
            (0..100_000).map(|k| 50.0 - 50.0 * libm::cos(rate * dt * index(k))).collect();
        let drive = Drive { u: &u, dt, hold: Hold::First };
        let of = Measures::of(&drive, &u, 0..u.len());
        // So few rows that the phase between them would be ten times as long as allowed.
        let every = thinning(&of, dt, u.len(), u.len() / 200);
        assert!(rate * dt * index(every) < 1.01 * LONGEST_PHASE);
        assert!(rate * dt * index(every + 1) > 0.99 * LONGEST_PHASE);
    }
}
