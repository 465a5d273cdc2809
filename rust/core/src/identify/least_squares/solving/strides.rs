//! Samples of a record at which its motion is computed, and the steps between them.

use super::fit::Fit;
use super::judged::Reading;
use super::late::Late;
use crate::models::{Relaxation, RelaxationFlow};
use crate::signal::{Hold, index};

/// Samples of a record at which its motion is computed: all of them, or, of a held drive of which
/// not all are judged, these, those at which they are read, those at which the drive changes,
/// and the last. Between these, one step is exact.
pub(super) struct Strides {
    places: Vec<usize>,
    /// Different lengths of the steps, in intervals, in order; and which of them leads to each place.
    gaps: Vec<usize>,
    steps: Vec<usize>,
}

impl Strides {
    /// Those of record `r` before sample `end`.
    pub fn of(fit: &Fit<'_>, r: usize, end: usize) -> Self {
        let record = &fit.common.records[r];
        let steps = fit.judged[r].steps(end).filter(|_| record.drive.hold == Hold::Zero);
        let Some(steps) = steps else {
            return Self { places: (0..end).collect(), gaps: vec![1], steps: vec![0; end] };
        };
        // Also in the warm-up and where readings are left out, or a step would be of any length.
        let mut places = steps.to_vec();
        places.extend(end.checked_sub(1));
        let late = Late::new(fit.delay(r), record.drive.dt);
        let read_late = !late.is_none() || !fit.own(r).delay.is_empty();
        // A part of the window may begin between two steps.
        for &Reading { place, .. } in fit.judged(r) {
            places.push(place);
            if read_late {
                places.extend(<[usize; 2]>::from(late.between(place)));
            }
        }
        places.sort_unstable();
        places.dedup();
        let between = |i: usize| if i == 0 { 1 } else { places[i] - places[i - 1] };
        let each: Vec<usize> = (0..places.len()).map(between).collect();
        let mut gaps = each.clone();
        gaps.sort_unstable();
        gaps.dedup();
        let steps = each.iter().map(|gap| gaps.partition_point(|other| other < gap)).collect();
        Self { places, gaps, steps }
    }

    /// The samples, in order.
    pub fn places(&self) -> &[usize] {
        &self.places
    }

    /// Different lengths of the steps, in intervals.
    pub fn gaps(&self) -> &[usize] {
        &self.gaps
    }

    /// Which of these is the step to a place of [`Self::places`].
    pub fn step(&self, place: usize) -> usize {
        self.steps[place]
    }
}

/// A part of the stage with its steps.
pub(super) struct Stepped {
    pub part: Relaxation,
    flows: Vec<RelaxationFlow>,
}

impl Stepped {
    /// With steps of so many intervals of `dt` seconds each.
    pub fn new(part: Relaxation, dt: f64, gaps: &[usize]) -> Self {
        let flows = gaps.iter().map(|gap| part.flow(dt * index(*gap))).collect();
        Self { part, flows }
    }

    /// The step of one of these lengths, by its place among them.
    #[inline(always)]
    pub fn over(&self, length: usize) -> &RelaxationFlow {
        &self.flows[length]
    }
}

#[cfg(test)]
mod tests {
    use super::Strides;
    use crate::error::{Error, Result};
    use crate::identify::least_squares::common::Common;
    use crate::identify::least_squares::solving::fit::{Beginning, Fit};
    use crate::identify::least_squares::solving::form::Form;
    use crate::identify::least_squares::solving::judged::Judged;
    use crate::identify::least_squares::weights_record::{WeightsDelay, WeightsRecord};
    use crate::identify::records::history::History;
    use crate::models::Model;
    use crate::signal::{Drive, Hold, NEVER};

    /// A record of plays under a held drive, of which about so many samples are judged.
    fn with_fit<T>(
        record: WeightsRecord<'_>,
        most: usize,
        of: impl FnOnce(Fit<'_>) -> Result<T>,
    ) -> Result<T> {
        let model = Model::named("prandtl-ishlinskii")?;
        let plays = model.superposition().ok_or_else(|| Error::Data("no plays".into()))?;
        let common = Common::new((model, plays), vec![record], false, NEVER);
        of(Fit { judged: vec![Judged::thinned(&record, most)], ..Fit::new(&common, &[2.0, 10.0]) })
    }

    #[test]
    fn no_step_is_longer_than_from_one_judged_sample_to_the_next() -> Result<()> {
        let (u, left_out) = ([1.0; 500], [true; 500]);
        let drive = Drive { u: &u, dt: 1e-3, hold: Hold::Zero };
        let record = WeightsRecord { left_out: &left_out, ..WeightsRecord::of(drive, &u, 207) };
        let gaps = with_fit(record, 60, |fit| Ok(Strides::of(&fit, 0, u.len()).gaps().to_vec()))?;
        assert!(gaps.iter().all(|gap| *gap <= 8), "{gaps:?}");
        Ok(())
    }

    /// Motion of plays that creep, read late or in time, and the samples from one on, of about so
    /// many of all, that are judged.
    fn motion(
        u: &[f64],
        (most, begin): (usize, usize),
        lag: &[f64],
        late: bool,
    ) -> Result<(Vec<f64>, Vec<usize>)> {
        let drive = Drive { u, dt: 1e-3, hold: Hold::Zero };
        let in_time = WeightsDelay::Known(0.0);
        let delay = if late { WeightsDelay::Fitted(0.0, 0.01) } else { in_time };
        let record = WeightsRecord { delay, ..WeightsRecord::of(drive, u, 3) };
        with_fit(record, most, |mut fit| {
            fit.restructure(|fit| {
                fit.begins = vec![Beginning { history: History::Settled, from: 0.0 }];
                fit.times = vec![0.02, 0.3];
            });
            fit.set_poles(if lag.is_empty() { Form::None } else { Form::First }, lag);
            let (layout, own) = (fit.layout(), fit.own(0));
            fit.x[layout.weights()].fill(0.3);
            fit.x[layout.creep_weights()].fill(0.1);
            fit.x[own.delay].fill(3.4e-3);
            fit.windows[0].start = begin;
            Ok((fit.motion(0)?, fit.judged(0).map(|one| one.place).collect()))
        })
    }

    #[test]
    fn the_motion_under_a_held_drive_is_that_of_all_samples() -> Result<()> {
        let levels = [0.0, 60.0, 20.0, 21.0, 90.0, 40.0];
        let u: Vec<f64> = (0..600).map(|k| levels[k / 7 % levels.len()]).collect();
        // Behind creep, the input of a lag is taken to be linear within a step.
        for (lag, most) in [(&[][..], 1e-12), (&[-5.0][..], 0.02)] {
            for (begin, late) in [(3, true), (3, false), (404, false)] {
                let (all, _) = motion(&u, (600, begin), lag, late)?;
                let (some, judged) = motion(&u, (120, begin), lag, late)?;
                assert!((30..=120).contains(&judged.len()));
                for k in judged {
                    assert!((all[k] - some[k]).abs() < most, "{k}: {} and {}", all[k], some[k]);
                }
            }
        }
        Ok(())
    }
}
