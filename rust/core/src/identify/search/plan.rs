//! How a problem is searched: by which method, from which seed, how often.

use super::descent_settings::DescentSettings;
use crate::error::{Error, Result};
use crate::identify::swarm::SwarmSettings;
use crate::math::available;

/// How a problem is searched.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Search method.
    pub method: Method,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Searches apart from each other.
    pub runs: usize,
    /// Place of the unit box from which descents start besides random ones, if any.
    pub start: Option<Vec<f64>>,
}

/// Search method.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// A particle swarm.
    Swarm(SwarmSettings),
    /// Descents from random points.
    Descents(DescentSettings),
}

impl Plan {
    /// Checks the settings and the number of runs.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming what cannot be used.
    pub fn validate(&self) -> Result<()> {
        let each = match &self.method {
            Method::Swarm(settings) => {
                settings.validate()?;
                settings.particles
            }
            Method::Descents(settings) => {
                settings.validate()?;
                settings.samples
            }
        };
        if self.runs == 0 || self.runs > MOST_RUNS {
            let expected = format!("1 or more, {MOST_RUNS} at most");
            return Err(Error::parameter("runs", self.runs, expected));
        }
        let outside = |z: &&f64| !(0.0..=1.0).contains(*z);
        if let Some(z) = self.start.iter().flatten().find(outside) {
            return Err(Error::parameter("coordinate of the start", z, "0 to 1"));
        }
        let particles = self.runs * each;
        if particles > MOST_PARTICLES {
            let expected = format!(
                "{} at most, with {each} particles in each: {MOST_PARTICLES} in all",
                (MOST_PARTICLES / each).max(1)
            );
            return Err(Error::parameter("runs", self.runs, expected));
        }
        available("the particles of the search", particles, PARTICLE)
    }
}

/// Most swarms of a search.
const MOST_RUNS: usize = 10_000;

/// Most particles of all swarms together.
const MOST_PARTICLES: usize = 1_000_000;

/// Bytes that a particle takes at most, with what is asked about it.
const PARTICLE: usize = 2000;
