//! Searches from several sides of the box: each by differential evolution, then refined.

use piezotrack_control::Controller;

use super::adaptation::Adaptation;
use super::evolution::Evolution;
use super::requirements::Robustness;
use super::run_metrics::RunMetrics;
use super::settings::{Setting, Settings};
use crate::parts::Law;

/// A candidate and what was found of it.
#[derive(Clone, Debug)]
pub(super) struct Tried {
    pub(super) settings: Vec<Settings>,
    pub(super) controllers: Option<Vec<Controller<Law>>>,
    pub(super) robustness: Option<Robustness>,
    pub(super) figures: Vec<RunMetrics>,
    pub(super) excess: f64,
    pub(super) cost: f64,
}

impl Tried {
    /// Rank that a search makes small: any that keeps what is required comes before any that does
    /// not, and one that keeps the margins before one that does not.
    pub(super) fn rank(&self) -> f64 {
        let rank = match (self.excess <= 1.0, self.figures.is_empty()) {
            (true, _) => self.cost,
            (false, false) => 1e6 * self.excess,
            (false, true) => 1e12 * self.excess,
        };
        if rank.is_nan() { f64::INFINITY } else { rank }
    }
}

/// Where a search begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// With a low-pass slower than the loop, which with the derivative is another structure.
    Slow,
    /// With a faster low-pass and a feedback that does most of the work.
    Fast,
    /// As [`Side::Fast`], at the places given, and without the observer about a law.
    Inside,
    /// With a repetitive part that is ahead and does most of the work; as [`Side::Slow`] without one.
    Ahead,
    /// With the best of all searches before, and places in the whole box.
    Joint,
}

/// Sides of the searches, and their budgets as multiples of that of the first; those of the second
/// round are taken where none of the first agree.
pub(super) const ROUNDS: [(&[Side], usize); 3] = [
    (&[Side::Slow, Side::Fast, Side::Inside, Side::Ahead], 1),
    (&[Side::Fast, Side::Ahead], 2),
    (&[Side::Joint], 3),
];

/// Searches that end within this share of the best one agree with it.
const AGREE: f64 = 0.02;

/// A refinement that after so many candidates is so much worse than the best search ends.
const BEHIND: (usize, f64) = (800, 1.5);

/// First step of a refinement, as a share of the box.
const ABOUT: f64 = 0.1;

impl Side {
    /// Part of the range in which a setting begins.
    fn part(self, setting: Setting, learns: bool) -> (f64, f64) {
        match (self, setting) {
            (Self::Ahead, Setting::Integral) if learns => (0.0, 0.5),
            (Self::Ahead, Setting::Learning | Setting::Lead) if learns => (0.5, 1.0),
            (Self::Ahead, Setting::Cutoff) if learns => (0.26, 1.0),
            (Self::Slow | Self::Ahead, Setting::Cutoff) => (0.0, 0.26),
            (Self::Fast, Setting::Cutoff) => (0.26, 1.0),
            (Self::Fast | Self::Inside, Setting::Learning) => (0.0, 0.3),
            (Self::Fast | Self::Inside, Setting::Integral) => (0.5, 1.0),
            // It does not evolve from there; its refinement has it.
            (Self::Inside, Setting::Observer) => (0.0, 0.0),
            _ => (0.0, 1.0),
        }
    }
}

/// Phase of a search.
enum Phase {
    Evolving(Evolution),
    Refining(Adaptation),
    Ended,
}

/// One search.
pub(super) struct Run {
    side: Side,
    address: (u64, u64),
    phase: Phase,
    refined: usize,
    pub(super) best: Option<(Vec<f64>, Tried)>,
}

impl Run {
    /// From a side, with settings of these names, beginning with `members` places, of which some are
    /// given: it evolves for `budget` candidates, and is refined for as many.
    pub(super) fn new(
        side: Side,
        address: (u64, u64),
        settings: &[Setting],
        starts: &[Vec<f64>],
        (members, budget): (usize, usize),
    ) -> Self {
        let learns = settings.contains(&Setting::Learning);
        let part: Vec<(f64, f64)> = settings.iter().map(|one| side.part(*one, learns)).collect();
        let evolution = Evolution::new(address, &part, starts, members, budget);
        Self { side, address, phase: Phase::Evolving(evolution), refined: budget, best: None }
    }

    /// Places whose ranks it needs now.
    pub(super) fn pending(&self) -> Vec<Vec<f64>> {
        match &self.phase {
            Phase::Evolving(one) => one.pending().cloned().collect(),
            Phase::Refining(one) => one.pending().cloned().collect(),
            Phase::Ended => Vec::new(),
        }
    }

    /// Takes what was found of the places that were pending.
    pub(super) fn tell(&mut self, places: &[Vec<f64>], tried: &[Tried]) {
        let ranks: Vec<f64> = tried.iter().map(Tried::rank).collect();
        for (place, one) in places.iter().zip(tried) {
            if self.best.as_ref().is_none_or(|(_, best)| one.rank() < best.rank()) {
                self.best = Some((place.clone(), one.clone()));
            }
        }
        match &mut self.phase {
            Phase::Evolving(one) => one.tell(&ranks),
            Phase::Refining(one) => one.tell(&ranks),
            Phase::Ended => {}
        }
        let ended = match &self.phase {
            Phase::Evolving(one) => one.ended(),
            Phase::Refining(one) => one.ended(),
            Phase::Ended => false,
        };
        if ended {
            self.phase = match (&self.phase, &self.best) {
                (Phase::Evolving(_), Some((place, _))) => {
                    Phase::Refining(Adaptation::new(self.address, place, ABOUT, self.refined))
                }
                _ => Phase::Ended,
            };
        }
    }

    /// Ends where it is far behind the best of all searches.
    pub(super) fn give_up(&mut self, best: f64) {
        let (candidates, factor) = BEHIND;
        if let Phase::Refining(one) = &self.phase
            && one.evaluated() >= candidates
            && self.rank() > factor * best
        {
            self.phase = Phase::Ended;
        }
    }

    /// Rank of its best.
    pub(super) fn rank(&self) -> f64 {
        self.best.as_ref().map_or(f64::INFINITY, |(_, one)| one.rank())
    }
}

/// By how much the best of each independent search is above the best of all, as a share of that, the
/// least first; infinite where a search keeps not what is required, and the best does.
pub(super) fn spread(runs: &[Run]) -> Vec<f64> {
    let best = runs.iter().map(Run::rank).fold(f64::INFINITY, f64::min);
    let kept = |run: &Run| run.best.as_ref().is_some_and(|(_, one)| one.excess <= 1.0);
    let any = runs.iter().any(kept);
    let independent = runs.iter().filter(|run| run.side != Side::Joint);
    let above = |run: &Run| if kept(run) == any { run.rank() / best - 1.0 } else { f64::INFINITY };
    let mut shares: Vec<f64> = independent.map(above).collect();
    shares.sort_by(f64::total_cmp);
    shares
}

/// How many independent searches there are, and how many of them end within 2 % of the best.
pub(super) fn agreeing(runs: &[Run]) -> (usize, usize) {
    let best = runs.iter().map(Run::rank).fold(f64::INFINITY, f64::min);
    let independent = || runs.iter().filter(|run| run.side != Side::Joint);
    let agree = independent().filter(|run| run.rank() <= best * (1.0 + AGREE));
    (independent().count(), agree.count())
}
