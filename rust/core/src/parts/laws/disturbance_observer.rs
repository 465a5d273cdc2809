//! Disturbance observer around a PID.

use piezotrack_control::{DisturbanceObserver, Observed, SampledPid};

use super::pid;
use crate::error::Result;
use crate::parts::info::{Form, NumberInfo, PartInfo};

pub(super) const INFO: PartInfo = PartInfo::law(
    "disturbance-observer",
    "PID with disturbance observer",
    &[
        NumberInfo::of("pid", Form::Part(&[&pid::INFO])),
        NumberInfo::new("plant_gain", "g", "m/V"),
        NumberInfo::new("plant_time", "T", "s").or(0.0),
        NumberInfo::new("cutoff", "wc", "Hz"),
    ],
);

pub(super) fn build(numbers: &[f64], dt: f64) -> Result<Observed<SampledPid>> {
    let &[ref inside @ .., gain, time, cutoff] = numbers else { return Err(INFO.refused(numbers)) };
    let observer = DisturbanceObserver::new(gain, time, cutoff)?;
    Ok(observer.around(pid::build(inside, dt)?, dt)?)
}
