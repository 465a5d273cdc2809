//! Inequalities between two parameters.
//!
//! Of two parameters that are searched, the coordinate of the smaller one goes from its lower bound
//! to the larger one, or to its own upper bound where that is less. So every place of the unit box
//! keeps the constraint, a search needs no projection, and the face on which the two are equal is a
//! face of the box. Bounds are tightened first, so that the smaller one always has room.

use super::candidate::PLACES;
use super::coordinate::Coordinate;
use super::tie::in_one_line;
use crate::error::{Error, Result, shown, shown_text};
use crate::models::{ParameterInfo, position};

/// Least coordinate of the unit box at which a parameter counts as on its limit.
const ON_LIMIT: f64 = 1.0 - 1e-3;

/// One parameter that is not above another.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// Place of the smaller one.
    pub lower: usize,
    /// Place of the larger one.
    pub upper: usize,
    /// As the caller wrote it, in one line.
    pub text: String,
}

impl Constraint {
    /// Reads a text with two names and `<`, `<=`, `>` or `>=` between them; whether they may be
    /// equal makes no difference to real numbers.
    ///
    /// # Errors
    /// [`Error::Parameter`] for any other text.
    pub fn read(infos: &[ParameterInfo], text: &str) -> Result<Self> {
        let refused = |expected: &str| Error::parameter("constraint", shown_text(text), expected);
        let form = "two parameters with <, <=, > or >= between them, as 'a < b'";
        let at = text.find(['<', '>']).ok_or_else(|| refused(form))?;
        let (left, rest) = text.split_at(at);
        let above = rest.starts_with('>');
        let right = rest.strip_prefix(['<', '>']).unwrap_or(rest);
        let (left, right) = (left.trim(), right.strip_prefix('=').unwrap_or(right).trim());
        if left.is_empty() || right.is_empty() || right.contains(['<', '>', '=']) {
            return Err(refused(form));
        }
        if [left, right].iter().any(|side| side.parse::<f64>().is_ok()) {
            return Err(refused("two parameters, as bounds keep one on a side of a number"));
        }
        let place = |name: &str| {
            let known = infos.iter().any(|info| info.name == name);
            let names: Vec<&str> = infos.iter().map(|info| info.name).collect();
            let expected = format!("one of {} in place of {}", names.join(", "), shown_text(name));
            if known { position(infos, "constraint", name) } else { Err(refused(&expected)) }
        };
        let (left, right) = (place(left)?, place(right)?);
        if left == right {
            return Err(refused("two different parameters"));
        }
        let (lower, upper) = if above { (right, left) } else { (left, right) };
        Ok(Self { lower, upper, text: in_one_line(text) })
    }

    /// Whether the two are equal at a candidate, and not by their bounds alone, given its
    /// coordinates in the unit box and its values.
    #[must_use]
    pub fn is_active(
        &self,
        coordinates: &[Coordinate; PLACES],
        unit: &[f64; PLACES],
        values: &[f64; PLACES],
    ) -> bool {
        let [lower, upper] = [self.lower, self.upper].map(|place| coordinates[place]);
        let (least, most) = (values[self.lower], values[self.upper]);
        match (lower, upper) {
            // Another constraint or its own bound may be what limits it.
            (Coordinate::Free { high, .. }, _) if most <= high => {
                let room = most - lower.limited(most).value(ON_LIMIT);
                unit[self.lower] >= ON_LIMIT && most - least <= room
            }
            (_, Coordinate::Free { low, .. }) => unit[self.upper] <= 1.0 - ON_LIMIT && low <= least,
            _ => false,
        }
    }
}

/// Puts constraints in an order in which each comes after those that limit its larger parameter.
///
/// # Errors
/// [`Error::Parameter`] where they go in a circle.
pub(in crate::identify) fn in_order(mut constraints: Vec<Constraint>) -> Result<Vec<Constraint>> {
    let mut ordered = Vec::with_capacity(constraints.len());
    while !constraints.is_empty() {
        let waits = |one: &Constraint| constraints.iter().any(|other| other.lower == one.upper);
        let Some(next) = constraints.iter().position(|one| !waits(one)) else {
            let texts: Vec<&str> = constraints.iter().map(|one| one.text.as_str()).collect();
            let found = shown_text(&texts.join(", "));
            return Err(Error::parameter("constraints", found, "inequalities not in a circle"));
        };
        ordered.push(constraints.remove(next));
    }
    Ok(ordered)
}

/// Takes from the bounds what no candidate can have.
///
/// # Errors
/// [`Error::Parameter`] where nothing is left.
pub(in crate::identify) fn tighten(
    constraints: &[Constraint],
    coordinates: &mut [Coordinate; PLACES],
    infos: &[ParameterInfo],
) -> Result<()> {
    let ends = |coordinate: Coordinate| match coordinate {
        Coordinate::Fixed(value) => Some((value, value)),
        Coordinate::Free { low, high, .. } => Some((low, high)),
        Coordinate::Tied => None,
    };
    // Once along each chain is enough, from its end and from its beginning.
    for one in constraints.iter().chain(constraints.iter().rev()) {
        let [lower, upper] = [one.lower, one.upper].map(|place| coordinates[place]);
        let (Some((low, high)), Some((least, most))) = (ends(lower), ends(upper)) else {
            let tied = if lower == Coordinate::Tied { one.lower } else { one.upper };
            let name = infos.get(tied).map_or("", |info| info.name);
            let expected = format!("parameters that are not tied, as {name} is");
            return Err(Error::parameter("constraint", shown_text(&one.text), expected));
        };
        let refused = |found: String, expected: &str| {
            let text = shown_text(&one.text);
            Err(Error::parameter("constraint", format!("{text}, {found}"), expected))
        };
        let held = |coordinate| matches!(coordinate, Coordinate::Fixed(_));
        if held(lower) && held(upper) {
            return refused("both held".into(), "one of the two to be searched");
        }
        if low >= most {
            let [a, b] = [one.lower, one.upper].map(|i| infos.get(i).map_or("", |info| info.name));
            let found = format!("with {a} from {} and {b} up to {}", shown(low), shown(most));
            return refused(found, "bounds within which it can hold");
        }
        coordinates[one.lower] = lower.limited(most.min(high));
        coordinates[one.upper] = upper.raised(least.max(low));
    }
    Ok(())
}
