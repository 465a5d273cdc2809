//! Iterative learning: between two periods, the table of voltages for the next one.
//!
//! ```text
//! u[j+1] = Q (u[j]) + L (e[j]),   filters over the whole period, which goes on at its ends
//! ```
//!
//! u is what the table has above the feedforward, e the error of the last period. Both filters know
//! the samples after an instant as well as those before it: Q is symmetric, L leads. Bristow,
//! Tharayil and Alleyne 2006, doi 10.1109/MCS.2006.1636313. The taps come from a model:
//! `FrequencyRule.taps` in Python, which also tests that the update converges.

use crate::Real;
use crate::error::{Error, Result, check, finite};
use crate::limits::Limits;

/// Taps on each side of the middle one of Q, at most.
const HALF: usize = 64;

/// The update of a table between two periods; see the [module](self).
///
/// ```
/// use piezotrack_control::{IterativeLearning, Limits};
///
/// // Of an error, half is added a sample earlier, for a stage of 1 um/V that is one sample late.
/// let learning = [0.5e6, 0.0, 0.0];
/// let smoothing = [0.0, 1.0, 0.0];
/// let rule = IterativeLearning::new(&learning, &smoothing, Limits::new(0.0, 75.0)?)?;
/// let (feedforward, error) = ([10.0; 4], [0.0, 2e-6, 0.0, 0.0]);
/// let mut table = feedforward;
/// assert_eq!(rule.update(&mut table, &feedforward, &error)?, 0);
/// assert_eq!(table, [11.0, 10.0, 10.0, 10.0]);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IterativeLearning<'a, T = f64> {
    learning: &'a [T],
    smoothing: &'a [T],
    limits: Limits<T>,
}

impl<'a, T: Real> IterativeLearning<'a, T> {
    /// An update with the taps of L, V/m, and of Q.
    ///
    /// Both have an odd number of taps, in the order of an impulse response that begins before its
    /// impulse: the middle one weighs an instant's own sample, those before it the samples that
    /// come later, those after it the earlier ones. Q is symmetric.
    ///
    /// # Errors
    /// Names `learning` or `smoothing` where a tap is not finite, their number is even, or Q is
    /// not symmetric, keeps more than all of a constant, or has more than 129 taps.
    pub fn new(learning: &'a [T], smoothing: &'a [T], limits: Limits<T>) -> Result<Self> {
        for (name, taps, most) in
            [("learning", learning, usize::MAX), ("smoothing", smoothing, 2 * HALF + 1)]
        {
            let right = taps.len() % 2 == 1 && taps.len() <= most;
            check(name, length(taps), "taps", right, "an odd number, for smoothing 129 at most")?;
            for &tap in taps {
                finite(name, tap.into(), if name == "learning" { "V/m" } else { "" })?;
            }
        }
        let (ahead, behind) = (smoothing.iter(), smoothing.iter().rev());
        for (&one, &other) in ahead.zip(behind) {
            let (one, other): (f64, f64) = (one.into(), other.into());
            let right = (one - other).abs() <= 1e-12 * (1.0 + one.abs());
            check("smoothing", one, "", right, "the tap on the other side, for no phase")?;
        }
        let kept: f64 = smoothing.iter().map(|&tap| tap.into()).sum();
        // Each tap that was rounded is off by half of this at most.
        let near = 1e-9_f64.max(length(smoothing) * T::EPSILON.into());
        check("smoothing", kept, "", kept.abs() <= 1.0 + near, "a sum between -1 and 1")?;
        Ok(Self { learning, smoothing, limits })
    }

    /// Overwrites the `table` of the last period, V, with that of the next.
    ///
    /// `feedforward` is the part that is not learnt, V; `error` is reference less displacement, m,
    /// at the samples of the period. Returns the number of samples whose error was no number: from
    /// these nothing is learnt. A voltage of the table that is no number counts as nothing learnt.
    /// The table is within the limits, and what is learnt is what the table can have, so that
    /// nothing winds up.
    ///
    /// # Errors
    /// Names `feedforward` or `error` where its length is not that of the table, and `table` where
    /// that is shorter than Q. The table is unchanged then.
    pub fn update(&self, table: &mut [T], feedforward: &[T], error: &[T]) -> Result<usize> {
        let count = table.len();
        let text = "as many samples as the table has";
        check("feedforward", length(feedforward), "samples", feedforward.len() == count, text)?;
        check("error", length(error), "samples", error.len() == count, text)?;
        if count < self.smoothing.len() {
            let (value, expected) = (length(table), "as many as the smoothing has taps");
            return Err(Error { name: "table", value, unit: "samples", expected });
        }
        let half = self.smoothing.len() / 2;
        let base = |k: usize| if feedforward[k].is_usable() { feedforward[k] } else { T::ZERO };
        let learnt = |table: &[T], k: usize| {
            let one = table[k] - base(k);
            if one.is_usable() { one } else { T::ZERO }
        };
        // Samples that are overwritten before Q has no more use for them.
        let (mut first, mut before) = ([T::ZERO; HALF], [T::ZERO; HALF]);
        for i in 0..half {
            first[i] = learnt(table, i);
            before[i] = learnt(table, count - half + i);
        }
        for k in 0..count {
            let own = learnt(table, k);
            let mut sum = self.smoothing[half] * own;
            for i in 1..=half {
                let later = if k + i < count { learnt(table, k + i) } else { first[k + i - count] };
                let both = before[(k + half - i) % half] + later;
                sum = sum + self.smoothing[half + i] * both;
            }
            sum = sum + self.learnt_from(error, k);
            if half > 0 {
                before[k % half] = own;
            }
            let following = base(k) + if sum.is_usable() { sum } else { own };
            table[k] = self.limits.clip(following);
        }
        Ok(error.iter().filter(|one| !one.is_usable()).count())
    }

    /// Correction that L makes of the errors around sample `k`, V.
    fn learnt_from(&self, error: &[T], k: usize) -> T {
        let (count, half) = (error.len(), self.learning.len() / 2);
        // Tap 0 weighs the sample `half` after this one; L may be longer than the period.
        let mut at = (k + half) % count;
        let mut sum = T::ZERO;
        for &tap in self.learning {
            if error[at].is_usable() {
                sum = sum + tap * error[at];
            }
            at = if at == 0 { count - 1 } else { at - 1 };
        }
        sum
    }
}

/// Number of entries, for a message.
#[expect(clippy::cast_precision_loss, reason = "no table has 2^53 samples")]
fn length<T>(entries: &[T]) -> f64 {
    entries.len() as f64
}
