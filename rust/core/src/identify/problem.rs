//! The search problem: the parameters held, and the free ones with their bounds.

use super::parameters::bounds;
use super::parameters::candidate::{BEFORE, DELAY, DRIFT_TIME, PLACES, Theta};
use super::parameters::constraint::Constraint;
use super::parameters::coordinate::{Coordinate, Scale};
use super::parameters::delay::Delay;
use super::parameters::drift::DriftKind;
use super::parameters::relations::Relations;
use super::records::creep_weights::check_times;
use super::records::history::{History, came_from};
use super::records::record::Record;
use crate::error::{Error, Result, finite, positive, shown_text};
use crate::integrator::MOST_PARAMETERS;
use crate::models::{FoundBy, Held, Measures, Model, NOMINAL_STIFFNESS, position};
use crate::signal::Stop;

/// Specification by the caller.
#[derive(Clone, Debug)]
pub struct Spec {
    /// The kind of stage.
    pub model: Model,
    /// Parameters that are searched although the model holds them by default, or the record does
    /// not show them; as are those with bounds, a scale or a prior, and all without a value.
    pub free: Vec<String>,
    /// Parameters held, SI.
    pub fixed: Vec<(String, f64)>,
    /// Bounds, SI.
    pub bounds: Vec<(String, (f64, f64))>,
    /// Whether a constant offset of the displacement is fitted with the rest.
    pub offset: bool,
    /// Delay of the displacement, s.
    pub delay: Delay,
    /// Drift of the sensor along the record.
    pub drift: DriftKind,
    /// Motion of the stage before the record.
    pub history: History,
    /// Time constants of the creep whose weights are fitted, s; none for no creep.
    pub creep_times: Vec<f64>,
    /// Scales of the search, `"linear"` or `"log"`; those that suit the bounds where not given.
    pub scales: Vec<(String, String)>,
    /// Parameters that follow from others, with their expressions.
    pub ties: Vec<(String, String)>,
    /// Inequalities between two parameters, as `"a < b"`.
    pub constraints: Vec<String>,
    /// Values that are known besides the record, with their standard deviations, SI.
    pub priors: Vec<(String, (f64, f64))>,
}

impl Spec {
    /// All that is not held by default is searched; no offset, delay or drift.
    #[must_use]
    pub fn of(model: Model) -> Self {
        Self {
            model,
            free: Vec::new(),
            fixed: Vec::new(),
            bounds: Vec::new(),
            offset: false,
            delay: Delay::default(),
            drift: DriftKind::None,
            history: History::Virgin,
            creep_times: Vec::new(),
            scales: Vec::new(),
            ties: Vec::new(),
            constraints: Vec::new(),
            priors: Vec::new(),
        }
    }

    fn scales(&self, name: &str) -> bool {
        self.scales.iter().any(|(other, _)| other == name)
    }

    fn frees(&self, name: &str) -> bool {
        self.free.iter().any(|other| other == name)
    }

    /// Names of the parameters of which something is said that only a searched one has.
    fn searched(&self) -> impl Iterator<Item = &str> {
        let bounded = self.bounds.iter().map(|(name, _)| name);
        let scaled = self.scales.iter().map(|(name, _)| name);
        let known = self.priors.iter().map(|(name, _)| name);
        self.free.iter().chain(bounded).chain(scaled).chain(known).map(String::as_str)
    }
}

/// A search with all its coordinates.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The kind of stage.
    pub model: Model,
    /// One for each place in [`Theta`].
    pub coordinates: [Coordinate; PLACES],
    /// Whether the stiffness is nominal because nothing fixes a force.
    pub scale_assumed: bool,
    /// Whether an offset is fitted.
    pub offset: bool,
    /// Motion of the stage before the record.
    pub history: History,
    /// Whether the drive is so slow that any lag is as likely as another that fits: the least is
    /// taken.
    pub slow: bool,
    /// Where the mass, which is held where it has no effect, may be where the record shows it.
    pub mass_if_shown: Option<Coordinate>,
    /// Time constants of the creep whose weights are fitted, s.
    pub creep_times: Vec<f64>,
    /// Ties, inequalities and priors.
    pub relations: Relations,
}

/// A value for each scalar parameter, where there is one.
type Fixed = [Option<f64>; MOST_PARAMETERS];

/// Parameters that are searched.
type Free = [bool; MOST_PARAMETERS];

impl Problem {
    /// Settles which parameters are free, and between which bounds; without what the record shows
    /// of modes where `stop` said so meanwhile.
    ///
    /// # Errors
    /// [`Error::Parameter`] for an unknown name, a value or bound out of range, a parameter
    /// that is both fixed and free or has no value, and where all the parameters that carry
    /// force are free.
    pub fn new(record: &Record<'_>, spec: &Spec, stop: Stop<'_>) -> Result<Self> {
        Ok(Self::of_records(&[(record, spec)], stop)?.remove(0))
    }

    /// The same for each of several records of one stage, with what is asked of it: the parameters
    /// of the stage have the same coordinates in all, between bounds that suit every record.
    ///
    /// Delay, drift, history and offset are a record's own; what is asked besides is that of the first.
    ///
    /// # Errors
    /// As [`Self::new`]; where one record is meant, with its label. [`Error::Parameter`] where there
    /// is no record.
    pub fn of_records(asked: &[(&Record<'_>, &Spec)], stop: Stop<'_>) -> Result<Vec<Self>> {
        let &[(_, spec), ..] = asked else {
            return Err(Error::parameter("records", "empty", "at least one"));
        };
        let records: Vec<&Record<'_>> = asked.iter().map(|&(record, _)| record).collect();
        let infos = spec.model.scalars();
        if spec.model.found_by() != FoundBy::Swarm {
            let found = format!("'{}'", spec.model.info().name);
            return Err(Error::parameter("model", found, "one that a swarm searches"));
        }
        let mut fixed = fixed_values(spec)?;
        let relations = Relations::read(
            infos,
            (&spec.ties, &spec.constraints),
            &spec.priors,
            records.iter().map(|record| record.window.len()).sum(),
        )?;
        check_tied(spec, &relations, &mut fixed)?;
        let free: Free = core::array::from_fn(|i| fixed[i].is_none() && !relations.is_tied(i));
        let has_scale = infos.iter().any(|info| info.carries_force);
        let holds_scale = !has_scale
            || infos
                .iter()
                .zip(&relations.known(&fixed))
                .any(|(info, value)| info.carries_force && value.is_some_and(|v| v != 0.0));
        let mut scale_assumed = false;
        if !holds_scale {
            if spec.frees("stiffness") {
                return Err(Error::parameter(
                    "stiffness",
                    "searched, as every parameter that carries force",
                    "one of them held in parameters=: voltage and displacement determine only \
                     their ratios",
                ));
            }
            let stiffness = position(infos, "stiffness", "stiffness")?;
            if let Some(tie) = relations.ties.iter().find(|tie| tie.parameter == stiffness) {
                return Err(Error::parameter(
                    "tie of stiffness",
                    shown_text(&tie.text),
                    "another parameter that carries force to be held, as voltage and displacement \
                     determine only their ratios",
                ));
            }
            fixed[stiffness] = Some(NOMINAL_STIFFNESS);
            scale_assumed = true;
        }
        check_fixed(spec.model, &fixed)?;
        let mut coordinates = [Coordinate::Fixed(0.0); PLACES];
        let wants_mode = spec.frees("mass") || spec.scales("mass");
        let known = relations.known(&fixed);
        let derived = bounds::derive(&records, spec.model, &known, wants_mode, stop)?;
        coordinates[..DELAY].copy_from_slice(&derived);
        enter_bounds(spec, &free, &mut coordinates)?;
        if scale_assumed && spec.bounds.iter().any(|(name, _)| name == "stiffness") {
            // Bounds make the stiffness a choice of the caller's, but no force is known.
            return Err(Error::parameter(
                "bounds of stiffness",
                "given, while no parameter that carries force is held",
                "a value for it, or one other than 0 for another of them, in parameters=",
            ));
        }
        let bounded = |name: &str| spec.bounds.iter().any(|(other, _)| other == name);
        relations.enter(spec.model, (&fixed, &free), &mut coordinates, bounded)?;
        enter_scales(spec, &mut coordinates)?;
        check_times(&spec.creep_times)?;
        let said = |name: &str| infos.iter().position(|info| info.name == name);
        let chosen = |name: &str| {
            let mentioned = said(name).is_some_and(|place| relations.mention(place));
            bounded(name) || mentioned || spec.scales(name)
        };
        let measures: Vec<Measures> =
            records.iter().map(|record| bounds::measures(record)).collect();
        let slow = !wants_mode
            && !chosen("damping")
            && measures.iter().all(|measures| measures.excited().is_none());
        let mass_if_shown = mass_if_shown(&measures, spec.model, &fixed, &coordinates)
            .filter(|_| !said("mass").is_some_and(|place| relations.mention(place)));
        let stage = Self {
            model: spec.model,
            coordinates,
            scale_assumed,
            offset: spec.offset,
            history: spec.history,
            slow,
            mass_if_shown,
            creep_times: spec.creep_times.clone(),
            relations,
        };
        let searched = |&(record, spec): &(&Record<'_>, &Spec)| {
            stage.on(record, spec).map_err(|error| record.named(error))
        };
        let all: Vec<Self> = asked.iter().map(searched).collect::<Result<_>>()?;
        if all.iter().all(|one| one.free().count() == 0) {
            return Err(Error::parameter("parameters", "all held", "at least one to search"));
        }
        Ok(all)
    }

    /// The search on a record, with the coordinates that are the record's own.
    fn on(&self, record: &Record<'_>, spec: &Spec) -> Result<Self> {
        let mut problem = Self { offset: spec.offset, history: spec.history, ..self.clone() };
        problem.coordinates[DELAY] = spec.delay.coordinate(record)?;
        problem.coordinates[DRIFT_TIME] = spec.drift.coordinate(record, spec.offset)?;
        if spec.history == History::Fitted {
            let (low, high) = came_from(&record.drive);
            problem.coordinates[BEFORE] = Coordinate::between("the voltage before", low, high)?;
        }
        problem.check_corners()?;
        Ok(problem)
    }

    /// Indices of the free parameters.
    pub fn free(&self) -> impl Iterator<Item = usize> {
        (0..self.coordinates.len())
            .filter(|&i| matches!(self.coordinates[i], Coordinate::Free { .. }))
    }

    /// All parameters at a place in the unit box of the free ones; NaN where ties make them such
    /// that no stage has them.
    #[must_use]
    pub fn theta(&self, place: &[f64]) -> Theta {
        let mut theta = self.values(place);
        self.relations.fail_without_stage(self.model, &mut theta);
        theta
    }

    /// All parameters at a place, whether a stage has them or not.
    fn values(&self, place: &[f64]) -> Theta {
        let mut places = place.iter();
        let unit = self.coordinates.map(|coordinate| match coordinate {
            Coordinate::Fixed(_) | Coordinate::Tied => f64::NAN,
            Coordinate::Free { .. } => places.next().copied().unwrap_or(0.5),
        });
        let mut theta = Theta(core::array::from_fn(|i| self.coordinates[i].value(unit[i])));
        if !self.relations.is_empty() {
            self.relations.settle(&self.coordinates, &unit, &mut theta);
        }
        theta
    }

    /// Whether the candidate at a place has the two parameters of each inequality equal.
    #[must_use]
    pub fn active(&self, place: &[f64]) -> Vec<bool> {
        let mut unit = [f64::NAN; PLACES];
        for (i, &z) in self.free().zip(place) {
            unit[i] = z;
        }
        let values = self.theta(place).0;
        let active = |one: &Constraint| one.is_active(&self.coordinates, &unit, &values);
        self.relations.constraints.iter().map(active).collect()
    }

    /// The parameters that all candidates share.
    #[must_use]
    pub fn held(&self) -> Held {
        let mut held = Held::defaults(self.model.scalars());
        for (slot, coordinate) in held.values.iter_mut().zip(&self.coordinates) {
            *slot = match coordinate {
                Coordinate::Fixed(value) => Some(*value),
                Coordinate::Free { .. } | Coordinate::Tied => None,
            };
        }
        held
    }

    /// Whether any candidate has a delay.
    #[must_use]
    pub fn has_delay(&self) -> bool {
        self.coordinates[DELAY] != Coordinate::Fixed(0.0)
    }

    /// Whether candidates have a drift.
    #[must_use]
    pub fn has_drift(&self) -> bool {
        self.coordinates[DRIFT_TIME] != Coordinate::Fixed(0.0)
    }

    /// The longest delay of any candidate, s.
    #[must_use]
    pub fn longest_delay(&self) -> f64 {
        let coordinate = self.coordinates[DELAY];
        [0.0, 1.0].map(|place| coordinate.value(place)).into_iter().fold(0.0, f64::max)
    }

    /// Refuses bounds that reach where no stage exists.
    fn check_corners(&self) -> Result<()> {
        let count = self.free().count();
        if !self.relations.ties.is_empty() {
            // Ties may have no stage at a corner: such candidates fail by themselves.
            return self.relations.check_middle(self.model, &self.values(&vec![0.5; count]));
        }
        for corner in [0.0, 1.0] {
            self.model.check(&self.theta(&vec![corner; count]).parameters())?;
        }
        Ok(())
    }
}

/// Range of a mass that nobody held, from where it is held up to a mode at three times the slowest
/// motion.
fn mass_if_shown(
    of: &[Measures],
    model: Model,
    fixed: &Fixed,
    coordinates: &[Coordinate; PLACES],
) -> Option<Coordinate> {
    let place = |name| position(model.scalars(), "parameters", name).ok();
    let (mass, stiffness) = (place("mass")?, place("stiffness")?);
    let Coordinate::Fixed(least) = coordinates[mass] else { return None };
    let slowest = 3.0 * of.iter().fold(f64::INFINITY, |slow, one| slow.min(one.slow));
    let most = coordinates[stiffness].value(1.0) / (slowest * slowest);
    fixed[mass].is_none().then(|| Coordinate::between("mass", least, most).ok())?
}

/// Values of the parameters that are held: as given, or the model's defaults of those of which
/// nothing is said.
fn fixed_values(spec: &Spec) -> Result<Fixed> {
    let infos = spec.model.scalars();
    let mut given: Fixed = [None; MOST_PARAMETERS];
    for (name, value) in &spec.fixed {
        let i = position(infos, "parameters", name)?;
        // A stiffness of 0 fixes no force, in place of which a nominal one would be held.
        let check = if name == "stiffness" { positive } else { finite };
        given[i] = Some(check(name, *value, infos[i].unit)?);
    }
    let defaults = Held::defaults(infos).values;
    let mut fixed: Fixed = core::array::from_fn(|i| given[i].or(defaults[i]));
    for name in spec.searched() {
        let i = position(infos, "parameters", name)?;
        if given[i].is_some() {
            continue;
        }
        if let Some(reason) = infos[i].held {
            return Err(Error::parameter("parameters", name, reason));
        }
        fixed[i] = None;
    }
    Ok(fixed)
}

/// Refuses held values with which no stage exists, by their own names.
fn check_fixed(model: Model, fixed: &Fixed) -> Result<()> {
    let defaults = Held::defaults(model.scalars()).values;
    let value = |i: usize| fixed[i].or(defaults[i]).unwrap_or(1.0);
    model.check(&core::array::from_fn(value))
}

/// Puts the bounds of the caller into the coordinates.
fn enter_bounds(spec: &Spec, free: &Free, coordinates: &mut [Coordinate; PLACES]) -> Result<()> {
    let infos = spec.model.scalars();
    for (name, (low, high)) in &spec.bounds {
        let i = position(infos, "parameters", name)?;
        if !free[i] {
            return Err(Error::parameter(
                format!("bounds of {name}"),
                format!("({low}, {high})"),
                "no bounds, as this parameter is held",
            ));
        }
        coordinates[i] = Coordinate::between(name, *low, *high)?;
    }
    Ok(())
}

/// Puts the scales of the caller into the coordinates.
fn enter_scales(spec: &Spec, coordinates: &mut [Coordinate; PLACES]) -> Result<()> {
    let infos = spec.model.scalars();
    for (name, scale) in &spec.scales {
        let i = position(infos, "parameters", name)?;
        coordinates[i] = coordinates[i].on(Scale::named(name, scale)?, name)?;
    }
    Ok(())
}

/// Refuses what else is said of a tied parameter, and takes its default away.
fn check_tied(spec: &Spec, relations: &Relations, fixed: &mut Fixed) -> Result<()> {
    for tie in &relations.ties {
        let name = spec.model.scalars()[tie.parameter].name;
        let beside = [
            ("value", spec.fixed.iter().any(|(other, _)| other == name)),
            ("bounds", spec.bounds.iter().any(|(other, _)| other == name)),
            ("scale", spec.scales(name)),
        ];
        if let Some((said, _)) = beside.iter().find(|(_, given)| *given) {
            return Err(Error::parameter(
                format!("tie of {name}"),
                shown_text(&tie.text),
                format!("no {said} of {name} in addition"),
            ));
        }
        fixed[tie.parameter] = None;
    }
    Ok(())
}
