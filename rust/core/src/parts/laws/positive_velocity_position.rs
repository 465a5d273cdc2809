//! Positive velocity and position feedback around a PID.

use piezotrack_control::{Damped, PositiveVelocityPositionFeedback, SampledPid};

use super::pid;
use crate::error::Result;
use crate::parts::info::{Form, NumberInfo, PartInfo};

pub(super) const INFO: PartInfo = PartInfo::law(
    "positive-velocity-position",
    "PID with positive velocity and position feedback",
    &[
        NumberInfo::of("pid", Form::Part(&[&pid::INFO])),
        NumberInfo::new("velocity_gain", "g1", "V/m"),
        NumberInfo::new("position_gain", "g2", "V/m"),
        NumberInfo::new("frequency", "wc", "Hz"),
        NumberInfo::new("damping_ratio", "zc", ""),
    ],
);

pub(super) fn build(numbers: &[f64], dt: f64) -> Result<Damped<SampledPid>> {
    let &[ref inside @ .., velocity, position, frequency, damping_ratio] = numbers else {
        return Err(INFO.refused(numbers));
    };
    let damping =
        PositiveVelocityPositionFeedback::new(velocity, position, frequency, damping_ratio)?;
    Ok(damping.around(pid::build(inside, dt)?, dt)?)
}
