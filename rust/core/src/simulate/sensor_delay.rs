//! Displacements of earlier instants, which sensors with a delay see while stages are driven.

use super::timing::{Delay, SAME};
use crate::error::Result;
use crate::math::room;

/// A sampling interval cut at the instants that delayed sensors see, for one axis or several.
pub(super) struct Looks<const AXES: usize> {
    /// Where the parts of the interval end, as parts of it; the last at 1.
    ends: Vec<f64>,
    /// Part of the interval at whose end each sensor looks.
    place: [usize; AXES],
    /// Whole intervals from there to its reading.
    whole: [usize; AXES],
    /// Displacements that each has seen, interval by interval, m.
    seen: [Vec<f64>; AXES],
}

impl<const AXES: usize> Looks<AXES> {
    /// For sensors with these delays, s, that read `samples` times, every `dt` seconds.
    pub(super) fn new(delays: [f64; AXES], dt: f64, samples: usize) -> Result<Self> {
        let delays = delays.map(|seconds| Delay::new(seconds, dt));
        let instants = delays.map(|delay| 1.0 - delay.fraction);
        let mut ends: Vec<f64> = vec![1.0];
        for instant in instants {
            if ends.iter().all(|end| (end - instant).abs() > SAME) {
                ends.push(instant);
            }
        }
        ends.sort_by(f64::total_cmp);
        let place = instants.map(|instant| {
            ends.iter().position(|end| (end - instant).abs() <= SAME).unwrap_or(ends.len() - 1)
        });
        let mut seen = [const { Vec::new() }; AXES];
        for line in &mut seen {
            *line = room("delayed readings of the sensor", samples)?;
        }
        Ok(Self { ends, place, whole: delays.map(|delay| delay.whole), seen })
    }

    /// The parts of the interval: where each begins and ends.
    pub(super) fn parts(&self) -> Vec<(f64, f64)> {
        let starts = core::iter::once(0.0).chain(self.ends.iter().copied());
        starts.zip(self.ends.iter().copied()).collect()
    }

    /// Whether a sensor looks at the end of a part.
    pub(super) fn is_due(&self, axis: usize, part: usize) -> bool {
        self.place[axis] == part
    }

    /// Takes what a sensor sees now, m.
    pub(super) fn see(&mut self, axis: usize, displacement: f64) {
        self.seen[axis].push(displacement);
    }

    /// Displacement that a sensor reads at sample `k`, m; before it has seen anything the start.
    pub(super) fn read_at(&self, axis: usize, k: usize) -> f64 {
        self.seen[axis][k.saturating_sub(self.whole[axis])]
    }
}
