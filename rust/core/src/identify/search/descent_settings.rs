//! Settings of a search by descents.

use crate::error::{Error, Result};

/// Settings of a search by descents.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DescentSettings {
    /// Random points in each round.
    pub samples: usize,
    /// Descents in each round, from the best of its points.
    pub starts: usize,
    /// Descents that have to end at the lowest cost.
    pub agreeing: usize,
    /// Most rounds.
    pub rounds: usize,
}

impl Default for DescentSettings {
    fn default() -> Self {
        Self { samples: 32, starts: 32, agreeing: 2, rounds: 10 }
    }
}

/// Most of each setting: far beyond any use, far below what memory holds.
const MOST_SAMPLES: usize = 100_000;
const MOST_STARTS: usize = 1000;
const MOST_ROUNDS: usize = 10_000;

impl DescentSettings {
    /// Checks every setting.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the setting.
    pub fn validate(&self) -> Result<()> {
        let between = |name: &str, value: usize, low: usize, high: usize| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Error::parameter(name, value, format!("{low} or more, {high} at most")))
        };
        between("starts", self.starts, 1, MOST_STARTS)?;
        between("samples", self.samples, self.starts, MOST_SAMPLES)?;
        between("rounds", self.rounds, 1, MOST_ROUNDS)?;
        between("agreeing", self.agreeing, 2, self.starts.saturating_mul(self.rounds).max(2))
    }
}
