//! Settings of a swarm: update, topology, boundary, stop criteria.

use crate::error::{Error, Result, not_negative};

/// Treatment of a particle that leaves the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Boundary {
    /// It stops at the wall: coordinate on the bound, its velocity 0.
    Absorb,
    /// It stops at the wall, and half its velocity turns back.
    Rebound,
    /// It comes back from the wall with its velocity reversed.
    Reflect,
    /// It flies on outside and is not evaluated there; its best places draw it back.
    Invisible,
}

/// Most particles of a swarm: far beyond any use, far below what memory holds.
const MOST_PARTICLES: usize = 100_000;

/// Whose best position attracts a particle besides its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topology {
    /// The best of all particles.
    Global,
    /// The best of the particle and its two neighbours on a ring: news travels slowly, so the
    /// swarm explores several local minima before it converges.
    Ring,
    /// The best of the particle and those that inform it: each informs three drawn at random,
    /// drawn anew after every iteration that did not improve the swarm's best.
    Random,
}

/// How a particle moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Update {
    /// Each coordinate by itself: Xu and Li 2010, equations (17) and (18).
    Classic,
    /// By a point drawn evenly from the hypersphere about the centre of gravity of the
    /// particle, a point beyond its own best place and one beyond its leader's: the same
    /// however the coordinates are turned. Clerc 2012, hal-00764996.
    Hypersphere,
    /// The same with the radius drawn evenly, not the volume, so that points are denser about the
    /// centre: what the programs released with SPSO-2011 do.
    HypersphereRadial,
}

/// Settings of the swarm.
#[derive(Clone, Debug, PartialEq)]
pub struct SwarmSettings {
    /// Particles.
    pub particles: usize,
    /// Most iterations after the first evaluation.
    pub iterations: usize,
    /// How a particle moves.
    pub update: Update,
    /// Inertia w at the first iteration and from `inertia_iterations` on.
    pub inertia: (f64, f64),
    /// Iterations over which the inertia goes linearly from one to the other.
    pub inertia_iterations: usize,
    /// c1, the pull of a particle's own best place; of a hypersphere how far beyond it
    /// a point is taken.
    pub cognitive: f64,
    /// c2, the same of the leader's best place.
    pub social: f64,
    /// Whose best place c2 draws to.
    pub topology: Topology,
    /// Largest velocity of a coordinate, as a fraction of its range; infinite for none.
    pub velocity_limit: f64,
    /// Treatment of particles at the bounds.
    pub boundary: Boundary,
    /// Improvement of the best cost, in m, below which an iteration counts as a stall.
    pub min_improvement: f64,
    /// Stalled iterations in a row after which the search stops.
    pub stall_iterations: usize,
    /// Whether a descent refines the best candidate after the search.
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
            update: Update::Classic,
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

    /// Standard Particle Swarm Optimisation 2011: Clerc 2012, hal-00764996; Zambrano-Bigiarini,
    /// Clerc and Rojas 2013, doi 10.1109/CEC.2013.6557848.
    ///
    /// 40 particles, w = 1/(2 ln 2), c1 = c2 = 1/2 + ln 2. When to end is left to the user there:
    /// the iterations and the stall are ours. Points are drawn evenly in volume.
    #[must_use]
    pub fn spso_2011() -> Self {
        use core::f64::consts::LN_2;
        Self {
            particles: 40,
            iterations: 1000,
            update: Update::Hypersphere,
            inertia: (0.5 / LN_2, 0.5 / LN_2),
            inertia_iterations: 1,
            cognitive: 0.5 + LN_2,
            social: 0.5 + LN_2,
            topology: Topology::Random,
            velocity_limit: f64::INFINITY,
            boundary: Boundary::Rebound,
            min_improvement: 1e-12,
            stall_iterations: 200,
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
    pub(super) fn inertia_at(&self, iteration: usize) -> f64 {
        let (start, end) = self.inertia;
        if iteration > self.inertia_iterations || self.inertia_iterations < 2 {
            return end;
        }
        let passed = crate::signal::index(iteration - 1);
        let span = crate::signal::index(self.inertia_iterations - 1);
        start + (end - start) * passed / span
    }
}
