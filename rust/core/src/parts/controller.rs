//! A controller from its parts, by their names and numbers, for those who call from another
//! language.

use piezotrack_control::{Controller, Limits, Span};

use super::filters::{LOW_PASS, NOTCH, filter};
use super::info::{PartInfo, Role};
use super::laws::law::Law;
use super::repetitive::{LAG, REPETITIVE, ZERO_PHASE, check_smoothing, repetitive};
use crate::error::{Error, Result};
use crate::signal::{INTERVALS, sampling_interval};

/// The parts besides the laws of [`Law::INFOS`].
pub const OTHERS: &[&PartInfo] = &[&REPETITIVE, &LAG, &ZERO_PHASE, &LOW_PASS, &NOTCH];

/// A part by its name, with its numbers.
pub type Named<'a> = (&'a str, &'a [f64]);

/// Parts of a controller.
#[derive(Clone, Debug)]
pub struct ControllerParts<'a> {
    /// Sampling interval, s.
    pub dt: f64,
    /// Lowest and highest voltage, V.
    pub limits: (f64, f64),
    /// Lowest and highest displacement that the sensor can show, m; the default where not given.
    pub span: Option<(f64, f64)>,
    /// Largest displacement in a sampling interval, m.
    pub max_jump: Option<f64>,
    /// Feedback law, as of [`Law::named`].
    pub law: Option<Named<'a>>,
    /// Repetitive part, by the name of its smoothing.
    pub repetitive: Option<Named<'a>>,
    /// Filters of the measurement.
    pub filters: Vec<Named<'a>>,
    /// Whether there is a feedforward beside it that makes the stage follow the reference.
    pub follows: bool,
}

/// Checks the numbers of a part before a sampling interval is known: at the shortest, with which the
/// interval itself forbids least.
///
/// # Errors
/// [`Error::Parameter`] for a name that is unknown, another count of numbers, and a number out of its
/// range.
pub fn check_part(role: Role, (name, numbers): Named<'_>) -> Result<()> {
    match role {
        Role::Law => Law::named(name, numbers, INTERVALS.0).map(drop),
        Role::Repetitive => repetitive(name, numbers).map(drop),
        Role::Smoothing => check_smoothing(name, numbers),
        Role::Filter => filter(name, numbers, INTERVALS.0).map(drop),
    }
}

impl ControllerParts<'_> {
    /// The controller.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a name that is unknown, another count of numbers, and a number out
    /// of its range.
    pub fn controller(&self) -> Result<Controller<Law>> {
        let dt = sampling_interval(self.dt)?;
        let law = match self.law {
            Some((name, numbers)) => Law::named(name, numbers, dt)?,
            None => Law::None,
        };
        let mut controller = Controller::new(Limits::new(self.limits.0, self.limits.1)?, law);
        if let Some((low, high)) = self.span {
            controller.span = Span::new(low, high)?;
        }
        if let Some(jump) = self.max_jump {
            controller.span = controller.span.with_max_jump(jump)?;
        }
        if let Some((name, numbers)) = self.repetitive {
            controller.repetitive = Some(repetitive(name, numbers)?.at(dt)?);
        }
        controller.follows = self.follows;
        let most = controller.filters.len();
        if self.filters.len() > most {
            return Err(Error::parameter("filters", self.filters.len(), format!("{most} at most")));
        }
        for (slot, (name, numbers)) in controller.filters.iter_mut().zip(&self.filters) {
            *slot = Some(filter(name, numbers, dt)?);
        }
        Ok(controller)
    }
}
