//! Incremental PID.

use piezotrack_control::{Pid, SampledPid};

use crate::error::Result;
use crate::parts::info::{NumberInfo, PartInfo};

pub(super) const INFO: PartInfo = PartInfo::law(
    "pid",
    "PID",
    &[
        NumberInfo::new("kp", "Kp", "V/m"),
        NumberInfo::new("ti", "Ti", "s"),
        NumberInfo::new("td", "Td", "s").or(0.0),
        NumberInfo::new("tt", "Tt", "s").or_none(),
    ],
);

pub(super) fn build(numbers: &[f64], dt: f64) -> Result<SampledPid> {
    Ok(unsampled(numbers)?.at(dt)?)
}

/// In continuous time.
pub(super) fn unsampled(numbers: &[f64]) -> Result<Pid> {
    let &[kp, ti, td, tt] = numbers else { return Err(INFO.refused(numbers)) };
    Ok(Pid::new(kp, ti, td, (!tt.is_nan()).then_some(tt))?)
}
