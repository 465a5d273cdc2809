//! Discrete state space.

use piezotrack_control::StateSpace;

use crate::error::{Error, Result};
use crate::parts::info::{Form, NumberInfo, PartInfo, whole};

/// Most states of a feedback law in state space.
pub const MOST_STATES: usize = 16;

/// As a plain list it begins with the number of states n.
pub(super) const INFO: PartInfo = PartInfo::law(
    "state-space",
    "state-space feedback",
    &[
        NumberInfo::of("a", Form::Matrix),
        NumberInfo::of("b", Form::List),
        NumberInfo::of("c", Form::List),
        NumberInfo::new("d", "D", "V/m").or(0.0),
        NumberInfo::of("back", Form::List).or_none(),
    ],
);

pub(super) fn build(numbers: &[f64], _dt: f64) -> Result<StateSpace<MOST_STATES>> {
    let short = || {
        let expected = "the number of states n, then n x n + n + n + 1 numbers, or n more";
        Error::parameter("law", format!("'state-space' with {} numbers", numbers.len()), expected)
    };
    let (n, rest) = numbers.split_at_checked(1).ok_or_else(short)?;
    let n = whole("state-space, n", n[0], 1.0)?.min(rest.len());
    let (a, rest) = rest.split_at_checked(n.saturating_mul(n)).ok_or_else(short)?;
    let (b, rest) = rest.split_at_checked(n).ok_or_else(short)?;
    let (c, rest) = rest.split_at_checked(n).ok_or_else(short)?;
    let (d, back) = rest.split_at_checked(1).ok_or_else(short)?;
    Ok(StateSpace::new(a, b, c, d[0], (!back.is_empty()).then_some(back))?)
}
