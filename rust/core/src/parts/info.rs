//! Descriptions of parts: names, titles and units, for files, the command line, C and Python.

use crate::error::{Error, Result};

/// Where a part stands in a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Feedback law.
    Law,
    /// Filter of the measurement.
    Filter,
    /// Repetitive control.
    Repetitive,
    /// Filter Q of the repetitive control.
    Smoothing,
}

impl Role {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Law => "law",
            Self::Filter => "filter",
            Self::Repetitive => "repetitive",
            Self::Smoothing => "smoothing",
        }
    }
}

/// A part of a controller.
#[derive(Debug)]
pub struct PartInfo {
    /// The name in files, on the command line, in C and in both languages.
    pub name: &'static str,
    /// Name in sentences and pictures.
    pub title: &'static str,
    /// Where it stands.
    pub role: Role,
    /// Its numbers. As a plain list they come in this order, those of a part in it in its place,
    /// after the lengths of lists if it has any.
    pub numbers: &'static [NumberInfo],
}

impl PartInfo {
    /// A feedback law.
    #[must_use]
    pub const fn law(
        name: &'static str,
        title: &'static str,
        numbers: &'static [NumberInfo],
    ) -> Self {
        Self { name, title, role: Role::Law, numbers }
    }

    /// Another part.
    #[must_use]
    pub const fn new(
        role: Role,
        name: &'static str,
        title: &'static str,
        numbers: &'static [NumberInfo],
    ) -> Self {
        Self { name, title, role, numbers }
    }

    /// Refuses a list of numbers of another length.
    #[must_use]
    pub fn refused(&self, numbers: &[f64]) -> Error {
        let value = format!("'{}' with {} numbers", self.name, numbers.len());
        let mut names = Vec::new();
        self.names(&mut names);
        Error::parameter(self.role.name(), value, names.join(", "))
    }

    /// The names of its numbers, with those of parts in it.
    fn names(&self, into: &mut Vec<String>) {
        for number in self.numbers {
            match number.form {
                Form::Part([inside]) => inside.names(into),
                _ if number.unit.is_empty() => into.push(number.name.into()),
                _ => into.push(format!("{} in {}", number.name, number.unit)),
            }
        }
    }
}

/// Form of a number of a part.
#[derive(Clone, Copy, Debug)]
pub enum Form {
    /// A number; infinity too, where the part takes it.
    Number,
    /// A whole number.
    Count,
    /// 1 for yes, 0 for no.
    Truth,
    /// Place of a word in this list.
    Word(&'static [&'static str]),
    /// Numbers.
    List,
    /// A square matrix, row by row.
    Matrix,
    /// One of these parts.
    Part(&'static [&'static PartInfo]),
    /// Several of such parts.
    Parts(&'static [&'static PartInfo]),
    /// A stage of one of these models, of which the part has numbers of its own.
    Stage(&'static [&'static str]),
}

impl Form {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Number => "number",
            Self::Count => "count",
            Self::Truth => "truth",
            Self::Word(_) => "word",
            Self::List => "numbers",
            Self::Matrix => "matrix",
            Self::Part(_) => "part",
            Self::Parts(_) => "parts",
            Self::Stage(_) => "stage",
        }
    }

    /// The words, the names of parts or of models that it is one of.
    #[must_use]
    pub fn choices(self) -> Vec<&'static str> {
        match self {
            Self::Word(names) | Self::Stage(names) => names.to_vec(),
            Self::Part(parts) | Self::Parts(parts) => parts.iter().map(|part| part.name).collect(),
            _ => Vec::new(),
        }
    }
}

/// A number of a part.
#[derive(Clone, Copy, Debug)]
pub struct NumberInfo {
    /// The name that both languages use.
    pub name: &'static str,
    /// The symbol in the literature, empty where there is none.
    pub symbol: &'static str,
    /// SI unit for a drive in volts, empty where there is none.
    pub unit: &'static str,
    /// Form of the number.
    pub form: Form,
    /// Value where the caller gives none.
    pub default: Option<f64>,
    /// Whether it may be left out: NaN in a plain list.
    pub is_optional: bool,
}

impl NumberInfo {
    /// One number.
    #[must_use]
    pub const fn new(name: &'static str, symbol: &'static str, unit: &'static str) -> Self {
        Self { name, symbol, unit, form: Form::Number, default: None, is_optional: false }
    }

    /// Describe an entry that is no single number.
    #[must_use]
    pub const fn of(name: &'static str, form: Form) -> Self {
        Self { form, ..Self::new(name, "", "") }
    }

    /// Its unit.
    #[must_use]
    pub const fn in_unit(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }

    /// It has this value where the caller gives none.
    #[must_use]
    pub const fn or(self, value: f64) -> Self {
        Self { default: Some(value), ..self }
    }

    /// It may be left out.
    #[must_use]
    pub const fn or_none(self) -> Self {
        Self { is_optional: true, ..self }
    }
}

/// A count that came as a float.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
pub(super) fn whole(name: &str, number: f64, least: f64) -> Result<usize> {
    if (least..=f64::from(u32::MAX)).contains(&number) && number.fract().abs() <= 0.0 {
        return Ok(number as usize);
    }
    let expected = format!("a whole number from {least} on, below 2^32");
    Err(Error::parameter(name, format!("{number:?}"), expected))
}

/// A truth value that came as a float.
pub(super) fn truth(name: &str, number: f64) -> Result<bool> {
    match number {
        0.0 => Ok(false),
        1.0 => Ok(true),
        other => Err(Error::parameter(name, format!("{other:?}"), "0 or 1")),
    }
}
