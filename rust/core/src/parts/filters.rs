//! Filters of the measurement.

use piezotrack_control::Filter;

use super::info::{NumberInfo, PartInfo, Role};
use crate::error::{Error, Result, shown_text};

pub(super) const LOW_PASS: PartInfo =
    PartInfo::new(Role::Filter, "low-pass", "low-pass", &[NumberInfo::new("cutoff", "", "Hz")]);

pub(super) const NOTCH: PartInfo = PartInfo::new(
    Role::Filter,
    "notch",
    "notch",
    &[
        NumberInfo::new("frequency", "", "Hz"),
        NumberInfo::new("width", "", "").or(0.5),
        NumberInfo::new("depth", "", "").or(0.0),
    ],
);

/// A filter for samples every `dt` seconds, from its name and its numbers.
pub(super) fn filter(name: &str, numbers: &[f64], dt: f64) -> Result<Filter> {
    Ok(match (name, numbers) {
        ("notch", &[frequency, width, depth]) => Filter::notch(frequency, width, depth, dt)?,
        ("low-pass", &[cutoff]) => Filter::low_pass(cutoff, dt)?,
        ("notch", _) => return Err(NOTCH.refused(numbers)),
        ("low-pass", _) => return Err(LOW_PASS.refused(numbers)),
        (other, _) => {
            return Err(Error::parameter("filter", shown_text(other), "'low-pass' or 'notch'"));
        }
    })
}
