//! The settings of a controller that a search may change, by their names.

use core::f64::consts::TAU;

use piezotrack_control::{
    Controller, DisturbanceObserver, Filter, IntegralResonantControl, LeadLag, Pid,
    PositivePositionFeedback, PositiveVelocityPositionFeedback, Repetitive, SlidingMode, Smoothing,
};

use crate::error::{Error, Result, shown_text};
use crate::parts::Law;

/// Highest cutoff of a low-pass, in sampling rates; above it the filter is left out.
pub const FASTEST: f64 = 2.0;

/// A setting that is sought.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Setting {
    /// Proportional gain of the PID, V/m.
    Proportional,
    /// Integral gain a sample, Kp Ts/Ti, V/m.
    Integral,
    /// Derivative gain a sample, Kp Td/Ts, V/m.
    Derivative,
    /// Cutoff of the low-pass on the measurement, Hz; above twice the sampling rate there is none.
    Cutoff,
    /// Middle of the notch, Hz.
    NotchFrequency,
    /// Damping ratio of the notch's poles.
    NotchWidth,
    /// Gain in the middle of the notch.
    NotchDepth,
    /// Learning gain of the repetitive part, V/um.
    Learning,
    /// Order of its zero-phase filter, to the nearest whole number; 0 for none.
    Order,
    /// Time constant of its lag, s, in place of the zero-phase filter.
    Lag,
    /// Samples by which it is advanced, to the nearest whole number.
    Lead,
    /// Its forgetting factor.
    Forgetting,
    /// Time constant of the zero of a lead-lag law, s.
    LeadTime,
    /// Time constant of its pole, s.
    LagTime,
    /// Switching gain of sliding mode control, V.
    Switching,
    /// Cutoff of a disturbance observer, Hz.
    Observer,
    /// Static gain of a damping filter, V/m.
    Damping,
    /// Its gain of the velocity, V/m at its frequency.
    DampingVelocity,
    /// Its natural frequency, or the cutoff of one of first order, Hz.
    DampingFrequency,
    /// Its damping ratio.
    DampingRatio,
}

/// Settings with their values.
pub type Settings = Vec<(Setting, f64)>;

/// Which feedback law has the gains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Structure {
    /// PID; without an integral gain PD.
    Pid,
    /// Lead-lag.
    LeadLag,
    /// Sliding mode, which inside its boundary layer is a PID.
    SlidingMode,
    /// Disturbance observer around a PID.
    DisturbanceObserver(Nominal),
    /// Disturbance observer around sliding mode.
    PerturbationEstimator(Nominal),
    /// Integral resonant control around a PID.
    IntegralResonant,
    /// Positive position feedback around a PID.
    PositivePosition,
    /// Positive velocity and position feedback around a PID.
    PositiveVelocityPosition,
}

/// The plant that an observer expects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nominal {
    /// Static gain, m/V.
    pub gain: f64,
    /// Time constant, s.
    pub time: f64,
}

/// All of them, with the names that both languages use.
const NAMES: [(&str, Setting); 20] = [
    ("kp", Setting::Proportional),
    ("ki", Setting::Integral),
    ("kd", Setting::Derivative),
    ("cutoff", Setting::Cutoff),
    ("notch_frequency", Setting::NotchFrequency),
    ("notch_width", Setting::NotchWidth),
    ("notch_depth", Setting::NotchDepth),
    ("kq", Setting::Learning),
    ("order", Setting::Order),
    ("tq", Setting::Lag),
    ("lead", Setting::Lead),
    ("forgetting_factor", Setting::Forgetting),
    ("lead_time", Setting::LeadTime),
    ("lag_time", Setting::LagTime),
    ("switching", Setting::Switching),
    ("observer", Setting::Observer),
    ("damping", Setting::Damping),
    ("damping_velocity", Setting::DampingVelocity),
    ("damping_frequency", Setting::DampingFrequency),
    ("damping_ratio", Setting::DampingRatio),
];

impl Setting {
    /// The setting of a name.
    ///
    /// # Errors
    /// [`Error::Parameter`] where there is none.
    pub fn named(name: &str) -> Result<Self> {
        NAMES.iter().find(|(known, _)| *known == name).map(|(_, setting)| *setting).ok_or_else(
            || {
                let names: Vec<&str> = NAMES.iter().map(|(known, _)| *known).collect();
                Error::parameter("setting", shown_text(name), names.join(", "))
            },
        )
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        NAMES.iter().find(|(_, setting)| *setting == self).map_or("", |(name, _)| name)
    }
}

/// A setting with the range in which it is sought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sought {
    /// Setting that is sought.
    pub setting: Setting,
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Whether equal ratios are equally far, not equal differences.
    pub logarithmic: bool,
}

impl Sought {
    /// The value at a place from 0 to 1.
    #[must_use]
    pub fn at(&self, place: f64) -> f64 {
        if self.logarithmic {
            return self.low * libm::pow(self.high / self.low, place);
        }
        self.low + (self.high - self.low) * place
    }

    /// Checks the range.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the setting.
    pub fn validate(&self) -> Result<()> {
        let ordered = self.low.is_finite() && self.high.is_finite() && self.low < self.high;
        if ordered && (!self.logarithmic || self.low > 0.0) {
            return Ok(());
        }
        let found = format!("{} to {}", self.low, self.high);
        Err(Error::parameter(self.setting.name(), found, "the lower end of the range first"))
    }
}

/// A controller of which some settings are sought.
#[derive(Clone, Copy, Debug)]
pub struct Template {
    /// Limits, span, and what is not sought.
    pub base: Controller<Law>,
    /// Sampling interval, s.
    pub dt: f64,
    /// Period of a repetitive part, s; `None` for none.
    pub period: Option<f64>,
    /// The feedback law.
    pub structure: Structure,
    /// Sign of its gains: that of the plant's gain.
    pub sign: f64,
}

impl Template {
    /// The controller with these settings; `None` where there is none with them.
    #[must_use]
    pub fn controller(&self, settings: &[(Setting, f64)]) -> Option<Controller<Law>> {
        let value = |wanted: Setting| {
            settings.iter().find(|(setting, _)| *setting == wanted).map(|(_, value)| *value)
        };
        let mut out = self.base;
        if let Some(kp) = value(Setting::Proportional) {
            out.feedback = self.law(kp, &value)?;
        }
        // Those of the base stay.
        let mut slots = out.filters.iter_mut().filter(|slot| slot.is_none());
        if let Some(cutoff) = value(Setting::Cutoff).filter(|one| one * self.dt <= FASTEST) {
            *slots.next()? = Some(Filter::low_pass(cutoff, self.dt).ok()?);
        }
        if let Some(frequency) = value(Setting::NotchFrequency) {
            let width = value(Setting::NotchWidth).unwrap_or(0.5);
            let depth = value(Setting::NotchDepth).unwrap_or(0.0);
            *slots.next()? = Some(Filter::notch(frequency, width, depth, self.dt).ok()?);
        }
        if let (Some(period), Some(kq)) = (self.period, value(Setting::Learning)) {
            out.repetitive = Some(Self::repetitive(period, kq, &value)?.at(self.dt).ok()?);
        }
        Some(out)
    }

    fn law(&self, kp: f64, value: &impl Fn(Setting) -> Option<f64>) -> Option<Law> {
        let dt = self.dt;
        let ki = value(Setting::Integral).unwrap_or(0.0);
        let kd = value(Setting::Derivative).unwrap_or(0.0);
        let inside = || pid(self.sign * kp, self.sign * ki, self.sign * kd, dt).ok()?.at(dt).ok();
        let sliding = || {
            let switching = value(Setting::Switching)?;
            let ti = if ki > 0.0 { kp * dt / ki } else { f64::INFINITY };
            let law = SlidingMode::new(switching, switching / kp, ti, kd * dt / kp, dt).ok()?;
            law.at(dt).ok()
        };
        let observer = |of: Nominal| {
            DisturbanceObserver::new(of.gain, of.time, value(Setting::Observer)?).ok()
        };
        let signed = |setting: Setting| Some(self.sign * value(setting)?);
        let poles = || Some((value(Setting::DampingFrequency)?, value(Setting::DampingRatio)?));
        Some(match self.structure {
            Structure::Pid => Law::Pid(inside()?),
            Structure::LeadLag => {
                let (lead, lag) = (value(Setting::LeadTime)?, value(Setting::LagTime)?);
                let law = LeadLag::new(self.sign * kp, lead, lag).ok()?;
                Law::StateSpace(law.at(dt).ok()?)
            }
            Structure::SlidingMode => Law::SlidingMode(sliding()?),
            Structure::DisturbanceObserver(of) => {
                Law::ObservedPid(observer(of)?.around(inside()?, dt).ok()?)
            }
            Structure::PerturbationEstimator(of) => {
                Law::ObservedSlidingMode(observer(of)?.around(sliding()?, dt).ok()?)
            }
            Structure::IntegralResonant => {
                let gain = signed(Setting::Damping)?;
                let corner = TAU * value(Setting::DampingFrequency)?;
                let law = IntegralResonantControl::new(gain * corner, 1.0 / gain).ok()?;
                Law::Damped(law.around(inside()?, dt).ok()?)
            }
            Structure::PositivePosition => {
                let ((wc, zc), gain) = (poles()?, signed(Setting::Damping)?);
                let law = PositivePositionFeedback::new(gain, wc, zc).ok()?;
                Law::Damped(law.around(inside()?, dt).ok()?)
            }
            Structure::PositiveVelocityPosition => {
                let ((wc, zc), position) = (poles()?, signed(Setting::Damping)?);
                let velocity = signed(Setting::DampingVelocity)?;
                let law = PositiveVelocityPositionFeedback::new(velocity, position, wc, zc).ok()?;
                Law::Damped(law.around(inside()?, dt).ok()?)
            }
        })
    }

    fn repetitive(
        period: f64,
        kq: f64,
        value: &impl Fn(Setting) -> Option<f64>,
    ) -> Option<Repetitive> {
        let smoothing = match (value(Setting::Lag), value(Setting::Order).map(whole)) {
            (Some(tq), _) => Smoothing::Lag { tq, compensated: true },
            (None, None | Some(0)) => Smoothing::None,
            (None, Some(order)) => Smoothing::ZeroPhase { order },
        };
        let part = Repetitive::new(period, smoothing, kq).ok()?;
        let forgetting_factor = value(Setting::Forgetting).unwrap_or(part.forgetting_factor);
        let lead = value(Setting::Lead).map_or(0, whole);
        Some(Repetitive { forgetting_factor, lead, ..part })
    }
}

/// A PID of gains a sample: Kp, Kp Ts/Ti and Kp Td/Ts, V/m.
///
/// Its antiwindup has the usual time, but one sampling interval at least.
///
/// # Errors
/// Those of [`Pid::new`].
pub fn pid(kp: f64, ki: f64, kd: f64, dt: f64) -> Result<Pid> {
    let ti = if ki.abs() > 0.0 { kp * dt / ki } else { f64::INFINITY };
    let td = kd * dt / kp;
    let usual = if td > 0.0 { libm::sqrt(ti * td) } else { ti };
    let tt = ti.is_finite().then_some(usual.max(dt));
    Ok(Pid::new(kp, ti, td, tt)?)
}

/// The nearest whole number.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn whole(value: f64) -> u32 {
    value.round() as u32
}
