//! Samples of a record that are judged.

use core::ops::Range;
use std::sync::Arc;

use crate::identify::least_squares::weights_record::WeightsRecord;
use crate::signal::{index, sample_noise};

/// Samples since the drive last changed for each by which the next one that is judged is further
/// away: what a stage does after a change slows down as it fades, in creep as the logarithm of time.
const SINCE_CHANGE: usize = 50;

/// Variance of the readings about their mean, relative to that of the noise, from which on the stage
/// still rings: each is judged alone.
const RINGS: f64 = 4.0;

/// A reading, in place of those up to the next one that is judged.
#[derive(Clone, Copy, Debug)]
pub(in crate::identify::least_squares) struct Reading {
    pub place: usize,
    /// How many samples it is in place of.
    pub share: f64,
    /// Displacement, m: of those since which the drive has stayed for long, the mean.
    pub y: f64,
    /// Sum of the squares of the deviations from that mean, m^2.
    pub scatter: f64,
}

/// Samples of a record that are judged.
#[derive(Clone, Debug)]
pub(in crate::identify::least_squares) struct Judged {
    readings: Arc<[Reading]>,
    /// Every how many of these are judged, from the begin of a window on.
    every: usize,
    /// Their samples, those before the window and left out too, and those at which the drive changes;
    /// `None` for all.
    steps: Option<Arc<[usize]>>,
}

impl Judged {
    /// All samples.
    pub fn all(record: &WeightsRecord<'_>) -> Self {
        Self { readings: each(record, 1.0), every: 1, steps: None }
    }

    /// About so many of the window at most: every so many, and fewer the longer the drive has stayed.
    pub fn thinned(record: &WeightsRecord<'_>, most: usize) -> Self {
        let noise = sample_noise(&record.y[record.start..]);
        let mut every = 1;
        loop {
            let judged = Self::every(record, every, noise);
            let count = judged.within(&(record.start..record.y.len())).count();
            if count <= most {
                return judged;
            }
            every = (every + 1).max(every * count / most);
        }
    }

    fn every(record: &WeightsRecord<'_>, every: usize, noise: f64) -> Self {
        let end = record.y.len();
        let (mut readings, mut steps, mut moves) = (Vec::new(), Vec::new(), true);
        let (mut begin, mut changed) = (0, 0);
        while begin < end {
            let longest = even((begin - changed) / SINCE_CHANGE).max(every);
            let mut next = begin;
            let mut changes = Vec::new();
            loop {
                next += 1;
                // The reading at a change is the last one before what follows from it.
                if next < end && record.changes(next) {
                    changed = next;
                }
                let moved = changed > begin && next >= begin + every;
                if moved || next == begin + longest || next == record.start || next == end {
                    break;
                }
                if changed == next {
                    changes.push(next);
                }
            }
            let stays = longest > every && changes.is_empty();
            moves &= !stays;
            let (place, samples) = if stays {
                (begin + (next - begin) / 2, begin..next)
            } else {
                (begin, begin..begin + 1)
            };
            let read = mean(record, place, samples.clone());
            if read.is_some_and(|one| one.scatter > RINGS * noise * noise * (one.share - 1.0)) {
                readings.extend(samples.clone().filter_map(|k| mean(record, k, k..k + 1)));
                steps.extend(samples);
            } else {
                let share = index(next - begin) / index(samples.len());
                readings.extend(read.map(|one| Reading { share: share * one.share, ..one }));
                steps.push(place);
            }
            steps.append(&mut changes);
            begin = next;
        }
        if moves {
            let steps = (every > 1).then(|| steps.into());
            return Self { readings: each(record, index(every)), every, steps };
        }
        Self { readings: readings.into(), every: 1, steps: Some(steps.into()) }
    }

    /// Whether the drive stays for long.
    pub fn stays(&self) -> bool {
        self.every == 1 && self.steps.is_some()
    }

    /// The samples before `end` at which the motion is needed; `None` for all.
    pub fn steps(&self, end: usize) -> Option<&[usize]> {
        self.steps.as_ref().map(|steps| &steps[..steps.partition_point(|step| *step < end)])
    }

    /// The readings of a part of the record.
    pub fn within(&self, part: &Range<usize>) -> impl Iterator<Item = &Reading> + Clone {
        let readings = &self.readings[self.before(part.start)..self.before(part.end)];
        readings.iter().step_by(self.every).filter(|one| one.share > 0.0)
    }

    fn before(&self, end: usize) -> usize {
        self.readings.partition_point(|one| one.place < end)
    }
}

/// Readings of all samples; those left out are in place of none.
fn each(record: &WeightsRecord<'_>, share: f64) -> Arc<[Reading]> {
    let share = |place: usize| if record.counts(place) { share } else { 0.0 };
    let places = record.y.iter().enumerate();
    places.map(|(place, &y)| Reading { place, share: share(place), y, scatter: 0.0 }).collect()
}

/// The mean of those of some samples that count, as read at a place; `None` where none does.
fn mean(record: &WeightsRecord<'_>, place: usize, samples: Range<usize>) -> Option<Reading> {
    let counted = || samples.clone().filter(|k| record.counts(*k)).map(|k| record.y[k]);
    let share = index(counted().count());
    let y = if samples.len() == 1 { record.y[place] } else { counted().sum::<f64>() / share };
    let scatter = counted().map(|one| (one - y) * (one - y)).sum();
    (share > 0.0).then_some(Reading { place, share, y, scatter })
}

/// A number with two digits that are not 0 in binary: few different steps.
fn even(number: usize) -> usize {
    let digits = usize::BITS - number.leading_zeros();
    let shift = digits.saturating_sub(2);
    number >> shift << shift
}

#[cfg(test)]
mod tests {
    use super::{Judged, Reading, even};
    use crate::identify::least_squares::weights_record::WeightsRecord;
    use crate::signal::{Drive, Hold, index};

    fn judged(u: &[f64], start: usize, most: usize) -> Judged {
        let drive = Drive { u, dt: 1e-3, hold: Hold::Zero };
        Judged::thinned(&WeightsRecord::of(drive, u, start), most)
    }

    #[test]
    fn a_drive_that_moves_is_judged_at_even_distances_from_the_start_on() {
        let u: Vec<f64> = (0..1000).map(|k| libm::sin(0.1 * index(k))).collect();
        let judged = judged(&u, 207, 200);
        let readings: Vec<_> = judged.within(&(207..1000)).collect();
        assert_eq!(readings[0].place, 207);
        assert!(readings.len() <= 200);
        assert!(readings.windows(2).all(|pair| (pair[1].place - pair[0].place) == 4));
        assert!(
            readings
                .iter()
                .all(|one| one.y.total_cmp(&u[one.place]).is_eq() && one.scatter.abs() < 1e-300)
        );
        assert!(readings.iter().all(|one| (one.share - 4.0).abs() < 1e-9));
    }

    #[test]
    fn a_drive_that_stays_is_judged_most_often_after_it_has_changed() {
        let levels = [0.0, 50.0, 20.0];
        let u: Vec<f64> = (0..9000).map(|k| levels[k / 3000]).collect();
        let judged = judged(&u, 0, 2000);
        for jump in [3000, 6000] {
            let readings: Vec<_> = judged.within(&(jump..jump + 3000)).collect();
            let first = readings.iter().take(50).enumerate();
            assert!(first.into_iter().all(|(i, one)| one.place == jump + i && one.share < 1.5));
            assert!(readings.windows(2).rev().skip(1).all(|pair| pair[0].share <= pair[1].share));
            assert!(readings.len() < 400);
            let sum = readings.iter().map(|one| one.share).sum::<f64>();
            assert!((sum - 3000.0).abs() < 1e-9);
        }
    }

    #[test]
    fn means_have_all_of_the_squares() {
        let u: Vec<f64> = (0..2000).map(|k| if k < 1000 { 0.0 } else { 9.0 }).collect();
        let y: Vec<f64> = (0..2000).map(|k| libm::sin(index(k * k))).collect();
        let left_out: Vec<bool> = (0..2000).map(|k| k % 7 == 0 && k > 1500).collect();
        let drive = Drive { u: &u, dt: 1e-3, hold: Hold::Zero };
        let record = WeightsRecord { left_out: &left_out, ..WeightsRecord::of(drive, &y, 0) };
        let squares = |judged: &Judged| {
            let of = |one: &Reading| one.share * one.y * one.y + one.scatter;
            judged.within(&(0..2000)).map(of).sum::<f64>()
        };
        let (all, some) = (Judged::all(&record), Judged::thinned(&record, 1000));
        assert!(some.within(&(0..2000)).count() < 600);
        // Where one left out is read alone, those up to the next are left out with it.
        assert!((squares(&some) / squares(&all) - 1.0).abs() < 0.01);
    }

    #[test]
    fn what_still_rings_is_judged_sample_by_sample() {
        let u: Vec<f64> = (0..2000).map(|k| if k < 1000 { 0.0 } else { 9.0 }).collect();
        let noise = |k: usize| 0.01 * libm::sin(index(k * k));
        let rings = |k: usize| {
            let since = index(k.saturating_sub(1000));
            u[k] * (1.0 - libm::exp(-since / 100.0) * libm::cos(0.9 * since))
        };
        let y: Vec<f64> = (0..2000).map(|k| rings(k) + noise(k)).collect();
        let drive = Drive { u: &u, dt: 1e-3, hold: Hold::Zero };
        let judged = Judged::thinned(&WeightsRecord::of(drive, &y, 0), 2000);
        assert!(judged.within(&(1000..1400)).all(|one| one.share < 1.5));
        assert!(judged.within(&(1800..2000)).count() < 50);
    }

    #[test]
    fn steps_are_of_few_lengths() {
        let lengths: Vec<usize> = (0..20).map(even).collect();
        assert_eq!(lengths, [0, 1, 2, 3, 4, 4, 6, 6, 8, 8, 8, 8, 12, 12, 12, 12, 16, 16, 16, 16]);
    }
}
