//! Particle swarm optimisation as ask/tell: no threads, no clock, no data inside.
//!
//! ```text
//! V_i <- w V_i + c1 r1 (P_i - X_i) + c2 r2 (P_g - X_i)     (17)
//! X_i <- X_i + V_i                                         (18)
//! ```
//!
//! Kennedy and Eberhart 1995, doi 10.1109/ICNN.1995.488968, with the settings of Xu and Li
//! 2010, equations (17) and (18), doi 10.1115/1.4001712. Particles live in the unit box: the
//! update does not change under a scaling of the coordinates. r1 and r2 are drawn anew for
//! each particle and coordinate.

use crate::error::{Error, Result, not_negative};
use crate::random::Draws;

/// What becomes of a particle that leaves the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Boundary {
    /// It stops at the wall: coordinate on the bound, its velocity 0.
    Absorb,
    /// It comes back from the wall with its velocity reversed.
    Reflect,
    /// It flies on outside and is not evaluated there; its best places draw it back.
    Invisible,
}

/// Most particles of a swarm: far beyond any use, far below what memory holds.
const MOST_PARTICLES: usize = 100_000;

/// Whose best place draws a particle besides its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topology {
    /// The best of all particles.
    Global,
    /// The best of the particle and its two neighbours on a ring: news travels slowly, so the
    /// swarm looks into several valleys before it settles.
    Ring,
}

/// Settings of the swarm.
#[derive(Clone, Debug, PartialEq)]
pub struct SwarmSettings {
    /// Particles.
    pub particles: usize,
    /// Most iterations after the first evaluation.
    pub iterations: usize,
    /// Inertia w at the first iteration and from `inertia_iterations` on.
    pub inertia: (f64, f64),
    /// Iterations over which the inertia goes linearly from one to the other.
    pub inertia_iterations: usize,
    /// c1, the pull of a particle's own best place.
    pub cognitive: f64,
    /// c2, the pull of the swarm's best place.
    pub social: f64,
    /// Whose best place c2 draws to.
    pub topology: Topology,
    /// Largest velocity of a coordinate, as a fraction of its range; infinite for none.
    pub velocity_limit: f64,
    /// What happens at the bounds.
    pub boundary: Boundary,
    /// Improvement of the best cost, in m, below which an iteration counts as a stall.
    pub min_improvement: f64,
    /// Stalled iterations in a row after which the search stops.
    pub stall_iterations: usize,
    /// Whether the best guess is polished by a descent after the search.
    pub polish: bool,
}

impl SwarmSettings {
    /// Section 3.3 of Xu and Li 2010.
    ///
    /// The paper gives neither a velocity limit nor what happens at the bounds: here a tenth of
    /// the range, and absorbing walls. It gives the improvement of 1e-6 without a unit; it can only
    /// be micrometres.
    #[must_use]
    pub fn xu_li_2010() -> Self {
        Self {
            particles: 10,
            iterations: 2000,
            inertia: (0.9, 0.4),
            inertia_iterations: 500,
            cognitive: 2.0,
            social: 2.0,
            topology: Topology::Global,
            velocity_limit: 0.1,
            boundary: Boundary::Absorb,
            min_improvement: 1e-12,
            stall_iterations: 500,
            polish: false,
        }
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the setting.
    pub fn validate(&self) -> Result<()> {
        let at_least = |name: &str, value: usize, least: usize| {
            if value >= least {
                return Ok(());
            }
            Err(Error::parameter(name, value, format!("{least} or more")))
        };
        at_least("particles", self.particles, 2)?;
        if self.particles > MOST_PARTICLES {
            let expected = format!("{MOST_PARTICLES} at most");
            return Err(Error::parameter("particles", self.particles, expected));
        }
        at_least("iterations", self.iterations, 1)?;
        at_least("stall_iterations", self.stall_iterations, 1)?;
        not_negative("inertia_start", self.inertia.0, "")?;
        not_negative("inertia_end", self.inertia.1, "")?;
        not_negative("cognitive", self.cognitive, "")?;
        not_negative("social", self.social, "")?;
        not_negative("min_improvement", self.min_improvement, "m")?;
        if self.velocity_limit.is_nan() || self.velocity_limit <= 0.0 {
            return Err(Error::parameter(
                "velocity_limit",
                self.velocity_limit,
                "a number above 0, or infinity for none",
            ));
        }
        Ok(())
    }

    /// Inertia at an iteration, the first one being 1.
    fn inertia_at(&self, iteration: usize) -> f64 {
        let (start, end) = self.inertia;
        if iteration > self.inertia_iterations || self.inertia_iterations < 2 {
            return end;
        }
        let passed = crate::integrate::index(iteration - 1);
        let span = crate::integrate::index(self.inertia_iterations - 1);
        start + (end - start) * passed / span
    }
}

/// A place in the unit box and what it cost.
#[derive(Clone, Debug)]
struct Best {
    place: Vec<f64>,
    cost: f64,
}

/// One particle.
#[derive(Clone, Debug)]
struct Particle {
    place: Vec<f64>,
    velocity: Vec<f64>,
    best: Best,
}

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
}

impl Swarm {
    /// A swarm spread evenly over the unit box, each particle with half the velocity that
    /// would take it to a second random place.
    ///
    /// # Errors
    /// [`Error::Parameter`] where a setting or the number of coordinates cannot be used.
    pub fn new(settings: SwarmSettings, coordinates: usize, seed: u64, run: u64) -> Result<Self> {
        settings.validate()?;
        if coordinates == 0 || coordinates > 32 {
            return Err(Error::parameter("coordinates", coordinates, "1 to 32"));
        }
        let count = settings.particles as u64;
        let limit = settings.velocity_limit;
        let particles = (0..count)
            .map(|i| {
                let mut draws = Draws::at(seed, run, 0, i, count);
                let place: Vec<f64> = (0..coordinates).map(|_| draws.uniform()).collect();
                let velocity = place
                    .iter()
                    .map(|x| (0.5 * (draws.uniform() - x)).clamp(-limit, limit))
                    .collect();
                let best = Best { place: place.clone(), cost: f64::INFINITY };
                Particle { place, velocity, best }
            })
            .collect::<Vec<_>>();
        let best = Best { place: vec![0.5; coordinates], cost: f64::INFINITY };
        Ok(Self { settings, seed, run, iteration: 0, stalled: 0, particles, best })
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
        self.fly();
    }

    /// Equations (17) and (18).
    fn fly(&mut self) {
        let settings = &self.settings;
        let inertia = settings.inertia_at(self.iteration);
        let limit = settings.velocity_limit;
        let count = settings.particles;
        let leaders: Vec<Vec<f64>> = (0..count).map(|i| self.leader(i).to_vec()).collect();
        for (i, (particle, leader)) in self.particles.iter_mut().zip(&leaders).enumerate() {
            let (i, count) = (i as u64, count as u64);
            let mut draws = Draws::at(self.seed, self.run, self.iteration as u64, i, count);
            let Particle { place, velocity, best } = particle;
            for (((x, v), own), lead) in place.iter_mut().zip(velocity).zip(&best.place).zip(leader)
            {
                let own = settings.cognitive * draws.uniform() * (own - *x);
                let shared = settings.social * draws.uniform() * (lead - *x);
                let pulled = (inertia * *v + own + shared).clamp(-limit, limit);
                (*x, *v) = bounded(settings.boundary, *x + pulled, pulled);
            }
        }
    }

    /// `P_g` of a particle: the best place that it knows of besides its own.
    fn leader(&self, i: usize) -> &[f64] {
        let count = self.particles.len();
        match self.settings.topology {
            Topology::Global => &self.best.place,
            Topology::Ring => [(i + count - 1) % count, i, (i + 1) % count]
                .map(|j| &self.particles[j].best)
                .into_iter()
                .min_by(|a, b| a.cost.total_cmp(&b.cost))
                .map_or(&self.best.place, |best| &best.place),
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

    /// Whether the last iteration allowed has been told.
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

/// One coordinate after its move.
fn bounded(boundary: Boundary, x: f64, velocity: f64) -> (f64, f64) {
    if (0.0..=1.0).contains(&x) || boundary == Boundary::Invisible {
        return (x, velocity);
    }
    let wall = if x < 0.0 { 0.0 } else { 1.0 };
    match boundary {
        Boundary::Reflect => ((2.0 * wall - x).clamp(0.0, 1.0), -velocity),
        _ => (wall, 0.0),
    }
}
