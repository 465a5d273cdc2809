//! Bounds of a search, from the record, where the caller gave none.

use super::coordinate::Coordinate;
use crate::error::{Error, Result, shown};
use crate::identify::records::record::Record;
use crate::identify::records::resonances::resonances;
use crate::integrator::MOST_PARAMETERS;
use crate::models::{Held, Measures, ModeShown, Model, Range, Ranges};
use crate::signal::{Drive, Stop, index, range};

/// Measures from which the bounds are built.
pub(in crate::identify) fn measures(record: &Record<'_>) -> Measures {
    Measures::of(&record.drive, record.y, record.window.clone())
}

/// Least shares of the deviation that a mode has to take away before the search allows for one,
/// and before it keeps to that one.
const FAINT: f64 = 0.05;
const CLEAR: f64 = 0.3;

/// Damping ratio below which it is a mode for certain: above, a lag looks alike.
const SWINGING: f64 = 0.5;

/// Samples of the window in which a mode is looked for: more would take longer than the search.
const LOOKED_AT: usize = 1 << 16;

/// Looks for a mode in the record: one that is clear, something that may be one, or none.
fn look_for_mode(of: &mut Measures, record: &Record<'_>, stop: Stop<'_>) {
    let end = record.y.len().min(record.window.start + LOOKED_AT);
    let drive = Drive { u: &record.drive.u[..end], ..record.drive };
    let found = resonances(&drive, &record.y[..end], record.window.start, 1, stop);
    let Some(found) = found else { return };
    of.mode = match found.first() {
        Some(mode) if mode.gain >= CLEAR && mode.damping_ratio < SWINGING => {
            ModeShown::Clear(core::f64::consts::TAU * mode.frequency)
        }
        Some(mode) if mode.gain >= FAINT => ModeShown::Faint,
        _ => ModeShown::Absent,
    };
}

/// Least range of the drive's means, relative to that of the drive, that tells a gain.
const SLOW_PART: f64 = 0.2;

/// Takes gain and stroke from means over two cycles of the mode, which its swinging does not
/// enlarge, where the drive moves slowly enough besides.
fn steady(of: &mut Measures, record: &Record<'_>, mode: f64) {
    let (u, y) = (&record.drive.u[record.window.clone()], &record.y[record.window.clone()]);
    let cycles = 2.0 * core::f64::consts::TAU / (mode * record.drive.dt);
    let Some(length) = (1..=u.len() / 4).find(|&length| index(length) >= cycles) else { return };
    let means = |values: &[f64]| -> Vec<f64> {
        let mean = |part: &[f64]| part.iter().sum::<f64>() / index(part.len());
        values.chunks_exact(length).map(mean).collect()
    };
    let (u_means, y_means) = (means(u), means(y));
    let (low, high) = range(u);
    let (least, most) = range(&u_means);
    let slow = most - least > SLOW_PART * (high - low);
    let Ok(drive) = Drive::new(&u_means, record.drive.dt, record.drive.hold.until(0)) else {
        return;
    };
    if slow && u_means.len() > 3 {
        let found = Measures::of(&drive, &y_means, 0..u_means.len());
        if found.gain > 0.0 && found.gain < of.gain {
            of.stroke *= found.gain / of.gain;
            of.gain = found.gain;
        }
        of.inverted = found.inverted;
    }
}

/// Parameters whose ranges follow from a mode where a record shows one.
const OF_MODE: [&str; 2] = ["mass", "damping"];

/// Coordinates of all parameters: the fixed ones as given, the others between derived bounds, which
/// hold those of each record.
///
/// # Errors
/// [`Error::Data`] where a record's values are absurd; [`Error::Parameter`] where a derived
/// range is empty, which does not happen with other records that passed [`Record::new`].
pub fn derive(
    records: &[&Record<'_>],
    model: Model,
    fixed: &[Option<f64>; MOST_PARAMETERS],
    wants_mode: bool,
    stop: Stop<'_>,
) -> Result<[Coordinate; MOST_PARAMETERS]> {
    let infos = model.scalars();
    let mut held = Held::defaults(infos);
    held.values = *fixed;
    let ranges = |record: &&Record<'_>| {
        let of = looked_through(record, wants_mode, stop).map_err(|error| record.named(error))?;
        Ok((matches!(of.mode, ModeShown::Clear(_)), model.ranges(&of, &held)?))
    };
    let all: Vec<(bool, Ranges)> = records.iter().map(ranges).collect::<Result<_>>()?;
    let shown = all.iter().any(|(clear, _)| *clear);
    let mut coordinates = [Coordinate::Fixed(0.0); MOST_PARAMETERS];
    for (i, info) in infos.iter().enumerate() {
        // A mode that one record shows is that of the stage, whatever the others leave open.
        let decides = |clear: bool| clear || !(shown && OF_MODE.contains(&info.name));
        let found = all.iter().filter(|(clear, _)| decides(*clear)).filter_map(|(_, ranges)| {
            ranges.iter().find(|(name, _)| *name == info.name).map(|(_, range)| *range)
        });
        let range = found.reduce(hull);
        coordinates[i] = match (fixed[i], range) {
            (Some(value), _) => Coordinate::Fixed(value),
            (None, Some((low, high))) if low < high => Coordinate::between(info.name, low, high)?,
            (None, range) => Coordinate::Fixed(range.map_or(0.0, |(value, _)| value)),
        };
    }
    Ok(coordinates)
}

/// The range that holds two, of which one that is a single value has no effect on its record.
fn hull(one: Range, other: Range) -> Range {
    match (one.0 < one.1, other.0 < other.1) {
        (true, true) => (one.0.min(other.0), one.1.max(other.1)),
        (true, false) => one,
        (false, true) => other,
        (false, false) => {
            let least = one.0.min(other.0);
            (least, least)
        }
    }
}

/// Measures of a record, those of a mode too.
fn looked_through(record: &Record<'_>, wants_mode: bool, stop: Stop<'_>) -> Result<Measures> {
    let mut of = Measures { wants_mode, ..measures(record) };
    if !of.usable() {
        return Err(Error::Data(format!(
            "a stroke of {} m, {} m/V and a drive of {} rad/s cannot be computed with: check \
             the units of time, drive and displacement",
            shown(of.stroke),
            shown(of.gain),
            shown(of.frequency)
        )));
    }
    if of.excited().is_some() {
        look_for_mode(&mut of, record, stop);
    }
    if let ModeShown::Clear(mode) = of.mode {
        steady(&mut of, record, mode);
    }
    Ok(of)
}
