//! Differential evolution that adapts itself to what it meets, of a population that shrinks.
//!
//! L-SHADE: Tanabe and Fukunaga 2014, doi 10.1109/CEC.2014.6900380, with trials by
//! current-to-pbest/1/bin (Zhang and Sanderson 2009, doi 10.1109/TEVC.2009.2014613).

use crate::math::Draws;
use crate::signal::index;

/// Remembered means of both factors.
const REMEMBERED: usize = 6;
/// Share of the population that counts as its best.
const BEST: f64 = 0.11;
/// Beaten places that are kept, as a multiple of the population.
const ARCHIVED: usize = 2;
/// Members at the end.
const LEAST: usize = 6;

/// A place and its rank, the lower the better.
#[derive(Clone, Debug)]
struct Member {
    place: Vec<f64>,
    rank: f64,
}

/// A trial: its place, and the factors that it was made with.
#[derive(Clone, Debug)]
struct Trial {
    place: Vec<f64>,
    scale: f64,
    crossover: f64,
}

/// The population and what it has learnt.
#[derive(Clone, Debug)]
pub(super) struct Evolution {
    seed: u64,
    run: u64,
    first: usize,
    budget: usize,
    evaluated: usize,
    generation: u64,
    members: Vec<Member>,
    trials: Vec<Trial>,
    archive: Vec<Vec<f64>>,
    scales: [f64; REMEMBERED],
    crossovers: [f64; REMEMBERED],
    slot: usize,
}

impl Evolution {
    /// A population that begins evenly in a part of the unit box, but for the places in `starts`.
    pub(super) fn new(
        (seed, run): (u64, u64),
        part: &[(f64, f64)],
        starts: &[Vec<f64>],
        members: usize,
        budget: usize,
    ) -> Self {
        let mut places = latin(seed, run, part, members);
        for (place, start) in places.iter_mut().zip(starts) {
            place.clone_from(start);
        }
        let trial = |place| Trial { place, scale: 0.5, crossover: 0.5 };
        Self {
            seed,
            run,
            first: members,
            budget,
            evaluated: 0,
            generation: 0,
            members: Vec::new(),
            trials: places.into_iter().map(trial).collect(),
            archive: Vec::new(),
            scales: [0.5; REMEMBERED],
            crossovers: [0.5; REMEMBERED],
            slot: 0,
        }
    }

    /// The places whose ranks it needs now.
    pub(super) fn pending(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.trials.iter().map(|trial| &trial.place)
    }

    /// Whether the budget is used up.
    pub(super) fn ended(&self) -> bool {
        self.evaluated >= self.budget
    }

    /// Takes the ranks of the places that were pending, in their order.
    pub(super) fn tell(&mut self, ranks: &[f64]) {
        let trials = core::mem::take(&mut self.trials);
        self.evaluated += trials.len();
        self.generation += 1;
        if self.members.is_empty() {
            let pairs = trials.into_iter().zip(ranks);
            self.members =
                pairs.map(|(one, rank)| Member { place: one.place, rank: *rank }).collect();
        } else {
            self.select(trials, ranks);
        }
        self.shrink();
        self.trials = self.try_next();
    }

    fn select(&mut self, trials: Vec<Trial>, ranks: &[f64]) {
        // Gain, scale and crossover of those that beat their parents.
        let mut won: Vec<(f64, f64, f64)> = Vec::new();
        for ((member, trial), rank) in self.members.iter_mut().zip(trials).zip(ranks) {
            if *rank < member.rank {
                let gain = (member.rank - rank).min(1e300);
                won.push((gain, trial.scale, trial.crossover));
                self.archive.push(core::mem::replace(&mut member.place, trial.place));
                member.rank = *rank;
            } else if *rank <= member.rank {
                member.place = trial.place;
            }
        }
        if won.is_empty() {
            return;
        }
        // A step from beyond the margins to within is no measure for one within.
        let mut gains: Vec<f64> = won.iter().map(|(gain, ..)| *gain).collect();
        gains.sort_by(f64::total_cmp);
        let most = 10.0 * gains[gains.len() / 2];
        let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            won.iter().map(|(gain, scale, crossover)| gain.min(most) * of(*scale, *crossover)).sum()
        };
        self.scales[self.slot] = sum(&|scale, _| scale * scale) / sum(&|scale, _| scale);
        let crossed = sum(&|_, crossover| crossover);
        let remembered = &mut self.crossovers[self.slot];
        *remembered = if *remembered < 0.0 || crossed <= 0.0 {
            -1.0
        } else {
            sum(&|_, crossover| crossover * crossover) / crossed
        };
        self.slot = (self.slot + 1) % REMEMBERED;
    }

    fn shrink(&mut self) {
        let (first, least) = (index(self.first), index(LEAST.min(self.first)));
        let left = 1.0 - index(self.evaluated) / index(self.budget);
        let wanted = whole(least + (first - least) * left.max(0.0));
        if wanted < self.members.len() {
            let mut ranks: Vec<f64> = self.members.iter().map(|one| one.rank).collect();
            ranks.sort_by(f64::total_cmp);
            let last = ranks[wanted - 1];
            let mut room = wanted;
            self.members.retain(|one| {
                let stays = one.rank <= last && room > 0;
                room -= usize::from(stays);
                stays
            });
        }
        let most = ARCHIVED * self.members.len();
        let mut draws =
            Draws::at(self.seed, self.run, self.generation, self.most(), self.most() + 1);
        while self.archive.len() > most {
            self.archive.swap_remove(draws.below(self.archive.len()));
        }
    }

    fn most(&self) -> u64 {
        self.first as u64
    }

    fn try_next(&self) -> Vec<Trial> {
        let members = &self.members;
        let count = members.len();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| members[*a].rank.total_cmp(&members[*b].rank));
        let best = whole(BEST * index(count)).max(2).min(count);
        let others = count + self.archive.len();
        let place = |i: usize| if i < count { &members[i].place } else { &self.archive[i - count] };
        let make = |i: usize| {
            let number = i as u64;
            let mut draws =
                Draws::at(self.seed, self.run, self.generation, number, self.most() + 1);
            let slot = draws.below(REMEMBERED);
            let crossover = if self.crossovers[slot] < 0.0 {
                0.0
            } else {
                (self.crossovers[slot] + 0.1 * draws.normals(1)[0]).clamp(0.0, 1.0)
            };
            let mut scale = 0.0;
            while scale <= 0.0 {
                let turn = core::f64::consts::PI * (draws.uniform() - 0.5);
                scale = (self.scales[slot] + 0.1 * libm::tan(turn)).min(1.0);
            }
            let towards = &members[order[draws.below(best)]].place;
            let one = (i + 1 + draws.below(count - 1)) % count;
            let mut other = draws.below(others);
            while other == i || other == one {
                other = (other + 1) % others;
            }
            let (own, one, other) = (place(i), place(one), place(other));
            let certain = draws.below(own.len());
            let coordinate = |j: usize| {
                if draws.uniform() >= crossover && j != certain {
                    return own[j];
                }
                let moved = own[j] + scale * (towards[j] - own[j]) + scale * (one[j] - other[j]);
                // Half-way to the end that it is beyond.
                if moved < 0.0 {
                    0.5 * own[j]
                } else if moved > 1.0 {
                    0.5 * (own[j] + 1.0)
                } else {
                    moved
                }
            };
            Trial { place: (0..own.len()).map(coordinate).collect(), scale, crossover }
        };
        (0..count).map(make).collect()
    }
}

/// Places of which each coordinate visits every one of as many equal parts once: `McKay`, Beckman
/// and Conover 1979, doi 10.1080/00401706.1979.10489755.
fn latin(seed: u64, run: u64, part: &[(f64, f64)], count: usize) -> Vec<Vec<f64>> {
    let drawn: Vec<Vec<(f64, f64)>> = (0..count as u64)
        .map(|i| {
            let mut draws = Draws::at(seed, run, 0, i, count as u64 + 1);
            part.iter().map(|_| (draws.uniform(), draws.uniform())).collect()
        })
        .collect();
    let mut places = vec![vec![0.0; part.len()]; count];
    for (j, (low, high)) in part.iter().enumerate() {
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| drawn[*a][j].0.total_cmp(&drawn[*b][j].0));
        for (k, i) in order.into_iter().enumerate() {
            places[i][j] = low + (high - low) * (index(k) + drawn[i][j].1) / index(count);
        }
    }
    places
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn whole(value: f64) -> usize {
    libm::round(value) as usize
}
