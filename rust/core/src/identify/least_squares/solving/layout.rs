//! The unknowns of a fit in one list, and the bounds of each.

use core::f64::consts::LN_2;
use core::ops::Range;

use super::form::Form;
use crate::math::{FREE, NOT_NEGATIVE};

/// Bounds of the weight of a dead zone.
const BEND: (f64, f64) = (-0.5, 1.0);

/// Bounds of the slope beyond any number of dead zones, relative to that before them.
const SLOPE: (f64, f64) = (0.2, 3.0);

/// Most that the relaxations of the creep add to the displacement, as a share.
const MOST_CREEP: f64 = 0.5;

/// How far a relaxation may stand from its equilibrium before a record, in strokes.
const MOST_DEPARTURE: f64 = 1.0;

/// Least distance of corners from each other and from the ends, as a share of what they bend.
const MARGIN: f64 = 0.05;

/// Most that a number of the dynamics changes by in one step, as a logarithm.
const STRIDE: f64 = LN_2;

/// How many unknowns of the stage there are of each sort, in this order.
#[derive(Clone, Copy, Debug)]
pub(in crate::identify::least_squares) struct Layout {
    /// That of the first signal above its least value, then those of the others, m/V.
    pub weights: usize,
    /// Weights of the dead zones.
    pub bends: usize,
    /// Thresholds of the dead zones, m, as many.
    pub corners: usize,
    /// Weights of the creep.
    pub creep_weights: usize,
    /// Logarithms of the numbers of the dynamics.
    pub poles: usize,
}

/// Where the unknowns are that a record has of its own, which follow those of the stage.
#[derive(Clone, Debug)]
pub(in crate::identify::least_squares) struct Own {
    /// Level of each relaxation before the record, beyond its equilibrium, m.
    pub departures: Range<usize>,
    /// Displacement that the sensor shows at rest, m: none or one.
    pub offset: Range<usize>,
    /// Drift of the sensor, m/s: none or one.
    pub drift: Range<usize>,
    /// Delay of the reading, s: none or one.
    pub delay: Range<usize>,
}

impl Own {
    /// The unknowns from `start` on.
    pub fn new(start: usize, departures: usize, [offset, drift, delay]: [bool; 3]) -> Self {
        let mut end = start;
        let mut next = |count: usize| {
            let from = end;
            end += count;
            from..end
        };
        let departures = next(departures);
        let [offset, drift, delay] = [offset, drift, delay].map(|one| next(usize::from(one)));
        Self { departures, offset, drift, delay }
    }

    pub fn end(&self) -> usize {
        self.delay.end
    }

    /// The parts that two structures may have in common.
    pub fn parts(&self) -> [Range<usize>; 4] {
        [&self.departures, &self.offset, &self.drift, &self.delay].map(Range::clone)
    }

    /// Bounds for a step; `stroke` in m, `delay` in s.
    pub fn bounds(&self, stroke: f64, delay: (f64, f64)) -> Vec<(f64, f64)> {
        let most = MOST_DEPARTURE * stroke;
        let mut bounds = vec![(-most, most); self.departures.len()];
        bounds.extend(vec![FREE; self.offset.len() + self.drift.len()]);
        bounds.extend(vec![delay; self.delay.len()]);
        bounds
    }
}

impl Layout {
    pub fn weights(&self) -> Range<usize> {
        0..self.weights
    }

    pub fn bends(&self) -> Range<usize> {
        self.weights..self.weights + self.bends
    }

    pub fn corners(&self) -> Range<usize> {
        self.bends().end..self.bends().end + self.corners
    }

    pub fn creep_weights(&self) -> Range<usize> {
        self.corners().end..self.corners().end + self.creep_weights
    }

    pub fn poles(&self) -> Range<usize> {
        self.creep_weights().end..self.creep_weights().end + self.poles
    }

    /// Unknowns of the stage.
    pub fn count(&self) -> usize {
        self.poles().end
    }

    /// Bounds for a step of the unknowns of the stage from `x`.
    pub fn bounds(
        &self,
        x: &[f64],
        held: bool,
        corners: (f64, f64),
        ranges: &[(f64, f64)],
    ) -> Vec<(f64, f64)> {
        let mut bounds = vec![NOT_NEGATIVE; self.weights];
        bounds.extend(vec![BEND; self.bends]);
        bounds.extend(Self::near(&x[self.corners()], corners));
        bounds.extend(vec![(0.0, MOST_CREEP); self.creep_weights]);
        let stride = if held { 0.0 } else { STRIDE };
        bounds.extend(x[self.poles()].iter().zip(ranges).map(|(at, (low, high))| {
            let at = at.min(*high).max(*low);
            (f64::max(*low, at - stride), f64::min(*high, at + stride))
        }));
        bounds
    }

    /// Bounds of corners for a step: they stay apart, and away from the ends of what they bend.
    fn near(corners: &[f64], (low, high): (f64, f64)) -> Vec<(f64, f64)> {
        let apart = MARGIN * (high - low);
        let bound = |(j, at): (usize, &f64)| {
            let below = if j == 0 { low + apart } else { 0.5 * (corners[j - 1] + at + apart) };
            let above = corners.get(j + 1).map_or(high - apart, |next| 0.5 * (next + at - apart));
            (f64::max(below, at - 2.0 * apart).min(*at), f64::min(above, at + 2.0 * apart).max(*at))
        };
        corners.iter().enumerate().map(bound).collect()
    }

    /// Sums of unknowns that have bounds too: from, to (exclusive), least and most.
    pub fn sums(&self) -> Vec<(Range<usize>, (f64, f64))> {
        let bends = self.bends();
        let slopes = (bends.start + 1..bends.end)
            .map(|end| (bends.start..end + 1, (SLOPE.0 - 1.0, SLOPE.1 - 1.0)));
        let creep = (self.creep_weights > 1).then(|| (self.creep_weights(), (0.0, MOST_CREEP)));
        slopes.chain(creep).collect()
    }

    /// Whether all sums lie within their bounds, but for rounding.
    pub fn admits(&self, x: &[f64]) -> bool {
        self.sums().into_iter().all(|(part, (low, high))| {
            let sum: f64 = x[part].iter().sum();
            sum > low - 1e-6 && sum < high + 1e-6
        })
    }

    /// Names of the unknowns that lie on a bound, but for weights of 0.
    pub fn at_bound(&self, x: &[f64], form: Form, ranges: &[(f64, f64)]) -> Vec<String> {
        let near = |value: f64, bound: f64| (value - bound).abs() < 1e-3;
        let mut names = Vec::new();
        for (j, bend) in x[self.bends()].iter().enumerate() {
            let sum: f64 = x[self.bends()][..=j].iter().sum();
            if near(*bend, BEND.0) || near(*bend, BEND.1) || near(1.0 + sum, SLOPE.0) {
                names.push(format!("dead_zone_weights[{j}]"));
            }
        }
        if near(x[self.creep_weights()].iter().sum(), MOST_CREEP) {
            names.push("creep_weights".into());
        }
        let poles = form.names().iter().zip(&x[self.poles()]).zip(ranges);
        for ((name, at), (low, high)) in poles {
            if at - low < 0.01 || high - at < 0.01 {
                names.push((*name).into());
            }
        }
        names
    }
}
