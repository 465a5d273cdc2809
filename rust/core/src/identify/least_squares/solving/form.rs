//! Linear dynamics as logarithms of their numbers, and weights of modes, which are found.

use crate::models::{Dynamics, HIGHEST_MODE, Mode};

/// Longest lag that is searched, as a share of the record.
const LONGEST_LAG: f64 = 0.1;

/// Shortest lag, in samples: a shorter one shows nowhere.
const SHORTEST_LAG: f64 = 0.02;

/// Fewest cycles of a mode in a record.
const CYCLES: f64 = 3.0;

/// Damping ratios that are searched.
const DAMPING: (f64, f64) = (2e-3, 2.0);

/// Shares of the static displacement of a further mode.
const WEIGHT: (f64, f64) = (-0.9, 0.9);

/// Which dynamics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::identify::least_squares) enum Form {
    None,
    First,
    /// So many modes in parallel, 1 or 2.
    Modes(usize),
}

impl Form {
    /// The form of some dynamics, and their numbers.
    pub fn of(dynamics: &Dynamics) -> (Self, Vec<f64>) {
        let log = |numbers: &[f64]| numbers.iter().map(|one| libm::log(*one)).collect::<Vec<f64>>();
        match *dynamics {
            Dynamics::None => (Self::None, Vec::new()),
            Dynamics::First { time } => (Self::First, log(&[time])),
            Dynamics::Second { frequency, damping_ratio } => {
                (Self::Modes(1), log(&[frequency, damping_ratio]))
            }
            Dynamics::Modes(modes) => {
                let main = modes.all()[0];
                let mut numbers = log(&[main.frequency, main.damping_ratio]);
                for mode in modes.further().iter().take(1) {
                    numbers.push(mode.weight);
                    numbers.extend(log(&[mode.frequency, mode.damping_ratio]));
                }
                (Self::Modes(2), numbers)
            }
        }
    }

    /// How many numbers it has.
    pub fn numbers(self) -> usize {
        self.names().len()
    }

    /// Names of the numbers.
    pub fn names(self) -> &'static [&'static str] {
        match self {
            Self::None => &[],
            Self::First => &["time_constant"],
            Self::Modes(1) => &["frequency", "damping_ratio"],
            Self::Modes(_) => &[
                "frequency",
                "damping_ratio",
                "mode_weights[0]",
                "mode_frequencies[0]",
                "mode_damping_ratios[0]",
            ],
        }
    }

    /// Ranges of the logarithms, for a window of so many seconds and samples every `dt`.
    pub fn ranges(self, length: f64, dt: f64) -> Vec<(f64, f64)> {
        let log = |(low, high): (f64, f64)| (libm::log(low), libm::log(high));
        match self {
            Self::None => Vec::new(),
            Self::First => vec![log((SHORTEST_LAG * dt, LONGEST_LAG * length))],
            Self::Modes(count) => {
                let mode = [log((CYCLES / length, HIGHEST_MODE / dt)), log(DAMPING)];
                let further = [WEIGHT, mode[0], mode[1]].repeat(count - 1);
                [&mode[..], &further].concat()
            }
        }
    }

    /// The dynamics of these logarithms.
    pub fn dynamics(self, poles: &[f64]) -> Dynamics {
        match (self, poles) {
            (Self::Modes(2), [frequency, damping_ratio, weight, second, second_damping]) => {
                let further = Mode {
                    weight: *weight,
                    frequency: libm::exp(*second),
                    damping_ratio: libm::exp(*second_damping),
                };
                Dynamics::modes(libm::exp(*frequency), libm::exp(*damping_ratio), &[further])
                    .unwrap_or(Dynamics::None)
            }
            (Self::First, [time, ..]) => Dynamics::First { time: libm::exp(*time) },
            (Self::Modes(_), [frequency, damping_ratio, ..]) => Dynamics::Second {
                frequency: libm::exp(*frequency),
                damping_ratio: libm::exp(*damping_ratio),
            },
            _ => Dynamics::None,
        }
    }
}
