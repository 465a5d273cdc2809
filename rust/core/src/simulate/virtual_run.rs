//! A virtual stage that goes on from command to command, as one behind a device does.

use super::apparatus::ApparatusState;
use super::open_loop::{OpenLoop, open_loop};
use super::virtual_stage::VirtualStage;
use crate::error::Result;
use crate::models::StageState;
use crate::signal::{Drive, Hold, NEVER, Stop, index};

/// A virtual stage in motion: each command holds until the next, also from one call to the next.
///
/// ```
/// use piezotrack_core::signal::NEVER;
/// use piezotrack_core::simulate::{VirtualRun, VirtualStage};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let mut run = VirtualRun::new(VirtualStage::xu_li_2010(1));
/// run.advance(&[75.0; 500], 2e-4, NEVER)?;
/// let later = run.advance(&[75.0; 500], 2e-4, NEVER)?.unwrap();
/// assert!((later.displacement[499] - 117.76e-6).abs() < 0.5e-6);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct VirtualRun {
    stage: VirtualStage,
    /// State at the first of the `past` commands.
    before: ApparatusState<StageState>,
    /// Commands at the last samples, V, as far back as the sensor's delay reaches: the last is held.
    past: Vec<f64>,
    /// Interval of these samples, s.
    dt: f64,
}

impl VirtualRun {
    /// A stage at its start, its command at 0 V.
    #[must_use]
    pub fn new(stage: VirtualStage) -> Self {
        let before = stage.start();
        let past = vec![before.command];
        Self { stage, before, past, dt: 1.0 }
    }

    /// Moves on through `u.len()` intervals of `dt` seconds. At the end of each the sensor is read,
    /// and the next of the commands `u`, V, goes out and is held.
    ///
    /// `None` where `stop` said so meanwhile: nothing has moved then.
    ///
    /// # Errors
    /// Those of [`open_loop`]; nothing has moved then either.
    pub fn advance(
        &mut self,
        u: &[f64],
        dt: f64,
        stop: Stop<'_>,
    ) -> Result<Option<OpenLoop<StageState>>> {
        Drive::new(u, dt, Hold::Zero)?;
        let mut from = self.at_interval(dt)?;
        from.past.extend_from_slice(u);
        let Some(mut run) = from.driven(from.past.len(), stop)? else { return Ok(None) };
        let old = run.measured.len() - u.len();
        for part in [&mut run.displacement, &mut run.measured, &mut run.applied] {
            part.drain(..old);
        }
        from.forget(&run.last)?;
        *self = from;
        Ok(Some(run))
    }

    /// The same with its past in intervals of `dt`, s: what was seen at others is forgotten.
    fn at_interval(&self, dt: f64) -> Result<Self> {
        let mut same = self.clone();
        if dt.total_cmp(&self.dt).is_ne() {
            if let Some(run) = self.driven(self.past.len(), NEVER)? {
                same.before = run.last;
            }
            same.past.drain(..self.past.len() - 1);
            same.dt = dt;
        }
        Ok(same)
    }

    /// Drives the stage through the first `count` of the commands.
    fn driven(&self, count: usize, stop: Stop<'_>) -> Result<Option<OpenLoop<StageState>>> {
        let drive = Drive::new(&self.past[..count], self.dt, Hold::Zero)?;
        open_loop(&self.stage.apparatus(), self.before.clone(), &drive, stop)
    }

    /// Keeps no more of the past than the sensor's delay reaches, after a run through all of it
    /// that ended in `last`.
    fn forget(&mut self, last: &ApparatusState<StageState>) -> Result<()> {
        let delay = self.stage.sensor.delay / self.dt;
        let most = self.past.len() - 1;
        let reach = (0..most).find(|&k| index(k) >= delay).unwrap_or(most);
        let gone = most - reach;
        let again = if reach == 0 { None } else { self.driven(gone + 1, NEVER)? };
        self.before = again.map_or_else(|| last.clone(), |run| run.last);
        self.past.drain(..gone);
        Ok(())
    }
}
