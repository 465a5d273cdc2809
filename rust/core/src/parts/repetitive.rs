//! Repetitive control and the filters that it may have.

use piezotrack_control::{Repetitive, Smoothing};

use super::info::{Form, NumberInfo, PartInfo, Role, truth, whole};
use crate::error::{Error, Result, shown_text};

pub(super) const LAG: PartInfo = PartInfo::new(
    Role::Smoothing,
    "lag",
    "lag",
    &[NumberInfo::new("tq", "Tq", "s").or(0.2), NumberInfo::of("compensated", Form::Truth).or(0.0)],
);

pub(super) const ZERO_PHASE: PartInfo = PartInfo::new(
    Role::Smoothing,
    "zero-phase",
    "zero-phase low-pass",
    &[NumberInfo::of("order", Form::Count).or(2.0)],
);

pub(super) const REPETITIVE: PartInfo = PartInfo::new(
    Role::Repetitive,
    "repetitive",
    "repetitive control",
    &[
        NumberInfo::new("period", "L", "s"),
        NumberInfo::new("kq", "Kq", "V/m").or(1e6),
        NumberInfo::of("smoothing", Form::Part(&[&LAG, &ZERO_PHASE])).or_none(),
        NumberInfo::of("lead", Form::Count).in_unit("samples").or(0.0),
        NumberInfo::new("forgetting_factor", "", "").or(0.99),
        NumberInfo::of("pause", Form::Truth).or(1.0),
    ],
);

/// A repetitive part from the name of its smoothing and six numbers: period (s), kq (V/m), time
/// constant (s) or order of the smoothing, forgetting factor, lead (samples), 1 for a pause under
/// saturation.
pub(super) fn repetitive(smoothing: &str, numbers: &[f64]) -> Result<Repetitive> {
    let &[period, kq, number, forgetting_factor, lead, pause] = numbers else {
        let value = format!("{} with {} numbers", shown_text(smoothing), numbers.len());
        return Err(Error::parameter("repetitive", value, "six numbers"));
    };
    let smoothing = match smoothing {
        "lag" => Smoothing::Lag { tq: number, compensated: false },
        "compensated-lag" => Smoothing::Lag { tq: number, compensated: true },
        "zero-phase" => Smoothing::ZeroPhase { order: count("order", number)? },
        "none" => Smoothing::None,
        other => {
            let expected = "'lag', 'compensated-lag', 'zero-phase' or 'none'";
            return Err(Error::parameter("smoothing", shown_text(other), expected));
        }
    };
    let (lead, pause) = (count("lead", lead)?, truth("pause", pause)?);
    // The bound of the gain holds for errors in um.
    let part = Repetitive { period, smoothing, kq: kq / 1e6, forgetting_factor, lead, pause };
    part.check()?;
    Ok(part)
}

/// Checks the filter of a repetitive part alone.
pub(super) fn check_smoothing(name: &str, numbers: &[f64]) -> Result<()> {
    let smoothing = match (name, numbers) {
        ("lag", &[tq, compensated]) => {
            Smoothing::Lag { tq, compensated: truth("compensated", compensated)? }
        }
        ("zero-phase", &[order]) => Smoothing::ZeroPhase { order: count("order", order)? },
        ("zero-phase", _) => return Err(ZERO_PHASE.refused(numbers)),
        _ => return Err(LAG.refused(numbers)),
    };
    Ok(smoothing.check()?)
}

fn count(name: &str, number: f64) -> Result<u32> {
    Ok(u32::try_from(whole(name, number, 0.0)?).unwrap_or(u32::MAX))
}
