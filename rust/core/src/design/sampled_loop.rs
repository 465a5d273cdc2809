//! The sampled closed loop: stage, feedback, filters and repetitive part.

use piezotrack_control::{Controller, Feedback, Filter, SampledRepetitive};

use super::linear_feedback::{LinearFeedback, of_filter, product};
use super::plant::LoopPlant;
use crate::error::{Error, Result, positive};
use crate::math::{C, Jet, Ratio};

/// Longest chain of delays that is counted exactly, in samples.
const LONGEST: usize = 1_000_000;

/// The repetitive part, `R = w^-lead Kq P/(1 - p w - P)`, P = sum of taps w^delay, w = 1/z.
#[derive(Clone, Debug)]
struct Learning {
    period: f64,
    pole: f64,
    gain: f64,
    lead: usize,
    nearest: usize,
    taps: Vec<f64>,
    /// `1 - p - P(1)`; 0 for a part that keeps all of a constant.
    forgets: f64,
}

/// The loop of one plant and one controller at one sampling interval, opened at the error.
#[derive(Clone, Debug)]
pub struct SampledLoop {
    dt: f64,
    plant: Ratio,
    /// Whole samples of delay of the plant.
    delay: usize,
    filters: Ratio,
    feedback: Ratio,
    /// Numerator of the feedback from the reference alone, where it is another.
    reference: Option<Ratio>,
    learning: Option<Learning>,
    /// Roots at exactly 1 that neither reference nor displacement show, and that are left out.
    hidden: usize,
    /// A real root `1 + delta` that is left out.
    left_out: Option<f64>,
    /// Factor on the plant's gain.
    gain: f64,
    named_gain: Option<f64>,
}

/// Both parts of the characteristic function `a + b` at a point; `b/a` is the open loop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parts {
    pub a: Jet,
    pub b: Jet,
}

impl SampledLoop {
    /// The loop of `plant` with the parts of a controller, all for the interval `dt`, s.
    ///
    /// # Errors
    /// Names `dt`; a plant or law without finite coefficients; delays beyond a million samples.
    pub fn new(
        plant: &LoopPlant,
        feedback: &impl LinearFeedback,
        filters: &[Filter],
        repetitive: Option<&SampledRepetitive>,
        dt: f64,
    ) -> Result<Self> {
        let (ratio, delay) = plant.sampled(positive("dt", dt, "s")?)?;
        let [above, below] = feedback.transfer_function();
        let proper = (1..=below.len()).contains(&above.len()) && below.last() == Some(&1.0);
        if !proper {
            let text = "the feedback's transfer function must be proper, its denominator monic";
            return Err(Error::Numerical(text.into()));
        }
        let mut law = Ratio { above, below }.checked("feedback")?;
        let mut hidden = law.cancel_integrators();
        // A root that is in both is in that of the reference too.
        let reference = feedback.reference_numerator().map(|above| Ratio {
            above: above.into_iter().skip(hidden).collect(),
            below: vec![1.0],
        });
        if law.above.iter().all(|c| *c == 0.0) {
            law = Ratio::constant(0.0);
        }
        let learning = repetitive.map(learning).transpose()?;
        if law.integrates() && learning.as_ref().is_some_and(|part| part.forgets == 0.0) {
            hidden += 1;
        }
        Ok(Self {
            dt,
            plant: ratio,
            delay,
            filters: filters.iter().fold(Ratio::constant(1.0), in_series),
            feedback: law,
            reference,
            learning,
            hidden,
            left_out: None,
            gain: 1.0,
            named_gain: feedback.named_gain(),
        })
    }

    /// The loop of `plant` with a controller that runs every `dt` seconds.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of<F: Feedback + LinearFeedback>(
        plant: &LoopPlant,
        controller: &Controller<F>,
        dt: f64,
    ) -> Result<Self> {
        let filters: Vec<Filter> = controller.filters.iter().flatten().copied().collect();
        Self::new(plant, &controller.feedback, &filters, controller.repetitive.as_ref(), dt)
    }

    /// The same loop with the plant's gain `factor` times as high.
    #[must_use]
    pub fn amplified(&self, factor: f64) -> Self {
        Self { gain: self.gain * factor, ..self.clone() }
    }

    /// The same loop without its repetitive part.
    #[must_use]
    pub fn without_repetitive(&self) -> Self {
        let both = self.feedback.integrates()
            && self.learning.as_ref().is_some_and(|part| part.forgets == 0.0);
        let hidden = self.hidden - usize::from(both);
        Self { learning: None, hidden, left_out: None, ..self.clone() }
    }

    /// The root that a forgetting factor has moved from exactly 1 to a little below, `z - 1`:
    /// still almost hidden, as it almost cancels with a pole of the repetitive part.
    pub(crate) fn almost_hidden(&self) -> Option<f64> {
        let part = self.learning.as_ref().filter(|_| self.feedback.integrates())?;
        if part.forgets == 0.0 {
            return None;
        }
        let newton = |f: &dyn Fn(Jet) -> Jet, start: f64| {
            let mut delta = start;
            for _ in 0..50 {
                let value = f(Jet { value: C::new(delta, 0.0), slope: C::new(1.0, 0.0) });
                let step = (value.value / value.slope).re;
                delta -= step;
                if step.abs() <= 1e-14 * delta.abs() {
                    return Some(delta);
                }
            }
            None
        };
        let below = |delta: Jet| {
            let w = (delta + Jet::constant(1.0)).inverse();
            Jet::constant(part.forgets) + delta * w * part.at(w).1
        };
        let pole = newton(&below, 0.0)?;
        let closed = |delta: Jet| {
            let parts = self.all_parts(delta);
            parts.a + parts.b
        };
        newton(&closed, pole).filter(|root| (root - pole).abs() < 0.5 * pole.abs())
    }

    /// The same loop with the root `1 + delta` left out.
    pub(crate) fn leaving_out(&self, delta: f64) -> Self {
        Self { left_out: Some(delta), ..self.clone() }
    }

    /// Sampling interval, s.
    #[must_use]
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Whether there is a repetitive part.
    #[must_use]
    pub fn repeats(&self) -> bool {
        self.learning.is_some()
    }

    /// Roots at exactly 1 that move neither displacement nor error.
    ///
    /// Beside a feedback that integrates, a repetitive part without forgetting factor has one: uRC
    /// and uFB move against each other. An incremental PID without an integral part has one too,
    /// its start value.
    #[must_use]
    pub fn hidden_roots(&self) -> usize {
        self.hidden
    }

    /// Kp of the feedback, V/m.
    pub(crate) fn named_gain(&self) -> Option<f64> {
        self.named_gain
    }

    /// Period of the repetitive part, in samples.
    pub(crate) fn period(&self) -> Option<f64> {
        self.learning.as_ref().map(|part| part.period)
    }

    /// `|d ln (1 - p w)/d ln z|` of the repetitive part's filter.
    pub(crate) fn turn_of_filter(&self, z: C) -> f64 {
        let pole = self.learning.as_ref().map_or(0.0, |part| part.pole);
        pole / (z - pole).norm()
    }

    /// The longest delay in the characteristic function, in samples.
    pub(crate) fn longest_delay(&self) -> usize {
        let learning = self.learning.as_ref().map_or(0, |part| part.nearest + part.taps.len());
        self.delay + learning
    }

    /// Degree of the characteristic function at infinity: its roots less its poles at 0.
    pub(crate) fn degree(&self) -> usize {
        let degree = self.plant.degree() + self.filters.degree() + self.feedback.degree();
        degree - usize::from(self.doubled()) - usize::from(self.left_out.is_some())
    }

    /// Whether feedback and repetitive part both have a pole at 1, so that one is left out.
    fn doubled(&self) -> bool {
        self.feedback.integrates() && self.learning.as_ref().is_some_and(|part| part.forgets == 0.0)
    }

    /// The characteristic function at `z = 1 + delta`.
    ///
    /// ```text
    /// a = dG dF dC dR,   b = nG nF w^delay (nC dR + dC nR)
    /// ```
    ///
    /// with a common factor `z - 1` of dC and dR taken out.
    pub(crate) fn parts(&self, delta: C) -> Parts {
        let delta = Jet { value: delta, slope: C::new(1.0, 0.0) };
        let Parts { a, b } = self.all_parts(delta);
        let Some(root) = self.left_out else { return Parts { a, b } };
        let without = (delta - Jet::constant(root)).inverse();
        Parts { a: a * without, b: b * without }
    }

    /// From the reference to the filtered displacement at `z = 1 + delta`: `b/(a + b)`, but for a law
    /// to which a reading is more than what is taken off the reference.
    pub(crate) fn complementary(&self, delta: C) -> C {
        let delta = Jet { value: delta, slope: C::new(1.0, 0.0) };
        let Parts { a, b } = self.all_parts(delta);
        let above = self.reference.as_ref().map(|reference| reference.at(delta).0);
        self.parts_of(delta, above).b.value / (a + b).value
    }

    fn all_parts(&self, delta: Jet) -> Parts {
        self.parts_of(delta, None)
    }

    /// All parts, with another numerator of the feedback where there is one.
    fn parts_of(&self, delta: Jet, above: Option<Jet>) -> Parts {
        let w = (delta + Jet::constant(1.0)).inverse();
        let (plant, plant_below) = self.plant.at(delta);
        let (filter, filter_below) = self.filters.at(delta);
        let forward = (plant * filter * w.power(self.delay).0).scale(self.gain);
        let rest = plant_below * filter_below;
        let (law, law_below) = self.feedback.at(delta);
        let law = above.unwrap_or(law);
        let Some(part) = &self.learning else {
            return Parts { a: rest * law_below, b: forward * law };
        };
        let (learnt, reduced) = part.at(w);
        // dR = forgets + (1 - w) S, and 1 - w = delta w
        if self.doubled() {
            let (_, below) = self.feedback.without_integrator().at(delta);
            let reduced = reduced * w;
            let both = law * reduced + below * learnt;
            return Parts { a: rest * law_below * reduced, b: forward * both };
        }
        let below = Jet::constant(part.forgets) + delta * w * reduced;
        Parts { a: rest * law_below * below, b: forward * (law * below + law_below * learnt) }
    }

    /// `Q (1 - z^lead Kq G F/(1 + G F C))` at `z = 1 + delta`, the gain from what is learnt in
    /// one period to what is learnt in the next; without a repetitive part, 0.
    pub(crate) fn learning_gain(&self, delta: C) -> C {
        let one = C::new(1.0, 0.0);
        let Some(part) = &self.learning else { return one * 0.0 };
        let at = Jet { value: delta, slope: one };
        let w = (at + Jet::constant(1.0)).inverse();
        let (learnt, _) = part.at(w);
        let taps = part.passed(w).value / (one - w.value * part.pole);
        let (plant, plant_below) = self.plant.at(at);
        let (filter, filter_below) = self.filters.at(at);
        let (law, law_below) = self.feedback.at(at);
        let forward = (plant * filter * w.power(self.delay).0).scale(self.gain);
        let closed = forward.value * law_below.value
            / (plant_below * filter_below * law_below + forward * law).value;
        taps - learnt.value / (one - w.value * part.pole) * closed
    }
}

impl Learning {
    /// P.
    fn passed(&self, w: Jet) -> Jet {
        let mut power = w.power(self.nearest).0;
        let mut sum = Jet::constant(0.0);
        for tap in &self.taps {
            sum = sum + power.scale(*tap);
            power = power * w;
        }
        sum
    }

    /// `w^-lead Kq P`, and S of `1 - p w - P = forgets + (1 - w) S`:
    /// `S = p + sum of taps (1 + w + ... + w^(delay-1))`.
    fn at(&self, w: Jet) -> (Jet, Jet) {
        let first = self.nearest - self.lead;
        let (mut early, _) = w.power(first);
        let (power, mut ones) = w.power(self.nearest);
        let mut late = power;
        let mut above = Jet::constant(0.0);
        let mut reduced = Jet::constant(self.pole);
        for tap in &self.taps {
            above = above + early.scale(*tap);
            reduced = reduced + ones.scale(*tap);
            ones = ones + late;
            early = early * w;
            late = late * w;
        }
        (above.scale(self.gain), reduced)
    }
}

fn learning(part: &SampledRepetitive) -> Result<Learning> {
    let recursion = part.recursion();
    if recursion.nearest > LONGEST {
        let found = format!("{} samples", recursion.nearest);
        return Err(Error::parameter("period", found, "a million sampling intervals or less"));
    }
    let taps: Vec<f64> = recursion.taps.iter().rev().copied().collect();
    let forgets = 1.0 - recursion.pole - taps.iter().sum::<f64>();
    Ok(Learning {
        period: recursion.period,
        pole: recursion.pole,
        gain: recursion.gain,
        lead: recursion.lead.min(recursion.nearest),
        nearest: recursion.nearest,
        // What rounding leaves of a sum that is 1
        forgets: if forgets.abs() < 4e-15 { 0.0 } else { forgets },
        taps,
    })
}

/// The filters so far with one more.
#[expect(clippy::needless_pass_by_value, reason = "the shape of a fold")]
pub(crate) fn in_series(before: Ratio, filter: &Filter) -> Ratio {
    let [above, below] = of_filter(filter);
    Ratio { above: product(&before.above, &above), below: product(&before.below, &below) }
}

/// A count as a number.
pub(crate) fn small(n: usize) -> f64 {
    u32::try_from(n).map_or(f64::INFINITY, f64::from)
}
