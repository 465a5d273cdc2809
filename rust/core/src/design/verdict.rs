//! Stability check of a controller on a plant.

use piezotrack_control::{Controller, Feedback};

use super::argument_principle::{Peak, Place};
use super::linear_feedback::LinearFeedback;
use super::margins::Margins;
use super::plant::LoopPlant;
use super::sampled_loop::SampledLoop;
use super::stability::{GainRange, Root};
use crate::error::Result;
use crate::math::C;

/// A loop gain so many times off its limit is taken for a wrong unit.
const WRONG_UNIT: f64 = 3e4;

/// Where the search for the small-gain bound begins, rad.
const SLOWEST: f64 = 1e-6;

/// The longest delay line, in samples, whose roots [`SampledLoop::check`] counts.
const EXACT: usize = 10_000;

/// Stability and margins of the closed loop of a plant and a controller, as far as they are known.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Whether it is stable, hidden roots aside.
    pub stable: bool,
    /// Whether that was decided by counting roots. With a delay line of more than 10 000 samples
    /// it is by the small-gain bound, which may call a stable loop unstable; roots, periods and
    /// gains are `None` then.
    pub exact: bool,
    /// How many roots are outside the unit circle; `None` where one is on it.
    pub outside: Option<usize>,
    /// The slowest root, the largest; `None` where all vanish within samples.
    pub slowest: Option<Root>,
    /// Roots at exactly 1 that move neither displacement nor error: see
    /// [`SampledLoop::hidden_roots`]. Under saturation they drift.
    pub hidden: usize,
    /// Factors on the plant's gain between which the loop is stable; `None` where there are
    /// none.
    pub gains: Option<GainRange>,
    /// The same for the feedback without the repetitive part.
    pub feedback_gains: Option<GainRange>,
    /// The root that a forgetting factor has moved from exactly 1 to a little below. uRC and uFB
    /// return by it from where they have drifted; the error hardly shows it.
    pub almost_hidden: Option<Root>,
    /// Periods until 1/e of an error is left, by the slowest root beside the almost hidden one;
    /// `None` without a repetitive part or for an unstable loop.
    pub periods: Option<f64>,
    /// The small-gain bound of [`SampledLoop::small_gain`]; `None` without a repetitive part.
    pub small_gain: Option<f64>,
    /// Margins of the feedback without the repetitive part.
    pub margins: Margins,
    /// Possible fault of the settings, in a sentence.
    pub hint: Option<String>,
}

/// Checks a controller that runs every `dt` seconds against a plant.
///
/// # Errors
/// As [`SampledLoop::new`]. An unstable loop is no error here but a verdict.
///
/// ```
/// use piezotrack_control::{Controller, Limits, Pid};
/// use piezotrack_core::design::{LoopPlant, check_loop};
///
/// // Kp per micrometre where per metre was meant: a million times too high
/// let pid = Pid::new(0.120e12, 0.009, 0.044, None)?.at(0.02)?;
/// let controller = Controller::new(Limits::new(0.0, 75.0)?, pid);
/// let verdict = check_loop(&LoopPlant::fixed_gain(1.2e-6)?, &controller, 0.02)?;
/// assert!(!verdict.stable && verdict.hint.is_some());
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn check_loop<F: Feedback + LinearFeedback>(
    plant: &LoopPlant,
    controller: &Controller<F>,
    dt: f64,
) -> Result<Verdict> {
    SampledLoop::of(plant, controller, dt)?.check()
}

impl SampledLoop {
    /// All that is known about this loop.
    ///
    /// # Errors
    /// [`crate::Error::Numerical`] where its numbers are too large to count roots with.
    pub fn check(&self) -> Result<Verdict> {
        let feedback = self.without_repetitive();
        let exact = self.longest_delay() <= EXACT;
        let small_gain = self.small_gain();
        let outside = if exact { self.roots_outside(1.0) } else { None };
        let bounded = || small_gain.is_none_or(|gain| gain < 1.0) && feedback.is_stable();
        let stable = if exact { outside == Some(0) } else { bounded() };
        let slowest = if exact { self.slowest_root()? } else { None };
        let almost_hidden = self.almost_hidden();
        let seen = match almost_hidden {
            Some(delta) if exact => self.leaving_out(delta).slowest_root()?,
            _ => slowest,
        };
        let samples = seen.filter(|_| stable).map(|root| root.samples);
        let feedback_gains = feedback.stable_gains();
        Ok(Verdict {
            stable,
            exact,
            outside,
            slowest,
            hidden: self.hidden_roots(),
            almost_hidden: almost_hidden.map(|delta| self.root(C::new(delta, 0.0), 0.0)),
            gains: match (exact, self.repeats()) {
                (true, true) => self.stable_gains(),
                (true, false) => feedback_gains,
                (false, _) => None,
            },
            feedback_gains,
            periods: self.period().and_then(|period| samples.map(|samples| samples / period)),
            small_gain,
            margins: feedback.margins(),
            hint: feedback.hint(feedback_gains),
        })
    }

    /// The largest `|Q (1 - z^lead Kq G F/(1 + G F C))|` above frequency 0.
    ///
    /// Below 1, and with a feedback that is stable by itself, the repetitive loop is stable
    /// whatever its period (small-gain theorem; Inoue et al. 1981, Hara et al. 1988, doi
    /// 10.1109/9.1274). Sufficient, not necessary. At frequency 0 without forgetting factor it is
    /// 1, the hidden root. `None` without a repetitive part.
    #[must_use]
    pub fn small_gain(&self) -> Option<f64> {
        if !self.repeats() {
            return None;
        }
        let feedback = self.without_repetitive();
        let size = |theta: f64| self.learning_gain(feedback.place(1.0, theta).delta).norm();
        // Q turns too, most where its pole is near
        let turn = |place: &Place| {
            let open = place.turn_open().norm().max(place.turn_closed().norm());
            8.0 * open.max(self.turn_of_filter(place.z()))
        };
        let mut peak = Peak::default();
        feedback.sweep(1.0, SLOWEST, turn, |left, right| {
            peak.take(left.theta, right.theta, size(right.theta));
        });
        Some(peak.refine(size).height)
    }

    /// Describe a possible fault of the gain of a feedback whose stable range is known.
    fn hint(&self, gains: Option<GainRange>) -> Option<String> {
        let gain = self.named_gain()?;
        if gain == 0.0 {
            return None;
        }
        let Some(GainRange { high, .. }) = gains else {
            let reversed = self.amplified(-1.0).stable_gains().is_some();
            let text = "no gain of this sign is stable, but one of the other sign is: has the \
                        sign of kp, or of the plant, been reversed?";
            return reversed.then(|| text.into());
        };
        if !high.is_finite() {
            return None;
        }
        let limit = gain * high;
        let micrometres = |kp: f64| kp * 1e-6;
        if high < 1.0 / WRONG_UNIT {
            let (times, meant) = (1.0 / high, micrometres(gain));
            return Some(format!(
                "kp = {gain:.3e} V/m is {times:.1e} times above the largest stable gain, \
                 {limit:.3e} V/m: did you mean {meant:.3e} V/m, that is {:.3e} V/um?",
                micrometres(meant),
            ));
        }
        (high > WRONG_UNIT).then(|| {
            format!(
                "kp = {gain:.3e} V/m is {high:.1e} times below the largest stable gain, \
                 {limit:.3e} V/m, and hardly does anything: did you mean {gain:.3e} V/um?"
            )
        })
    }
}
