//! Incremental PID controller with back-calculation antiwindup.
//!
//! ```text
//! uFB[k] = uFB[k-1] + Kp (e[k] - e[k-1]) + (Kp Ts/Ti) e[k]
//!          + (Kp Td/Ts) (e[k] - 2 e[k-1] + e[k-2]) + (Ts/Tt) eu[k-1],   eu = v - u
//! ```
//!
//! Xu and Li 2010, equations (22) to (25), doi 10.1115/1.4001712, with one correction. As
//! printed, the recursion starts from the previous *total* command and adds the feedforward
//! again, which integrates the feedforward and causes an error of about 100 um. Here the
//! recursion is that of the feedback part only. The excess `eu` is the applied voltage `v` less
//! the total command `u = uFB + uFF + uRC`.

use crate::cast::{Cast, rounded};
use crate::error::{Error, Result, check, finite, not_negative};
use crate::feedback_law::{Feedback, FeedbackSample};
use crate::number::{Number, Real};

/// Gains of a PID controller, in continuous time.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `kp` | Kp | V/m | any |
/// | `ti` | Ti | s | > 0, or infinite: no integral part |
/// | `td` | Td | s | >= 0 |
/// | `tt` | Tt | s | > Ts/2, or infinite: no antiwindup |
///
/// ```
/// use piezotrack_control::{Feedback, FeedbackSample, Pid};
///
/// let pid = Pid::new(0.120e6, 0.009, 0.044, None)?.at(0.02)?;
/// let mut state = pid.rest();
/// let volts = pid.step(&mut state, &FeedbackSample::new(1e-6));
/// assert!((volts - 0.120 * 0.02 / 0.009).abs() < 1e-12);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pid {
    kp: f64,
    ti: f64,
    td: f64,
    tt: f64,
}

impl Pid {
    /// Gains `kp` in V/m and times in s.
    ///
    /// `tt`, the time constant of back-calculation, is sqrt(Ti Td) by default, and Ti where Td
    /// is 0. Without an integral part (`ti` infinite) nothing winds up, and in an incremental
    /// controller a correction by back-calculation would stay for ever; there is no antiwindup
    /// then, and a finite `tt` is refused.
    ///
    /// # Errors
    /// Names the gain or time that is out of its range.
    pub fn new(kp: f64, ti: f64, td: f64, tt: Option<f64>) -> Result<Self> {
        finite("kp", kp, "V/m")?;
        check("ti", ti, "s", ti > 0.0, "a time above 0, or infinity for no integral part")?;
        not_negative("td", td, "s")?;
        let tt = match tt {
            Some(tt) => {
                check("tt", tt, "s", tt > 0.0, "a time above 0, or infinity for no antiwindup")?;
                let right = ti.is_finite() || tt.is_infinite();
                check("tt", tt, "s", right, "none: with ti infinite there is nothing to unwind")?
            }
            None if ti.is_finite() && td > 0.0 => libm::sqrt(ti) * libm::sqrt(td),
            None => ti,
        };
        Ok(Self { kp, ti, td, tt })
    }

    /// The published gains: Kp 0.120 V/um, Ti 0.009 s, Td 0.044 s, Tt = sqrt(Ti Td).
    ///
    /// Xu and Li 2010, section 5, doi 10.1115/1.4001712; for a sampling rate of 50 Hz.
    #[must_use]
    pub fn xu_li_2010() -> Self {
        Self { kp: 0.120e6, ti: 0.009, td: 0.044, tt: libm::sqrt(0.009 * 0.044) }
    }

    /// Kp, V/m.
    #[must_use]
    pub fn kp(&self) -> f64 {
        self.kp
    }

    /// Ti, s.
    #[must_use]
    pub fn ti(&self) -> f64 {
        self.ti
    }

    /// Td, s.
    #[must_use]
    pub fn td(&self) -> f64 {
        self.td
    }

    /// Tt, s.
    #[must_use]
    pub fn tt(&self) -> f64 {
        self.tt
    }

    /// The controller for a sampling interval `dt`, s.
    ///
    /// # Errors
    /// Names `dt` where it is not above 0; `tt` where it is not above dt/2, since the pole of
    /// back-calculation, 1 - dt/Tt, is then unstable; `kp` where a coefficient overflows.
    pub fn at(&self, dt: f64) -> Result<SampledPid> {
        crate::error::positive("dt", dt, "s")?;
        let right = self.tt > 0.5 * dt;
        check("tt", self.tt, "s", right, "more than half a sampling interval")?;
        let sampled = SampledPid {
            proportional: self.kp,
            integral: self.kp * (dt / self.ti),
            derivative: self.kp * (self.td / dt),
            tracking: dt / self.tt,
        };
        let right = sampled.integral.is_finite() && sampled.derivative.is_finite();
        let expected = "a gain whose coefficients Kp dt/Ti and Kp Td/dt are finite";
        if right {
            Ok(sampled)
        } else {
            Err(Error { name: "kp", value: self.kp, unit: "V/m", expected })
        }
    }
}

/// Coefficients of a PID controller for one sampling interval; see [`Pid::at`].
///
/// Gains change without a bump: continue with the same state and other coefficients. The state
/// is the output and two errors, and no coefficient multiplies the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledPid<T = f64> {
    /// Kp, V/m.
    proportional: T,
    /// Kp Ts/Ti, V/m.
    integral: T,
    /// Kp Td/Ts, V/m.
    derivative: T,
    /// Ts/Tt.
    tracking: T,
}

/// State of a PID controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PidState<T = f64> {
    /// The output, V.
    pub(crate) volts: T,
    /// The last two errors, m. `None` before the first error, which then stands for the earlier
    /// ones too, so that the controller starts without a derivative kick. Without an integral part
    /// nothing would ever make up for what it asks for: from 0 V, that is the first output then.
    pub(crate) errors: Option<[T; 2]>,
}

crate::snapshot!([T: Real] PidState<T> { volts, errors });
crate::snapshot!([T: Real] SampledPid<T> { proportional, integral, derivative, tracking });

impl Cast for SampledPid {
    type In<T: Real> = SampledPid<T>;

    fn cast<T: Real>(&self) -> Result<SampledPid<T>> {
        Ok(SampledPid {
            proportional: rounded("kp", self.proportional, "V/m")?,
            integral: rounded("ti", self.integral, "V/m")?,
            derivative: rounded("td", self.derivative, "V/m")?,
            tracking: rounded("tt", self.tracking, "")?,
        })
    }
}

impl<T: Real> SampledPid<T> {
    /// Kp, Kp Ts/Ti and Kp Td/Ts, V/m: the weights of `e[k] - e[k-1]`, `e[k]` and
    /// `e[k] - 2 e[k-1] + e[k-2]`.
    #[must_use]
    pub fn weights(&self) -> [T; 3] {
        [self.proportional, self.integral, self.derivative]
    }

    /// Ts/Tt: the weight of the voltage applied less the command, in the sample before.
    #[must_use]
    pub fn tracking(&self) -> T {
        self.tracking
    }

    /// The controller whose coefficients are a share, 0 to 1, of the way to those of another.
    #[must_use]
    pub fn towards(&self, other: &Self, share: T) -> Self {
        let between = |from: T, to: T| from + share * (to - from);
        Self {
            proportional: between(self.proportional, other.proportional),
            integral: between(self.integral, other.integral),
            derivative: between(self.derivative, other.derivative),
            tracking: between(self.tracking, other.tracking),
        }
    }
}

impl<N: Number> SampledPid<N> {
    /// The output after `volts` (V), of one controller or of lanes of them: for an error, the two
    /// before it, the last first, and the excess of the sample before.
    #[inline(always)]
    pub(crate) fn output(&self, volts: N, error: N, [e1, e2]: [N; 2], excess: N) -> N {
        let rise = error - e1;
        let bend = rise - (e1 - e2);
        let change = self.proportional * rise
            + self.integral * error
            + self.derivative * bend
            + self.tracking * excess;
        volts + change
    }

    /// The controllers that a function gives for each lane of numbers like `like`.
    pub(crate) fn in_lanes(like: N, of: impl Fn(usize) -> SampledPid<N::Lane>) -> Self {
        Self {
            proportional: like.by_lane(|lane| of(lane).proportional),
            integral: like.by_lane(|lane| of(lane).integral),
            derivative: like.by_lane(|lane| of(lane).derivative),
            tracking: like.by_lane(|lane| of(lane).tracking),
        }
    }
}

impl<T: Real> Feedback<T> for SampledPid<T> {
    type State = PidState<T>;

    fn rest(&self) -> PidState<T> {
        self.start(T::ZERO)
    }

    fn start(&self, volts: T) -> PidState<T> {
        PidState { volts, errors: None }
    }

    /// Always: no coefficient multiplies the output.
    fn adopt(&self, _before: &Self, _state: &mut PidState<T>) -> bool {
        true
    }

    #[inline]
    fn step(&self, state: &mut PidState<T>, sample: &FeedbackSample<T>) -> T {
        let FeedbackSample { error, excess, .. } = *sample;
        let [e1, e2] = state.errors.unwrap_or([error; 2]);
        if state.errors.is_none() && self.integral == T::ZERO && state.volts == T::ZERO {
            state.volts = self.proportional * error;
        }
        let volts = self.output(state.volts, error, [e1, e2], excess);
        if volts.is_finite() {
            *state = PidState { volts, errors: Some([error, e1]) };
        } else {
            // Overflow: hold the output, and start again from the next error.
            state.errors = None;
        }
        state.volts
    }
}
