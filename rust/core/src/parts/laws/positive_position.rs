//! Positive position feedback around a PID.

use piezotrack_control::{Damped, PositivePositionFeedback, SampledPid};

use super::pid;
use crate::error::Result;
use crate::parts::info::{Form, NumberInfo, PartInfo};

pub(super) const INFO: PartInfo = PartInfo::law(
    "positive-position",
    "PID with positive position feedback",
    &[
        NumberInfo::of("pid", Form::Part(&[&pid::INFO])),
        NumberInfo::new("gain", "g", "V/m"),
        NumberInfo::new("frequency", "wc", "Hz"),
        NumberInfo::new("damping_ratio", "zc", ""),
    ],
);

pub(super) fn build(numbers: &[f64], dt: f64) -> Result<Damped<SampledPid>> {
    let &[ref inside @ .., gain, frequency, damping_ratio] = numbers else {
        return Err(INFO.refused(numbers));
    };
    let damping = PositivePositionFeedback::new(gain, frequency, damping_ratio)?;
    Ok(damping.around(pid::build(inside, dt)?, dt)?)
}
