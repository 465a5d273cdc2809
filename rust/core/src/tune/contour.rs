//! Loops of both axes of an XY stage along a path, judged by the contour error.
//!
//! Each axis goes in lanes by itself. What cross-talk adds is taken from where the other axis should
//! be: where it really is differs from that by its tracking error, of which a hundredth shows.

use piezotrack_control::Controller;
use rayon::prelude::*;

use super::loops::{Motion, ReadyTask, Task};
use super::run_metrics::RunMetrics;
use crate::error::{Error, Result, not_negative};
use crate::math::room;
use crate::parts::Law;
use crate::signal::contour_error::{Polyline, radial_errors};
use crate::signal::{Stop, index};
use crate::simulate::Delay;

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
    x: Task<'a>,
    /// The axis that is served second.
    y: Task<'a>,
    /// By how much later, s.
    lag: f64,
    /// The path.
    outline: Outline,
}

impl<'a> PathTask<'a> {
    /// A path of two axes, of which y is served `lag` seconds after x.
    ///
    /// # Errors
    /// Names `lag` where it is below 0.
    pub fn new(x: Task<'a>, y: Task<'a>, lag: f64, outline: Outline) -> Result<Self> {
        not_negative("lag", lag, "s")?;
        let Delay { fraction, .. } = Delay::new(lag, y.timing.interval);
        let shown_at = if fraction > 0.0 { 1.0 - fraction } else { 0.0 };
        Ok(Self { x, y: Task { shown_at, ..y }, lag, outline })
    }

    /// Brings both axes to where the loops begin.
    ///
    /// # Errors
    /// Those of [`Task::ready`]; where the axes differ in their samples.
    pub fn ready(&'a self) -> Result<ReadyPath<'a>> {
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
        let y = self.at_those_of_x(y)?;
        let [x, y] = [x, &y].map(|axis| axis.get(self.x.from..).unwrap_or_default());
        match &self.outline {
            Outline::Circle(centre, radius) => radial_errors(x, y, *centre, *radius),
            Outline::Points(path) => path.signed_distances(x, y),
        }
    }

    /// Motion of y at the instants of x: before y's first sample it stands where it is.
    fn at_those_of_x(&self, y: &[f64]) -> Result<Vec<f64>> {
        let Delay { whole, fraction } = Delay::new(self.lag, self.y.timing.interval);
        let late = whole + usize::from(fraction > 0.0);
        let mut out = room("the motion of y", y.len())?;
        out.extend(core::iter::repeat_n(y.first().copied().unwrap_or(0.0), late.min(y.len())));
        out.extend_from_slice(&y[..y.len().saturating_sub(late)]);
        Ok(out)
    }

    fn figures(&self, x: &Motion, y: &Motion) -> Result<RunMetrics> {
        let Motion { figures: of_x, shown: along_x } = x;
        let Motion { figures: of_y, shown: along_y } = y;
        if *of_x == RunMetrics::FAILED || *of_y == RunMetrics::FAILED {
            return Ok(RunMetrics::FAILED);
        }
        let errors = self.errors(along_x, along_y)?;
        let squares: f64 = errors.iter().map(|error| error * error).sum();
        Ok(RunMetrics {
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
    /// Metrics of each pair of controllers: errors are contour errors, effort is the rms of both
    /// axes, slew and clipped share the larger one.
    ///
    /// # Errors
    /// Those of [`ReadyTask::figures`].
    pub fn figures(
        &self,
        controllers: [&[Controller<Law>]; 2],
        stop: Stop<'_>,
    ) -> Result<Vec<RunMetrics>> {
        let [x, y] = &self.axes;
        let x = x.motions(controllers[0], true, stop)?;
        let y = y.motions(controllers[1], true, stop)?;
        x.par_iter().zip(&y).map(|(x, y)| self.task.figures(x, y)).collect()
    }
}
