//! Lead-lag compensator, as a law in state space.
//!
//! ```text
//! C(s) = K (1 + s T_lead)/(1 + s T_lag)
//! ```
//!
//! Franklin, Powell and Emami-Naeini, Feedback Control of Dynamic Systems; sampled by Tustin's rule
//! or with matched pole and zero. Both keep the static gain K.

use crate::error::{Error, Result, check, finite, not_negative, positive};
use crate::state_space::StateSpace;

/// A lead-lag compensator in continuous time.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `gain` | K | V/m | any |
/// | `lead`, `lag` | `T_lead`, `T_lag` | s | >= 0 |
///
/// ```
/// use piezotrack_control::{Feedback, FeedbackSample, LeadLag, StateSpace};
///
/// let law: StateSpace<1> = LeadLag::new(1e5, 0.01, 0.1)?.at(0.001)?;
/// let mut state = law.rest();
/// let sample = FeedbackSample::new(1e-6);
/// let volts = (0..2000).fold(0.0, |_, _| law.step(&mut state, &sample));
/// assert!((volts - 0.1).abs() < 1e-9);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeadLag {
    gain: f64,
    lead: f64,
    lag: f64,
    /// Matched pole and zero in place of Tustin's rule.
    pub matched: bool,
}

impl LeadLag {
    /// A compensator of gain (V/m) and two time constants (s), for Tustin's rule.
    ///
    /// # Errors
    /// Names the gain that is not finite or the time below 0.
    pub fn new(gain: f64, lead: f64, lag: f64) -> Result<Self> {
        Ok(Self {
            gain: finite("kp", gain, "V/m")?,
            lead: not_negative("lead", lead, "s")?,
            lag: not_negative("lag", lag, "s")?,
            matched: false,
        })
    }

    /// The law for a sampling interval `dt`, s.
    ///
    /// # Errors
    /// Names `dt` where it is not above 0; `lag` below `dt`/100 for Tustin's rule, whose pole then
    /// rings at half the sampling rate; `kp` where a coefficient overflows.
    pub fn at<const N: usize>(&self, dt: f64) -> Result<StateSpace<N>> {
        positive("dt", dt, "s")?;
        let (pole, direct) = if self.matched {
            // A time of 0 is a pole or a zero at the origin.
            let (pole, zero) = (libm::exp(-dt / self.lag), libm::exp(-dt / self.lead));
            (pole, -self.gain * libm::expm1(-dt / self.lag) / (1.0 - zero))
        } else {
            let expected = "at least a hundredth of a sampling interval for Tustin's rule";
            check("lag", self.lag, "s", self.lag >= 0.01 * dt, expected)?;
            let (lead, lag) = (2.0 * self.lead / dt, 2.0 * self.lag / dt);
            ((lag - 1.0) / (lag + 1.0), self.gain * (1.0 + lead) / (1.0 + lag))
        };
        let rest = (self.gain - direct) * (1.0 - pole);
        if !(direct.is_finite() && rest.is_finite() && pole.abs() < 1.0) {
            let expected = "a gain and times whose sampled coefficients are finite";
            return Err(Error { name: "kp", value: self.gain, unit: "V/m", expected });
        }
        StateSpace::new(&[pole], &[rest], &[1.0], direct, None)
    }
}
