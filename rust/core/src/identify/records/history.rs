//! Where a record begins: what the stage went through before the first sample.
//!
//! A stage is in equilibrium at the first sample of the drive, moved there slowly. How it came
//! there decides the memory of its hysteresis. A record does not show the drive before it, so the
//! history is assumed, or found with the parameters.

use crate::error::{Error, Result, shown_text};
use crate::signal::{Drive, Hold, range, turns};

/// Assumption about the drive before a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum History {
    /// The stage never moved before: it goes from 0 V to the first sample.
    Virgin,
    /// The drive of the record went on before it until the hysteresis repeated.
    Settled,
    /// The stage came from a voltage that is found with the parameters.
    Fitted,
}

impl History {
    /// A history by its name.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a name that none has.
    pub fn named(name: &str) -> Result<Self> {
        let all = [Self::Virgin, Self::Settled, Self::Fitted];
        all.into_iter().find(|history| history.name() == name).ok_or_else(|| {
            Error::parameter("history", shown_text(name), "'virgin', 'settled' or 'fit'")
        })
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Virgin => "virgin",
            Self::Settled => "settled",
            Self::Fitted => "fit",
        }
    }
}

/// Smallest reversal that settles anything, as a share of the drive's range.
const LEAST_TURN: f64 = 1e-3;

/// Most reversals that are repeated before a record.
const MOST_TURNS: usize = 24;

/// Rounds through the reversals: operators without return-point memory need several.
const ROUNDS: usize = 2;

/// The voltages that a stage visits slowly, in turn, before the drive of a record, the last of
/// which is its first sample; `from` is the voltage of a history that is fitted.
#[must_use]
pub fn voltages_before(drive: &Drive<'_>, history: History, from: f64) -> Vec<f64> {
    let first = drive.u.first().copied().unwrap_or(0.0);
    match history {
        History::Virgin => vec![first],
        History::Fitted => vec![from, first],
        History::Settled => {
            let (low, high) = range(drive.u);
            let turning = turns(drive.u, LEAST_TURN * (high - low));
            let latest = &turning[turning.len().saturating_sub(MOST_TURNS)..];
            let mut round = vec![low, high];
            round.extend(latest.iter().map(|&k| drive.u[k]));
            if drive.hold != Hold::Zero {
                round.extend(drive.u.last());
            }
            let mut all = round.repeat(ROUNDS);
            all.push(first);
            all
        }
    }
}

/// Voltages that a stage may have come from, V: half the drive's range beyond it at either end.
#[must_use]
pub fn came_from(drive: &Drive<'_>) -> (f64, f64) {
    let (low, high) = range(drive.u);
    let beyond = 0.5 * (high - low);
    (low - beyond, high + beyond)
}
