//! Requirements that a loop keeps for every plant of a set, read off a grid of frequencies.
//!
//! For a search: thousands of controllers against the same plants, whose responses are computed
//! once. The grid is fine where a plant turns fast; what it says of the best controller is checked
//! by [`crate::design`], which is exact.

use core::f64::consts::PI;

use piezotrack_control::{Controller, SampledRepetitive};

use crate::design::{LinearFeedback, LoopPlant, in_series};
use crate::error::{Error, Result, positive};
use crate::math::{C, Ratio};
use crate::parts::Law;

/// Requirements that every loop of a set keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Requirements {
    /// Least gain margin, a factor above 1.
    pub gain_margin: f64,
    /// Least phase margin, rad.
    pub phase_margin: f64,
    /// Largest sensitivity Ms, above 1.
    pub sensitivity: f64,
    /// Largest gain from what is learnt in one period to what is learnt in the next.
    pub learning: f64,
    /// Fastest change of the command, V/s; infinite for any.
    pub slew: f64,
    /// Largest share of samples at which the command is clipped.
    pub largest_saturation: f64,
    /// Largest rms error over all motions, m; infinite for any.
    pub largest_error: f64,
}

impl Requirements {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the one that no loop can keep.
    pub fn validate(&self) -> Result<()> {
        // The search of a loop that forgets nothing bounds what is learnt by 1 and a rounding.
        let learning = positive("learning", self.learning, "")?.min(1.0);
        check_margins(self.gain_margin, self.phase_margin, self.sensitivity, learning)?;
        if self.slew.is_nan() || self.slew <= 0.0 {
            let found = format!("{} V/s", self.slew);
            return Err(Error::parameter("slew", found, "above 0, or infinity"));
        }
        if self.largest_error.is_nan() || self.largest_error <= 0.0 {
            let found = format!("{} m", self.largest_error);
            return Err(Error::parameter("largest_error", found, "above 0, or infinity"));
        }
        if !(0.0..=1.0).contains(&self.largest_saturation) {
            let expected = "a share, 0 to 1";
            return Err(Error::parameter("largest_saturation", self.largest_saturation, expected));
        }
        Ok(())
    }
}

/// Checks margins as those of [`Requirements`], `phase` in rad.
///
/// # Errors
/// [`Error::Parameter`] naming the one that no loop can keep.
pub fn check_margins(gain: f64, phase: f64, sensitivity: f64, learning: f64) -> Result<()> {
    for (name, value) in [("gain", gain), ("sensitivity", sensitivity)] {
        if !(value > 1.0 && value.is_finite()) {
            return Err(Error::parameter(name, value, "a factor above 1"));
        }
    }
    if !(0.0..PI).contains(&phase) {
        let expected = "0 to below pi; 30 degrees are 0.524 rad";
        return Err(Error::parameter("phase", format!("{phase} rad"), expected));
    }
    if !(learning > 0.0 && learning <= 1.0) {
        return Err(Error::parameter("learning", learning, "above 0, at most 1"));
    }
    Ok(())
}

/// A number of the worst plant of a set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worst {
    /// Its value.
    pub value: f64,
    /// Which plant has it.
    pub plant: usize,
}

/// Worst margins over a set of plants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robustness {
    /// Roots outside of the unit circle, of the plant that has most of them.
    pub unstable: Worst,
    /// Least gain margin.
    pub gain_margin: Worst,
    /// Least phase margin, rad.
    pub phase_margin: Worst,
    /// Largest sensitivity.
    pub sensitivity: Worst,
    /// Largest gain of what is learnt from period to period; 0 without a repetitive part.
    pub learning: Worst,
}

/// How far an unstable loop counts as being off: further than one that is stable, however large the
/// margins that are asked for.
const UNSTABLE: f64 = 1e15;

impl Robustness {
    /// How far the set is from what is required: 1 or less where it is kept by all.
    #[must_use]
    pub fn excess(&self, required: &Requirements) -> f64 {
        if self.unstable.value > 0.0 {
            return UNSTABLE * (1.0 + self.unstable.value);
        }
        let ratios = [
            self.sensitivity.value / required.sensitivity,
            required.gain_margin / self.gain_margin.value,
            required.phase_margin / self.phase_margin.value.max(1e-9),
            self.learning.value / required.learning,
        ];
        ratios.into_iter().fold(0.0, |most, ratio| if ratio <= most { most } else { ratio })
    }

    /// The worse of each.
    pub(super) fn worse(self, other: Self) -> Self {
        let high = |a: Worst, b: Worst| if b.value > a.value { b } else { a };
        let low = |a: Worst, b: Worst| if b.value < a.value { b } else { a };
        Self {
            unstable: high(self.unstable, other.unstable),
            gain_margin: low(self.gain_margin, other.gain_margin),
            phase_margin: low(self.phase_margin, other.phase_margin),
            sensitivity: high(self.sensitivity, other.sensitivity),
            learning: high(self.learning, other.learning),
        }
    }

    /// The same of plants with numbers higher by `before`.
    pub(super) fn numbered_from(self, before: usize) -> Self {
        let later = |one: Worst| Worst { plant: one.plant + before, ..one };
        Self {
            unstable: later(self.unstable),
            gain_margin: later(self.gain_margin),
            phase_margin: later(self.phase_margin),
            sensitivity: later(self.sensitivity),
            learning: later(self.learning),
        }
    }
}

/// Responses of the plants of a set, on a grid.
#[derive(Clone, Debug)]
pub struct PlantSet {
    dt: f64,
    /// z - 1 at the grid's places, and 1/z.
    delta: Vec<C>,
    late: Vec<C>,
    /// Of each plant.
    responses: Vec<Vec<C>>,
}

/// Places of the grid that are even on a logarithmic scale, and those that are even.
const SLOW: usize = 160;
const EVEN: usize = 240;

/// Places about each mode of a plant, on either side.
const NEAR: i32 = 24;

/// Lowest angle of the grid, rad.
const LOWEST: f64 = 1e-4;

impl PlantSet {
    /// The plants at samples every `dt` seconds.
    ///
    /// # Errors
    /// Names `dt`, and `plants` where there is none; those of the sampling of a plant.
    pub fn new(plants: &[LoopPlant], dt: f64) -> Result<Self> {
        positive("dt", dt, "s")?;
        if plants.is_empty() {
            return Err(Error::parameter("plants", "none", "one or more"));
        }
        let sampled: Result<Vec<(Ratio, usize)>> =
            plants.iter().map(|plant| plant.sampled(dt)).collect();
        let sampled = sampled?;
        let angles = grid(&sampled);
        let delta: Vec<C> = angles.iter().map(|angle| unit(*angle)).collect();
        let late: Vec<C> = delta.iter().map(|delta| (delta + C::new(1.0, 0.0)).inv()).collect();
        let responses = sampled
            .iter()
            .map(|(ratio, whole)| {
                let places = delta.iter().zip(&late);
                places.map(|(delta, late)| of(ratio, *delta) * late.powu(to_u32(*whole))).collect()
            })
            .collect();
        Ok(Self { dt, delta, late, responses })
    }

    /// Number of plants.
    #[must_use]
    pub fn len(&self) -> usize {
        self.responses.len()
    }

    /// Whether there is no plant.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.responses.is_empty()
    }

    /// Number of frequencies at which the margins are read off.
    #[must_use]
    pub fn places(&self) -> usize {
        self.delta.len()
    }

    /// Sampling interval, s.
    #[must_use]
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Worst margins of a controller over the set.
    #[must_use]
    pub fn robustness(&self, controller: &Controller<Law>) -> Robustness {
        let [above, below] = controller.feedback.transfer_function();
        let ratio = Ratio { above, below };
        let integrators = integrators(&ratio);
        let law = self.along(&ratio);
        let filters = controller.filters.iter().flatten();
        let passed = self.along(&filters.fold(Ratio::constant(1.0), in_series));
        let learnt = controller.repetitive.as_ref().map(|part| self.learnt(part));
        let mut out: Option<Robustness> = None;
        for (plant, response) in self.responses.iter().enumerate() {
            let forward = |k: usize| response[k] * passed[k];
            let mut one = walk(law.len(), integrators, |k| forward(k) * law[k]);
            if let Some(learnt) = &learnt {
                let gain = (0..law.len()).map(|k| {
                    let closed = over(forward(k), C::new(1.0, 0.0) + forward(k) * law[k]);
                    (learnt[k].0 * (C::new(1.0, 0.0) - learnt[k].1 * closed)).norm_sqr()
                });
                one.learning.value = libm::sqrt(gain.fold(0.0, f64::max));
            }
            let one = one.numbered_from(plant);
            out = Some(out.map_or(one, |before| before.worse(one)));
        }
        // There is a plant: `new` saw to it.
        out.unwrap_or_else(|| walk(0, 0, |_| C::new(0.0, 0.0)))
    }

    /// Largest displacement that a disturbance of the drive causes, over its angle: `|G S/(z - 1)|`,
    /// m/V, of the worst plant.
    ///
    /// For slow disturbances it is 1 over the integral gain, the integral of the error after a step;
    /// where a mode rings it is more.
    #[must_use]
    pub fn disturbed(&self, controller: &Controller<Law>) -> f64 {
        let [above, below] = controller.feedback.transfer_function();
        let law = self.along(&Ratio { above, below });
        let filters = controller.filters.iter().flatten();
        let passed = self.along(&filters.fold(Ratio::constant(1.0), in_series));
        let one = C::new(1.0, 0.0);
        let plants = self.responses.iter().map(|response| {
            let places = response.iter().zip(&law).zip(&passed).zip(&self.delta);
            let sizes = places.map(|(((plant, law), passed), delta)| {
                (plant / ((one + plant * passed * law) * delta)).norm_sqr()
            });
            sizes.fold(0.0, f64::max)
        });
        libm::sqrt(plants.fold(0.0, f64::max))
    }

    fn along(&self, ratio: &Ratio) -> Vec<C> {
        self.delta.iter().map(|delta| of(ratio, *delta)).collect()
    }

    /// Filter of the repetitive part, and what it takes of the error, at each place.
    fn learnt(&self, part: &SampledRepetitive) -> Vec<(C, C)> {
        let recursion = part.recursion();
        let one = C::new(1.0, 0.0);
        let places = self.late.iter().map(|late| {
            let mut power = one;
            let mut sum = C::new(0.0, 0.0);
            for tap in recursion.taps.iter().rev() {
                sum += power * *tap;
                power *= late;
            }
            // The whole delay turns it, and changes no size.
            let lead = late.conj().powu(to_u32(recursion.lead.min(recursion.nearest)));
            (over(sum, one - late * recursion.pole), lead * recursion.gain)
        });
        places.collect()
    }
}

/// Poles at 1 that do not cancel.
fn integrators(law: &Ratio) -> usize {
    let zeros = |of: &[f64]| of.iter().take_while(|one| **one == 0.0).count();
    zeros(&law.below).saturating_sub(zeros(&law.above))
}

/// The loop along the grid: margins, and roots outside.
fn walk(count: usize, integrators: usize, open: impl Fn(usize) -> C) -> Robustness {
    let one = C::new(1.0, 0.0);
    // Square of the distance from -1.
    let mut nearest = f64::INFINITY;
    let (mut phase, mut gain) = (PI, f64::INFINITY);
    // Turns of 1 + L across the negative real axis, counterclockwise.
    let mut turns = 0.0;
    let mut before: Option<(C, C)> = None;
    let mut first = 0.0;
    for k in 0..count {
        let open = open(k);
        let closed = one + open;
        let distance = closed.norm_sqr();
        nearest = if distance >= nearest { nearest } else { distance };
        if let Some((last, last_closed)) = before {
            let way = closed - last_closed;
            // On the line between them there is a place nearer to 0 than either.
            if dot(last_closed, way) < 0.0 && dot(closed, way) > 0.0 {
                nearest = nearest.min(
                    square(last_closed.re * way.im - last_closed.im * way.re) / way.norm_sqr(),
                );
            }
            let down = closed.im.is_sign_negative();
            if down != last_closed.im.is_sign_negative() {
                let cross = last_closed.re * closed.im - last_closed.im * closed.re;
                if down && cross > 0.0 {
                    turns += 1.0;
                } else if !down && cross < 0.0 {
                    turns -= 1.0;
                }
            }
            if (last.norm_sqr() > 1.0) != (open.norm_sqr() > 1.0) {
                let at = between(last, open, last.norm().ln(), open.norm().ln());
                phase = phase.min((-at).arg().abs());
            }
            if (last.im > 0.0) != (open.im > 0.0) {
                let at = between(last, open, last.im, open.im).re;
                if at < 0.0 {
                    let factor = -1.0 / at;
                    gain = gain.min(if factor > 1.0 { factor } else { 1.0 / factor });
                }
            }
        } else {
            first = closed.arg();
        }
        before = Some((open, closed));
    }
    // At half the sampling rate, the last place, the loop is real.
    if let Some((last, _)) = before
        && last.re < 0.0
        && last.re > -1.0
    {
        gain = gain.min(-1.0 / last.re);
    }
    // Along the upper half of the circle 1 + L turns from where it begins to 0 where no root is
    // outside; each integrator lets it begin 90 degrees earlier.
    let last = before.map_or(first, |(_, closed)| closed.arg());
    let turned = last - first + 2.0 * PI * turns;
    let begin = if integrators > 1 && first > 0.0 { first - 2.0 * PI } else { first };
    let lost = (begin + turned) / PI;
    let reversed = integrators < 2 && first.abs() > 0.75 * PI;
    let outside = if lost.is_nan() || reversed { 1.0 } else { lost.abs().round() };
    let worst = |value| Worst { value, plant: 0 };
    Robustness {
        unstable: worst(outside),
        gain_margin: worst(gain),
        phase_margin: worst(phase),
        sensitivity: worst(if nearest > 0.0 { 1.0 / libm::sqrt(nearest) } else { f64::INFINITY }),
        learning: worst(0.0),
    }
}

fn square(value: f64) -> f64 {
    value * value
}

/// Scalar product of two values as vectors.
fn dot(a: C, b: C) -> f64 {
    a.re * b.re + a.im * b.im
}

/// Where the line between two values crosses zero of a quantity that is `low` at one, `high` at
/// the other.
fn between(a: C, b: C, low: f64, high: f64) -> C {
    let share = low / (low - high);
    if share.is_finite() { a + (b - a) * share } else { a }
}

/// Angles from nearly 0 to pi, dense where a plant turns fast.
fn grid(plants: &[(Ratio, usize)]) -> Vec<f64> {
    let even = |k: usize, n: usize| small(k) / small(n);
    let slow = (0..SLOW).map(|k| LOWEST * (PI / LOWEST).powf(even(k, SLOW)));
    let mut angles: Vec<f64> = slow.chain((1..=EVEN).map(|k| PI * even(k, EVEN))).collect();
    for (ratio, _) in plants {
        for (angle, width) in modes(ratio) {
            for k in -NEAR..=NEAR {
                let away = width * (f64::from(k) / 8.0).sinh();
                angles.push(angle + away);
            }
        }
    }
    angles.retain(|angle| *angle >= LOWEST && *angle <= PI);
    angles.sort_by(f64::total_cmp);
    angles.dedup();
    angles
}

/// Rise above a place beside it, as a share, from which a peak is no rounding of a flat response.
const FLAT: f64 = 1e-10;

/// Angle and width of the poles of a sampled plant, rad: from peaks of its response.
fn modes(ratio: &Ratio) -> Vec<(f64, f64)> {
    const FINE: usize = 4096;
    let angle = |k: usize| PI * small(k) / small(FINE);
    let size: Vec<f64> = (1..FINE).map(|k| of(ratio, unit(angle(k))).norm()).collect();
    let peaks = size.windows(3).enumerate().filter(|(_, near)| {
        let lower = near[0].min(near[2]);
        near[1] > near[0].max(near[2]) && near[1] > lower * (1.0 + FLAT)
    });
    peaks
        .map(|(k, _)| {
            let place = angle(k + 2);
            let half = size[k + 1] * core::f64::consts::FRAC_1_SQRT_2;
            let wide = size[k + 1..].iter().take_while(|value| **value > half).count();
            (place, small(wide.max(1)) * PI / small(FINE))
        })
        .collect()
}

/// `exp(i angle) - 1` without cancelling.
fn unit(angle: f64) -> C {
    let half = libm::sin(0.5 * angle);
    C::new(-2.0 * half * half, libm::sin(angle))
}

fn of(ratio: &Ratio, delta: C) -> C {
    let at = |polynomial: &[f64]| {
        polynomial.iter().rev().fold(C::new(0.0, 0.0), |sum, of| sum * delta + of)
    };
    over(at(&ratio.above), at(&ratio.below))
}

/// The ratio of two values, neither so large that its square overflows.
fn over(above: C, below: C) -> C {
    above * below.conj() * below.norm_sqr().recip()
}

fn small(count: usize) -> f64 {
    crate::signal::index(count)
}

fn to_u32(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}
