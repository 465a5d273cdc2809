//! Luenberger observer of the hysteresis, whose estimate compensates it, around a feedback law.
//!
//! ```text
//! T x' + x = g (u - w),   uFB = uC + w^
//! ```
//!
//! w is the hysteresis as a voltage: Fh/T of a Dahl stage, an operator along the displacement, or
//! h/d of a Bouc-Wen stage, an operator along the voltage. After Luenberger 1971, doi
//! 10.1109/TAC.1971.1099826; equations (2) and (20) of Xu and Li 2010, doi 10.1115/1.4001712,
//! without mass. Sampled, p = exp(-Ts/T), v the voltage that was applied, y the measurement:
//!
//! ```text
//! x-[k] = p x^[k-1] + (1 - p) g (v[k-1] - w^[k-1]),   x^[k] = x-[k] + L (y[k] - x-[k])
//! w^[k] = w-[k] + L (v[k-1] - w-[k] - (y[k] - p x^[k-1])/(g (1 - p)))
//! ```
//!
//! w- is the operator's output after the way to `x^[k]`, or to `v[k-1]`. With L = 0 the model runs
//! beside the stage; with L = 1 everything that the linear part does not explain counts as
//! hysteresis, creep and disturbances too. Of the operator only the output is corrected, not its
//! slope. The compensation takes the place of a feedforward by the inverse of the hysteresis, which
//! would compensate it twice; a linear feedforward r/g, or none, goes with it.

use crate::cast::{Cast, all_rounded, rounded};
use crate::error::{Result, check, finite, not_negative, positive};
use crate::feedback_law::{Feedback, FeedbackSample};
use crate::hysteresis::{BoucWen, BoucWenState, Dahl, DahlState, Operator};
use crate::number::Real;
use crate::unfused::Unfused;

/// Most pieces of a way that is too long for one.
const MOST_PIECES: u32 = 16;

/// A hysteresis operator that an observer can run.
pub trait Observable: Copy {
    /// The operator as it runs on a target without a fused instruction.
    type Running: ObservedOperator;

    /// That operator.
    fn running(&self) -> Self::Running;

    /// The longest way, m or V, along which one branch is exact.
    fn longest(&self) -> f64;

    /// Smallest and largest slope of the output, V/m or V/V, for displacements up to `stroke`, m.
    fn slopes(&self, stroke: f64) -> [f64; 2];
}

impl Observable for Dahl<f64> {
    type Running = Dahl<Unfused>;

    fn running(&self) -> Dahl<Unfused> {
        Dahl { a1: Unfused(self.a1), a2: Unfused(self.a2), gain: Unfused(self.gain) }
    }

    /// A tenth of a radian: the series leaves out less than 1e-9 of the change.
    fn longest(&self) -> f64 {
        0.1 / libm::sqrt(self.a2).max(self.a1)
    }

    /// 0 at the origin; on the virgin branch it rises to b1 up x, at most to that of a2.
    fn slopes(&self, stroke: f64) -> [f64; 2] {
        let most = self.gain * stroke.min(1.0 / libm::sqrt(self.a2));
        [most.min(0.0), most.max(0.0)]
    }
}

impl Observable for BoucWen<f64> {
    type Running = BoucWen<Unfused>;

    fn running(&self) -> BoucWen<Unfused> {
        let Self { rise, beta, gamma, exponent } = *self;
        BoucWen { rise: Unfused(rise), beta: Unfused(beta), gamma: Unfused(gamma), exponent }
    }

    fn longest(&self) -> f64 {
        f64::INFINITY
    }

    /// 0 at the limit; A at the origin or, if that is more, 2 A beta/(beta + gamma) after a
    /// reversal at the limit.
    fn slopes(&self, _stroke: f64) -> [f64; 2] {
        let both = self.beta + self.gamma;
        let reversed = if both > 0.0 { 2.0 * self.beta / both } else { 1.0 };
        let most = self.rise * reversed.max(1.0);
        [most.min(0.0), most.max(0.0)]
    }
}

/// A hysteresis operator with its output in volts whose state can be corrected.
pub trait ObservedOperator<T: Real = f64>: Operator<Unfused<T>> {
    /// Whether its path is the applied voltage; otherwise it is the displacement.
    const OF_DRIVE: bool;

    /// The state with an output larger by `volts`.
    fn corrected(&self, state: &Self::State, volts: T) -> Self::State;

    /// Its state from a state at a place to the next place on the path, in pieces of `longest`.
    #[inline]
    fn moved(&self, state: &Self::State, way: T, longest: T) -> Self::State {
        let mut out = *state;
        let direction = Unfused(if way < T::ZERO { T::of(-1.0) } else { T::of(1.0) });
        let mut left = way.abs();
        for _ in 0..MOST_PIECES {
            if left <= T::ZERO {
                break;
            }
            let piece = left.smaller(longest);
            out = self.along(&self.branch(&out, direction), direction * Unfused(piece));
            left = left - piece;
        }
        out
    }
}

impl<T: Real> ObservedOperator<T> for Dahl<Unfused<T>> {
    const OF_DRIVE: bool = false;

    #[inline]
    fn corrected(&self, state: &DahlState<Unfused<T>>, volts: T) -> DahlState<Unfused<T>> {
        DahlState { force: state.force + Unfused(volts), ..*state }
    }
}

impl<T: Real> ObservedOperator<T> for BoucWen<Unfused<T>> {
    const OF_DRIVE: bool = true;

    #[inline]
    fn corrected(&self, state: &BoucWenState<Unfused<T>>, volts: T) -> BoucWenState<Unfused<T>> {
        BoucWenState { value: state.value + Unfused(volts), ..*state }
    }
}

/// Nominal plant and gain of an observer, in continuous time.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `operator` | w | V | finite coefficients |
/// | `gain` | g | m/V | not 0 |
/// | `time` | T | s | >= 0 |
/// | `correction` | L | 1 | 0 to 1 |
/// | `stroke` | | m | > 0 |
///
/// ```
/// use piezotrack_control::hysteresis::BoucWen;
/// use piezotrack_control::{Feedback, FeedbackSample, HysteresisObserver};
///
/// let operator = BoucWen { rise: 0.36, beta: 0.04, gamma: 0.03, exponent: 1.0 };
/// let observer = HysteresisObserver::new(operator, 1.7e-6, 0.0, 0.0, 100e-6)?;
/// let law = observer.around((), 0.02)?;
/// let mut state = law.rest();
/// let sample = FeedbackSample { applied: 10.0, ..FeedbackSample::new(0.0) };
/// let volts = law.step(&mut state, &sample);
/// // What the hysteresis takes from 10 V
/// assert!((volts - 0.36 / 0.07 * (1.0 - (-0.7_f64).exp())).abs() < 1e-12);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HysteresisObserver<O> {
    operator: O,
    gain: f64,
    time: f64,
    correction: f64,
    stroke: f64,
}

impl<O: Observable> HysteresisObserver<O> {
    /// The operator with its output in V; gain (m/V) and time constant (s) of the linear part; the
    /// share (0 to 1) of the difference to the measurement that corrects the estimate in a sample;
    /// and the largest displacement (m), for the stability check.
    ///
    /// # Errors
    /// Names the number that is out of its range; the operator where its slope is not finite.
    pub fn new(operator: O, gain: f64, time: f64, correction: f64, stroke: f64) -> Result<Self> {
        finite("plant_gain", gain, "m/V")?;
        check("plant_gain", gain, "m/V", gain.abs() > 0.0, "a gain other than 0")?;
        not_negative("plant_time", time, "s")?;
        let right = (0.0..=1.0).contains(&correction);
        check("correction", correction, "", right, "a share from 0 to 1")?;
        positive("stroke", stroke, "m")?;
        let [_, largest] = operator.slopes(stroke);
        finite("slope of the hysteresis", largest, "")?;
        Ok(Self { operator, gain, time, correction, stroke })
    }

    /// The observer around the law `inner`, both for the sampling interval `dt`, s.
    ///
    /// # Errors
    /// Names `dt` where it is not above 0; `plant_gain` where the sampled gain has no inverse.
    pub fn around<F>(&self, inner: F, dt: f64) -> Result<HysteresisObserved<O::Running, F>> {
        positive("dt", dt, "s")?;
        let rest = if self.time > 0.0 { -libm::expm1(-dt / self.time) } else { 1.0 };
        let fresh = self.gain * rest;
        let expected = "a linear part whose sampled inverse is finite";
        check("plant_gain", self.gain, "m/V", (1.0 / fresh).is_finite(), expected)?;
        let (operator, correction) = (self.operator.running(), self.correction);
        let (slopes, longest) = (self.operator.slopes(self.stroke), self.operator.longest());
        let pole = 1.0 - rest;
        Ok(HysteresisObserved { operator, longest, inner, pole, fresh, correction, slopes })
    }
}

/// A feedback law with an observer of the hysteresis, for one sampling interval; see
/// [`HysteresisObserver::around`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HysteresisObserved<O, F, T = f64> {
    operator: O,
    /// The longest piece of its path, m or V.
    longest: T,
    inner: F,
    /// p.
    pole: T,
    /// g (1 - p), m/V.
    fresh: T,
    /// L.
    correction: T,
    /// Smallest and largest slope of the operator.
    slopes: [T; 2],
}

/// State of a [`HysteresisObserved`] law; `O` is that of the operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HysteresisObservedState<O, S, T = f64> {
    inner: S,
    operator: O,
    /// x^, m.
    displacement: T,
    /// The operator's place on its path, m or V.
    place: T,
    /// Whether there was a sample.
    begun: bool,
    /// Voltage to begin with, V.
    first: Option<T>,
    /// The last output, V.
    volts: T,
}

crate::snapshot!(
    [O: crate::Snapshot, S: crate::Snapshot, T: Real]
    HysteresisObservedState<O, S, T> { inner, operator, displacement, place, begun, first, volts }
);

impl<O: Cast, F: Cast> Cast for HysteresisObserved<O, F> {
    type In<T: Real> = HysteresisObserved<O::In<T>, F::In<T>, T>;

    fn cast<T: Real>(&self) -> Result<Self::In<T>> {
        Ok(HysteresisObserved {
            operator: self.operator.cast()?,
            longest: rounded("longest", self.longest, "")?,
            inner: self.inner.cast()?,
            pole: rounded("plant_time", self.pole, "")?,
            fresh: rounded("plant_gain", self.fresh, "m/V")?,
            correction: rounded("correction", self.correction, "")?,
            slopes: all_rounded("slope of the hysteresis", &self.slopes, "")?,
        })
    }
}

impl<O: ObservedOperator<T>, F, T: Real> HysteresisObserved<O, F, T> {
    /// The law inside.
    #[must_use]
    pub fn inner(&self) -> &F {
        &self.inner
    }

    /// The operator of the hysteresis.
    #[must_use]
    pub fn operator(&self) -> &O {
        &self.operator
    }

    /// The longest piece of its path, m or V.
    #[must_use]
    pub fn longest(&self) -> T {
        self.longest
    }

    /// p, g (1 - p) in m/V, and L.
    #[must_use]
    pub fn coefficients(&self) -> [T; 3] {
        [self.pole, self.fresh, self.correction]
    }

    /// Smallest and largest slope of the operator, V/m or V/V.
    #[must_use]
    pub fn slopes(&self) -> [T; 2] {
        self.slopes
    }

    /// Whether the operator's path is the applied voltage; otherwise it is the displacement.
    #[must_use]
    pub fn is_of_drive(&self) -> bool {
        O::OF_DRIVE
    }

    /// The estimated hysteresis, V.
    #[must_use]
    pub fn estimate<S>(&self, state: &HysteresisObservedState<O::State, S, T>) -> T {
        self.output(state)
    }

    #[inline]
    fn output<S>(&self, state: &HysteresisObservedState<O::State, S, T>) -> T {
        self.operator.output(&state.operator).0.0
    }

    /// Moves the operator to a place on its path; its output there.
    #[inline]
    fn follow<S>(&self, state: &mut HysteresisObservedState<O::State, S, T>, place: T) -> T {
        let way = place - state.place;
        state.operator = self.operator.moved(&state.operator, way, self.longest);
        state.place = place;
        self.output(state)
    }

    /// The estimate at this sample, V.
    #[inline]
    fn observe<S>(
        &self,
        state: &mut HysteresisObservedState<O::State, S, T>,
        sample: &FeedbackSample<T>,
    ) -> T {
        let FeedbackSample { measured, applied, .. } = *sample;
        if !state.begun {
            // The way from the origin; nothing is known of what was before.
            (state.begun, state.displacement) = (true, measured);
            return self.follow(state, if O::OF_DRIVE { applied } else { measured });
        }
        let mut before = self.output(state);
        if O::OF_DRIVE {
            before = self.follow(state, applied);
        }
        let kept = self.pole * state.displacement;
        let ahead = kept + self.fresh * (applied - before);
        state.displacement = ahead + self.correction * (measured - ahead);
        let moved = if O::OF_DRIVE { before } else { self.follow(state, state.displacement) };
        let step = self.correction * (applied - moved - (measured - kept) / self.fresh);
        state.operator = self.operator.corrected(&state.operator, step);
        moved + step
    }
}

impl<O: ObservedOperator<T> + PartialEq, F: Feedback<T>, T: Real> Feedback<T>
    for HysteresisObserved<O, F, T>
{
    type State = HysteresisObservedState<O::State, F::State, T>;

    fn rest(&self) -> Self::State {
        HysteresisObservedState {
            inner: self.inner.rest(),
            operator: self.operator.rest(),
            displacement: T::ZERO,
            place: T::ZERO,
            begun: false,
            first: None,
            volts: T::ZERO,
        }
    }

    fn start(&self, volts: T) -> Self::State {
        HysteresisObservedState { first: Some(volts), volts, ..self.rest() }
    }

    fn holds(&self) -> bool {
        self.inner.holds()
    }

    fn adopt(&self, before: &Self, state: &mut Self::State) -> bool {
        let same = self.coefficients() == before.coefficients();
        let same = same && self.operator == before.operator;
        same && self.inner.adopt(&before.inner, &mut state.inner)
    }

    #[inline]
    fn step(&self, state: &mut Self::State, sample: &FeedbackSample<T>) -> T {
        let estimate = self.observe(state, sample);
        if let Some(first) = state.first.take() {
            // Started once the estimate is known, and as if the error had been 0 so far.
            state.inner = self.inner.start(first - estimate);
        }
        let volts = self.inner.step(&mut state.inner, sample) + estimate;
        if volts.is_finite() {
            state.volts = volts;
        } else {
            // Overflow: hold the output, and observe again from the next sample on.
            let HysteresisObservedState { operator, displacement, place, begun, .. } = self.rest();
            *state =
                HysteresisObservedState { operator, displacement, place, begun, ..state.clone() };
        }
        state.volts
    }
}
