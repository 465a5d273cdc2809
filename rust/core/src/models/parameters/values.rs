//! Names and values of a model's parameters and states.

use crate::error::{Error, Result, shown_text};
use crate::integrator::{MOST_PARAMETERS, Parameters};

/// Name, symbol and unit of one parameter, and whether it is searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterInfo {
    /// The name that both languages use.
    pub name: &'static str,
    /// The symbol in the literature.
    pub symbol: &'static str,
    /// SI unit, empty where there is none.
    pub unit: &'static str,
    /// Whether it has the dimension of force: all such parameters can be scaled by one number.
    pub carries_force: bool,
    /// Value that is held by default.
    pub default: Option<f64>,
    /// Why it is never searched, if so.
    pub held: Option<&'static str>,
    /// Whether it is a list of numbers, as weights are.
    pub is_list: bool,
    /// Whether it may be left out: a list of none or one, or of any length.
    pub is_optional: bool,
}

impl ParameterInfo {
    /// One number.
    #[must_use]
    pub const fn new(name: &'static str, symbol: &'static str, unit: &'static str) -> Self {
        Self {
            name,
            symbol,
            unit,
            carries_force: false,
            default: None,
            held: None,
            is_list: false,
            is_optional: false,
        }
    }

    /// A list of any length.
    #[must_use]
    pub const fn list(name: &'static str, symbol: &'static str, unit: &'static str) -> Self {
        Self { is_list: true, ..Self::new(name, symbol, unit) }
    }

    /// One number, or none.
    #[must_use]
    pub const fn optional(name: &'static str, symbol: &'static str, unit: &'static str) -> Self {
        Self { is_optional: true, ..Self::new(name, symbol, unit) }
    }

    /// It may be left out.
    #[must_use]
    pub const fn or_none(self) -> Self {
        Self { is_optional: true, ..self }
    }

    /// It carries force.
    #[must_use]
    pub const fn force(self) -> Self {
        Self { carries_force: true, ..self }
    }

    /// It has this value where the caller says nothing.
    #[must_use]
    pub const fn or(self, value: f64) -> Self {
        Self { default: Some(value), ..self }
    }

    /// It is never searched, for this reason.
    #[must_use]
    pub const fn never_searched(self, reason: &'static str) -> Self {
        Self { held: Some(reason), ..self }
    }
}

/// Room for the parameters of any stage, or its state.
pub(in crate::models) const ROOM: usize = 20;

/// Descriptions with others after them.
pub(in crate::models) const fn extended(
    own: &[ParameterInfo],
    more: &[ParameterInfo],
) -> [ParameterInfo; ROOM] {
    let mut all = [ParameterInfo::new("", "", ""); ROOM];
    let mut i = 0;
    while i < own.len() + more.len() {
        all[i] = if i < own.len() { own[i] } else { more[i - own.len()] };
        i += 1;
    }
    all
}

/// Values of named parameters, or of a state, in the order of their descriptions.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    infos: &'static [ParameterInfo],
    entries: Vec<Vec<f64>>,
}

impl Values {
    /// Values by their names, in any order.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a name that is unknown, given twice or missing;
    /// [`Error::Shape`] where a single number is a list of another length.
    pub fn named(
        infos: &'static [ParameterInfo],
        given: impl IntoIterator<Item = (String, Vec<f64>)>,
    ) -> Result<Self> {
        let mut entries: Vec<Option<Vec<f64>>> = vec![None; infos.len()];
        for (name, numbers) in given {
            let i = position(infos, "parameters", &name)?;
            let (found, info) = (numbers.len(), &infos[i]);
            if !(info.is_list || found == 1 || info.is_optional && found == 0) {
                let expected = if info.is_optional { "one number or none" } else { "one number" };
                let found = format!("{found} numbers");
                return Err(Error::Shape { name, found, expected: expected.into() });
            }
            if entries[i].replace(numbers).is_some() {
                return Err(Error::parameter(name, "given twice", "one value"));
            }
        }
        let mut whole = Vec::with_capacity(infos.len());
        for (info, entry) in infos.iter().zip(entries) {
            let entry = entry.or((info.is_list && info.is_optional).then(Vec::new));
            whole.push(entry.ok_or_else(|| Error::parameter(info.name, "missing", "a value"))?);
        }
        Ok(Self { infos, entries: whole })
    }

    /// Values of parameters that are single numbers, in their order; zeros where there are more,
    /// and lists without entries.
    #[must_use]
    pub fn scalars(infos: &'static [ParameterInfo], numbers: &[f64]) -> Self {
        let entry = |(i, info): (usize, &ParameterInfo)| {
            if info.is_list { vec![] } else { vec![numbers.get(i).copied().unwrap_or(0.0)] }
        };
        Self { infos, entries: infos.iter().enumerate().map(entry).collect() }
    }

    /// The first of the values, which `infos` describes.
    #[must_use]
    pub fn leading(&self, infos: &'static [ParameterInfo]) -> Self {
        Self { infos, entries: self.entries.iter().take(infos.len()).cloned().collect() }
    }

    /// These values and others after them, described together by `infos`.
    #[must_use]
    pub fn followed(&self, infos: &'static [ParameterInfo], others: Vec<Vec<f64>>) -> Self {
        Self { infos, entries: self.entries.iter().cloned().chain(others).collect() }
    }

    /// The values with another number of a parameter.
    #[must_use]
    pub fn with(&self, name: &str, number: f64) -> Self {
        let mut entries = self.entries.clone();
        if let Some(i) = self.infos.iter().position(|info| info.name == name) {
            entries[i] = vec![number];
        }
        Self { infos: self.infos, entries }
    }

    /// Values given whole, in the order of their descriptions.
    #[must_use]
    pub fn of(
        infos: &'static [ParameterInfo],
        entries: impl IntoIterator<Item = Vec<f64>>,
    ) -> Self {
        Self { infos, entries: entries.into_iter().collect() }
    }

    /// The first number of each parameter, in their order.
    #[must_use]
    pub fn numbers<const N: usize>(&self) -> [f64; N] {
        core::array::from_fn(|i| self.entries.get(i).and_then(|e| e.first()).map_or(0.0, |v| *v))
    }

    /// The numbers of a parameter by its name; none where there is no such parameter.
    #[must_use]
    pub fn list(&self, name: &str) -> &[f64] {
        let place = self.infos.iter().position(|info| info.name == name);
        place.map_or(&[], |i| &self.entries[i])
    }

    /// The number of a parameter by its name; 0 where there is no such parameter.
    #[must_use]
    pub fn number(&self, name: &str) -> f64 {
        self.list(name).first().copied().unwrap_or(0.0)
    }

    /// Names and numbers, in their order.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &[f64])> {
        self.infos.iter().zip(&self.entries).map(|(info, numbers)| (info.name, numbers.as_slice()))
    }
}

/// Place of a parameter by its name.
///
/// # Errors
/// [`Error::Parameter`] naming the `argument` where there is none of that name.
pub fn position(infos: &[ParameterInfo], argument: &str, name: &str) -> Result<usize> {
    infos.iter().position(|info| info.name == name).ok_or_else(|| {
        let names: Vec<&str> = infos.iter().map(|info| info.name).collect();
        Error::parameter(argument, shown_text(name), format!("one of {}", names.join(", ")))
    })
}

/// Parameters that all candidates of a search share; those that are searched have no value.
#[derive(Clone, Copy, Debug)]
pub struct Held {
    infos: &'static [ParameterInfo],
    /// In the order of the model's parameters.
    pub values: [Option<f64>; MOST_PARAMETERS],
}

impl Held {
    /// The defaults of a model's parameters, and nothing else.
    #[must_use]
    pub fn defaults(infos: &'static [ParameterInfo]) -> Self {
        let values = core::array::from_fn(|i| infos.get(i).map_or(Some(0.0), |info| info.default));
        Self { infos, values }
    }

    /// All parameters of one candidate.
    #[must_use]
    pub fn all(infos: &'static [ParameterInfo], parameters: &Parameters<f64>) -> Self {
        Self { infos, values: parameters.map(Some) }
    }

    /// The value of a parameter by its name, where it is held.
    #[must_use]
    pub fn value(&self, name: &str) -> Option<f64> {
        let place = self.infos.iter().position(|info| info.name == name)?;
        self.values[place]
    }
}
