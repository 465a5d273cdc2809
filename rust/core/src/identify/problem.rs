//! What is searched: a record, the parameters held and the parameters free.

use super::bounds::{self, NOMINAL_STIFFNESS};
use super::coordinate::Coordinate;
use super::record::Record;
use crate::error::{Error, Result, finite, positive, shown};
use crate::models::{DELAY, Model, Theta};
use crate::signal::index;

/// What the caller asked for.
#[derive(Clone, Debug, Default)]
pub struct Spec {
    /// The kind of stage.
    pub model: Model,
    /// Parameters to search; all that are not fixed where `None`.
    pub free: Option<Vec<String>>,
    /// Parameters held, SI.
    pub fixed: Vec<(String, f64)>,
    /// Bounds, SI.
    pub bounds: Vec<(String, (f64, f64))>,
    /// The stiffness where it is known, N/m.
    pub stiffness: Option<f64>,
    /// Whether a constant offset of the displacement is fitted with the rest.
    pub offset: bool,
    /// Time by which the displacement is late, s.
    pub delay: Delay,
}

/// Delay between drive and displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Delay {
    /// Known, s; 0 for none.
    Fixed(f64),
    /// Fitted, up to twenty samples or a tenth of the drive's period, whichever is less.
    Fitted,
    /// Fitted between two bounds, s.
    Between(f64, f64),
}

impl Default for Delay {
    fn default() -> Self {
        Self::Fixed(0.0)
    }
}

impl Delay {
    /// The coordinate of the search.
    fn coordinate(self, record: &Record<'_>) -> Result<Coordinate> {
        let length = record.drive.dt * index(record.drive.u.len());
        let (low, high) = match self {
            Self::Fixed(value) => (value, value),
            Self::Fitted => {
                return Coordinate::between("delay", 0.0, bounds::longest_delay(record));
            }
            Self::Between(low, high) => (low, high),
        };
        if !(low >= 0.0 && high < length) {
            let found = if low < high || high < low {
                format!("({}, {}) s", shown(low), shown(high))
            } else {
                format!("{} s", shown(low))
            };
            let expected = format!("0 s or above, below the record's {length:.6} s");
            return Err(Error::parameter("delay", found, expected));
        }
        match self {
            Self::Fixed(value) => Ok(Coordinate::Fixed(value)),
            _ => Coordinate::between("delay", low, high),
        }
    }
}

/// A search made definite.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The kind of stage.
    pub model: Model,
    /// One for each place in [`Theta`].
    pub coordinates: [Coordinate; 10],
    /// Whether the stiffness is nominal because nothing fixes a force.
    pub scale_assumed: bool,
    /// Whether an offset is fitted.
    pub offset: bool,
}

const STIFFNESS: usize = 2;

impl Problem {
    /// Settles which parameters are free, and between which bounds.
    ///
    /// # Errors
    /// [`Error::Parameter`] for an unknown name, a value or bound out of range, a parameter
    /// that is both fixed and free or has no value, and where all the parameters that carry
    /// force are free.
    pub fn new(record: &Record<'_>, spec: &Spec) -> Result<Self> {
        let mut fixed = fixed_values(spec)?;
        let free = free_parameters(spec, &mut fixed)?;
        let forces = spec.model.facts().forces;
        let holds_scale =
            forces.is_empty() || forces.iter().any(|&i| fixed[i].is_some_and(|value| value != 0.0));
        let mut scale_assumed = false;
        if !holds_scale {
            let asked =
                spec.free.as_ref().is_some_and(|names| names.iter().any(|n| n == "stiffness"));
            if asked {
                return Err(Error::parameter(
                    "free",
                    "every parameter that carries force",
                    "one of them held: voltage and displacement fix only their ratios \
                     (give stiffness=, or name one in fixed=)",
                ));
            }
            fixed[STIFFNESS] = Some(NOMINAL_STIFFNESS);
            scale_assumed = true;
        }
        check_fixed(spec.model, &fixed)?;
        let mut coordinates = [Coordinate::Fixed(0.0); 10];
        coordinates[..DELAY].copy_from_slice(&bounds::derive(record, spec.model, &fixed)?);
        coordinates[DELAY] = spec.delay.coordinate(record)?;
        for (name, (low, high)) in &spec.bounds {
            let i = parameter(spec.model, "bounds", name)?;
            if !free[i] {
                return Err(Error::parameter(
                    format!("bounds of {name}"),
                    format!("({low}, {high})"),
                    "no bounds, as this parameter is not free",
                ));
            }
            coordinates[i] = Coordinate::between(name, *low, *high)?;
        }
        if scale_assumed && spec.bounds.iter().any(|(name, _)| name == "stiffness") {
            // Bounds make the stiffness a choice of the caller's, but no force is known.
            return Err(Error::parameter(
                "bounds of stiffness",
                "given, while no parameter that carries force is held",
                "stiffness=, or a value other than 0 for another of them in fixed=",
            ));
        }
        let problem = Self { model: spec.model, coordinates, scale_assumed, offset: spec.offset };
        problem.check_corners()?;
        Ok(problem)
    }

    /// Indices of the free parameters.
    pub fn free(&self) -> impl Iterator<Item = usize> {
        (0..self.coordinates.len())
            .filter(|&i| matches!(self.coordinates[i], Coordinate::Free { .. }))
    }

    /// All parameters at a place in the unit box of the free ones.
    #[must_use]
    pub fn theta(&self, place: &[f64]) -> Theta {
        let mut places = place.iter();
        self.coordinates.map(|coordinate| match coordinate {
            Coordinate::Fixed(value) => value,
            Coordinate::Free { .. } => coordinate.value(places.next().copied().unwrap_or(0.5)),
        })
    }

    /// Whether any guess has dry friction.
    #[must_use]
    pub fn has_friction(&self) -> bool {
        self.model == Model::Dahl && self.coordinates[7] != Coordinate::Fixed(0.0)
    }

    /// Whether any guess is late.
    #[must_use]
    pub fn has_delay(&self) -> bool {
        self.coordinates[DELAY] != Coordinate::Fixed(0.0)
    }

    /// Refuses bounds that reach where no stage exists.
    fn check_corners(&self) -> Result<()> {
        let count = self.free().count();
        if count == 0 {
            return Err(Error::parameter("free", "empty", "at least one parameter to search"));
        }
        for corner in [0.0, 1.0] {
            self.model.check(&self.theta(&vec![corner; count]))?;
        }
        Ok(())
    }
}

/// Values of `fixed=` and `stiffness=`, with the model's defaults.
fn fixed_values(spec: &Spec) -> Result<[Option<f64>; 9]> {
    let facts = spec.model.facts();
    let mut fixed: [Option<f64>; 9] = [None; 9];
    for (name, value) in &spec.fixed {
        let i = parameter(spec.model, "fixed", name)?;
        let unit = facts.parameters[i].unit;
        fixed[i] = Some(finite(&format!("fixed {name}"), *value, unit)?);
    }
    if let Some(stiffness) = spec.stiffness {
        positive("stiffness", stiffness, "N/m")?;
        if fixed[STIFFNESS].is_some_and(|value| value.to_bits() != stiffness.to_bits()) {
            return Err(Error::parameter(
                "stiffness",
                format!("{stiffness} N/m"),
                "the value given for it in fixed=, or only one of the two",
            ));
        }
        fixed[STIFFNESS] = Some(stiffness);
    }
    for &(i, value) in facts.defaults {
        fixed[i] = fixed[i].or(Some(value));
    }
    for missing in &mut fixed[facts.parameters.len()..] {
        *missing = Some(0.0);
    }
    Ok(fixed)
}

/// Refuses held values with which no stage exists, by their own names.
fn check_fixed(model: Model, fixed: &[Option<f64>; 9]) -> Result<()> {
    let mut theta = [1.0; 10];
    for &(i, value) in model.facts().defaults {
        theta[i] = value;
    }
    for (value, held) in theta.iter_mut().zip(fixed) {
        *value = held.unwrap_or(*value);
    }
    model.check(&theta)?;
    if model == Model::Dahl && theta[8] == 0.0 {
        return Err(Error::parameter("up", 0, "a value other than 0: without it no hysteresis"));
    }
    Ok(())
}

/// Which parameters are searched; each of the others must have a value.
fn free_parameters(spec: &Spec, fixed: &mut [Option<f64>; 9]) -> Result<[bool; 9]> {
    let Some(names) = &spec.free else {
        return Ok(fixed.map(|value| value.is_none()));
    };
    let mut free = [false; 9];
    for name in names {
        let i = parameter(spec.model, "free", name)?;
        if spec.fixed.iter().any(|(other, _)| other == name)
            || (i == STIFFNESS && fixed[i].is_some())
        {
            return Err(Error::parameter("free", name, "a parameter that is not fixed as well"));
        }
        if let Some((_, reason)) = spec.model.facts().held.iter().find(|(held, _)| *held == i) {
            return Err(Error::parameter("free", name, *reason));
        }
        free[i] = true;
        fixed[i] = None;
    }
    for i in 0..9 {
        let scale = i == STIFFNESS && !spec.model.facts().forces.is_empty();
        if !free[i] && fixed[i].is_none() && !scale {
            let name = spec.model.facts().parameters[i].name;
            return Err(Error::parameter(
                "free",
                names.join(", "),
                format!("{name} as well, or a value for it in fixed="),
            ));
        }
    }
    Ok(free)
}

/// Index of a parameter by its name.
fn parameter(model: Model, argument: &str, name: &str) -> Result<usize> {
    let parameters = model.facts().parameters;
    parameters.iter().position(|info| info.name == name).ok_or_else(|| {
        let names: Vec<&str> = parameters.iter().map(|info| info.name).collect();
        Error::parameter(argument, format!("'{name}'"), format!("one of {}", names.join(", ")))
    })
}
