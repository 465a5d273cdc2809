//! Identification by least squares: weights of plays, dead zones, creep and linear dynamics.
//!
//! Weights, dead zones, weights of the creep and the offset are found by the Gauss-Newton method,
//! each step of which is a non-negative least-squares problem; without dead zones and creep one
//! step is sufficient (Kuhnen 2003, doi 10.3166/ejc.9.407-418, has the linear problem;
//! he identifies the dead zones of the inverse, which here would amplify the sensor's noise).
//! The numbers of the dynamics are further unknowns of these steps, from where the record's
//! spectrum has a mode; the numbers of an envelope are searched along one line at a time.

mod choices;
mod fit;
mod follower;
mod form;
mod gauss_newton;
mod layout;
mod modes;
mod plays;

use super::history::History;
use crate::error::{Error, Result};
use crate::models::{
    Dynamics, Measures, Model, PlayHysteresis, Relaxation, Values, WeightedPlays, WeightedVisitor,
};
use crate::signal::{Drive, Stop, index, range, turns};

use fit::{Common, Fit};

/// What is to be found.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Which plays.
    pub plays: PlaysKind,
    /// Number of dead zones.
    pub zones: usize,
    /// Which creep.
    pub creep: CreepKind,
    /// Which dynamics.
    pub dynamics: DynamicsKind,
    /// What went before the record; `None` chooses.
    pub history: Option<History>,
    /// Whether the sensor shows something where the stage is at rest.
    pub offset: bool,
}

/// Plays of a fit.
#[derive(Clone, Debug, PartialEq)]
pub enum PlaysKind {
    /// Those of these thresholds, V, ascending.
    Thresholds(Vec<f64>),
    /// So many, spread evenly up to half of the drive's range.
    Spread(usize),
    /// As many as foretell best what they were not fitted to.
    Auto,
}

/// Creep of a fit.
#[derive(Clone, Debug, PartialEq)]
pub enum CreepKind {
    /// Relaxations of these time constants, s; none where empty.
    Times(Vec<f64>),
    /// What the record shows.
    Auto,
}

impl PlaysKind {
    /// Those given, or as many zeros as there may be.
    fn thresholds(&self) -> Vec<f64> {
        match self {
            Self::Thresholds(thresholds) => thresholds.clone(),
            Self::Spread(count) => vec![0.0; *count],
            Self::Auto => vec![0.0; 10],
        }
    }
}

impl CreepKind {
    /// Those given.
    fn times(&self) -> &[f64] {
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
    /// What the record shows: a mode, the smallest lag that explains it, or none.
    Auto,
}

/// A record: the displacement under a drive, judged from sample `start` on.
#[derive(Clone, Copy, Debug)]
pub struct WeightsRecord<'a> {
    /// Drive, V.
    pub drive: Drive<'a>,
    /// Displacement, m.
    pub y: &'a [f64],
    /// First sample that counts; those before are warm-up.
    pub start: usize,
}

impl WeightsRecord<'_> {
    /// Measures of the samples that count.
    fn measures(&self) -> Measures {
        Measures::of(&self.drive, self.y, self.start..self.y.len())
    }
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct LeastSquaresFit {
    /// Parameters of the stage, as the model builds it.
    pub values: Values,
    /// Displacement that the sensor shows at rest, m.
    pub offset: f64,
    /// Root mean square of the deviations, m.
    pub rms: f64,
    /// Simulations of the record.
    pub evaluations: usize,
    /// Names of the parameters that lie on a bound of what was searched.
    pub at_bound: Vec<String>,
    /// What went before the record.
    pub history: History,
    /// State of the stage before the first sample.
    pub start: Values,
    /// Lags that explain the record within 1 % of the deviation, s; `None` where the record shows a
    /// mode, or where the dynamics were set.
    pub lag_range: Option<(f64, f64)>,
}

/// Identifies a stage of a model; `None` where `stop` said so meanwhile.
///
/// # Errors
/// [`Error`] where the model, the settings or the record cannot be used.
pub fn identify_weights(
    model: Model,
    record: &WeightsRecord<'_>,
    settings: &Settings,
    stop: Stop<'_>,
) -> Result<Option<LeastSquaresFit>> {
    // What the settings are refused for, before anything else.
    let zeros = |count: usize| vec![0.0; count];
    let zones = zeros(settings.zones);
    let thresholds = settings.plays.thresholds();
    PlayHysteresis::new(1.0, &thresholds, &zeros(thresholds.len()), &zones, &zones)?;
    let times = settings.creep.times();
    Relaxation::new(&zeros(times.len()), times, Dynamics::None)?;
    let falls = check(record, settings)?;
    model.weighted(Search { record, settings, falls, stop }).unwrap_or_else(|| {
        let found = format!("'{}'", model.info().name);
        Err(Error::parameter("model", found, "one whose weights least squares find"))
    })
}

/// The search, for a model.
struct Search<'a> {
    record: &'a WeightsRecord<'a>,
    settings: &'a Settings,
    /// Whether the displacement falls as the drive rises.
    falls: bool,
    stop: Stop<'a>,
}

impl WeightedVisitor for Search<'_> {
    type Output = Result<Option<LeastSquaresFit>>;

    fn visit<M: WeightedPlays>(self) -> Self::Output {
        if self.settings.zones > 0 && !M::DEAD_ZONES {
            let expected = format!("0: {} has no dead zones", M::INFO.title);
            return Err(Error::parameter("dead_zones", self.settings.zones, expected));
        }
        // A falling displacement is fitted as a rising one: under the negative drive, or negative
        // itself where an envelope bends the drive.
        let negative = |values: &[f64]| values.iter().map(|value| -value).collect::<Vec<f64>>();
        let WeightsRecord { drive, y, start } = *self.record;
        let (u, y) = match (self.falls, M::DEAD_ZONES) {
            (true, true) => (negative(drive.u), y.to_vec()),
            (true, false) => (drive.u.to_vec(), negative(y)),
            (false, _) => (drive.u.to_vec(), y.to_vec()),
        };
        let record = WeightsRecord { drive: Drive { u: &u, ..drive }, y: &y, start };
        let common = Common::new(&record, self.settings.offset, self.falls, self.stop);
        let found = choices::search::<M>(&common, self.settings);
        let result =
            |(fit, lag_range): (Fit<'_, M>, _)| Ok(LeastSquaresFit { lag_range, ..fit.result()? });
        found.map(result).transpose()
    }
}

/// Refuses records that tell nothing of a hysteresis; true where the displacement falls as the
/// drive rises.
fn check(record: &WeightsRecord<'_>, settings: &Settings) -> Result<bool> {
    let WeightsRecord { drive, y, start } = *record;
    if y.len() != drive.u.len() {
        return Err(Error::Shape {
            name: "y".into(),
            found: format!("{} samples", y.len()),
            expected: format!("{}, as many as u", drive.u.len()),
        });
    }
    let unknowns =
        2 + settings.plays.thresholds().len() + settings.zones + settings.creep.times().len();
    let count = y.len().saturating_sub(start);
    if count < 2 * unknowns {
        return Err(Error::Data(format!(
            "the window has {count} samples: expected at least {}, twice the number of unknowns",
            2 * unknowns
        )));
    }
    let (u, y) = (&drive.u[start..], &y[start..]);
    let (low, high) = range(u);
    if high <= low {
        return Err(Error::Data(format!(
            "the drive is constant at {low} V in the window: expected a drive that moves the stage, up \
             and down at least once"
        )));
    }
    let (least, most) = range(y);
    if most <= least {
        return Err(Error::Data(format!(
            "the displacement is constant at {least} m in the window while the drive moves: the sensor \
             seems dead or not connected"
        )));
    }
    if turns(drive.u, 0.01 * (high - low)).is_empty() {
        return Err(Error::Data(
            "the drive never reverses: hysteresis shows where it does, so record a full cycle"
                .into(),
        ));
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / index(values.len());
    let (middle, centre) = (mean(u), mean(y));
    let together: f64 = u.iter().zip(y).map(|(u, y)| (u - middle) * (y - centre)).sum();
    Ok(together < 0.0)
}
