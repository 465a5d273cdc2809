//! Identification by least squares: weights of plays, dead zones, creep and linear dynamics.
//!
//! Weights, dead zones, weights of the creep and the offset are found by the Gauss-Newton method,
//! each step of which is a non-negative least-squares problem; without dead zones and creep one
//! step is sufficient (Kuhnen 2003, doi 10.3166/ejc.9.407-418, has the linear problem;
//! he identifies the dead zones of the inverse, which here would amplify the sensor's noise).
//! The time constant, frequency and lag of a mode, and the numbers of an envelope, are searched
//! along one line at a time.

mod fit;
mod follower;

use crate::error::{Error, Result};
use crate::models::{
    Dynamics, Model, PlayHysteresis, Relaxation, Values, WeightedPlays, WeightedVisitor,
};
use crate::signal::{Drive, Stop, index, range, turns};

use fit::Fit;

/// What is to be found.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Thresholds of the plays, V, ascending.
    pub thresholds: Vec<f64>,
    /// Number of dead zones.
    pub zones: usize,
    /// Time constants of the creep, s.
    pub times: Vec<f64>,
    /// Which dynamics.
    pub dynamics: DynamicsKind,
    /// Whether the sensor shows something where the stage is at rest.
    pub offset: bool,
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
    /// Whether a time constant or a frequency lies on the edge of what was searched.
    pub at_bound: bool,
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
    let weights = zeros(settings.thresholds.len());
    let zones = zeros(settings.zones);
    PlayHysteresis::new(1.0, &settings.thresholds, &weights, &zones, &zones)?;
    Relaxation::new(&zeros(settings.times.len()), &settings.times, Dynamics::None)?;
    check(record, settings)?;
    model.weighted(Search { record, settings, stop }).unwrap_or_else(|| {
        let found = format!("'{}'", model.info().name);
        Err(Error::parameter("model", found, "one whose weights least squares find"))
    })
}

/// The search, for a model.
struct Search<'a> {
    record: &'a WeightsRecord<'a>,
    settings: &'a Settings,
    stop: Stop<'a>,
}

impl WeightedVisitor for Search<'_> {
    type Output = Result<Option<LeastSquaresFit>>;

    fn visit<M: WeightedPlays>(self) -> Self::Output {
        if self.settings.zones > 0 && !M::DEAD_ZONES {
            let expected = format!("0: {} has no dead zones", M::INFO.title);
            return Err(Error::parameter("dead_zones", self.settings.zones, expected));
        }
        let mut fit = Fit::<M>::new(self.record, self.settings, self.stop);
        fit.run().then(|| fit.result()).transpose()
    }
}

/// Refuses records that tell nothing of a hysteresis.
fn check(record: &WeightsRecord<'_>, settings: &Settings) -> Result<()> {
    let WeightsRecord { drive, y, start } = *record;
    if y.len() != drive.u.len() {
        return Err(Error::Shape {
            name: "y".into(),
            found: format!("{} samples", y.len()),
            expected: format!("{}, as many as u", drive.u.len()),
        });
    }
    let unknowns = 2 + settings.thresholds.len() + settings.zones + settings.times.len();
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
        return Err(Error::Data(format!("the drive stays at {low} V: nothing can be identified")));
    }
    let (least, most) = range(y);
    if most <= least {
        return Err(Error::Data(format!(
            "the displacement stays at {least:e} m: is the sensor alive?"
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
    if together <= 0.0 {
        return Err(Error::Data(
            "the displacement falls as the drive rises: turn the sign of one of them".into(),
        ));
    }
    Ok(())
}
