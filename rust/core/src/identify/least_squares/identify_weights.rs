//! Identification of a stage by least squares: checks, then the structure and its weights.

use super::common::Common;
use super::result::LeastSquaresFit;
use super::settings::{NodesKind, Settings};
use super::structure::selection;
use super::weights_record::WeightsRecord;
use crate::error::{Error, Result, positive};
use crate::identify::parameters::drift::DriftKind;
use crate::models::{
    AnySuperposition, Dynamics, MOST_LEVELS, Model, Nodes, PlayHysteresis, Relaxation, SignalsOf,
    check_nodes,
};
use crate::signal::{Drive, Stop, index, range, turns};

/// Nodes that a record of few samples has to determine where nobody says how many.
const AUTO_NODES: usize = 10;

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
    match &settings.nodes {
        NodesKind::Given(nodes) => check_nodes(of.nodes(), nodes)?,
        NodesKind::Spread(count) => check_count(of, *count)?,
        NodesKind::Auto => {}
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
    let found = selection::search(&common, settings);
    found.map(|fit| fit.result()).transpose()
}

/// Refuses a number of nodes with which no stage exists.
fn check_count(of: &dyn AnySuperposition, count: usize) -> Result<()> {
    let title = of.info().title;
    let expected = match of.nodes() {
        Nodes::Thresholds => return Ok(()),
        Nodes::Levels if (1..MOST_LEVELS).contains(&count) => return Ok(()),
        Nodes::Levels => format!("1 to {} intervals between levels of {title}", MOST_LEVELS - 1),
        Nodes::None => format!("None: {title} has no thresholds or levels"),
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
    let nodes = match &settings.nodes {
        NodesKind::Given(nodes) => nodes.clone(),
        NodesKind::Spread(count) => (0..*count).map(index).collect(),
        NodesKind::Auto => (0..AUTO_NODES).map(index).collect(),
    };
    let shape: Vec<f64> = of.shapes().iter().map(|one| one.neutral).collect();
    let made = SignalsOf { shape: &shape, nodes: &nodes, drive: (0.0, index(AUTO_NODES)) };
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
