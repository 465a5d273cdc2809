//! Course of a profile from its minimum to a bound: where the next descent begins.

use nalgebra::DVector;

use crate::identify::cost::residual_sums::Costs;
use crate::identify::search::descents::Start;

/// Largest first distance, in the unit box.
const FIRST: f64 = 0.25;

/// Part of the foretold end at which a profile begins.
const BEGIN: f64 = 0.5;

/// Least and largest factor between two distances on the way to the end.
const FACTORS: (f64, f64) = (1.3, 3.0);

/// Factor between two distances beyond it.
const BEYOND: f64 = 2.0;

/// Share of the way to the bound from which on the bound is next.
const NEARLY: f64 = 0.7;

/// Most descents to an end, and most that refine it.
const MOST: usize = 40;
const REFINED: usize = 8;

/// Distance from the threshold at which an end is found: of the root of the rise, relative.
const FOUND: f64 = 0.01;

/// Share of the cost that is little for an iteration to gain, and most iterations, far beyond an end;
/// most iterations elsewhere.
const ROUGH: (f64, usize) = (1e-3, 10);
const PRECISE: usize = 60;

/// Distance in the unit box within which two places are one.
const SAME: f64 = 1e-9;

/// Share of a bracket at whose ends nothing is tried.
const EDGE: f64 = 0.1;

/// A place with its cost.
#[derive(Clone, Debug)]
pub struct ProfilePoint {
    /// In the unit box.
    pub place: Vec<f64>,
    /// Its cost.
    pub costs: Costs,
}

/// A profile from its minimum on in one direction.
pub(super) struct Chain {
    /// Which coordinate, and +1 or -1.
    pub coordinate: usize,
    pub way: f64,
    /// Rise of the squared cost at the end, relative.
    pub threshold: f64,
    /// Distance from the minimum to the bound.
    reach: f64,
    /// Distance of the end by the curvature at the minimum.
    foretold: f64,
    /// Distance, root of the rise over the threshold, and what was found there; in ascending order,
    /// the minimum first.
    steps: Vec<Step>,
    /// Direction in which the other coordinates go at the minimum.
    along: DVector<f64>,
    refined: usize,
    failed: bool,
    /// Places of descents with all coordinates free, from where the cost is less than on both sides.
    dips: Option<Vec<Vec<f64>>>,
}

struct Step {
    distance: f64,
    root: f64,
    point: ProfilePoint,
}

impl Chain {
    /// `foretold` is the distance at which the squared cost rises by the threshold, and `along` the
    /// change of all coordinates with this one, both by the curvature at the minimum.
    pub fn new(
        (coordinate, way): (usize, f64),
        threshold: f64,
        minimum: ProfilePoint,
        (foretold, along): (f64, DVector<f64>),
    ) -> Self {
        let z = minimum.place[coordinate];
        let reach = if way > 0.0 { 1.0 - z } else { z };
        let steps = vec![Step { distance: 0.0, root: 0.0, point: minimum }];
        let foretold = foretold.min(FIRST);
        Self {
            coordinate,
            way,
            threshold,
            reach,
            foretold,
            steps,
            along,
            refined: 0,
            failed: false,
            dips: None,
        }
    }

    /// The next descent; `None` where the profile is complete.
    pub fn next(&mut self) -> Option<Start> {
        if !self.scans() {
            let dips = self.dips.take().unwrap_or_else(|| self.found_dips());
            let next = dips.last().map(|place| Start::free(place, 1e-3 * self.threshold));
            self.dips = Some(dips);
            if next.is_some() {
                return next;
            }
        }
        // Near the threshold the end depends on the cost; far beyond it a rough one tells enough.
        let far = self.last().root > 2.0 && self.scans();
        let (little, most) = if far { ROUGH } else { (1e-3 * self.threshold, PRECISE) };
        Some(Start { place: self.place()?, held: Some(self.coordinate), little, most })
    }

    /// Where the next descent begins.
    fn place(&self) -> Option<Vec<f64>> {
        let distance = self.distance()?;
        let z = self.steps[0].point.place[self.coordinate];
        let mut place = self.foretold_at(distance);
        // The bound itself, not what rounding makes of it.
        place[self.coordinate] = if distance >= self.reach {
            f64::from(self.way > 0.0)
        } else {
            self.way.mul_add(distance, z).clamp(0.0, 1.0)
        };
        Some(place)
    }

    /// Takes what the descent found; an infinite cost ends the profile there.
    pub fn take(&mut self, point: ProfilePoint) {
        let z = self.steps[0].point.place[self.coordinate];
        if let Some(dips) = self.dips.as_mut()
            && dips.pop().is_some()
        {
            let distance = self.way * (point.place[self.coordinate] - z);
            let known = |step: &Step| (step.distance - distance).abs() <= SAME;
            if distance > SAME && point.costs.rms.is_finite() && !self.steps.iter().any(known) {
                self.insert(distance, point);
            }
            return;
        }
        let Some(distance) = self.distance() else { return };
        if !self.scans() {
            self.refined += 1;
        }
        if !point.costs.rms.is_finite() {
            self.failed = true;
            return;
        }
        self.insert(distance, point);
    }

    fn insert(&mut self, distance: f64, point: ProfilePoint) {
        let ratio = point.costs.rms / self.steps[0].point.costs.rms;
        let root = ((ratio * ratio - 1.0).max(0.0) / self.threshold).sqrt();
        let place = self.steps.partition_point(|step| step.distance < distance);
        self.steps.insert(place, Step { distance, root, point });
    }

    /// The points, the minimum first.
    pub fn points(self) -> impl DoubleEndedIterator<Item = ProfilePoint> {
        self.steps.into_iter().map(|step| step.point)
    }

    /// Coordinate of the outermost end; `None` where the cost stays below the threshold.
    pub fn end(&self) -> Option<f64> {
        let (inside, outside) = self.bracket()?;
        let share = (1.0 - inside.root) / (outside.root - inside.root);
        let distance = share.mul_add(outside.distance - inside.distance, inside.distance);
        Some(self.way.mul_add(distance, self.steps[0].point.place[self.coordinate]))
    }

    /// Whether it is on its way to the bound.
    fn scans(&self) -> bool {
        let on = self.last().distance < self.reach && self.steps.len() < MOST;
        on && !self.failed && self.refined == 0 && self.dips.is_none()
    }

    /// Places between higher ones, and the last one where it is below the one before: with the other
    /// coordinates of the profile there, and with those of the minimum.
    fn found_dips(&self) -> Vec<Vec<f64>> {
        let steps = &self.steps;
        let dip = |&i: &usize| {
            let after = steps.get(i + 1).is_none_or(|after| steps[i].root < after.root);
            steps[i].root < steps[i - 1].root && after
        };
        let both = |i: usize| {
            let (here, mut there) = (&steps[i].point.place, steps[0].point.place.clone());
            there[self.coordinate] = here[self.coordinate];
            [here.clone(), there]
        };
        (1..steps.len()).filter(dip).flat_map(both).collect()
    }

    fn last(&self) -> &Step {
        &self.steps[self.steps.len() - 1]
    }

    /// The steps on either side of the outermost end.
    fn bracket(&self) -> Option<(&Step, &Step)> {
        let mut pairs = self.steps.windows(2).rev();
        pairs.find_map(|pair| match pair {
            [inside, outside] if inside.root < 1.0 && outside.root >= 1.0 => {
                Some((inside, outside))
            }
            _ => None,
        })
    }

    /// Distance of the next descent from the minimum.
    fn distance(&self) -> Option<f64> {
        let last = self.last();
        if self.scans() {
            let next = if last.root < 1.0 { self.towards_end() } else { BEYOND * last.distance };
            return Some(if next >= NEARLY * self.reach { self.reach } else { next });
        }
        let (inside, outside) = self.bracket()?;
        let near = 1.0 - inside.root < FOUND || outside.root - 1.0 < FOUND;
        if near || self.refined >= REFINED {
            return None;
        }
        let width = outside.distance - inside.distance;
        let share = (1.0 - inside.root) / (outside.root - inside.root);
        Some(share.clamp(EDGE, 1.0 - EDGE).mul_add(width, inside.distance))
    }

    /// A distance nearer to the end, or a little beyond it.
    fn towards_end(&self) -> f64 {
        let [.., before, last] = &self.steps[..] else { return BEGIN * self.foretold };
        let slope = (last.root - before.root) / (last.distance - before.distance);
        let wanted = if last.root < 0.4 { (2.0 * last.root).max(0.3) } else { 1.0 + 0.5 * FOUND };
        let next = last.distance + (wanted - last.root) / slope;
        let (least, most) = (FACTORS.0 * last.distance, FACTORS.1 * last.distance);
        if slope > 0.0 { next.clamp(least, most) } else { most }
    }

    /// The place at a distance: on the line through the nearest two, or along the curvature.
    fn foretold_at(&self, distance: f64) -> Vec<f64> {
        let after = self.steps.partition_point(|step| step.distance < distance);
        let line = |a: &Step, b: &Step| {
            let share = (distance - a.distance) / (b.distance - a.distance);
            let ends = a.point.place.iter().zip(&b.point.place);
            ends.map(|(a, b)| share.mul_add(b - a, *a).clamp(0.0, 1.0)).collect()
        };
        match &self.steps[..] {
            [only] => {
                let moved = only.point.place.iter().zip(self.along.iter());
                let step = self.way * distance;
                moved.map(|(z, change)| step.mul_add(*change, *z).clamp(0.0, 1.0)).collect()
            }
            steps if after < steps.len() => line(&steps[after - 1], &steps[after]),
            steps => line(&steps[after - 2], &steps[after - 1]),
        }
    }
}
