//! Result of an identification by least squares.

use crate::identify::records::history::History;
use crate::models::Values;

/// Result of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct LeastSquaresFit {
    /// Parameters of the stage, as the model builds it.
    pub values: Values,
    /// Root mean square of the deviations from all records, m.
    pub rms: f64,
    /// Simulations of the records.
    pub evaluations: usize,
    /// Names of the parameters that lie on a bound of what was searched.
    pub at_bound: Vec<String>,
    /// Of each record, what it has of its own.
    pub records: Vec<RecordFit>,
    /// Lags that explain the records within 1 % of the deviation, s; `None` where they show a
    /// mode, or where the dynamics were set.
    pub lag_range: Option<(f64, f64)>,
}

/// Result of a fit for one record.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordFit {
    /// Displacement that the sensor shows at rest, m.
    pub offset: f64,
    /// Drift at the first sample that counts, m, and its time constant, s.
    pub drift: Option<(f64, f64)>,
    /// Delay of the reading, s.
    pub delay: f64,
    /// Root mean square of the deviations, m.
    pub rms: f64,
    /// Motion before the record.
    pub history: History,
    /// State of the stage before the first sample.
    pub start: Values,
}
