//! Open-loop simulation of a drive, as in the recording of a log.

use super::apparatus::{Apparatus, ApparatusState, Stretch, instants, still_finite};
use super::sensor_delay::Looks;
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
    let mut looks = Looks::new([apparatus.sensor.delay], drive.dt, n)?;
    let route = Route::new(apparatus, &looks, drive.dt)?;
    let mut run = OpenLoop::from_start(n, start)?;
    looks.see(0, apparatus.plant.displacement(&run.last.plant));
    for k in 0..n {
        for part in 0..route.parts(k) {
            if !run.drive(apparatus, &route, drive, (k, part), stop) {
                return Ok(None);
            }
            if looks.is_due(0, part) {
                looks.see(0, apparatus.plant.displacement(&run.last.plant));
            }
        }
        if k % BLOCK == 0 && stop() {
            return Ok(None);
        }
        let measured = apparatus.read_seen(&mut run.last, looks.read_at(0, k), since(drive, k));
        run.keep(apparatus.displacement(&run.last), measured, drive.dt * index(k))?;
    }
    Ok(Some(run))
}

/// The parts of a sampling interval through which an apparatus is driven.
pub(super) struct Route<F> {
    /// Each with where it begins and ends, as parts of the interval.
    parts: Vec<(Stretch<F>, f64, f64)>,
}

impl<F> Route<F> {
    pub(super) fn new<P: Plant<Flow = F>, const AXES: usize>(
        apparatus: &Apparatus<'_, P>,
        looks: &Looks<AXES>,
        dt: f64,
    ) -> Result<Self> {
        let part = |(from, to): (f64, f64)| Ok((apparatus.stretch((to - from) * dt)?, from, to));
        Ok(Self { parts: looks.parts().into_iter().map(part).collect::<Result<_>>()? })
    }

    /// How many there are before sample `k`: none before the first.
    pub(super) fn parts(&self, k: usize) -> usize {
        if k == 0 { 0 } else { self.parts.len() }
    }
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

    /// Leads an apparatus through a part of the interval before sample `k`; false where `stop` said
    /// so meanwhile.
    #[must_use]
    pub(super) fn drive<P: Plant<State = S>>(
        &mut self,
        apparatus: &Apparatus<'_, P>,
        route: &Route<P::Flow>,
        drive: &Drive<'_>,
        (k, part): (usize, usize),
        stop: Stop<'_>,
    ) -> bool {
        let (stretch, from, to) = &route.parts[part];
        let (volts, change) = drive.interval(k - 1);
        let at = |place: f64| place.mul_add(change, volts);
        apparatus.drive(stretch, &mut self.last, [at(*from), at(*to)], stop)
    }

    /// Keeps the present sample, at `time` s.
    pub(super) fn keep(&mut self, displacement: f64, measured: f64, time: f64) -> Result<()> {
        self.measured.push(measured);
        self.displacement.push(still_finite(displacement, time)?);
        self.applied.push(self.last.applied);
        Ok(())
    }
}
