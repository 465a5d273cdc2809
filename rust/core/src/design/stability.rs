//! Exact stability: roots outside a circle are counted, the slowest is found, and the gains at
//! which one crosses the unit circle.

use core::f64::consts::{PI, TAU};

use super::argument_principle::Place;
use super::sampled_loop::{SampledLoop, small};
use crate::error::{Error, Result};
use crate::math::C;

/// Places on the circle that a search for a stable range of gains may cost, about.
const EFFORT: usize = 300_000;

/// A root of the closed loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root {
    /// Distance from 0: what is left of its motion a sample later.
    pub radius: f64,
    /// How fast it turns, Hz.
    pub frequency: f64,
    /// Sampling intervals until 1/e of its motion is left; infinite or negative where it grows.
    pub samples: f64,
}

/// Factors on the loop gain between which the closed loop is stable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainRange {
    /// It is unstable just below this factor; 0 where it is stable down to no gain at all.
    pub low: f64,
    /// It is unstable just above this factor.
    pub high: f64,
}

impl SampledLoop {
    /// How many roots of the closed loop lie outside the circle of a radius; `None` where one
    /// lies on it. Hidden roots do not count.
    ///
    /// The principle of the argument: `a + b` grows as z^n at infinity and has no pole outside,
    /// so it turns n times less the number of those roots along the circle. The step length adapts to
    /// `d ln (a + b)/d ln z`, by which a root close to the circle cannot be stepped over.
    #[must_use]
    pub fn roots_outside(&self, radius: f64) -> Option<usize> {
        self.count(radius).0
    }

    /// Whether the closed loop is stable: no root on or outside the unit circle, hidden ones
    /// aside.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.roots_outside(1.0) == Some(0)
    }

    /// The count, and the place on the circle that seems nearest to a root.
    fn count(&self, radius: f64) -> (Option<usize>, Option<Place>) {
        let mut turned = 0.0;
        let mut met = false;
        let mut nearest: Option<(f64, Place)> = None;
        let complete = self.sweep(
            radius,
            0.0,
            |place| place.turn_closed().norm(),
            |left, right| {
                let (from, to) = (left.closed().value, right.closed().value);
                let turn = (to * from.conj()).arg();
                // Also where it is not a number
                met |= turn.is_nan() || turn.abs() > 2.0 || from == C::new(0.0, 0.0);
                turned += turn;
                let steep = right.turn_closed().norm();
                if nearest.as_ref().is_none_or(|(most, _)| steep > *most) {
                    nearest = Some((steep, *right));
                }
            },
        );
        let outside = small(self.degree()) - turned / PI;
        let whole = libm::round(outside);
        let certain = complete && !met && (outside - whole).abs() < 0.05 && whole >= 0.0;
        (certain.then(|| to_count(whole)), nearest.map(|(_, place)| place))
    }

    /// The slowest root of the closed loop, the one farthest out; hidden ones aside.
    ///
    /// A circle is halved in on it by counting, until Newton's method finds it. Roots that
    /// vanish within a few samples are not looked for: `None`.
    ///
    /// # Errors
    /// [`Error::Numerical`] where the loop's numbers are too large to count with.
    pub fn slowest_root(&self) -> Result<Option<Root>> {
        let reach = small(self.longest_delay()) + 10.0;
        let mut low = libm::exp(-200.0 / reach).max(1e-6);
        let mut high = 1.0;
        let mut near = None;
        let mut outer = self.count(high);
        while outer.0 != Some(0) {
            if outer.0.is_some() {
                low = high;
            }
            high = if high < 1.5 { 1.0 + 16.0 * (high - 1.0).max(1e-12) } else { high * 8.0 };
            if high > 1e30 {
                let text = "the closed loop's roots cannot be counted: its gain is too large";
                return Err(Error::Numerical(text.into()));
            }
            outer = self.count(high);
        }
        if low < 1.0 && self.count(low).0 == Some(0) {
            return Ok(None);
        }
        for _ in 0..200 {
            // Halve the logarithm of the distance from the unit circle first
            let (inner, outer) = ((1.0 - low).max(1e-13), (1.0 - high).max(1e-13));
            let middle = if low < 1.0 && inner > 4.0 * outer {
                1.0 - libm::sqrt(inner * outer)
            } else {
                0.5 * (low + high)
            };
            let width = high - low;
            let fine = 1e-3 * (1.0 - middle).abs().min(1.0 / reach);
            if width <= fine.max(2e-13) || middle <= low || middle >= high {
                break;
            }
            match self.count(middle) {
                (Some(0), place) => {
                    high = middle;
                    near = place;
                }
                (Some(_), place) => {
                    low = middle;
                    near = place;
                }
                // On the root itself
                (None, place) => {
                    near = place;
                    (low, high) = (middle, middle);
                    break;
                }
            }
        }
        let start = near.or(outer.1);
        let width = (high - low).max(1e-11);
        let found = start.and_then(|place| self.newton(place.delta)).filter(|delta| {
            let radius = radius_of(*delta);
            radius > low - width && radius < high + width
        });
        let middle = C::new(0.5 * (low + high) - 1.0, 0.0);
        let angle = start.map_or(0.0, |place| place.theta);
        Ok(Some(match found {
            Some(delta) => self.root(delta, (delta + C::new(1.0, 0.0)).arg()),
            None => self.root(middle, angle),
        }))
    }

    /// Describes a root at `z = 1 + delta`, or at that radius and an angle.
    pub(crate) fn root(&self, delta: C, angle: f64) -> Root {
        let radius = radius_of(delta);
        // ln |1 + delta| without cancelling
        let log = 0.5 * libm::log1p(2.0 * delta.re + delta.norm_sqr());
        // What rounding leaves of a real root
        let angle = if angle.abs() < 1e-14 { 0.0 } else { angle.abs() };
        Root { radius, frequency: angle / (TAU * self.dt()), samples: -1.0 / log }
    }

    /// Newton's method on the characteristic function.
    pub(crate) fn newton(&self, start: C) -> Option<C> {
        let mut delta = start;
        for _ in 0..50 {
            let f = {
                let parts = self.parts(delta);
                parts.a + parts.b
            };
            let step = f.value / f.slope;
            delta -= step;
            if !delta.is_finite() {
                return None;
            }
            if step.norm() <= 1e-15 * (delta + C::new(1.0, 0.0)).norm().max(1.0) {
                return Some(delta);
            }
        }
        None
    }

    /// The factors on the loop gain that leave the loop stable: the range about 1, or the
    /// nearest one, below rather than above; `None` where no gain will do.
    ///
    /// A root crosses the unit circle only at a gain `k = -1/L`, where the open loop L is real
    /// and negative. Those gains are found along the circle, and between two of them the roots
    /// are counted once; so often at most, that a range with very many crossings inside may be
    /// given too narrow.
    #[must_use]
    pub fn stable_gains(&self) -> Option<GainRange> {
        let gains = self.crossing_gains();
        let at = gains.partition_point(|gain| *gain < 1.0);
        let stable = |i: usize| {
            let low = if i == 0 { None } else { gains.get(i - 1) };
            let middle = match (low, gains.get(i)) {
                (Some(low), Some(high)) => libm::sqrt(low * high),
                (None, Some(high)) => 0.5 * high,
                (Some(low), None) => 2.0 * low,
                (None, None) => 1.0,
            };
            self.amplified(middle).is_stable()
        };
        let tries = (EFFORT / (64 + self.longest_delay())).clamp(8, 200);
        let below = (0..=at).rev().take(tries);
        let above = (at + 1..=gains.len()).take(tries);
        let found = below.chain(above).find(|i| stable(*i))?;
        // The last range on either side that is stable still
        let last = (found + 1..=gains.len()).take(tries).take_while(|i| stable(*i)).last();
        let first = (0..found).rev().take(tries).take_while(|i| stable(*i)).last();
        let (first, last) = (first.unwrap_or(found), last.unwrap_or(found));
        let low = if first == 0 { None } else { gains.get(first - 1) };
        Some(GainRange {
            low: low.copied().unwrap_or(0.0),
            high: gains.get(last).copied().unwrap_or(f64::INFINITY),
        })
    }

    /// All factors on the loop gain at which a root is on the unit circle, in rising order.
    fn crossing_gains(&self) -> Vec<f64> {
        let mut gains: Vec<f64> = self
            .phase_crossings()
            .into_iter()
            .map(|(_, open)| -1.0 / open.re)
            .filter(|gain| gain.is_finite() && *gain > 0.0)
            .collect();
        gains.sort_by(f64::total_cmp);
        gains.dedup_by(|a, b| (*a - *b).abs() < 1e-12 * a.abs());
        gains
    }

    /// Where the open loop is real and negative: angle (rad) and value.
    pub(crate) fn phase_crossings(&self) -> Vec<(f64, C)> {
        let mut found = Vec::new();
        let start = self.place(1.0, 0.0);
        let end = self.place(1.0, PI);
        for place in [start, end] {
            let open = place.open();
            if open.re < 0.0 && open.re.is_finite() {
                found.push((place.theta, open));
            }
        }
        let side = |place: &Place| (place.parts.b.value * place.parts.a.value.conj()).im;
        self.sweep(
            1.0,
            0.0,
            |place| place.turn_open().norm(),
            |left, right| {
                let negative = left.open().re < 0.0 || right.open().re < 0.0;
                if negative && side(left) * side(right) < 0.0 {
                    let place = self.between(left, right, side);
                    let open = place.open();
                    // Not where it passes through a pole or from one side of 0 to the other
                    if open.re < 0.0 && open.im.abs() < 1e-3 * open.re.abs() {
                        found.push((place.theta, open));
                    }
                }
            },
        );
        found
    }

    /// The place on the unit circle at which `value` changes its sign between two.
    pub(crate) fn between(
        &self,
        left: &Place,
        right: &Place,
        value: impl Fn(&Place) -> f64,
    ) -> Place {
        let (mut left, mut right) = (*left, *right);
        let rising = value(&right) > value(&left);
        for _ in 0..60 {
            let theta = 0.5 * (left.theta + right.theta);
            if theta <= left.theta || theta >= right.theta {
                break;
            }
            let middle = self.place(1.0, theta);
            if (value(&middle) > 0.0) == rising {
                right = middle;
            } else {
                left = middle;
            }
        }
        right
    }
}

/// |1 + delta|.
fn radius_of(delta: C) -> f64 {
    (delta + C::new(1.0, 0.0)).norm()
}

/// A count from a whole number, already checked.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
fn to_count(value: f64) -> usize {
    value as usize
}
