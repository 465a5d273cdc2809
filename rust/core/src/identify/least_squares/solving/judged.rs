//! Samples of a record that are judged.

use std::sync::Arc;

use crate::identify::least_squares::weights_record::WeightsRecord;

/// Samples since the drive last changed for each by which the next one that is judged is further
/// away: what a stage does after a change slows down as it fades, in creep as the logarithm of time.
const SINCE_CHANGE: usize = 50;

/// Samples of a record that are judged, each in place of those up to the next one.
///
/// Those before the window are where a step of the motion ends.
#[derive(Clone, Debug)]
pub(in crate::identify::least_squares) struct Judged {
    places: Arc<[usize]>,
    /// These, and the samples at which the drive changes.
    steps: Arc<[usize]>,
    end: usize,
}

impl Judged {
    /// All samples.
    pub fn all(record: &WeightsRecord<'_>) -> Self {
        let end = record.y.len();
        let places: Arc<[usize]> = (0..end).collect();
        Self { steps: places.clone(), places, end }
    }

    /// About so many of the window at most: every so many, and fewer the longer the drive has stayed.
    pub fn thinned(record: &WeightsRecord<'_>, most: usize) -> Self {
        let of = |every| Self::every(record, every);
        let mut every = 1;
        let mut judged = of(every);
        while judged.count(record.start) > most {
            every = (every + 1).max(every * judged.count(record.start) / most);
            judged = of(every);
        }
        judged
    }

    fn every(record: &WeightsRecord<'_>, every: usize) -> Self {
        let end = record.y.len();
        let (mut places, mut steps) = (Vec::new(), Vec::new());
        let (mut place, mut changed) = (0, 0);
        while place < end {
            places.push(place);
            steps.push(place);
            let longest = even((place - changed) / SINCE_CHANGE).max(every);
            let mut next = place;
            loop {
                next += 1;
                // The reading at a change is the last one before what follows from it.
                if next < end && record.changes(next) {
                    changed = next;
                }
                let moved = changed > place && next >= place + every;
                if moved || next == place + longest || next == record.start {
                    break;
                }
                if changed == next {
                    steps.push(next);
                }
            }
            place = next;
        }
        Self { places: places.into(), steps: steps.into(), end }
    }

    /// Samples of a window that begins at `start`.
    fn count(&self, start: usize) -> usize {
        self.places.len() - self.places.partition_point(|place| *place < start)
    }

    /// Whether all samples are judged.
    pub fn is_all(&self) -> bool {
        self.places.len() == self.end
    }

    /// The samples before `end`, those before the window too, and those at which the drive changes.
    pub fn steps(&self, end: usize) -> &[usize] {
        &self.steps[..self.steps.partition_point(|step| *step < end)]
    }

    /// The samples from one to before another, and how many each is in place of.
    pub fn within(&self, from: usize, to: usize) -> impl Iterator<Item = (usize, usize)> {
        let first = self.places.partition_point(|place| *place < from);
        let last = self.places.partition_point(|place| *place < to);
        (first..last).map(|i| {
            let next = self.places.get(i + 1).copied().unwrap_or(self.end);
            (self.places[i], next - self.places[i])
        })
    }
}

/// A number with two digits that are not 0 in binary: few different steps.
fn even(number: usize) -> usize {
    let digits = usize::BITS - number.leading_zeros();
    let shift = digits.saturating_sub(2);
    number >> shift << shift
}

#[cfg(test)]
mod tests {
    use super::{Judged, even};
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
        let shares: Vec<_> = judged.within(207, 1000).collect();
        assert_eq!(shares[0].0, 207);
        assert!(shares.len() <= 200);
        assert!(shares.iter().rev().skip(1).all(|(_, share)| *share == shares[0].1));
        assert_eq!(shares.iter().map(|(_, share)| share).sum::<usize>(), 793);
    }

    #[test]
    fn a_drive_that_stays_is_judged_most_often_after_it_has_changed() {
        let levels = [0.0, 50.0, 20.0];
        let u: Vec<f64> = (0..9000).map(|k| levels[k / 3000]).collect();
        let judged = judged(&u, 0, 2000);
        for jump in [3000, 6000] {
            let shares: Vec<_> = judged.within(jump, jump + 3000).collect();
            assert!(shares.iter().take(50).enumerate().all(|(i, one)| *one == (jump + i, 1)));
            assert!(shares.windows(2).rev().skip(1).all(|pair| pair[0].1 <= pair[1].1));
            assert!(shares.len() < 400 && shares.iter().map(|one| one.1).sum::<usize>() == 3000);
        }
    }

    #[test]
    fn steps_are_of_few_lengths() {
        let lengths: Vec<usize> = (0..20).map(even).collect();
        assert_eq!(lengths, [0, 1, 2, 3, 4, 4, 6, 6, 8, 8, 8, 8, 12, 12, 12, 12, 16, 16, 16, 16]);
    }
}
