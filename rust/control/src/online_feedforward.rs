//! Feedforward sample by sample: derivatives of the reference, compensation of offset and delay,
//! then the inverse of the stage.
//!
//! With r the reference, T the sampling interval, and the derivatives where they are not given:
//!
//! ```text
//! with preview:     v[k] = (r[k+1] - r[k-1])/(2 T),   a[k] = (r[k+1] - 2 r[k] + r[k-1])/T^2
//! without preview:  v[k] = (r[k] - r[k-1])/T,         a[k] = (r[k] - 2 r[k-1] + r[k-2])/T^2
//!
//! xd  = r[k] + L (v + L a/2) - offset                      L: delay to be compensated
//! xd' = v + L a,   xd'' = a
//! u   = inverse(xd, xd', xd'')
//! ```
//!
//! Central differences are of second order in T. Backward differences are of first order: the
//! velocity is that of half a sample ago, the acceleration that of one sample ago. The delay is
//! compensated by a Taylor expansion of second order, that is, for a constant acceleration over
//! the time L. The inverse is that of Xu and Li 2010, equation (21), doi 10.1115/1.4001712, or of
//! another model; see [`Inverse`].

use crate::cast::{Cast, rounded};
use crate::error::{Result, finite, not_negative, positive};
use crate::inverse::{Inverse, after_drive};
use crate::limits::Limits;
use crate::number::Real;

/// One sample of a reference, with what is known beside its value; `None` for what is not.
///
/// ```
/// use piezotrack_control::ReferenceSample;
///
/// let sample = ReferenceSample { preview: Some(1.2e-6), ..ReferenceSample::new(1e-6) };
/// assert_eq!(sample.velocity, None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceSample<T = f64> {
    /// Displacement to be followed, m.
    pub position: T,
    /// Velocity, m/s; a difference of samples is used where it is not known.
    pub velocity: Option<T>,
    /// Acceleration, m/s^2; a difference of samples is used where it is not known.
    pub acceleration: Option<T>,
    /// Displacement one sample ahead, m; makes the differences central ones.
    pub preview: Option<T>,
}

impl<T> ReferenceSample<T> {
    /// A sample of which only the displacement (m) is known.
    #[must_use]
    pub fn new(position: T) -> Self {
        Self { position, velocity: None, acceleration: None, preview: None }
    }
}

/// An inverse that is fed sample by sample from a reference, with compensation of offset and
/// delay.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `dt` | T | s | > 0, the interval that the inverse was made for |
/// | `offset` | offset | m | any |
/// | `delay` | L | s | >= 0 |
///
/// ```
/// use piezotrack_control::{DahlInverse, OnlineFeedforward, ReferenceSample};
///
/// let dt = 0.02;
/// let inverse = DahlInverse::xu_li_2010().at(dt)?;
/// let feedforward = OnlineFeedforward::new(inverse, dt, 0.0, 0.0)?;
/// let mut state = feedforward.rest();
/// let sample = ReferenceSample {
///     position: 10e-6,
///     velocity: Some(50e-6),
///     acceleration: Some(0.0),
///     preview: None,
/// };
/// let volts = feedforward.step(&mut state, &sample);
/// assert!((volts - 8.40).abs() < 0.005);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnlineFeedforward<I, T = f64> {
    inverse: I,
    dt: T,
    offset: T,
    delay: T,
}

/// State of an [`OnlineFeedforward`]; `S` is the state of its inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnlineFeedforwardState<S, T = f64> {
    /// The last two references, the older one first, m; `None` before the first sample.
    past: Option<[T; 2]>,
    inverse: S,
    /// The inverse before the last sample, and what that asked of it; `None` without a last sample,
    /// or where it is not finite.
    before: S,
    target: Option<[T; 3]>,
    /// By how much the stage was off the reference at the last sample and at the one before it, in
    /// displacement and velocity, m and m/s; 0 where the drive was within the limits.
    off: [T; 2],
    off_before: [T; 2],
}

crate::snapshot!(
    [S: crate::Snapshot, T: Real]
    OnlineFeedforwardState<S, T> { past, inverse, before, target, off, off_before }
);

impl<I: Inverse> OnlineFeedforward<I> {
    /// Feedforward through `inverse` for samples every `dt` seconds.
    ///
    /// `offset` (m) is what the sensor shows where the stage is at rest without drive. `delay`
    /// (s) is the time by which the displacement lags behind the drive beyond the model: the
    /// drive comes that much earlier.
    ///
    /// # Errors
    /// Names `dt`, `offset` or `delay` where it is out of its range.
    pub fn new(inverse: I, dt: f64, offset: f64, delay: f64) -> Result<Self> {
        Ok(Self {
            inverse,
            dt: positive("dt", dt, "s")?,
            offset: finite("offset", offset, "m")?,
            delay: not_negative("delay", delay, "s")?,
        })
    }
}

impl<I: Cast> Cast for OnlineFeedforward<I> {
    type In<T: Real> = OnlineFeedforward<I::In<T>, T>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        Ok(OnlineFeedforward {
            inverse: self.inverse.cast()?,
            dt: rounded("dt", self.dt, "s")?,
            offset: rounded("offset", self.offset, "m")?,
            delay: rounded("delay", self.delay, "s")?,
        })
    }
}

impl<I: Inverse<T>, T: Real> OnlineFeedforward<I, T> {
    /// The sampling interval, s.
    #[must_use]
    pub fn dt(&self) -> T {
        self.dt
    }

    /// The inverse of the stage.
    #[must_use]
    pub fn inverse(&self) -> &I {
        &self.inverse
    }

    /// The state before the first sample, for a stage at rest that never moved.
    #[must_use]
    pub fn rest(&self) -> OnlineFeedforwardState<I::State, T> {
        self.start(self.inverse.rest())
    }

    /// The state before the first sample, with that of the inverse given: for a stage that has
    /// moved before.
    #[must_use]
    pub fn start(&self, inverse: I::State) -> OnlineFeedforwardState<I::State, T> {
        OnlineFeedforwardState {
            past: None,
            inverse,
            before: inverse,
            target: None,
            off: [T::ZERO; 2],
            off_before: [T::ZERO; 2],
        }
    }

    /// The drive (V for a piezo stage) for the next sample of the reference.
    ///
    /// The first sample counts as having been there before: its differences are 0.
    ///
    /// NaN where an input is not finite or the inverse has no drive; the inverse then remembers
    /// nothing of the sample, and a controller holds its feedforward. Where the reference itself
    /// is not finite, the differences go on as if it had kept its velocity.
    #[inline]
    pub fn step(
        &self,
        state: &mut OnlineFeedforwardState<I::State, T>,
        sample: &ReferenceSample<T>,
    ) -> T {
        let (reference, dt) = (sample.position, self.dt);
        let (half, two) = (T::of(0.5), T::of(2.0));
        let [first, before] = state.past.unwrap_or([reference; 2]);
        let (velocity, acceleration) = match sample.preview {
            Some(preview) => {
                (half * (preview - before) / dt, (preview - two * reference + before) / (dt * dt))
            }
            None => ((reference - before) / dt, (reference - two * before + first) / (dt * dt)),
        };
        let v = sample.velocity.unwrap_or(velocity);
        let a = sample.acceleration.unwrap_or(acceleration);
        let lead = self.delay;
        let x = reference + lead * (v + half * lead * a) - self.offset;
        state.before = state.inverse;
        (state.off_before, state.off) = (state.off, [T::ZERO; 2]);
        let target = [x, v + lead * a, a];
        state.target = target.iter().all(|value| value.is_finite()).then_some(target);
        let [x, v, a] = target;
        let drive = self.inverse.step(&mut state.inverse, x, v, a);
        if reference.is_finite() {
            state.past = Some([before, reference]);
        } else if state.past.is_some() {
            state.past = Some([before, two * before - first]);
        }
        drive
    }

    /// The drive for the next sample, as [`Self::step`], of which only that within the limits
    /// reaches the stage: that is what the inverse remembers.
    #[inline]
    pub fn step_within(
        &self,
        state: &mut OnlineFeedforwardState<I::State, T>,
        sample: &ReferenceSample<T>,
        limits: &Limits<T>,
    ) -> T {
        let drive = self.step(state, sample);
        let reached = limits.clip(drive);
        // Not where the drive is NaN.
        if (drive - reached).abs() > T::ZERO {
            self.applied(state, reached);
        }
        drive
    }

    /// Reports the drive that reached the stage in place of the last one: the inverse remembers
    /// it instead. [`crate::Controller::reached`] knows it.
    ///
    /// The last step is done again for the displacement at which the inverse gives this drive: the
    /// inverse is evaluated 42 times at most, some 8 times mostly. Without a last drive, and where no
    /// displacement has this one, nothing changes.
    pub fn applied(&self, state: &mut OnlineFeedforwardState<I::State, T>, volts: T) {
        let Some(target) = state.target else { return };
        let (before, off) = (&state.before, state.off_before);
        if let Some(after) = after_drive(&self.inverse, before, target, off, self.dt, volts) {
            (state.inverse, state.off) = after;
        }
    }
}
