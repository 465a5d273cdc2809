//! Observer of the hysteresis around a PID.

use piezotrack_control::hysteresis::{BoucWen, Dahl};
use piezotrack_control::unfused::Unfused;
use piezotrack_control::{HysteresisObserved, HysteresisObserver, SampledPid};

use super::pid;
use crate::error::{Error, Result};
use crate::parts::info::{Form, NumberInfo, PartInfo};

/// As a plain list it has the PID, gain (m/V) and time (s) of the linear part, correction, stroke
/// (m), and its operator: a1, a2 and curvature of a Dahl hysteresis, or rise, beta, gamma and
/// exponent of a Bouc-Wen one.
pub(super) const INFO: PartInfo = PartInfo::law(
    "hysteresis-observer",
    "PID with hysteresis observer",
    &[
        NumberInfo::of("stage", Form::Stage(&["dahl", "bouc-wen"])),
        NumberInfo::of("pid", Form::Part(&[&pid::INFO])),
        NumberInfo::new("correction", "L", "").or(0.1),
        NumberInfo::new("stroke", "", "m").or(100e-6),
    ],
);

/// The observer of either hysteresis.
pub(super) enum AnyObserved {
    Dahl(HysteresisObserved<Dahl<Unfused>, SampledPid>),
    BoucWen(HysteresisObserved<BoucWen<Unfused>, SampledPid>),
}

pub(super) fn build(numbers: &[f64], dt: f64) -> Result<AnyObserved> {
    let refused = || {
        let value = format!("'{}' with {} numbers", INFO.name, numbers.len());
        Error::parameter("law", value, "11 numbers of a Dahl hysteresis, or 12 of a Bouc-Wen one")
    };
    let (inside, rest) = numbers.split_at_checked(4).ok_or_else(refused)?;
    let &[gain, time, correction, stroke, ref operator @ ..] = rest else { return Err(refused()) };
    Ok(match *operator {
        [a1, a2, curvature] => {
            let operator = Dahl { a1, a2, gain: curvature };
            let observer = HysteresisObserver::new(operator, gain, time, correction, stroke)?;
            AnyObserved::Dahl(observer.around(pid::build(inside, dt)?, dt)?)
        }
        [rise, beta, gamma, exponent] => {
            let operator = BoucWen { rise, beta, gamma, exponent };
            let observer = HysteresisObserver::new(operator, gain, time, correction, stroke)?;
            AnyObserved::BoucWen(observer.around(pid::build(inside, dt)?, dt)?)
        }
        _ => return Err(refused()),
    })
}
