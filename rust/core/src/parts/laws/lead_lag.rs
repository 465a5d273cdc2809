//! Lead-lag compensator.

use piezotrack_control::{LeadLag, StateSpace};

use super::state_space::MOST_STATES;
use crate::error::Result;
use crate::parts::info::{Form, NumberInfo, PartInfo, truth};

pub(super) const INFO: PartInfo = PartInfo::law(
    "lead-lag",
    "lead-lag",
    &[
        NumberInfo::new("kp", "Kp", "V/m"),
        NumberInfo::new("lead", "Tlead", "s"),
        NumberInfo::new("lag", "Tlag", "s"),
        NumberInfo::of("method", Form::Word(&["tustin", "matched"])).or(0.0),
    ],
);

pub(super) fn build(numbers: &[f64], dt: f64) -> Result<StateSpace<MOST_STATES>> {
    let &[kp, lead, lag, matched] = numbers else { return Err(INFO.refused(numbers)) };
    let mut law = LeadLag::new(kp, lead, lag)?;
    law.matched = truth("lead-lag, method", matched)?;
    Ok(law.at(dt)?)
}
