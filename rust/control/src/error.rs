//! The error of a parameter out of its range: its name, its value and what was expected.

use core::fmt;

/// A parameter that is out of its range. It holds static text only and needs no allocation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Error {
    /// Name of the argument.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Unit of the value, empty where it has none.
    pub unit: &'static str,
    /// The values that are accepted.
    pub expected: &'static str,
}

/// Result of a function that checks its parameters.
pub type Result<T> = core::result::Result<T, Error>;

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let space = if self.unit.is_empty() { "" } else { " " };
        write!(f, "{} is {}{space}{}: expected {}", self.name, self.value, self.unit, self.expected)
    }
}

impl core::error::Error for Error {}

/// `value`, or an error unless `right`.
pub(crate) fn check(
    name: &'static str,
    value: f64,
    unit: &'static str,
    right: bool,
    expected: &'static str,
) -> Result<f64> {
    if right { Ok(value) } else { Err(Error { name, value, unit, expected }) }
}

/// Refuses NaN and infinity.
pub(crate) fn finite(name: &'static str, value: f64, unit: &'static str) -> Result<f64> {
    check(name, value, unit, value.is_finite(), "a finite number")
}

/// Refuses values other than finite numbers above zero.
pub(crate) fn positive(name: &'static str, value: f64, unit: &'static str) -> Result<f64> {
    let right = value.is_finite() && value > 0.0;
    check(name, value, unit, right, "a finite number above 0")
}

/// Refuses values other than finite numbers, zero or above.
pub(crate) fn not_negative(name: &'static str, value: f64, unit: &'static str) -> Result<f64> {
    let right = value.is_finite() && value >= 0.0;
    check(name, value, unit, right, "a finite number, 0 or above")
}

/// Whether a number may enter a state: NaN, infinity and numbers that soon overflow may not.
#[inline]
pub(crate) fn usable(value: f64) -> bool {
    value.abs() < 1e100
}
