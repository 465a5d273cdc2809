//! A drive without feedback: what a log is made of.

use super::{Apparatus, ApparatusState, Plant, instants, still_finite};
use crate::error::{Result, finite};
use crate::integrate::{Drive, Stop, index};

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
const BLOCK: usize = 64;

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
    let n = instants("u", Some(drive.u.len()))?;
    for &volts in drive.u {
        finite("u", volts, "V")?;
    }
    let stretch = apparatus.stretch(drive.dt)?;
    let empty = || Vec::with_capacity(n);
    let mut run =
        OpenLoop { displacement: empty(), measured: empty(), applied: empty(), last: start };
    for k in 0..n {
        if k > 0 {
            let (from, change) = drive.interval(k - 1);
            apparatus.lead(&stretch, &mut run.last, from, from + change);
        }
        if k % BLOCK == 0 && stop() {
            return Ok(None);
        }
        let interval = if k == 0 { 0.0 } else { drive.dt };
        run.measured.push(apparatus.read(&mut run.last, interval));
        let displacement = apparatus.displacement(&run.last);
        run.displacement.push(still_finite(displacement, drive.dt * index(k))?);
        run.applied.push(run.last.applied);
    }
    Ok(Some(run))
}
