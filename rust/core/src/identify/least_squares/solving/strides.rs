//! Samples of a record at which its motion is computed, and the steps between them.

use super::fit::Fit;
use super::late::Late;
use crate::models::{Relaxation, RelaxationFlow};
use crate::signal::{Hold, index};

/// Samples of a record at which its motion is computed: all of them, or, of a held drive of which
/// every so many are judged, these, those at which they are read, those at which the drive changes,
/// and the last. Between these, one step is exact.
pub(super) struct Strides(Vec<usize>);

impl Strides {
    /// Those of record `r` before sample `end`.
    pub fn of(fit: &Fit<'_>, r: usize, end: usize) -> Self {
        let record = &fit.common.records[r];
        let u = record.drive.u;
        if fit.every[r] == 1 || fit.exact || record.drive.hold != Hold::Zero {
            return Self((0..end).collect());
        }
        // Also in the warm-up and where readings are left out, or a step would be of any length.
        let (every, first) = (fit.every[r], fit.windows[r].start);
        let regular = |k: usize| k % every == first % every;
        let changes = |k: usize| k == 0 || u[k].to_bits() != u[k - 1].to_bits();
        let mut needed: Vec<bool> =
            (0..end).map(|k| regular(k) || changes(k) || k + 1 == end).collect();
        let late = Late::new(fit.delay(r), record.drive.dt);
        for k in fit.judged(r).filter(|_| !late.is_none()) {
            let (before, after) = late.between(k);
            (needed[before], needed[after]) = (true, true);
        }
        Self((0..end).filter(|k| needed[*k]).collect())
    }

    /// The samples, in order.
    pub fn places(&self) -> &[usize] {
        &self.0
    }

    /// Intervals from the sample before to the one at `place` of [`Self::places`].
    pub fn gap(&self, place: usize) -> usize {
        if place == 0 { 1 } else { self.0[place] - self.0[place - 1] }
    }

    /// The longest of them.
    pub fn longest(&self) -> usize {
        (0..self.0.len()).map(|place| self.gap(place)).max().unwrap_or(1)
    }
}

/// A part of the stage with its steps of one interval, of two, and so on.
pub(super) struct Stepped {
    pub part: Relaxation,
    flows: Vec<RelaxationFlow>,
}

impl Stepped {
    /// With steps of up to `longest` intervals of `dt` seconds.
    pub fn new(part: Relaxation, dt: f64, longest: usize) -> Self {
        let flows = (1..=longest).map(|gap| part.flow(dt * index(gap))).collect();
        Self { part, flows }
    }

    /// The step over so many intervals.
    #[inline(always)]
    pub fn over(&self, gap: usize) -> &RelaxationFlow {
        &self.flows[gap - 1]
    }
}

#[cfg(test)]
mod tests {
    use super::Strides;
    use crate::error::{Error, Result};
    use crate::identify::least_squares::common::Common;
    use crate::identify::least_squares::solving::fit::{Beginning, Fit};
    use crate::identify::least_squares::solving::form::Form;
    use crate::identify::least_squares::weights_record::{WeightsDelay, WeightsRecord};
    use crate::identify::records::history::History;
    use crate::models::Model;
    use crate::signal::{Drive, Hold, NEVER};

    /// A record of plays under a held drive, of which every so many samples are judged.
    fn with_fit<T>(
        record: WeightsRecord<'_>,
        every: usize,
        of: impl FnOnce(Fit<'_>) -> Result<T>,
    ) -> Result<T> {
        let model = Model::named("prandtl-ishlinskii")?;
        let plays = model.superposition().ok_or_else(|| Error::Data("no plays".into()))?;
        let common = Common::new((model, plays), vec![record], false, NEVER);
        of(Fit { every: vec![every], ..Fit::new(&common, &[2.0, 10.0]) })
    }

    #[test]
    fn no_step_is_longer_than_from_one_judged_sample_to_the_next() -> Result<()> {
        let (u, left_out) = ([1.0; 500], [true; 500]);
        let drive = Drive { u: &u, dt: 1e-3, hold: Hold::Zero };
        let record = WeightsRecord { left_out: &left_out, ..WeightsRecord::of(drive, &u, 207) };
        let longest = with_fit(record, 5, |fit| Ok(Strides::of(&fit, 0, u.len()).longest()))?;
        assert_eq!(longest, 5);
        Ok(())
    }

    /// Motion of plays that creep, read late.
    fn motion(u: &[f64], every: usize, lag: &[f64]) -> Result<Vec<f64>> {
        let drive = Drive { u, dt: 1e-3, hold: Hold::Zero };
        let delay = WeightsDelay::Fitted(0.0, 0.01);
        let record = WeightsRecord { delay, ..WeightsRecord::of(drive, u, 3) };
        with_fit(record, every, |mut fit| {
            fit.restructure(|fit| {
                fit.begins = vec![Beginning { history: History::Settled, from: 0.0 }];
                fit.times = vec![0.02, 0.3];
            });
            fit.set_poles(if lag.is_empty() { Form::None } else { Form::First }, lag);
            let (layout, own) = (fit.layout(), fit.own(0));
            fit.x[layout.weights()].fill(0.3);
            fit.x[layout.creep_weights()].fill(0.1);
            fit.x[own.delay].fill(3.4e-3);
            fit.motion(0)
        })
    }

    #[test]
    fn the_motion_under_a_held_drive_is_that_of_all_samples() -> Result<()> {
        let levels = [0.0, 60.0, 20.0, 21.0, 90.0, 40.0];
        let u: Vec<f64> = (0..600).map(|k| levels[k / 7 % levels.len()]).collect();
        // Behind creep, the input of a lag is taken to be linear within a step.
        for (lag, most) in [(&[][..], 1e-12), (&[-5.0][..], 0.02)] {
            let (all, some) = (motion(&u, 1, lag)?, motion(&u, 5, lag)?);
            for k in (3..u.len()).step_by(5) {
                assert!((all[k] - some[k]).abs() < most, "{k}: {} and {}", all[k], some[k]);
            }
        }
        Ok(())
    }
}
