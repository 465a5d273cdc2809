//! Errors of inputs: one sentence that names the argument and its value.

/// Result of anything that checks its input.
pub type Result<T> = core::result::Result<T, Error>;

/// An input that cannot be used, or a computation that reached no usable result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// An argument has a value that cannot be used.
    #[error("{name} is {value}: expected {expected}")]
    Parameter {
        /// The argument as the caller wrote it.
        name: String,
        /// Its value, with the unit.
        value: String,
        /// Description of a right value.
        expected: String,
    },
    /// An array has the wrong size.
    #[error("{name} has {found}: expected {expected}")]
    Shape {
        /// The argument as the caller wrote it.
        name: String,
        /// The shape found.
        found: String,
        /// The shape expected.
        expected: String,
    },
    /// A record cannot be used for what was asked.
    #[error("{0}")]
    Data(String),
    /// Valid input, but no usable result.
    #[error("{0}")]
    Numerical(String),
    /// Memory that cannot be had.
    #[error("{what}: {} MB of memory cannot be allocated", bytes.div_ceil(1_000_000))]
    Memory {
        /// Contents that it was to hold.
        what: String,
        /// Its size.
        bytes: usize,
    },
}

impl Error {
    /// An [`Error::Parameter`] from anything that can be shown.
    pub fn parameter(
        name: impl Into<String>,
        value: impl core::fmt::Display,
        expected: impl Into<String>,
    ) -> Self {
        Self::Parameter { name: name.into(), value: value.to_string(), expected: expected.into() }
    }

    /// The same error, said of one of several records by its label; as it is where that is empty.
    #[must_use]
    pub fn of(self, label: &str) -> Self {
        let of = |text: String| format!("{label}: {text}");
        match self {
            _ if label.is_empty() => self,
            Self::Parameter { name, value, expected } => {
                Self::Parameter { name: of(name), value, expected }
            }
            Self::Shape { name, found, expected } => {
                Self::Shape { name: of(name), found, expected }
            }
            Self::Data(text) => Self::Data(of(text)),
            Self::Numerical(text) => Self::Numerical(of(text)),
            Self::Memory { what, bytes } => Self::Memory { what: of(what), bytes },
        }
    }
}

impl From<piezotrack_control::Error> for Error {
    fn from(error: piezotrack_control::Error) -> Self {
        let piezotrack_control::Error { name, value, unit, expected } = error;
        Self::parameter(name, format!("{} {unit}", shown(value)).trim_end(), expected)
    }
}

/// Refuses a value that is not a finite number above zero.
///
/// # Errors
/// [`Error::Parameter`] naming the argument, its value and unit.
pub fn positive(name: &str, value: f64, unit: &str) -> Result<f64> {
    check(name, value, unit, value > 0.0, "a finite number above 0")
}

/// Refuses a value that is not a finite number, zero or above.
///
/// # Errors
/// [`Error::Parameter`] naming the argument, its value and unit.
pub fn not_negative(name: &str, value: f64, unit: &str) -> Result<f64> {
    check(name, value, unit, value >= 0.0, "a finite number, 0 or above")
}

/// Refuses NaN and infinity.
///
/// # Errors
/// [`Error::Parameter`] naming the argument, its value and unit.
pub fn finite(name: &str, value: f64, unit: &str) -> Result<f64> {
    check(name, value, unit, true, "a finite number")
}

/// Refuses 0 and what is not a finite number.
///
/// # Errors
/// [`Error::Parameter`] naming the argument, its value and unit.
pub fn not_zero(name: &str, value: f64, unit: &str) -> Result<f64> {
    finite(name, value, unit)?;
    // 0 is added, so that -0 is shown as 0.
    check(name, value + 0.0, unit, value != 0.0, "a value other than 0")
}

/// Refuses a number without a unit that is not finite or not within two others.
///
/// # Errors
/// [`Error::Parameter`] naming the argument and its value.
pub fn within(name: &str, value: f64, low: f64, high: f64) -> Result<f64> {
    finite(name, value, "")?;
    let expected = format!("a number from {low} to {high}");
    check(name, value, "", (low..=high).contains(&value), &expected)
}

/// A number as a person would write it, never with hundreds of digits.
#[must_use]
pub fn shown(value: f64) -> String {
    let size = value.abs();
    if value.is_finite() && size != 0.0 && !(1e-4..1e7).contains(&size) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// Most characters of a text that an error repeats.
const SHOWN: usize = 60;

/// A text of the caller's in quotes and in one line, and not all of a long one.
#[must_use]
pub fn shown_text(text: &str) -> String {
    let short: String = text.chars().take(SHOWN).flat_map(char::escape_debug).collect();
    let more = if text.chars().count() > SHOWN { "..." } else { "" };
    format!("'{short}{more}'")
}

fn check(name: &str, value: f64, unit: &str, holds: bool, expected: &str) -> Result<f64> {
    if value.is_finite() && holds {
        return Ok(value);
    }
    let space = if unit.is_empty() { "" } else { " " };
    Err(Error::parameter(name, format!("{}{space}{unit}", shown(value)), expected))
}
