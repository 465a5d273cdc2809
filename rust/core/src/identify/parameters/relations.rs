//! Relations of parameters besides their bounds: ties, inequalities and priors.

use super::candidate::{DELAY, PLACES, Theta};
use super::constraint::{self, Constraint};
use super::coordinate::Coordinate;
use super::prior::{Prior, factor};
use super::tie::{self, Tie};
use crate::error::{Error, Result, shown, shown_text};
use crate::integrator::MOST_PARAMETERS;
use crate::models::{Model, ParameterInfo, position};

/// Relations between the parameters of a search, and what is known of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Relations {
    /// Each after those that it refers to.
    pub ties: Vec<Tie>,
    /// Each after those that limit its larger parameter.
    pub constraints: Vec<Constraint>,
    /// Knowledge besides the record.
    pub priors: Vec<Prior>,
    /// Samples in the window of the record, which stand against the priors.
    pub samples: usize,
}

impl Relations {
    /// Reads what a caller says.
    ///
    /// # Errors
    /// [`Error::Parameter`] for an unknown name, a text that cannot be read, a circle, or a value
    /// that cannot be used.
    pub fn read(
        infos: &[ParameterInfo],
        (ties, constraints): (&[(String, String)], &[String]),
        priors: &[(String, (f64, f64))],
        samples: usize,
    ) -> Result<Self> {
        let tie = |(name, text): &(String, String)| {
            let place = position(infos, "parameters", name)?;
            if let Some(reason) = infos[place].held {
                return Err(Error::parameter(format!("tie of {name}"), shown_text(text), reason));
            }
            Tie::read(infos, place, text)
        };
        let prior = |(name, (mean, width)): &(String, (f64, f64))| {
            let place = position(infos, "parameters", name)?;
            Prior::new(&infos[place], place, *mean, *width)
        };
        let ties: Result<Vec<Tie>> = ties.iter().map(tie).collect();
        let constraints: Result<Vec<Constraint>> =
            constraints.iter().map(|text| Constraint::read(infos, text)).collect();
        let priors: Result<Vec<Prior>> = priors.iter().map(prior).collect();
        Ok(Self {
            ties: tie::in_order(infos, ties?)?,
            constraints: constraint::in_order(constraints?)?,
            priors: priors?,
            samples,
        })
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ties.is_empty() && self.constraints.is_empty() && self.priors.is_empty()
    }

    /// Whether a parameter is tied.
    #[must_use]
    pub fn is_tied(&self, place: usize) -> bool {
        self.ties.iter().any(|tie| tie.parameter == place)
    }

    /// Places of the parameters that depend on several coordinates.
    pub fn dependent(&self) -> impl Iterator<Item = usize> {
        let ties = self.ties.iter().map(|tie| tie.parameter);
        ties.chain(self.constraints.iter().map(|one| one.lower))
    }

    /// Whether anything is said of a parameter.
    #[must_use]
    pub fn mention(&self, place: usize) -> bool {
        let tied = |tie: &Tie| tie.parameter == place || tie.names().any(|name| name == place);
        self.ties.iter().any(tied)
            || self.constraints.iter().any(|one| one.lower == place || one.upper == place)
            || self.priors.iter().any(|prior| prior.parameter == place)
    }

    /// The values that are held, with those that ties to held ones alone have and those that are
    /// known from elsewhere: what bounds can be derived from.
    pub(in crate::identify) fn known(
        &self,
        fixed: &[Option<f64>; MOST_PARAMETERS],
    ) -> [Option<f64>; MOST_PARAMETERS] {
        // Bounds derived from any other would not be finite.
        let usable = |value: &f64| value.abs() > 1e-60 && value.abs() < 1e60;
        let mut known = *fixed;
        for prior in &self.priors {
            known[prior.parameter] = Some(prior.mean).filter(usable);
        }
        for tie in &self.ties {
            let values = known.map(|value| value.unwrap_or(f64::NAN));
            let whole = tie.names().all(|name| fixed[name].is_some() || self.is_tied(name));
            let value = Some(tie.value(&values)).filter(|value| whole && usable(value));
            known[tie.parameter] = known[tie.parameter].or(value);
        }
        known
    }

    /// Puts them into the coordinates of a search.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a prior or a constraint of what is not searched, a prior outside its
    /// bounds, and where no candidate keeps the constraints.
    pub(in crate::identify) fn enter(
        &self,
        model: Model,
        (held, free): (&[Option<f64>; MOST_PARAMETERS], &[bool; MOST_PARAMETERS]),
        coordinates: &mut [Coordinate; PLACES],
        bounded: impl Fn(&str) -> bool,
    ) -> Result<()> {
        let infos = model.scalars();
        for tie in &self.ties {
            coordinates[tie.parameter] = Coordinate::Tied;
        }
        for prior in &self.priors {
            let (place, info) = (prior.parameter, &infos[prior.parameter]);
            if coordinates[place] == Coordinate::Tied {
                continue;
            }
            if !free[place] {
                return Err(prior.refuse(info, "none, as this parameter is held"));
            }
            let valid = |value: f64| {
                let at = |i: usize| if i == place { value } else { held[i].unwrap_or(1.0) };
                model.check(&core::array::from_fn(at))
            };
            if let Err(Error::Parameter { expected, .. }) = valid(prior.mean) {
                return Err(prior.refuse(info, expected));
            }
            if !bounded(info.name) {
                let (low, high) = prior.range(|value| valid(value).is_ok());
                coordinates[place] = Coordinate::between(info.name, low, high)?;
            }
            if let Coordinate::Free { low, high, .. } = coordinates[place]
                && !(low..=high).contains(&prior.mean)
            {
                let expected = format!("a value in its bounds, ({}, {})", shown(low), shown(high));
                return Err(prior.refuse(info, expected));
            }
        }
        constraint::tighten(&self.constraints, coordinates, infos)
    }

    /// Gives the tied parameters of a candidate their values, and the smaller ones of the
    /// constraints theirs, from its coordinates `unit` in the unit box.
    pub(in crate::identify) fn settle(
        &self,
        coordinates: &[Coordinate; PLACES],
        unit: &[f64; PLACES],
        theta: &mut Theta,
    ) {
        let mut limited = *coordinates;
        for one in &self.constraints {
            if let Coordinate::Free { .. } = limited[one.lower] {
                limited[one.lower] = limited[one.lower].limited(theta.0[one.upper]);
                theta.0[one.lower] = limited[one.lower].value(unit[one.lower]);
            }
        }
        for tie in &self.ties {
            theta.0[tie.parameter] = tie.value(&theta.0[..DELAY]);
        }
    }

    /// Makes a candidate fail with which no stage exists, as ties alone can make it.
    pub(in crate::identify) fn fail_without_stage(&self, model: Model, theta: &mut Theta) {
        if !self.ties.is_empty() && model.check(&theta.parameters()).is_err() {
            theta.0[..DELAY].fill(f64::NAN);
        }
    }

    /// Refuses ties that have no value, or none that a stage can have, in the middle of the box.
    ///
    /// # Errors
    /// [`Error::Parameter`] with the value there.
    pub(in crate::identify) fn check_middle(&self, model: Model, middle: &Theta) -> Result<()> {
        for tie in &self.ties {
            let info = &model.scalars()[tie.parameter];
            let value = middle.0[tie.parameter];
            let number = format!("{} {}", shown(value), info.unit);
            let text = shown_text(&tie.text);
            let found = format!("{text}, {} in the middle of the bounds", number.trim_end());
            let refused =
                |expected: &str| Error::parameter(format!("tie of {}", info.name), found, expected);
            if !value.is_finite() {
                return Err(refused("a finite number"));
            }
            if let Err(Error::Parameter { name, expected, .. }) = model.check(&middle.parameters())
                && name == info.name
            {
                return Err(refused(&expected));
            }
        }
        model.check(&middle.parameters())
    }

    /// Factor of the priors on the cost of a candidate; 1 without any.
    #[must_use]
    pub fn factor(&self, theta: &Theta) -> f64 {
        if self.priors.is_empty() { 1.0 } else { factor(&self.priors, theta, self.samples) }
    }
}
