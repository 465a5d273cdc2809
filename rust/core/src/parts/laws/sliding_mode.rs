//! Sliding mode control with a boundary layer.

use piezotrack_control::{SampledSlidingMode, SlidingMode};

use crate::error::Result;
use crate::parts::info::{NumberInfo, PartInfo};

pub(super) const INFO: PartInfo = PartInfo::law(
    "sliding-mode",
    "sliding mode",
    &[
        NumberInfo::new("switching", "eta", "V"),
        NumberInfo::new("layer", "phi", "m"),
        NumberInfo::new("ti", "Ti", "s").or(f64::INFINITY),
        NumberInfo::new("td", "Td", "s").or(0.0),
        NumberInfo::new("tf", "Tf", "s").or(0.0),
    ],
);

pub(super) fn build(numbers: &[f64], dt: f64) -> Result<SampledSlidingMode> {
    let &[switching, layer, ti, td, tf] = numbers else { return Err(INFO.refused(numbers)) };
    Ok(SlidingMode::new(switching, layer, ti, td, tf)?.at(dt)?)
}
