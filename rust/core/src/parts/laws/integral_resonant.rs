//! Integral resonant control around a PID.

use piezotrack_control::{Damped, IntegralResonantControl, SampledPid};

use super::pid;
use crate::error::Result;
use crate::parts::info::{Form, NumberInfo, PartInfo};

pub(super) const INFO: PartInfo = PartInfo::law(
    "integral-resonant",
    "PID with integral resonant control",
    &[
        NumberInfo::of("pid", Form::Part(&[&pid::INFO])),
        NumberInfo::new("gain", "k", "V/m/s"),
        NumberInfo::new("feedthrough", "d", "m/V"),
    ],
);

pub(super) fn build(numbers: &[f64], dt: f64) -> Result<Damped<SampledPid>> {
    let &[ref inside @ .., gain, feedthrough] = numbers else { return Err(INFO.refused(numbers)) };
    let damping = IntegralResonantControl::new(gain, feedthrough)?;
    Ok(damping.around(pid::build(inside, dt)?, dt)?)
}
