//! Loops of both axes of an XY stage along a path, judged by the contour error.
//!
//! Each axis goes in lanes by itself. What cross-talk adds is taken from where the other axis should
//! be: where it really is differs from that by its tracking error, of which a hundredth shows.

use piezotrack_control::Controller;
use rayon::prelude::*;

use super::loops::{Figures, Motion, ReadyTask, Task};
use crate::error::{Error, Result, not_negative};
use crate::math::room;
use crate::signal::contour_error::{Polyline, radial_errors};
use crate::signal::{Stop, index};
use crate::simulate::Law;

/// The shape of a path.
#[derive(Clone, Debug)]
pub enum Outline {
    /// A circle: centre and radius, m.
    Circle([f64; 2], f64),
    /// Points of it.
    Points(Polyline),
}

/// A path that two controllers follow.
#[derive(Clone, Debug)]
pub struct PathTask<'a> {
    /// The axis that is served first.
    pub x: Task<'a>,
    /// The axis that is served second.
    pub y: Task<'a>,
    /// By how much later, s.
    pub lag: f64,
    /// The path.
    pub outline: Outline,
}

impl<'a> PathTask<'a> {
    /// Brings both axes to where the loops begin.
    ///
    /// # Errors
    /// Those of [`Task::ready`]; where the axes differ in their samples or a number is out of its
    /// range.
    pub fn ready(&'a self) -> Result<ReadyPath<'a>> {
        not_negative("lag", self.lag, "s")?;
        let [x, y] = [&self.x, &self.y].map(|task| task.samples.reference.len());
        if x != y {
            return Err(Error::Shape {
                name: "reference of y".into(),
                found: format!("{y} samples"),
                expected: format!("{x}, as many as that of x"),
            });
        }
        Ok(ReadyPath { task: self, axes: [self.x.ready()?, self.y.ready()?] })
    }

    /// Contour error at each sample that counts, m.
    fn errors(&self, x: &[f64], y: &[f64]) -> Result<Vec<f64>> {
        let y = later(y, self.lag / self.y.timing.interval)?;
        let [x, y] = [x, &y].map(|axis| axis.get(self.x.from..).unwrap_or_default());
        match &self.outline {
            Outline::Circle(centre, radius) => radial_errors(x, y, *centre, *radius),
            Outline::Points(path) => path.signed_distances(x, y),
        }
    }

    fn figures(&self, x: &Motion, y: &Motion) -> Result<Figures> {
        let Motion { figures: of_x, shown: along_x } = x;
        let Motion { figures: of_y, shown: along_y } = y;
        if *of_x == Figures::FAILED || *of_y == Figures::FAILED {
            return Ok(Figures::FAILED);
        }
        let errors = self.errors(along_x, along_y)?;
        let squares: f64 = errors.iter().map(|error| error * error).sum();
        Ok(Figures {
            rms: libm::sqrt(squares / index(errors.len())),
            largest: errors.iter().fold(0.0, |most, error| error.abs().max(most)),
            effort: libm::sqrt(0.5 * (of_x.effort * of_x.effort + of_y.effort * of_y.effort)),
            slew: of_x.slew.max(of_y.slew),
            clipped: of_x.clipped.max(of_y.clipped),
        })
    }
}

/// A path whose axes are where the loops begin.
#[derive(Clone, Debug)]
pub struct ReadyPath<'a> {
    task: &'a PathTask<'a>,
    axes: [ReadyTask<'a>; 2],
}

impl ReadyPath<'_> {
    /// Figures of each pair of controllers: errors are contour errors, effort is the rms of both
    /// axes, slew and clipped share the larger one.
    ///
    /// # Errors
    /// Those of [`ReadyTask::figures`].
    pub fn figures(
        &self,
        controllers: [&[Controller<Law>]; 2],
        stop: Stop<'_>,
    ) -> Result<Vec<Figures>> {
        let [x, y] = &self.axes;
        let x = x.motions(controllers[0], true, stop)?;
        let y = y.motions(controllers[1], true, stop)?;
        x.par_iter().zip(&y).map(|(x, y)| self.task.figures(x, y)).collect()
    }
}

/// Samples that come `late` intervals later, at the instants of those that do not; before the first
/// of them the axis stands where it is.
fn later(samples: &[f64], late: f64) -> Result<Vec<f64>> {
    let whole = libm::floor(late);
    let part = late - whole;
    let mut out = room("the motion of y", samples.len())?;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let whole = whole as usize;
    let at = |k: Option<usize>| k.and_then(|k| samples.get(k)).or(samples.first());
    for k in 0..samples.len() {
        let (new, old) = (at(k.checked_sub(whole)), at(k.checked_sub(whole.saturating_add(1))));
        let [new, old] = [new, old].map(|value| value.copied().unwrap_or(f64::NAN));
        out.push(new + part * (old - new));
    }
    Ok(out)
}
