//! Topology: whose best position attracts a particle besides its own.

use super::particle::{Best, Particle};
use super::settings::Topology;
use crate::math::Draws;

/// Particles that one informs, itself aside: K of Clerc 2012, hal-00764996.
const INFORMED: usize = 3;

/// Whom each particle informs, in a random topology.
#[derive(Clone, Debug)]
pub(super) struct Links(Vec<[usize; INFORMED]>);

impl Links {
    /// Links drawn for an iteration; the same particle may be drawn more than once.
    pub(super) fn draw(seed: u64, run: u64, iteration: usize, count: usize) -> Self {
        let drawn = |i| {
            let mut draws = Draws::of_links(seed, run, iteration as u64, i as u64, count as u64);
            core::array::from_fn(|_| draws.below(count))
        };
        Self((0..count).map(drawn).collect())
    }

    /// The best informant of each particle, itself included.
    fn leaders(&self, particles: &[Particle]) -> Vec<usize> {
        let mut leaders: Vec<usize> = (0..particles.len()).collect();
        for (i, informed) in self.0.iter().enumerate() {
            for &j in informed {
                if particles[i].best.cost < particles[leaders[j]].best.cost {
                    leaders[j] = i;
                }
            }
        }
        leaders
    }
}

/// `P_g` of each particle: the best position among its informants.
pub(super) fn leaders(
    topology: Topology,
    particles: &[Particle],
    best: &Best,
    links: &Links,
) -> Vec<Best> {
    let count = particles.len();
    match topology {
        Topology::Global => vec![best.clone(); count],
        Topology::Ring => (0..count)
            .map(|i| {
                [(i + count - 1) % count, i, (i + 1) % count]
                    .map(|j| &particles[j].best)
                    .into_iter()
                    .min_by(|a, b| a.cost.total_cmp(&b.cost))
                    .unwrap_or(best)
                    .clone()
            })
            .collect(),
        Topology::Random => {
            links.leaders(particles).into_iter().map(|j| particles[j].best.clone()).collect()
        }
    }
}
