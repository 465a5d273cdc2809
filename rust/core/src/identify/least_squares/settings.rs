//! Settings of an identification by least squares, and the constants that its steps share.

use crate::identify::records::history::History;
use crate::models::Dynamics;

/// Settings of a fit: the unknowns of the stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Thresholds of plays, or levels.
    pub nodes: NodesKind,
    /// Number of dead zones.
    pub zones: usize,
    /// Which creep.
    pub creep: CreepKind,
    /// Which dynamics.
    pub dynamics: DynamicsKind,
    /// Structure to begin with.
    pub start: Option<Structure>,
}

/// Structure of a fit beside its signals, from which that of another model begins.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// History and time constant of the drift, s, of each record.
    pub records: Vec<(History, Option<f64>)>,
    /// Time constants of the creep, s.
    pub creep_times: Vec<f64>,
    /// Dynamics.
    pub dynamics: Dynamics,
    /// Whether the fit is kept, and not only judged beside others: to its last digits then, and
    /// with the lags that explain the records as well.
    pub kept: bool,
}

/// Thresholds of plays, or levels of a grid.
#[derive(Clone, Debug, PartialEq)]
pub enum NodesKind {
    /// These, V, ascending.
    Given(Vec<f64>),
    /// So many plays, spread evenly up to half of the drive's range; so many intervals between
    /// levels.
    Spread(usize),
    /// As many as foretell best what they were not fitted to.
    Auto,
}

/// Creep of a fit.
#[derive(Clone, Debug, PartialEq)]
pub enum CreepKind {
    /// Relaxations of these time constants, s; none where empty.
    Times(Vec<f64>),
    /// Chosen from the record.
    Auto,
}

impl CreepKind {
    /// Those given.
    pub(super) fn times(&self) -> &[f64] {
        match self {
            Self::Times(times) => times,
            Self::Auto => &[],
        }
    }
}

/// Linear dynamics that can be searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DynamicsKind {
    /// None.
    None,
    /// A first-order lag.
    First,
    /// A mode.
    Second,
    /// Chosen from the record: a mode, the smallest lag that explains it, or none.
    Auto,
}

/// Gain of a step below which a choice is settled.
pub(super) const ROUGH: f64 = 1e-3;

/// Most steps.
pub(super) const STEPS: usize = 60;

/// Deviations that differ by less than this share tell nothing.
pub(super) const SAME: f64 = 1.01;

/// Share of a fitted creep to start from.
pub(super) const FIRST_SHARE: f64 = 0.005;

pub(super) const MODE_GAIN: f64 = 0.02;

/// Shares of the deviation that a history, creep, a drift and a lag have to take away.
pub(super) const HISTORY_GAIN: f64 = 0.02;
pub(super) const CREEP_GAIN: f64 = 0.015;
pub(super) const DRIFT_GAIN: f64 = 0.015;
pub(super) const LAG_GAIN: f64 = 0.01;

/// Shares that a voltage which the stage came from has to take away: at least, and of what is above
/// the noise. That is an error of the model, of which such a voltage takes up some by itself.
pub(super) const VOLTAGE_GAIN: f64 = 0.04;
pub(super) const VOLTAGE_GAIN_ABOVE_NOISE: f64 = 0.2;

/// Share of the deviation that a lag of a stage that creeps has to take away, and one in place of
/// creep: relaxations faster than the drive's period turn its phase as a lag does.
pub(super) const LAG_BESIDE_CREEP_GAIN: f64 = 0.05;

/// Share of the deviation that a mode has to take away whose resonance no record shows: it would
/// also explain some of the creep, or of what the plays do not.
pub(super) const UNSEEN_GAIN: f64 = 0.15;
