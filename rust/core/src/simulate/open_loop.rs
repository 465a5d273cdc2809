//! Open-loop simulation of a drive, as in the recording of a log.

use super::apparatus::{Apparatus, ApparatusState, Stretch, instants, still_finite};
use crate::error::{Result, finite};
use crate::math::room;
use crate::models::Plant;
use crate::signal::{Drive, Stop, index};

/// An apparatus at the samples of its drive.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenLoop<S> {
    /// True displacement from the sensor's zero, m.
    pub displacement: Vec<f64>,
    /// Reading of the sensor, m.
    pub measured: Vec<f64>,
    /// Voltage that the amplifier gave, V.
    pub applied: Vec<f64>,
    /// State at the last sample.
    pub last: ApparatusState<S>,
}

/// Samples between two questions whether to stop.
pub(super) const BLOCK: usize = 64;

/// Drives an apparatus; `None` where `stop` said so meanwhile.
///
/// The first sample is the start itself; from there on the command is the drive's.
///
/// # Errors
/// [`crate::Error::Parameter`] where a number is out of its range or the drive is not finite;
/// [`crate::Error::Numerical`] where the motion is not finite.
pub fn open_loop<P: Plant>(
    apparatus: &Apparatus<'_, P>,
    start: ApparatusState<P::State>,
    drive: &Drive<'_>,
    stop: Stop<'_>,
) -> Result<Option<OpenLoop<P::State>>> {
    apparatus.validate()?;
    let n = checked(drive)?;
    let stretch = apparatus.stretch(drive.dt)?;
    let mut run = OpenLoop::from_start(n, start)?;
    for k in 0..n {
        if !run.drive(apparatus, &stretch, drive, k, stop) || (k % BLOCK == 0 && stop()) {
            return Ok(None);
        }
        let measured = apparatus.read(&mut run.last, since(drive, k));
        run.keep(apparatus.displacement(&run.last), measured, drive.dt * index(k))?;
    }
    Ok(Some(run))
}

/// Number of samples of a drive that is finite.
pub(super) fn checked(drive: &Drive<'_>) -> Result<usize> {
    for &volts in drive.u {
        finite("u", volts, "V")?;
    }
    instants("u", Some(drive.u.len()))
}

/// Time since the last reading at sample `k`, s.
pub(super) fn since(drive: &Drive<'_>, k: usize) -> f64 {
    if k == 0 { 0.0 } else { drive.dt }
}

impl<S> OpenLoop<S> {
    /// Room for `n` samples, none of them kept yet.
    pub(super) fn from_start(n: usize, last: ApparatusState<S>) -> Result<Self> {
        let empty = || room("the simulated motion", n);
        Ok(Self { displacement: empty()?, measured: empty()?, applied: empty()?, last })
    }

    /// Leads an apparatus to sample `k`; false where `stop` said so meanwhile.
    #[must_use]
    pub(super) fn drive<P: Plant<State = S>>(
        &mut self,
        apparatus: &Apparatus<'_, P>,
        stretch: &Stretch<P::Flow>,
        drive: &Drive<'_>,
        k: usize,
        stop: Stop<'_>,
    ) -> bool {
        let Some(before) = k.checked_sub(1) else { return true };
        let (from, change) = drive.interval(before);
        apparatus.drive(stretch, &mut self.last, [from, from + change], stop)
    }

    /// Keeps the present sample, at `time` s.
    pub(super) fn keep(&mut self, displacement: f64, measured: f64, time: f64) -> Result<()> {
        self.measured.push(measured);
        self.displacement.push(still_finite(displacement, time)?);
        self.applied.push(self.last.applied);
        Ok(())
    }
}
