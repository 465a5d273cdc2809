//! The swarm between two evaluations: it asks for costs and is told them.

use super::particle::{Best, Particle};
use super::settings::{SwarmSettings, Topology, Update};
use super::topology::{Links, leaders};
use crate::error::{Error, Result};
use crate::math::Draws;

/// A swarm between two evaluations.
#[derive(Clone, Debug)]
pub struct Swarm {
    settings: SwarmSettings,
    seed: u64,
    run: u64,
    iteration: usize,
    stalled: usize,
    particles: Vec<Particle>,
    best: Best,
    links: Links,
}

impl Swarm {
    /// A swarm spread evenly over the unit box, each particle with the velocity that would take
    /// it to a second random place, or half of it where the update is the classic one.
    ///
    /// # Errors
    /// [`Error::Parameter`] where a setting or the number of coordinates cannot be used.
    pub fn new(settings: SwarmSettings, coordinates: usize, seed: u64, run: u64) -> Result<Self> {
        settings.validate()?;
        if coordinates == 0 || coordinates > 32 {
            return Err(Error::parameter("coordinates", coordinates, "1 to 32"));
        }
        let count = settings.particles as u64;
        let share = match settings.update {
            Update::Classic => 0.5,
            Update::Hypersphere | Update::HypersphereRadial => 1.0,
        };
        let limit = settings.velocity_limit;
        let particles = (0..count)
            .map(|i| {
                let mut draws = Draws::at(seed, run, 0, i, count);
                let place: Vec<f64> = (0..coordinates).map(|_| draws.uniform()).collect();
                let velocity = place
                    .iter()
                    .map(|x| (share * (draws.uniform() - x)).clamp(-limit, limit))
                    .collect();
                let best = Best { place: place.clone(), cost: f64::INFINITY };
                Particle { place, velocity, best }
            })
            .collect::<Vec<_>>();
        let best = Best { place: vec![0.5; coordinates], cost: f64::INFINITY };
        let links = Links::draw(seed, run, 0, settings.particles);
        Ok(Self { settings, seed, run, iteration: 0, stalled: 0, particles, best, links })
    }

    /// The places to evaluate, one a particle; `None` for one that is outside and invisible.
    pub fn ask(&self) -> impl Iterator<Item = Option<&[f64]>> {
        self.particles.iter().map(|particle| {
            let inside = particle.place.iter().all(|x| (0.0..=1.0).contains(x));
            inside.then_some(particle.place.as_slice())
        })
    }

    /// The cost of each place asked for beyond which it changes nothing: its particle's best.
    pub fn limits(&self) -> impl Iterator<Item = f64> {
        self.particles.iter().map(|particle| particle.best.cost)
    }

    /// Takes the costs of the places asked for, and moves the particles on.
    ///
    /// A cost that is not a number counts as infinite. A particle beyond the end of `costs`
    /// keeps its best.
    pub fn tell(&mut self, costs: &[f64]) {
        let before = self.best.cost;
        for (particle, &cost) in self.particles.iter_mut().zip(costs) {
            if cost < particle.best.cost {
                particle.best = Best { place: particle.place.clone(), cost };
            }
            if cost < self.best.cost {
                self.best = Best { place: particle.place.clone(), cost };
            }
        }
        // From infinity to infinity the difference is NaN: a stall.
        let improvement = before - self.best.cost;
        let improved = improvement > 0.0 && improvement >= self.settings.min_improvement;
        self.stalled = if improved { 0 } else { self.stalled + 1 };
        self.iteration += 1;
        if self.settings.topology == Topology::Random && self.best.cost >= before {
            let count = self.settings.particles;
            self.links = Links::draw(self.seed, self.run, self.iteration, count);
        }
        self.fly();
    }

    /// Moves every particle.
    fn fly(&mut self) {
        let inertia = self.settings.inertia_at(self.iteration);
        let leaders = leaders(self.settings.topology, &self.particles, &self.best, &self.links);
        let (iteration, count) = (self.iteration as u64, self.settings.particles as u64);
        for ((i, particle), leader) in (0..).zip(&mut self.particles).zip(&leaders) {
            let mut draws = Draws::at(self.seed, self.run, iteration, i, count);
            particle.fly(&self.settings, inertia, leader, &mut draws);
        }
    }

    /// Iterations done: evaluations of the whole swarm, less the first one.
    #[must_use]
    pub fn iteration(&self) -> usize {
        self.iteration.saturating_sub(1)
    }

    /// The best place so far, in the unit box, and its cost.
    #[must_use]
    pub fn best(&self) -> (&[f64], f64) {
        (&self.best.place, self.best.cost)
    }

    /// Whether all iterations allowed are done.
    #[must_use]
    pub fn exhausted(&self) -> bool {
        self.iteration > self.settings.iterations
    }

    /// Whether the best cost has stalled for as long as the settings allow.
    #[must_use]
    pub fn stalled(&self) -> bool {
        self.stalled >= self.settings.stall_iterations
    }
}
