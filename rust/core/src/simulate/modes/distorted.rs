//! Modes that regressors move beside the drives, from sample to sample.

use pulp::{Simd, WithSimd};

use super::modal_system::{ModalState, ModalSystem, by_channel, finite_outputs, push, sized};
use super::regressors::{RegressorState, Regressors};
use crate::error::{Error, Result};
use crate::math::{dispatch_fused, room, zeros};

/// A [`ModalSystem`] whose modes are also moved by [`Regressors`] of its drives and its motion.
///
/// ```text
/// w_i[k+1] = p_i w_i[k] + e_i . (u[k], n[k])
/// y[k]     = 2 Re sum_i c_i (x_i[k] + w_i[k]) + D u[k]
/// ```
///
/// The regressors n follow the motion of x alone, so that no loop is closed by them.
///
/// ```
/// use piezotrack_core::simulate::{DistortedModes, ModalSystem, Regressor, Regressors};
///
/// // A lag, moved by the square of its drive as well.
/// let lag = ModalSystem::new([1, 1], &[[0.5, 0.0]], &[[1.0, 0.0]], &[[0.5, 0.0]], &[0.0])?;
/// let square = Regressors::new([1, 1], &[1.0, 0.0], vec![Regressor::Product(vec![0, 0])])?;
/// let whole = DistortedModes::new(lag, square, &[[0.0, 0.0], [0.1, 0.0]])?;
/// let mut state = whole.rest()?;
/// assert_eq!(whole.simulate(&mut state, &[2.0, 0.0, 0.0])?, [0.0, 2.4, 1.2]);
/// # Ok::<(), piezotrack_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DistortedModes {
    system: ModalSystem,
    regressors: Regressors,
    /// Real and imaginary parts of e of the drives, drive by drive.
    linear: [Vec<f64>; 2],
    /// Regressors and their e, other than 0, mode after mode, and where those of a mode end.
    forces: Vec<(usize, [f64; 2])>,
    ends: Vec<usize>,
}

/// State of [`DistortedModes`].
#[derive(Clone, Debug, PartialEq)]
pub struct DistortedState {
    /// x, which the drives move.
    pub modes: ModalState,
    /// w, which drives and regressors move.
    pub forced: ModalState,
    /// Memory of the regressors.
    pub memory: RegressorState,
}

impl DistortedModes {
    /// A system with regressors, and e of the drives and the regressors, mode by mode; complex
    /// numbers as real and imaginary part.
    ///
    /// # Errors
    /// [`Error::Shape`] where sizes do not fit each other; [`Error::Parameter`] where a number is
    /// not finite; [`Error::Memory`].
    pub fn new(system: ModalSystem, regressors: Regressors, forces: &[[f64; 2]]) -> Result<Self> {
        let drives = system.drives;
        let width = drives + regressors.count();
        sized("forces", forces.len(), system.modes().saturating_mul(width))?;
        let channels = [regressors.drives, regressors.sensors];
        sized("regressors", channels[0], drives)?;
        sized("regressors", channels[1], system.sensors)?;
        if let Some(value) = forces.iter().flatten().find(|value| !value.is_finite()) {
            return Err(Error::parameter("forces", value, "finite numbers"));
        }
        let mut own = room("the forces", system.modes() * drives)?;
        let (mut acting, mut ends) = (room("the forces", forces.len())?, Vec::new());
        for row in forces.chunks_exact(width.max(1)) {
            let (linear, rest) = row.split_at(drives);
            own.extend_from_slice(linear);
            let entries = rest.iter().enumerate().filter(|(_, entry)| **entry != [0.0, 0.0]);
            acting.extend(entries.map(|(k, entry)| (k, *entry)));
            ends.push(acting.len());
        }
        let linear = by_channel(&own, drives, [1.0, 1.0])?;
        Ok(Self { system, regressors, linear, forces: acting, ends })
    }

    /// The state at rest.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub fn rest(&self) -> Result<DistortedState> {
        Ok(DistortedState {
            modes: self.system.rest()?,
            forced: self.system.rest()?,
            memory: self.regressors.rest()?,
        })
    }

    /// Simulates a drive from a state, which becomes the state after it.
    ///
    /// All channels of a sample stand after each other, in the drive and in the outputs.
    ///
    /// # Errors
    /// [`Error::Shape`] where the drive holds no whole number of samples or the state is of another
    /// system; [`Error::Numerical`] where the output overflows; [`Error::Memory`].
    pub fn simulate(&self, state: &mut DistortedState, drive: &[f64]) -> Result<Vec<f64>> {
        let system = &self.system;
        let count = system.checked(&state.modes, "drive", drive.len(), system.drives)?;
        system.checked(&state.forced, "drive", drive.len(), system.drives)?;
        self.regressors.check(&state.memory)?;
        let now = zeros("the variables", state.memory.last.len())?;
        let mut outputs = zeros("the outputs", count.saturating_mul(system.sensors))?;
        dispatch_fused(Motion { distorted: self, state, drive, now, outputs: &mut outputs });
        finite_outputs(outputs)
    }

    /// Adds to the forced modes what the regressors do to them.
    #[inline(always)]
    fn force(&self, state: &mut ModalState, values: &[f64]) {
        let mut from = 0;
        let modes = state.real.iter_mut().zip(&mut state.imaginary);
        for ((x, y), &to) in modes.zip(&self.ends) {
            let mut sum = [*x, *y];
            for &(regressor, [real, imaginary]) in &self.forces[from..to] {
                let value = values[regressor];
                sum = [sum[0] + real * value, sum[1] + imaginary * value];
            }
            [*x, *y] = sum;
            from = to;
        }
    }
}

/// A drive along which the modes are simulated; wider vectors change no bits, as every mode is by
/// itself.
struct Motion<'a> {
    distorted: &'a DistortedModes,
    state: &'a mut DistortedState,
    drive: &'a [f64],
    now: Vec<f64>,
    outputs: &'a mut [f64],
}

impl WithSimd for Motion<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { distorted, state, drive, mut now, outputs } = self;
        let system = &distorted.system;
        let DistortedState { modes, forced, memory } = state;
        let samples = drive.chunks_exact(system.drives);
        for (slots, sample) in outputs.chunks_exact_mut(system.sensors).zip(samples) {
            system.output(modes, sample, slots);
            system.advance(modes, sample);
            distorted.regressors.step(memory, &mut now, sample, slots);
            system.add_modes(forced, slots);
            system.turn(forced);
            push(&distorted.linear, forced, sample);
            distorted.force(forced, &memory.values);
        }
    }
}
