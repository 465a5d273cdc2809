//! Repetitive parts in lanes, whose lines have entries and taps at the same places.

use super::TAPS;
use super::sampled::{RepetitiveState, SampledRepetitive};
use super::saturation::{Learning, Lengths, Saturation};
use crate::number::{Number, Real};

/// A state that may have that of a repetitive part.
pub(crate) trait Learner<L, T> {
    fn part(&self) -> Option<&RepetitiveState<L, T>>;
    fn part_mut(&mut self) -> Option<&mut RepetitiveState<L, T>>;
}

/// Repetitive parts in lanes, as long as all of them learn; their counts of clipped samples stay with
/// the states of each.
#[derive(Debug)]
pub(crate) struct LanedRepetitive<'a, N: Number> {
    part: SampledRepetitive<N>,
    lengths: Lengths<N::Lane>,
    /// Largest voltage, V.
    most: N,
    line: &'a mut [N],
    next: usize,
    /// The last output, V.
    volts: N,
    /// Samples that the counts of the states lack.
    passed: u32,
}

impl<'a, N: Number> LanedRepetitive<'a, N> {
    /// Parts in lanes of numbers like `like`, each with the largest voltage (V) of its output; `None`
    /// where a lane has none, their lines differ in shape, or `line` is too short for one of them.
    pub(crate) fn new(
        like: N,
        of: impl Fn(usize) -> Option<(SampledRepetitive<N::Lane>, N::Lane)>,
        line: &'a mut [N],
    ) -> Option<Self> {
        let (first, _) = of(0)?;
        let mut alike = true;
        let most = like.by_lane(|lane| {
            let found = of(lane);
            alike = alike && found.is_some_and(|(part, _)| first.is_shaped_like(&part));
            found.map_or(N::Lane::ZERO, |(_, most)| most)
        });
        let line = line.get_mut(..first.length()).filter(|_| alike)?;
        let part = |lane: usize| of(lane).map_or(first, |(part, _)| part);
        let mut taps = [like.like(0.0); TAPS];
        for (i, tap) in taps.iter_mut().enumerate() {
            *tap = like.by_lane(|lane| part(lane).taps[i]);
        }
        let Lengths { period, rest, whole, entries } = first.lengths;
        let part = SampledRepetitive {
            lengths: Lengths { period, rest: like.each(rest), whole, entries },
            pole: like.by_lane(|lane| part(lane).pole),
            gain: like.by_lane(|lane| part(lane).gain),
            pause: first.pause,
            lead: first.lead,
            nearest: first.nearest,
            taps,
            reads: first.reads,
            entries: first.entries,
            unread: first.unread,
        };
        let volts = like.like(0.0);
        Some(Self { part, lengths: first.lengths, most, line, next: 0, volts, passed: 0 })
    }

    /// Reads the states, those of the last for the lanes that are left; false where they cannot go
    /// on in lanes.
    pub(crate) fn load<L: AsRef<[N::Lane]>, S: Learner<L, N::Lane>>(
        &mut self,
        states: &[S],
    ) -> bool {
        let at = |lane: usize| states.get(lane).or(states.last()).and_then(S::part);
        let Some(first) = at(0) else { return false };
        (self.next, self.passed) = (first.next, 0);
        let mut learn = true;
        let most = self.volts.each(N::Lane::HUGE);
        self.volts = self.volts.by_lane(|lane| {
            let Some(state) = at(lane) else { return N::Lane::NAN };
            learn = learn && state.next == first.next && state.saturation.learning == Learning::On;
            state.volts
        });
        let mut usable = self.volts.all_within(-most, most);
        if !(learn && usable) {
            return false;
        }
        // As at the start, where reading them lane by lane would take as long as many samples.
        if states.iter().filter_map(S::part).all(|state| is_blank(state.line.as_ref())) {
            self.line.fill(most.like(0.0));
        } else {
            for (i, entry) in self.line.iter_mut().enumerate() {
                *entry = entry.by_lane(|lane| {
                    let found = at(lane).and_then(|state| state.line.as_ref().get(i));
                    found.copied().unwrap_or(N::Lane::NAN)
                });
                usable = usable && entry.all_within(-most, most);
            }
        }
        usable
    }

    /// Writes the states.
    pub(crate) fn settle<L: AsMut<[N::Lane]>, S: Learner<L, N::Lane>>(&mut self, states: &mut [S]) {
        for (lane, state) in states.iter_mut().enumerate() {
            let Some(state) = state.part_mut() else { continue };
            for (entry, slot) in self.line.iter().zip(state.line.as_mut()) {
                *slot = entry.lane(lane);
            }
            (state.next, state.volts) = (self.next, self.volts.lane(lane));
            state.saturation.pass_by(self.passed);
        }
        self.passed = 0;
    }

    /// The voltages for this sample, from the errors of the sample before, and the voltages applied
    /// less the commands; `None`, and nothing is changed, where a lane stops learning.
    #[inline(always)]
    pub(crate) fn step<L, S: Learner<L, N::Lane>>(
        &mut self,
        error: N,
        excess: N,
        states: &mut [S],
    ) -> Option<N> {
        let volts = self.volts;
        let clipped = excess.smaller(-excess);
        let (mut sum, mut learns) = (volts, self.part.gain * error);
        if self.part.pause && clipped.any_negative() {
            if !self.count(clipped, states) {
                return None;
            }
            // As much of the output as takes the command to the limit.
            let zero = volts.like(0.0);
            let (least, most) = (volts.smaller(zero), volts.larger(zero));
            let used = (volts + excess).larger(least).smaller(most);
            sum = clipped.where_negative(used, volts);
            learns = clipped.where_negative(zero, learns);
        } else {
            self.passed = self.passed.saturating_add(1);
        }
        self.part.store(self.line, &mut self.next, [sum, volts], learns);
        let out = self.part.pole * volts + self.part.filtered(self.line, self.next);
        self.volts = out.larger(-self.most).smaller(self.most);
        Some(self.volts)
    }

    /// Counts a sample that is clipped in the lanes below 0; false, and nothing is changed, where one
    /// stops learning.
    #[inline(never)]
    fn count<L, S: Learner<L, N::Lane>>(&mut self, clipped: N, states: &mut [S]) -> bool {
        let after = |lane: usize, saturation: &Saturation<N::Lane>| {
            let mut after = *saturation;
            after.pass_by(self.passed);
            after.follow(clipped.lane(lane) < N::Lane::ZERO, &self.lengths);
            after
        };
        let mut learn = true;
        for (lane, state) in states.iter_mut().enumerate() {
            if let Some(state) = state.part_mut() {
                learn = learn && after(lane, &state.saturation).learning == Learning::On;
            }
        }
        if learn {
            for (lane, state) in states.iter_mut().enumerate() {
                if let Some(state) = state.part_mut() {
                    state.saturation = after(lane, &state.saturation);
                }
            }
            self.passed = 0;
        }
        learn
    }
}

/// Whether all entries are +0.
fn is_blank<T: Real>(entries: &[T]) -> bool {
    // Counted to the end, so that several are compared at once.
    let blank = |entry: &&T| **entry == T::ZERO && !entry.is_sign_negative();
    entries.iter().filter(blank).count() == entries.len()
}
