//! Nonlinear functions of drives and displacements of several axes, from sample to sample.

use super::modal_system::{sized, whole_samples};
use crate::error::{Error, Result};
use crate::math::{room, zeros};

/// A function of the variables of [`Regressors`] at one sample.
#[derive(Clone, Debug, PartialEq)]
pub enum Regressor {
    /// The product of some variables.
    Product(Vec<usize>),
    /// A stop operator: the way since a reversal, up to a threshold.
    Stop {
        /// The variable.
        variable: usize,
        /// The threshold.
        threshold: f64,
    },
    /// The change d since the sample before, saturated: `d/(scale + |d|)`.
    Change {
        /// The variable.
        variable: usize,
        /// The change at which half of the saturation is reached.
        scale: f64,
    },
}

/// Functions of variables that are linear in the drives and the displacements of a sample.
///
/// ```
/// use piezotrack_core::simulate::{Regressor, Regressors};
///
/// // One drive and one sensor; the variable is half their sum.
/// let square = Regressors::new([1, 1], &[0.5, 0.5], vec![Regressor::Product(vec![0, 0])])?;
/// let mut state = square.rest()?;
/// assert_eq!(square.follow(&mut state, &[1.0, 2.0], &[3.0, 0.0])?, [4.0, 1.0]);
/// # Ok::<(), piezotrack_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Regressors {
    pub(super) drives: usize,
    pub(super) sensors: usize,
    /// From drives and displacements to the variables, variable by variable.
    matrix: Vec<f64>,
    list: Vec<Regressor>,
}

/// State of [`Regressors`].
#[derive(Clone, Debug, PartialEq)]
pub struct RegressorState {
    /// The variables at the last sample.
    pub last: Vec<f64>,
    /// The value of each regressor at the last sample, of which a stop operator goes on.
    pub values: Vec<f64>,
}

impl Regressors {
    /// Regressors of `[drives, sensors]`, whose variables follow from drives and displacements by a
    /// matrix, variable by variable.
    ///
    /// # Errors
    /// [`Error::Shape`] where the matrix has no whole number of variables; [`Error::Parameter`]
    /// where a number is out of its range.
    pub fn new(
        [drives, sensors]: [usize; 2],
        matrix: &[f64],
        list: Vec<Regressor>,
    ) -> Result<Self> {
        if drives == 0 || sensors == 0 {
            let expected = "a drive and a sensor or more";
            return Err(Error::parameter(
                "drives, sensors",
                format!("{drives}, {sensors}"),
                expected,
            ));
        }
        let count = whole_samples("matrix", matrix.len(), drives.saturating_add(sensors))?;
        if let Some(value) = matrix.iter().find(|value| !value.is_finite()) {
            return Err(Error::parameter("matrix", value, "finite numbers"));
        }
        let known = |variable: usize| {
            let right = variable < count;
            let expected = format!("variables from 0 to below {count}");
            right.then_some(()).ok_or_else(|| Error::parameter("list", variable, expected))
        };
        let positive = |size: f64| {
            let right = size > 0.0 && size.is_finite();
            let expected = "thresholds and scales above 0";
            right.then_some(()).ok_or_else(|| Error::parameter("list", size, expected))
        };
        for one in &list {
            match one {
                Regressor::Product(variables) => {
                    variables.iter().try_for_each(|variable| known(*variable))?;
                }
                Regressor::Stop { variable, threshold: size }
                | Regressor::Change { variable, scale: size } => {
                    known(*variable)?;
                    positive(*size)?;
                }
            }
        }
        Ok(Self { drives, sensors, matrix: matrix.to_vec(), list })
    }

    /// The state in which all variables were 0.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub fn rest(&self) -> Result<RegressorState> {
        let count = self.matrix.len() / (self.drives + self.sensors);
        Ok(RegressorState {
            last: zeros("the variables", count)?,
            values: zeros("the regressors", self.list.len())?,
        })
    }

    /// The regressors along drives and displacements, all of a sample after each other, from a
    /// state, which becomes the state after them.
    ///
    /// # Errors
    /// [`Error::Shape`] where drives, displacements or the state do not fit; [`Error::Numerical`]
    /// where a regressor overflows; [`Error::Memory`].
    pub fn follow(
        &self,
        state: &mut RegressorState,
        drives: &[f64],
        displacements: &[f64],
    ) -> Result<Vec<f64>> {
        let samples = whole_samples("drives", drives.len(), self.drives)?;
        sized("displacements", displacements.len(), samples.saturating_mul(self.sensors))?;
        self.check(state)?;
        let mut found = room("the regressors", samples.saturating_mul(self.list.len()))?;
        let mut now = zeros("the variables", state.last.len())?;
        let sensors = displacements.chunks_exact(self.sensors);
        for (drive, displacement) in drives.chunks_exact(self.drives).zip(sensors) {
            self.step(state, &mut now, drive, displacement);
            found.extend_from_slice(&state.values);
        }
        if found.iter().all(|value: &f64| value.is_finite()) {
            return Ok(found);
        }
        Err(Error::Numerical("a regressor leaves the range of numbers".into()))
    }

    /// Number of the regressors.
    pub(super) fn count(&self) -> usize {
        self.list.len()
    }

    /// Refuses a state of other regressors.
    pub(super) fn check(&self, state: &RegressorState) -> Result<()> {
        let variables = self.matrix.len() / (self.drives + self.sensors);
        sized("state", state.last.len(), variables)?;
        sized("state", state.values.len(), self.list.len())
    }

    /// Advances a state by a sample; `now` has room for the variables.
    #[inline(always)]
    pub(super) fn step(
        &self,
        state: &mut RegressorState,
        now: &mut [f64],
        drive: &[f64],
        displacement: &[f64],
    ) {
        let rows = self.matrix.chunks_exact(self.drives + self.sensors);
        for (slot, row) in now.iter_mut().zip(rows) {
            let channels = row.iter().zip(drive.iter().chain(displacement));
            *slot = channels.map(|(gain, value)| gain * value).sum();
        }
        for (value, one) in state.values.iter_mut().zip(&self.list) {
            *value = match one {
                Regressor::Product(variables) => {
                    variables.iter().map(|variable| now[*variable]).product()
                }
                Regressor::Stop { variable, threshold } => {
                    let moved = now[*variable] - state.last[*variable];
                    (*value + moved).clamp(-threshold, *threshold)
                }
                Regressor::Change { variable, scale } => {
                    let moved = now[*variable] - state.last[*variable];
                    moved / (scale + moved.abs())
                }
            };
        }
        state.last.copy_from_slice(now);
    }
}
