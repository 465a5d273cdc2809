//! Parts of a controller by their names and numbers, for those who call from another language.
//!
//! | law | its numbers |
//! | --- | --- |
//! | `pid` | kp (V/m), ti, td (s), tt (s; NaN for its default) |
//! | `state space` | n, then A row by row, B, C, D (V/m), and back-calculation (n) where it is given |
//! | `lead-lag` | kp (V/m), lead, lag (s), 1 for matched poles, else 0 |
//! | `sliding mode` | switching gain (V), layer (m), ti, td, tf (s) |
//! | `disturbance observer` | those of the PID; plant's gain (m/V) and time (s), cutoff (Hz) |
//! | `perturbation` | those of the sliding mode; plant's gain (m/V) and time (s), cutoff (Hz) |
//! | `Dahl observer` | those of the PID; gain (m/V), time (s), correction, stroke (m); a1, a2, curvature |
//! | `Bouc-Wen observer` | the same to the stroke; rise, beta, gamma, exponent |
//! | `scheduled pid` | counts of amplitudes and rates, both (m, Hz), the first of each; four for each PID |

use piezotrack_control::hysteresis::{BoucWen, Dahl};
use piezotrack_control::{
    Controller, DisturbanceObserver, Filter, HysteresisObserver, LeadLag, Limits, Pid, Repetitive,
    SampledPid, ScheduledPid, SlidingMode, Smoothing, Span, StateSpace,
};

use super::tracking::Law;
use crate::error::{Error, Result};
use crate::signal::sampling_interval;

/// A part by its name, with its numbers.
pub type Named<'a> = (&'a str, &'a [f64]);

/// What a controller is made of.
#[derive(Clone, Debug)]
pub struct ControllerParts<'a> {
    /// Sampling interval, s.
    pub dt: f64,
    /// Lowest and highest voltage, V.
    pub limits: (f64, f64),
    /// Lowest and highest displacement that the sensor can show, m; the default where not given.
    pub span: Option<(f64, f64)>,
    /// Largest displacement in a sampling interval, m.
    pub max_jump: Option<f64>,
    /// Feedback law, as of [`Law::named`].
    pub law: Option<Named<'a>>,
    /// Repetitive part, by the name of its smoothing.
    pub repetitive: Option<Named<'a>>,
    /// Filters of the measurement.
    pub filters: Vec<Named<'a>>,
}

impl ControllerParts<'_> {
    /// The controller.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a name that is unknown, another count of numbers, and a number out
    /// of its range.
    pub fn controller(&self) -> Result<Controller<Law>> {
        let dt = sampling_interval(self.dt)?;
        let law = match self.law {
            Some((name, numbers)) => Law::named(name, numbers, dt)?,
            None => Law::None,
        };
        let mut controller = Controller::new(Limits::new(self.limits.0, self.limits.1)?, law);
        if let Some((low, high)) = self.span {
            controller.span = Span::new(low, high)?;
        }
        if let Some(jump) = self.max_jump {
            controller.span = controller.span.with_max_jump(jump)?;
        }
        if let Some((name, numbers)) = self.repetitive {
            controller.repetitive = Some(repetitive(name, numbers)?.at(dt)?);
        }
        let most = controller.filters.len();
        if self.filters.len() > most {
            return Err(Error::parameter("filters", self.filters.len(), format!("{most} at most")));
        }
        for (slot, (name, numbers)) in controller.filters.iter_mut().zip(&self.filters) {
            *slot = Some(filter(name, numbers, dt)?);
        }
        Ok(controller)
    }
}

impl Law {
    /// A law for samples every `dt` seconds, from its name and its numbers; see the table of the
    /// module.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a name that is unknown, another count of numbers, and a number out
    /// of its range.
    pub fn named(name: &str, numbers: &[f64], dt: f64) -> Result<Self> {
        let sliding = |[switching, layer, ti, td, tf]: [f64; 5]| {
            SlidingMode::new(switching, layer, ti, td, tf)?.at(dt)
        };
        Ok(match (name, numbers) {
            ("pid", &[kp, ti, td, tt]) => Self::Pid(pid([kp, ti, td, tt], dt)?),
            ("state space", numbers) => Self::StateSpace(state_space(numbers)?),
            ("lead-lag", &[kp, lead, lag, matched]) => {
                let mut law = LeadLag::new(kp, lead, lag)?;
                law.matched = truth("lead-lag, matched", matched)?;
                Self::StateSpace(law.at(dt)?)
            }
            ("sliding mode", &[switching, layer, ti, td, tf]) => {
                Self::SlidingMode(sliding([switching, layer, ti, td, tf])?)
            }
            ("perturbation", &[switching, layer, ti, td, tf, gain, time, cutoff]) => {
                let inner = sliding([switching, layer, ti, td, tf])?;
                let observer = DisturbanceObserver::new(gain, time, cutoff)?;
                Self::ObservedSlidingMode(observer.around(inner, dt)?)
            }
            ("disturbance observer", &[kp, ti, td, tt, gain, time, cutoff]) => {
                let observer = DisturbanceObserver::new(gain, time, cutoff)?;
                Self::ObservedPid(observer.around(pid([kp, ti, td, tt], dt)?, dt)?)
            }
            (
                "Dahl observer",
                &[kp, ti, td, tt, gain, time, correction, stroke, a1, a2, curvature],
            ) => {
                let operator = Dahl { a1, a2, gain: curvature };
                let observer = HysteresisObserver::new(operator, gain, time, correction, stroke)?;
                Self::DahlObserver(observer.around(pid([kp, ti, td, tt], dt)?, dt)?)
            }
            (
                "Bouc-Wen observer",
                &[kp, ti, td, tt, gain, time, correction, stroke, rise, beta, gamma, exponent],
            ) => {
                let operator = BoucWen { rise, beta, gamma, exponent };
                let observer = HysteresisObserver::new(operator, gain, time, correction, stroke)?;
                Self::BoucWenObserver(observer.around(pid([kp, ti, td, tt], dt)?, dt)?)
            }
            ("scheduled pid", numbers) => Self::Scheduled(scheduled(numbers, dt)?),
            (other, numbers) => {
                let value = format!("'{other}' with {} numbers", numbers.len());
                return Err(Error::parameter("law", value, LAWS));
            }
        })
    }
}

/// What a law has to be.
const LAWS: &str = "'pid' with 4 numbers, 'lead-lag' with 4, 'sliding mode' with 5, 'disturbance \
    observer' with 7, 'perturbation' with 8, 'Dahl observer' with 11, 'Bouc-Wen observer' with 12, \
    'state space' or 'scheduled pid'";

/// The last number is NaN for the default of tt.
fn optional(tt: f64) -> Option<f64> {
    (!tt.is_nan()).then_some(tt)
}

fn pid([kp, ti, td, tt]: [f64; 4], dt: f64) -> Result<SampledPid> {
    Ok(Pid::new(kp, ti, td, optional(tt))?.at(dt)?)
}

fn state_space<const N: usize>(numbers: &[f64]) -> Result<StateSpace<N>> {
    let short = || {
        let expected = "the number of states n, then n x n + n + n + 1 numbers, or n more";
        Error::parameter("law", format!("state space with {} numbers", numbers.len()), expected)
    };
    let (n, rest) = split(numbers, 1).ok_or_else(short)?;
    let n = whole("state space, n", n[0], 1.0)?.min(rest.len());
    let (a, rest) = split(rest, n.saturating_mul(n)).ok_or_else(short)?;
    let (b, rest) = split(rest, n).ok_or_else(short)?;
    let (c, rest) = split(rest, n).ok_or_else(short)?;
    let (d, back) = split(rest, 1).ok_or_else(short)?;
    Ok(StateSpace::new(a, b, c, d[0], (!back.is_empty()).then_some(back))?)
}

/// Counts of amplitudes and rates, their values, those at first, then four numbers of each PID.
fn scheduled(numbers: &[f64], dt: f64) -> Result<ScheduledPid> {
    let short = || {
        let expected = "two counts, as many amplitudes and rates, the first of each, and 4 numbers \
            for each pair";
        Error::parameter("law", format!("scheduled pid with {} numbers", numbers.len()), expected)
    };
    let (counts, rest) = split(numbers, 2).ok_or_else(short)?;
    let along = |number| whole("scheduled pid, counts", number, 1.0);
    let (amplitudes, rest) = split(rest, along(counts[0])?).ok_or_else(short)?;
    let (rates, rest) = split(rest, along(counts[1])?).ok_or_else(short)?;
    let (first, gains) = split(rest, 2).ok_or_else(short)?;
    let pids: Result<Vec<Pid>> = gains
        .chunks_exact(4)
        .map(|one| Ok(Pid::new(one[0], one[1], one[2], optional(one[3]))?))
        .collect();
    Ok(ScheduledPid::new(amplitudes, rates, &pids?, (first[0], first[1]), dt)?)
}

fn split(numbers: &[f64], at: usize) -> Option<(&[f64], &[f64])> {
    numbers.split_at_checked(at)
}

/// A count that came as a float.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
fn whole(name: &str, number: f64, least: f64) -> Result<usize> {
    if (least..=f64::from(u32::MAX)).contains(&number) && number.fract().abs() <= 0.0 {
        return Ok(number as usize);
    }
    Err(Error::parameter(name, format!("{number:?}"), format!("a whole number from {least} on")))
}

/// A truth value that came as a float.
fn truth(name: &str, number: f64) -> Result<bool> {
    match number {
        0.0 => Ok(false),
        1.0 => Ok(true),
        other => Err(Error::parameter(name, format!("{other:?}"), "0 or 1")),
    }
}

/// A filter of the measurement: `low pass` with its cutoff (Hz), `notch` with its frequency (Hz),
/// width and depth.
fn filter(name: &str, numbers: &[f64], dt: f64) -> Result<Filter> {
    Ok(match (name, numbers) {
        ("notch", &[frequency, width, depth]) => Filter::notch(frequency, width, depth, dt)?,
        ("low pass", &[cutoff]) => Filter::low_pass(cutoff, dt)?,
        (other, numbers) => {
            let value = format!("'{other}' with {} numbers", numbers.len());
            let expected = "'notch' with three numbers or 'low pass' with one";
            return Err(Error::parameter("filters", value, expected));
        }
    })
}

/// A repetitive part from the name of its smoothing and six numbers: period (s), kq (V/m), time
/// constant (s) or order of the smoothing, forgetting factor, lead (samples), 1 for a pause under
/// saturation.
fn repetitive(smoothing: &str, numbers: &[f64]) -> Result<Repetitive> {
    let &[period, kq, number, forgetting_factor, lead, pause] = numbers else {
        let value = format!("'{smoothing}' with {} numbers", numbers.len());
        return Err(Error::parameter("repetitive", value, "six numbers"));
    };
    let whole = |name, number| -> Result<u32> {
        Ok(u32::try_from(whole(name, number, 0.0)?).unwrap_or(u32::MAX))
    };
    let smoothing = match smoothing {
        "lag" => Smoothing::Lag { tq: number, compensated: false },
        "compensated lag" => Smoothing::Lag { tq: number, compensated: true },
        "zero phase" => Smoothing::ZeroPhase { order: whole("order", number)? },
        "none" => Smoothing::None,
        other => {
            let expected = "'lag', 'compensated lag', 'zero phase' or 'none'";
            return Err(Error::parameter("smoothing", format!("'{other}'"), expected));
        }
    };
    let (lead, pause) = (whole("lead", lead)?, truth("pause", pause)?);
    // The bound of the gain holds for errors in um.
    let learner = Repetitive::new(period, smoothing, kq / 1e6)?;
    Ok(Repetitive { forgetting_factor, lead, pause, ..learner })
}
