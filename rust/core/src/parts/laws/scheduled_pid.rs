//! PID whose gains follow amplitude and rate of the reference.

use piezotrack_control::{Pid, ScheduledPid};

use super::pid;
use crate::error::{Error, Result};
use crate::parts::info::{Form, NumberInfo, PartInfo, whole};

/// As a plain list it begins with the counts of amplitudes and of rates.
pub(super) const INFO: PartInfo = PartInfo::law(
    "scheduled-pid",
    "scheduled PID",
    &[
        NumberInfo::of("amplitudes", Form::List).in_unit("m"),
        NumberInfo::of("rates", Form::List).in_unit("Hz"),
        NumberInfo::of("first", Form::List).in_unit("m and Hz").or_none(),
        NumberInfo::of("gains", Form::Parts(&[&pid::INFO])),
    ],
);

pub(super) fn build(numbers: &[f64], dt: f64) -> Result<ScheduledPid> {
    let short = || {
        let expected = "two counts, as many amplitudes and rates, the first of each, and 4 numbers \
            for each pair";
        Error::parameter("law", format!("'scheduled-pid' with {} numbers", numbers.len()), expected)
    };
    let along = |number| whole("scheduled-pid, counts", number, 1.0);
    let (counts, rest) = numbers.split_at_checked(2).ok_or_else(short)?;
    let (amplitudes, rest) = rest.split_at_checked(along(counts[0])?).ok_or_else(short)?;
    let (rates, rest) = rest.split_at_checked(along(counts[1])?).ok_or_else(short)?;
    let (first, gains) = rest.split_at_checked(2).ok_or_else(short)?;
    let gains = gains.chunks_exact(4);
    if !gains.remainder().is_empty() {
        return Err(short());
    }
    let pids: Result<Vec<Pid>> = gains.map(pid::unsampled).collect();
    Ok(ScheduledPid::new(amplitudes, rates, &pids?, (first[0], first[1]), dt)?)
}
