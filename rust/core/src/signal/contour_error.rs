//! Contour error: signed distance of a motion in the plane from its reference path.
//!
//! Positive is to the left of the direction of travel: on a circle that is run counter-clockwise,
//! to the inside, R - r.

use crate::error::{Error, Result, finite, positive};
use crate::math::room;

/// Signed radial error R - r of points from a circle of radius R, m.
///
/// Xu and Li 2010, Table 2, doi 10.1115/1.4001712.
///
/// ```
/// use piezotrack_core::signal::contour_error::radial_errors;
///
/// let errors = radial_errors(&[3.0, 0.0], &[4.0, 6.0], [0.0, 0.0], 5.5)?;
/// assert_eq!(errors, [0.5, -0.5]);
/// # Ok::<(), piezotrack_core::Error>(())
/// ```
///
/// # Errors
/// [`Error::Parameter`] where the radius is not above 0 or the centre not finite;
/// [`Error::Shape`] where the records are empty or differ in length; [`Error::Data`] where a
/// sample is not finite.
pub fn radial_errors(x: &[f64], y: &[f64], centre: [f64; 2], radius: f64) -> Result<Vec<f64>> {
    positive("radius", radius, "m")?;
    for (name, place) in ["centre[0]", "centre[1]"].iter().zip(centre) {
        finite(name, place, "m")?;
    }
    check(["x", "y"], x, y, 1)?;
    let error = |(x, y): (&f64, &f64)| radius - libm::hypot(x - centre[0], y - centre[1]);
    collected(x.iter().zip(y).map(error))
}

/// As many errors as there are points, m.
fn collected(errors: impl ExactSizeIterator<Item = f64>) -> Result<Vec<f64>> {
    let mut all = room("the contour error", errors.len())?;
    all.extend(errors);
    Ok(all)
}

/// Segments that a leaf of the tree holds: few boxes, short scans.
const LEAF: usize = 8;

/// A path through points, ready to be asked for distances.
///
/// Boxes around stretches of it, each of two halves, leave most of the path unlooked at: a
/// question costs the logarithm of its length, and nothing where the last answer is near.
///
/// ```
/// use piezotrack_core::signal::contour_error::Polyline;
///
/// let corner = Polyline::new(&[0.0, 1.0, 1.0], &[0.0, 0.0, 1.0])?;
/// assert_eq!(corner.signed_distances(&[0.5, 1.5], &[0.25, 0.5])?, [0.25, -0.5]);
/// # Ok::<(), piezotrack_core::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Polyline {
    points: Vec<[f64; 2]>,
    /// Boxes of the tree: the children of `i` are `2 i + 1` and `2 i + 2`.
    boxes: Vec<Bounds>,
}

/// A box with its sides along the axes.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    low: [f64; 2],
    high: [f64; 2],
}

/// The nearest place on a path that is known so far.
#[derive(Clone, Copy, Debug)]
struct Nearest {
    /// Distance squared, m^2.
    square: f64,
    segment: usize,
    /// Where on the segment, from 0 to 1.
    part: f64,
}

impl Polyline {
    /// A path from point to point.
    ///
    /// # Errors
    /// [`Error::Shape`] where there are less than two points, or `x` and `y` differ in length;
    /// [`Error::Data`] where one is not finite.
    pub fn new(x: &[f64], y: &[f64]) -> Result<Self> {
        check(["x of the path", "y of the path"], x, y, 2)?;
        let mut points = room("the points of the path", x.len())?;
        points.extend(x.iter().zip(y).map(|(&x, &y)| [x, y]));
        let segments = points.len() - 1;
        // A complete binary tree whose leaves hold LEAF segments at most.
        let leaves = segments.div_ceil(LEAF).next_power_of_two();
        let mut boxes = room("the boxes around the path", 2 * leaves - 1)?;
        boxes.resize(2 * leaves - 1, Bounds::EMPTY);
        let mut path = Self { points, boxes };
        path.fill(0, 0, segments);
        Ok(path)
    }

    /// Signed distance of each point from the path, m; positive to the left of its direction.
    ///
    /// # Errors
    /// [`Error::Shape`] where the records are empty or differ in length; [`Error::Data`] where a
    /// sample is not finite.
    pub fn signed_distances(&self, x: &[f64], y: &[f64]) -> Result<Vec<f64>> {
        check(["x", "y"], x, y, 1)?;
        let mut segment = 0;
        let distance = |(&x, &y): (&f64, &f64)| {
            let mut best = self.on_segment(segment, [x, y]);
            self.search(0, 0, self.points.len() - 1, [x, y], &mut best);
            segment = best.segment;
            libm::copysign(best.square.sqrt(), self.side(&best, [x, y]))
        };
        collected(x.iter().zip(y).map(distance))
    }

    /// Boxes of the stretch `from..to` of segments and of all in it.
    fn fill(&mut self, node: usize, from: usize, to: usize) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        if 2 * node + 1 >= self.boxes.len() {
            for point in &self.points[from..=to.min(self.points.len() - 1)] {
                bounds = bounds.with(&Bounds { low: *point, high: *point });
            }
        } else {
            let middle = from.midpoint(to);
            let left = self.fill(2 * node + 1, from, middle);
            bounds = left.with(&self.fill(2 * node + 2, middle, to));
        }
        self.boxes[node] = bounds;
        bounds
    }

    /// Looks for anything nearer than `best` in a stretch, the nearer half first.
    fn search(&self, node: usize, from: usize, to: usize, point: [f64; 2], best: &mut Nearest) {
        if from >= to || self.boxes[node].square_distance(point) >= best.square {
            return;
        }
        if 2 * node + 1 >= self.boxes.len() {
            for segment in from..to {
                let found = self.on_segment(segment, point);
                if found.square < best.square {
                    *best = found;
                }
            }
            return;
        }
        let middle = from.midpoint(to);
        let halves = [(2 * node + 1, from, middle), (2 * node + 2, middle, to)];
        let [left, right] = halves.map(|(half, _, _)| self.boxes[half].square_distance(point));
        let order = if left <= right { [0, 1] } else { [1, 0] };
        for half in order {
            let (node, from, to) = halves[half];
            self.search(node, from, to, point, best);
        }
    }

    /// The place nearest to a point on one segment.
    fn on_segment(&self, segment: usize, point: [f64; 2]) -> Nearest {
        let (a, b) = (self.points[segment], self.points[segment + 1]);
        let along = [b[0] - a[0], b[1] - a[1]];
        let to = [point[0] - a[0], point[1] - a[1]];
        let length = dot(along, along);
        let part = if length > 0.0 { (dot(to, along) / length).clamp(0.0, 1.0) } else { 0.0 };
        let off = [to[0] - part * along[0], to[1] - part * along[1]];
        Nearest { square: dot(off, off), segment, part }
    }

    /// Above 0 where a point is left of the path there; at a corner, of the mean of both sides.
    fn side(&self, nearest: &Nearest, point: [f64; 2]) -> f64 {
        let Nearest { segment, part, .. } = *nearest;
        let mut along = self.direction(segment);
        let neighbour = if part <= 0.0 {
            segment.checked_sub(1)
        } else if part >= 1.0 {
            Some(segment + 1).filter(|&next| next + 1 < self.points.len())
        } else {
            None
        };
        if let Some(other) = neighbour {
            let other = self.direction(other);
            along = [along[0] + other[0], along[1] + other[1]];
        }
        let (a, b) = (self.points[segment], self.points[segment + 1]);
        let foot = [a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])];
        along[0] * (point[1] - foot[1]) - along[1] * (point[0] - foot[0])
    }

    /// Unit vector along a segment; 0 where it has no length.
    fn direction(&self, segment: usize) -> [f64; 2] {
        let (a, b) = (self.points[segment], self.points[segment + 1]);
        let along = [b[0] - a[0], b[1] - a[1]];
        let length = libm::hypot(along[0], along[1]);
        if length > 0.0 { along.map(|part| part / length) } else { [0.0; 2] }
    }
}

impl Bounds {
    /// Holds nothing.
    const EMPTY: Self = Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };

    /// The smallest box around both.
    fn with(&self, other: &Self) -> Self {
        Self {
            low: [0, 1].map(|i| self.low[i].min(other.low[i])),
            high: [0, 1].map(|i| self.high[i].max(other.high[i])),
        }
    }

    /// From a point to the box, squared; 0 inside, infinite where there is none.
    fn square_distance(&self, point: [f64; 2]) -> f64 {
        let off = [0, 1].map(|i| (self.low[i] - point[i]).max(point[i] - self.high[i]).max(0.0));
        dot(off, off)
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0].mul_add(b[0], a[1] * b[1])
}

/// Refuses records of a plane that cannot be used.
pub(crate) fn check(names: [&str; 2], x: &[f64], y: &[f64], least: usize) -> Result<()> {
    if x.len() < least || x.len() != y.len() {
        return Err(Error::Shape {
            name: names[1].into(),
            found: format!("{} samples", y.len()),
            expected: format!("{} as {} has, and {least} at least", x.len(), names[0]),
        });
    }
    for (name, record) in [(names[0], x), (names[1], y)] {
        if let Some(k) = record.iter().position(|value| !value.is_finite()) {
            return Err(Error::Data(format!("{name} is {} at sample {k}", record[k])));
        }
    }
    Ok(())
}
