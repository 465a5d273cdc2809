//! Judgement of controllers by a search.

use piezotrack_control::Controller;

use super::contour::{PathTask, ReadyPath};
use super::loops::{ReadyTask, Task};
use super::run_metrics::RunMetrics;
use crate::error::{Error, Result};
use crate::parts::Law;
use crate::signal::Stop;

/// A motion that controllers are judged by.
#[derive(Clone, Debug)]
pub enum Judge<'a> {
    /// Of one axis, by the tracking error.
    Axis(Task<'a>),
    /// Of both axes of an XY stage, by the contour error.
    Path(Box<PathTask<'a>>),
}

impl<'a> Judge<'a> {
    /// How many controllers it takes.
    pub(super) fn axes(&self) -> usize {
        match self {
            Self::Axis(_) => 1,
            Self::Path(_) => 2,
        }
    }

    /// Brings its stage to where the loops begin.
    pub(super) fn ready(&'a self) -> Result<Ready<'a>> {
        Ok(match self {
            Self::Axis(task) => Ready::Axis(Box::new(task.ready()?)),
            Self::Path(task) => Ready::Path(Box::new(task.ready()?)),
        })
    }
}

/// A motion whose stage is where the loops begin.
pub(super) enum Ready<'a> {
    Axis(Box<ReadyTask<'a>>),
    Path(Box<ReadyPath<'a>>),
}

impl Ready<'_> {
    /// Metrics of each controller, or of each pair of them.
    pub(super) fn figures(
        &self,
        controllers: &[Vec<Controller<Law>>],
        stop: Stop<'_>,
    ) -> Result<Vec<RunMetrics>> {
        match (self, controllers) {
            (Self::Axis(task), [all]) => task.figures(all, stop),
            (Self::Path(task), [x, y]) => task.figures([x, y], stop),
            (_, other) => Err(Error::parameter("axes", other.len(), "as many as the motion has")),
        }
    }
}
