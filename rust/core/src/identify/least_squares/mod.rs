//! Identification by least squares: weights of plays, dead zones, creep and linear dynamics.
//!
//! Weights, dead zones, weights of the creep and the offset are found by the Gauss-Newton method,
//! each step of which is a non-negative least-squares problem; without dead zones and creep one
//! step is sufficient (Kuhnen 2003, doi 10.3166/ejc.9.407-418, has the linear problem;
//! he identifies the dead zones of the inverse, which here would amplify the sensor's noise).
//! The numbers of the dynamics are further unknowns of these steps, from where the record's
//! spectrum has a mode; the numbers of an envelope are searched along one line at a time.

mod choices;
mod columns;
mod common;
mod fit;
mod follower;
mod form;
mod gauss_newton;
mod layout;
mod modes;
mod places;
mod record_path;
mod slow_parts;
mod trials;

use super::parameters::delay::Delay;
use super::parameters::drift::DriftKind;
use super::records::history::History;
use crate::error::{Error, Result, positive, shown};
use crate::models::{
    AnySuperposition, Dynamics, MOST_LEVELS, Measures, Model, Places, PlayHysteresis, Relaxation,
    SignalsOf, Values, check_places,
};
use crate::signal::{Drive, Hold, Stop, index, range, turns};

use common::Common;

/// What is to be found of the stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Thresholds of plays, or levels.
    pub places: PlacesKind,
    /// Number of dead zones.
    pub zones: usize,
    /// Which creep.
    pub creep: CreepKind,
    /// Which dynamics.
    pub dynamics: DynamicsKind,
}

/// Thresholds of plays, or levels of a grid.
#[derive(Clone, Debug, PartialEq)]
pub enum PlacesKind {
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
    /// What the record shows.
    Auto,
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

/// Places that a record of few samples has to determine where nobody says how many.
const AUTO_PLACES: usize = 10;

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

/// A record: the displacement under a drive, judged from sample `start` on, and what is asked of
/// it alone.
#[derive(Clone, Copy, Debug)]
pub struct WeightsRecord<'a> {
    /// Drive, V.
    pub drive: Drive<'a>,
    /// Displacement, m.
    pub y: &'a [f64],
    /// First sample that counts; those before are warm-up.
    pub start: usize,
    /// What went before the record; `None` chooses.
    pub history: Option<History>,
    /// Whether the sensor shows something where the stage is at rest.
    pub offset: bool,
    /// Whether what it shows drifts.
    pub drift: DriftKind,
    /// Delay of the reading.
    pub delay: WeightsDelay,
    /// How much a sample counts beside those of other records.
    pub weight: f64,
}

/// Delay of a reading in a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WeightsDelay {
    /// Known, s; 0 for none.
    Known(f64),
    /// To be found between two bounds, s.
    Fitted(f64, f64),
}

impl<'a> WeightsRecord<'a> {
    /// A record that begins as it shows, with an offset, without drift or delay.
    #[must_use]
    pub fn of(drive: Drive<'a>, y: &'a [f64], start: usize) -> Self {
        let delay = WeightsDelay::Known(0.0);
        Self {
            drive,
            y,
            start,
            history: None,
            offset: true,
            drift: DriftKind::None,
            delay,
            weight: 1.0,
        }
    }

    /// The same with a delay of its reading.
    ///
    /// # Errors
    /// Names `delay` where it is out of its range.
    pub fn delayed(self, delay: Delay) -> Result<Self> {
        let length = self.drive.dt * index(self.drive.u.len());
        let ends = delay.ends(length, || self.measures().longest_delay())?;
        let delay = match delay {
            Delay::Fixed(value) => WeightsDelay::Known(value),
            Delay::Between(low, high) if low > high => {
                let found = format!("({}, {}) s", shown(low), shown(high));
                return Err(Error::parameter("delay", found, "the lower bound first"));
            }
            _ if ends.0 < ends.1 => WeightsDelay::Fitted(ends.0, ends.1),
            _ => WeightsDelay::Known(ends.0),
        };
        Ok(Self { delay, ..self })
    }

    /// Measures of the samples that count.
    fn measures(&self) -> Measures {
        Measures::of(&self.drive, self.y, self.start..self.y.len())
    }

    /// Seconds within which the drive comes to a sample: none where it is held and jumps.
    fn step(&self, k: usize) -> f64 {
        if k > 0 && self.drive.hold == Hold::First { self.drive.dt } else { f64::INFINITY }
    }

    /// Samples that count.
    fn samples(&self) -> usize {
        self.y.len().saturating_sub(self.start)
    }

    /// Seconds that count.
    fn length(&self) -> f64 {
        self.drive.dt * index(self.samples())
    }

    /// Whether readings are late.
    fn is_delayed(&self) -> bool {
        self.delay != WeightsDelay::Known(0.0)
    }
}

/// What was found.
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

/// What was found of one record.
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
    /// What went before the record.
    pub history: History,
    /// State of the stage before the first sample.
    pub start: Values,
}

/// Identifies a stage of a model from one or several records; `None` where `stop` said so
/// meanwhile. Trials go side by side on the threads of the present pool.
///
/// # Errors
/// [`Error`] where the model, the settings or a record cannot be used.
pub fn identify_weights(
    model: Model,
    records: &[WeightsRecord<'_>],
    settings: &Settings,
    stop: Stop<'_>,
) -> Result<Option<LeastSquaresFit>> {
    let Some(of) = model.superposition() else {
        let found = format!("'{}'", model.info().name);
        return Err(Error::parameter("model", found, "one whose weights least squares find"));
    };
    if records.is_empty() {
        return Err(Error::parameter("records", "none", "at least one"));
    }
    // What the settings are refused for, before anything else.
    let zeros = |count: usize| vec![0.0; count];
    let zones = zeros(settings.zones);
    PlayHysteresis::new(1.0, &[], &[], &zones, &zones)?;
    match &settings.places {
        PlacesKind::Given(places) => check_places(of.places(), places)?,
        PlacesKind::Spread(count) => check_count(of, *count)?,
        PlacesKind::Auto => {}
    }
    let times = settings.creep.times();
    Relaxation::new(&zeros(times.len()), times, Dynamics::None)?;
    let mut falls = None;
    for record in records {
        if let DriftKind::Time(time) = record.drift {
            positive("drift", time, "s")?;
        }
        check(record, unknowns(of, settings))?;
        let here = is_falling(record);
        if *falls.get_or_insert(here) != here {
            return Err(Error::Data(
                "the displacement rises with the drive in one record and falls in another".into(),
            ));
        }
    }
    if settings.zones > 0 && !of.has_dead_zones() {
        let expected = format!("0: {} has no dead zones", of.info().title);
        return Err(Error::parameter("dead_zones", settings.zones, expected));
    }
    let falls = falls.unwrap_or(false);
    let mirrored: Vec<_> = records.iter().map(|one| mirror(one, falls, of)).collect();
    let seen = records.iter().zip(&mirrored);
    let records =
        seen.map(|(one, (u, y))| WeightsRecord { drive: Drive { u, ..one.drive }, y, ..*one });
    let common = Common::new((model, of), records.collect(), falls, stop);
    let found = choices::search(&common, settings);
    found.map(|fit| fit.result()).transpose()
}

/// Refuses a number of places with which no stage exists.
fn check_count(of: &dyn AnySuperposition, count: usize) -> Result<()> {
    let title = of.info().title;
    let expected = match of.places() {
        Places::Thresholds => return Ok(()),
        Places::Levels if (1..MOST_LEVELS).contains(&count) => return Ok(()),
        Places::Levels => format!("1 to {} intervals between levels of {title}", MOST_LEVELS - 1),
        Places::None => format!("None: {title} has no thresholds or levels"),
    };
    Err(Error::parameter("count", count, expected))
}

/// A falling displacement is fitted as a rising one: under the negative drive, or negative itself
/// where the signals bend the drive.
fn mirror(
    record: &WeightsRecord<'_>,
    falls: bool,
    of: &dyn AnySuperposition,
) -> (Vec<f64>, Vec<f64>) {
    let negative = |values: &[f64]| values.iter().map(|value| -value).collect::<Vec<f64>>();
    let (u, y) = (record.drive.u, record.y);
    match (falls, of.has_dead_zones()) {
        (true, true) => (negative(u), y.to_vec()),
        (true, false) => (u.to_vec(), negative(y)),
        (false, _) => (u.to_vec(), y.to_vec()),
    }
}

/// Number of unknowns that the settings ask for at most.
fn unknowns(of: &dyn AnySuperposition, settings: &Settings) -> usize {
    let places = match &settings.places {
        PlacesKind::Given(places) => places.clone(),
        PlacesKind::Spread(count) => (0..*count).map(index).collect(),
        PlacesKind::Auto => (0..AUTO_PLACES).map(index).collect(),
    };
    let shape: Vec<f64> = of.shapes().iter().map(|one| one.neutral).collect();
    let made = SignalsOf { shape: &shape, places: &places, drive: (0.0, index(AUTO_PLACES)) };
    1 + of.signals(&made).count() + settings.zones + settings.creep.times().len()
}

/// Refuses records that tell nothing of a hysteresis.
fn check(record: &WeightsRecord<'_>, unknowns: usize) -> Result<()> {
    let WeightsRecord { drive, y, start, .. } = *record;
    if y.len() != drive.u.len() {
        return Err(Error::Shape {
            name: "y".into(),
            found: format!("{} samples", y.len()),
            expected: format!("{}, as many as u", drive.u.len()),
        });
    }
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
    Ok(())
}

/// Whether the displacement falls as the drive rises.
fn is_falling(record: &WeightsRecord<'_>) -> bool {
    let (u, y) = (&record.drive.u[record.start..], &record.y[record.start..]);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / index(values.len());
    let (middle, centre) = (mean(u), mean(y));
    let together: f64 = u.iter().zip(y).map(|(u, y)| (u - middle) * (y - centre)).sum();
    together < 0.0
}
