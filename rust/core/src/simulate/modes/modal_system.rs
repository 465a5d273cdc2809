//! Modes in parallel with several drives and sensors, from sample to sample, alone or in a loop.

use piezotrack_control::{Feedback, FeedbackSample};
use pulp::{Simd, WithSimd};

use crate::error::{Error, Result};
use crate::math::{dispatch_fused, room, zeros};

/// A sampled system of n drives and m sensors whose modes stand in parallel.
///
/// ```text
/// x_i[k+1] = p_i x_i[k] + b_i . u[k]
/// y[k]     = 2 Re sum_i c_i x_i[k] + D u[k]
/// ```
///
/// Each mode is a complex pole p with the vectors b (of the drives) and c (of the sensors); its
/// conjugate is the factor 2 Re. A pole on the real axis is a first-order lag.
///
/// ```
/// use piezotrack_core::simulate::ModalSystem;
///
/// // 2 Re 0.5/(z - 0.5): a lag with a static gain of 2.
/// let lag = ModalSystem::new([1, 1], &[[0.5, 0.0]], &[[1.0, 0.0]], &[[0.5, 0.0]], &[0.0])?;
/// let mut state = lag.rest()?;
/// assert_eq!(lag.simulate(&mut state, &[1.0, 1.0, 1.0])?, [0.0, 1.0, 1.5]);
/// # Ok::<(), piezotrack_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ModalSystem {
    pub(super) drives: usize,
    pub(super) sensors: usize,
    /// Real and imaginary parts of the poles.
    poles: [Vec<f64>; 2],
    /// Real and imaginary parts of b, drive by drive.
    inputs: [Vec<f64>; 2],
    /// Real and negative imaginary parts of 2 c, sensor by sensor.
    outputs: [Vec<f64>; 2],
    /// D, sensor by sensor.
    direct: Vec<f64>,
}

/// State of a [`ModalSystem`]: real and imaginary parts of its modes.
#[derive(Clone, Debug, PartialEq)]
pub struct ModalState {
    /// Real parts.
    pub real: Vec<f64>,
    /// Imaginary parts.
    pub imaginary: Vec<f64>,
}

/// A loop around a [`ModalSystem`]: one law for each sensor, and matrices between axes and drives.
///
/// A command is computed from a reading and put out one sample later.
#[derive(Clone, Debug)]
pub struct AxesLoop<F> {
    /// The law of each axis.
    pub laws: Vec<F>,
    /// From the outputs of the laws to the drives, drive by drive.
    pub to_drives: Vec<f64>,
    /// From the drives to the outputs of the laws, axis by axis, for antiwindup.
    pub to_axes: Vec<f64>,
    /// Least and largest value of each drive.
    pub limits: Vec<[f64; 2]>,
}

/// Motion in a loop: readings without noise, and drives, sample by sample.
#[derive(Clone, Debug, PartialEq)]
pub struct AxesRun {
    /// Displacements, all sensors of a sample after each other.
    pub outputs: Vec<f64>,
    /// Drives within their limits, all of a sample after each other.
    pub drives: Vec<f64>,
}

/// Refuses a list that has not as many entries as expected.
pub(super) fn sized(name: &str, found: usize, expected: usize) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(Error::Shape {
        name: name.into(),
        found: format!("{found} entries"),
        expected: format!("{expected}"),
    })
}

/// The number of samples of so many channels, one or more.
pub(super) fn whole_samples(name: &str, entries: usize, channels: usize) -> Result<usize> {
    if channels == 0 || entries == 0 || !entries.is_multiple_of(channels) {
        let found = format!("{entries} entries");
        let expected = format!("whole samples of {channels} channels, one or more");
        return Err(Error::Shape { name: name.into(), found, expected });
    }
    Ok(entries / channels)
}

/// Refuses modes whose lists do not fit each other, that are not stable or not finite.
///
/// # Errors
/// As of [`ModalSystem::new`].
pub(crate) fn check_modes(
    [drives, sensors]: [usize; 2],
    poles: &[[f64; 2]],
    inputs: &[[f64; 2]],
    outputs: &[[f64; 2]],
    direct: &[f64],
) -> Result<()> {
    let count = poles.len();
    sized("inputs", inputs.len(), count.saturating_mul(drives))?;
    sized("outputs", outputs.len(), count.saturating_mul(sensors))?;
    sized("direct", direct.len(), sensors.saturating_mul(drives))?;
    for [real, imaginary] in poles {
        let size = real * real + imaginary * imaginary;
        if size.is_nan() || size >= 1.0 {
            let value = format!("{real} + {imaginary}i");
            return Err(Error::parameter("poles", value, "poles inside the unit circle"));
        }
    }
    let all = inputs.iter().chain(outputs).flatten().chain(direct);
    if let Some(value) = all.into_iter().find(|value| !value.is_finite()) {
        return Err(Error::parameter("inputs, outputs or direct", value, "finite numbers"));
    }
    Ok(())
}

impl ModalSystem {
    /// A system of `[drives, sensors]` with these poles, b of each mode, c of each mode, and D
    /// sensor by sensor; complex numbers as real and imaginary part.
    ///
    /// # Errors
    /// [`Error::Shape`] where the lists do not fit each other; [`Error::Parameter`] where a pole is
    /// not inside the unit circle or a number is not finite; [`Error::Memory`].
    pub fn new(
        [drives, sensors]: [usize; 2],
        poles: &[[f64; 2]],
        inputs: &[[f64; 2]],
        outputs: &[[f64; 2]],
        direct: &[f64],
    ) -> Result<Self> {
        check_modes([drives, sensors], poles, inputs, outputs, direct)?;
        Ok(Self {
            drives,
            sensors,
            poles: by_channel(poles, 1, [1.0, 1.0])?,
            inputs: by_channel(inputs, drives, [1.0, 1.0])?,
            outputs: by_channel(outputs, sensors, [2.0, -2.0])?,
            direct: direct.to_vec(),
        })
    }

    /// Number of modes.
    #[must_use]
    pub fn modes(&self) -> usize {
        self.poles[0].len()
    }

    /// The state at rest.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub fn rest(&self) -> Result<ModalState> {
        let count = self.modes();
        Ok(ModalState { real: zeros("the state", count)?, imaginary: zeros("the state", count)? })
    }

    /// Writes the output of a state under a drive to `output`, which has an entry for each sensor.
    #[inline(always)]
    pub(super) fn output(&self, state: &ModalState, drive: &[f64], output: &mut [f64]) {
        for (slot, gains) in output.iter_mut().zip(self.direct.chunks_exact(self.drives)) {
            *slot = gains.iter().zip(drive).map(|(gain, value)| gain * value).sum();
        }
        self.add_modes(state, output);
    }

    /// Adds what the modes of a state move to `output`.
    #[inline(always)]
    pub(super) fn add_modes(&self, state: &ModalState, output: &mut [f64]) {
        let count = self.modes();
        for (channel, slot) in output.iter_mut().enumerate() {
            let rows = self.outputs.each_ref().map(|part| &part[channel * count..][..count]);
            let gains = rows[0].iter().zip(rows[1]);
            for ((real, imaginary), (x, y)) in gains.zip(state.real.iter().zip(&state.imaginary)) {
                *slot += real * x + imaginary * y;
            }
        }
    }

    /// Advances a state by one sample under a drive, which has an entry for each channel.
    #[inline(always)]
    pub(super) fn advance(&self, state: &mut ModalState, drive: &[f64]) {
        self.turn(state);
        push(&self.inputs, state, drive);
    }

    /// Advances a state by one sample without a drive.
    #[inline(always)]
    pub(super) fn turn(&self, state: &mut ModalState) {
        let poles = self.poles[0].iter().zip(&self.poles[1]);
        for ((p, q), (x, y)) in poles.zip(state.real.iter_mut().zip(&mut state.imaginary)) {
            let real = p * *x - q * *y;
            *y = q * *x + p * *y;
            *x = real;
        }
    }

    /// Simulates a drive from a state, which becomes the state after it.
    ///
    /// All channels of a sample stand after each other, in the drive and in the outputs.
    ///
    /// # Errors
    /// [`Error::Shape`] where the drive holds no whole number of samples or the state has another
    /// number of modes; [`Error::Numerical`] where the output overflows; [`Error::Memory`].
    pub fn simulate(&self, state: &mut ModalState, drive: &[f64]) -> Result<Vec<f64>> {
        let count = self.checked(state, "drive", drive.len(), self.drives)?;
        let mut outputs = zeros("the outputs", count * self.sensors)?;
        dispatch_fused(Motion { system: self, state, drive, outputs: &mut outputs });
        finite_outputs(outputs)
    }

    /// Closes a loop from rest along a reference, with noise of the sensors and a feedforward.
    ///
    /// # Errors
    /// [`Error::Shape`] where sizes do not fit each other; [`Error::Numerical`] where a signal
    /// overflows; [`Error::Memory`].
    pub fn track<F: Feedback>(
        &self,
        around: &AxesLoop<F>,
        reference: &[f64],
        feedforward: &[f64],
        noise: &[f64],
    ) -> Result<AxesRun> {
        let (n, m) = (self.drives, self.sensors);
        let mut state = self.rest()?;
        let count = self.checked(&state, "reference", reference.len(), m)?;
        sized("laws", around.laws.len(), m)?;
        sized("to_drives", around.to_drives.len(), n * m)?;
        sized("to_axes", around.to_axes.len(), n * m)?;
        sized("limits", around.limits.len(), n)?;
        sized("feedforward", feedforward.len(), count * n)?;
        sized("noise", noise.len(), count * m)?;
        let mut memories = room("the laws", m)?;
        memories.extend(around.laws.iter().map(Feedback::rest));
        let (mut outputs, mut drives) =
            (zeros("the outputs", count * m)?, zeros("the drives", count * n)?);
        let mut next = zeros("the command", n)?;
        clip(&mut next, feedforward, &around.limits);
        let (mut wanted, mut excess) = (zeros("the command", m)?, zeros("the excess", m)?);
        let mut raw = zeros("the command", n)?;
        for k in 0..count {
            let drive = &mut drives[k * n..][..n];
            drive.copy_from_slice(&next);
            let output = &mut outputs[k * m..][..m];
            self.output(&state, drive, output);
            self.advance(&mut state, drive);
            for (axis, law) in around.laws.iter().enumerate() {
                let measured = output[axis] + noise[k * m + axis];
                let reference = reference[k * m + axis];
                let sample = FeedbackSample {
                    error: reference - measured,
                    reference,
                    measured,
                    excess: excess[axis],
                    ..FeedbackSample::default()
                };
                wanted[axis] = law.step(&mut memories[axis], &sample);
            }
            let later = &feedforward[(k + 1).min(count - 1) * n..][..n];
            for (channel, slot) in raw.iter_mut().enumerate() {
                let row = around.to_drives[channel * m..][..m].iter().zip(&wanted);
                *slot = later[channel] + row.map(|(gain, value)| gain * value).sum::<f64>();
            }
            clip(&mut next, &raw, &around.limits);
            for (axis, slot) in excess.iter_mut().enumerate() {
                let row = around.to_axes[axis * n..][..n].iter().zip(next.iter().zip(&raw));
                *slot = row.map(|(gain, (clipped, raw))| gain * (clipped - raw)).sum::<f64>();
            }
        }
        Ok(AxesRun { outputs: finite_outputs(outputs)?, drives })
    }

    /// The number of samples of a signal with some channels, where all sizes fit.
    pub(super) fn checked(
        &self,
        state: &ModalState,
        name: &str,
        entries: usize,
        channels: usize,
    ) -> Result<usize> {
        sized("state", state.real.len(), self.modes())?;
        sized("state", state.imaginary.len(), self.modes())?;
        whole_samples(name, entries, channels)
    }
}

/// Real and imaginary parts of entries with so many channels of each mode, mode after mode for each
/// channel, times two factors.
pub(super) fn by_channel(
    entries: &[[f64; 2]],
    width: usize,
    factors: [f64; 2],
) -> Result<[Vec<f64>; 2]> {
    let mut found = [room("the modes", entries.len())?, room("the modes", entries.len())?];
    for channel in 0..width {
        for entry in entries.iter().skip(channel).step_by(width) {
            found[0].push(factors[0] * entry[0]);
            found[1].push(factors[1] * entry[1]);
        }
    }
    Ok(found)
}

/// Adds to a state what a drive does to it.
#[inline(always)]
pub(super) fn push(inputs: &[Vec<f64>; 2], state: &mut ModalState, drive: &[f64]) {
    let count = state.real.len();
    for (channel, value) in drive.iter().enumerate() {
        let rows = inputs.each_ref().map(|part| &part[channel * count..][..count]);
        for (x, b) in state.real.iter_mut().zip(rows[0]) {
            *x += b * value;
        }
        for (y, b) in state.imaginary.iter_mut().zip(rows[1]) {
            *y += b * value;
        }
    }
}

/// Modes that a drive moves; wider vectors change no bits, as every mode is by itself.
struct Motion<'a> {
    system: &'a ModalSystem,
    state: &'a mut ModalState,
    drive: &'a [f64],
    outputs: &'a mut [f64],
}

impl WithSimd for Motion<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { system, state, drive, outputs } = self;
        let samples = drive.chunks_exact(system.drives);
        for (slots, sample) in outputs.chunks_exact_mut(system.sensors).zip(samples) {
            system.output(state, sample, slots);
            system.advance(state, sample);
        }
    }
}

/// Writes values within limits to `target`.
fn clip(target: &mut [f64], values: &[f64], limits: &[[f64; 2]]) {
    for ((slot, value), [low, high]) in target.iter_mut().zip(values).zip(limits) {
        *slot = value.max(*low).min(*high);
    }
}

/// The outputs, where they are finite.
pub(super) fn finite_outputs(outputs: Vec<f64>) -> Result<Vec<f64>> {
    if outputs.iter().all(|value| value.is_finite()) {
        return Ok(outputs);
    }
    Err(Error::Numerical("the simulated output leaves the range of numbers".into()))
}
