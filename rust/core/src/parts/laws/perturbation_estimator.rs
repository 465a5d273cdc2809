//! Sliding mode control with perturbation estimation.

use piezotrack_control::{DisturbanceObserver, Observed, SampledSlidingMode};

use super::sliding_mode;
use crate::error::Result;
use crate::parts::info::{Form, NumberInfo, PartInfo};

pub(super) const INFO: PartInfo = PartInfo::law(
    "perturbation-estimator",
    "sliding mode with perturbation estimation",
    &[
        NumberInfo::of("sliding", Form::Part(&[&sliding_mode::INFO])),
        NumberInfo::new("plant_gain", "g", "m/V"),
        NumberInfo::new("plant_time", "T", "s").or(0.0),
        NumberInfo::new("cutoff", "wc", "Hz").or(f64::INFINITY),
    ],
);

pub(super) fn build(numbers: &[f64], dt: f64) -> Result<Observed<SampledSlidingMode>> {
    let &[ref inside @ .., gain, time, cutoff] = numbers else { return Err(INFO.refused(numbers)) };
    let inside = sliding_mode::build(inside, dt)?;
    Ok(DisturbanceObserver::new(gain, time, cutoff)?.around(inside, dt)?)
}
