//! Linear dynamics as logarithms of their numbers, which are found.

use crate::models::Dynamics;
use crate::signal::Drive;
use crate::signal::index;

/// Longest lag that is searched, as a share of the record.
const LONGEST_LAG: f64 = 0.1;

/// Shortest lag, in samples: a shorter one shows nowhere.
const SHORTEST_LAG: f64 = 0.02;

/// Highest frequency of a mode, in cycles a sample.
const HIGHEST: f64 = 0.45;

/// Fewest cycles of a mode in a record.
const CYCLES: f64 = 3.0;

/// Damping ratios that are searched.
const DAMPING: (f64, f64) = (2e-3, 2.0);

/// Which dynamics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    None,
    First,
    Second,
}

impl Form {
    /// How many numbers it has.
    pub fn numbers(self) -> usize {
        self.names().len()
    }

    /// Names of the numbers.
    pub fn names(self) -> &'static [&'static str] {
        match self {
            Self::None => &[],
            Self::First => &["time_constant"],
            Self::Second => &["frequency", "damping_ratio"],
        }
    }

    /// Ranges of the logarithms, for a window of so many seconds.
    pub fn ranges(self, drive: &Drive<'_>, start: usize) -> Vec<(f64, f64)> {
        let dt = drive.dt;
        let length = dt * index(drive.u.len() - start);
        let log = |(low, high): (f64, f64)| (libm::log(low), libm::log(high));
        match self {
            Self::None => Vec::new(),
            Self::First => vec![log((SHORTEST_LAG * dt, LONGEST_LAG * length))],
            Self::Second => vec![log((CYCLES / length, HIGHEST / dt)), log(DAMPING)],
        }
    }

    /// The dynamics of these logarithms.
    pub fn dynamics(self, poles: &[f64]) -> Dynamics {
        match (self, poles) {
            (Self::First, [time, ..]) => Dynamics::First { time: libm::exp(*time) },
            (Self::Second, [frequency, damping_ratio, ..]) => Dynamics::Second {
                frequency: libm::exp(*frequency),
                damping_ratio: libm::exp(*damping_ratio),
            },
            _ => Dynamics::None,
        }
    }
}
