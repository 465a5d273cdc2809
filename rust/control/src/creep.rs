//! Creep of a piezo actuator: first-order relaxations in parallel with a direct path.
//!
//! ```text
//! d = h + sum_j c_j q_j,   tau_j q_j' = h - q_j
//! ```
//!
//! h is the output of the hysteresis operator, d the displacement, both in m. A sum of relaxations
//! is the linear creep operator of Krejci and Kuhnen 2001, IEE Proceedings - Control Theory and
//! Applications 148(3), 185-192, doi 10.1049/ip-cta:20010375. With time constants a decade apart
//! and about equal shares the creep grows nearly with the logarithm of time, as that of
//! piezoceramics does.
//!
//! The input is taken to be a straight line from sample to sample (first-order hold). For such an
//! input the step of length T is exact, with `r = h1 - h0` and `p = exp(-T/tau)`:
//!
//! ```text
//! q1 = h1 - (p (h0 - q0 - r tau/T) + r tau/T)
//! ```
//!
//! Behind mechanics, whose velocity is known too, the input is the cubic through values and slopes:
//! [`CubicLag`].
//!
//! The relaxations are passed as slices, so that a model with room for more of them (the
//! simulation's) and one of fixed size (the firmware's) run the same code.

use crate::cast::{Cast, all_rounded, rounded};
use crate::error::{Error, Result, not_negative, positive};
use crate::number::{Number, Real};

/// One relaxation of the creep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Creep {
    /// Displacement that it adds after a long time, as a share of the immediate one, c.
    pub share: f64,
    /// Time constant tau, s.
    pub time: f64,
}

/// A first-order lag discretised for one step length; see [`Lag::step`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// exp(-T/tau).
    decay: f64,
    /// tau/T.
    ratio: f64,
}

impl Lag {
    /// The lag with time constant `time` (s) for steps of `step` seconds.
    #[must_use]
    pub fn new(time: f64, step: f64) -> Self {
        Self { decay: libm::exp(-step / time), ratio: time / step }
    }

    /// The output after one step; `output` is that before it. The input goes in a straight line,
    /// by `rise`, to `end`. Output, `end` and `rise` have the same unit.
    #[must_use]
    #[inline(always)]
    pub fn step<N: Number>(&self, output: N, end: N, rise: N) -> N {
        lagged(output, end, rise, [rise.like(self.decay), rise.like(self.ratio)])
    }
}

/// The output after one step of a lag, of exp(-T/tau) and tau/T.
#[inline(always)]
fn lagged<N: Number>(output: N, end: N, rise: N, [decay, ratio]: [N; 2]) -> N {
    // Behind a ramp the output lags by `trail` in the end; the rest of the gap decays.
    let trail = rise * ratio;
    end - ((end - rise - output - trail) * decay + trail)
}

/// State of the creep: its input, and the output of each relaxation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CreepState<const N: usize, T = f64> {
    /// Input h, m.
    pub input: T,
    /// Output of each relaxation, q, m.
    pub reached: [T; N],
}

crate::snapshot!([const N: usize, T: Real] CreepState<N, T> { input, reached });

impl<const N: usize, T: Real> Default for CreepState<N, T> {
    fn default() -> Self {
        Self { input: T::ZERO, reached: [T::ZERO; N] }
    }
}

/// The displacement d (m) for the input h (m) and the outputs q (m) of the relaxations.
///
/// No closure: those of lanes are not compiled for their instruction set unless they are inlined.
#[must_use]
#[inline(always)]
pub fn output<N: Number>(relaxations: &[Creep], input: N, reached: &[N]) -> N {
    let mut sum = input;
    for (creep, reached) in relaxations.iter().zip(reached) {
        sum = sum + input.like(creep.share) * *reached;
    }
    sum
}

/// One step of every relaxation, in which the input goes in a straight line from `from` to `to`, m.
#[inline(always)]
pub fn advance<N: Number>(lags: &[Lag], reached: &mut [N], from: N, to: N) {
    let rise = to - from;
    for (reached, lag) in reached.iter_mut().zip(lags) {
        *reached = lag.step(*reached, to, rise);
    }
}

/// Exact inverse of up to `N` relaxations for one sampling interval: displacement in, input out.
///
/// The displacement at the end of a step is linear in the input there, d1 = f + g h1, where f
/// follows from the state and g is a constant.
///
/// ```
/// use piezotrack_control::creep::{Creep, CreepInverse, CreepState};
///
/// let creep = [Creep { share: 0.01, time: 0.1 }, Creep { share: 0.01, time: 1.0 }];
/// let inverse = CreepInverse::<2>::new(&creep, 1e-3)?;
/// let mut state = CreepState::default();
/// let at_once = inverse.jump(&mut state, 10e-6);
/// assert_eq!(at_once, 10e-6);
/// // To hold the displacement, the input falls as the creep grows.
/// assert!(inverse.step(&mut state, 10e-6) < at_once);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CreepInverse<const N: usize, T = f64> {
    /// c.
    shares: [T; N],
    /// exp(-T/tau) and tau/T.
    lags: [[T; 2]; N],
    /// How many of them are in use.
    count: usize,
    /// g.
    gain: T,
}

impl<const N: usize> CreepInverse<N> {
    /// The inverse of these relaxations for samples every `dt` seconds.
    ///
    /// # Errors
    /// Names `creep` where there are more than `N`; `creep_weights`, `creep_times` or `dt` where
    /// one is out of its range.
    pub fn new(creep: &[Creep], dt: f64) -> Result<Self> {
        positive("dt", dt, "s")?;
        if creep.len() > N {
            let value = u32::try_from(creep.len()).map_or(f64::INFINITY, f64::from);
            let expected = "at most as many relaxations as the inverse has room for";
            return Err(Error { name: "creep", value, unit: "entries", expected });
        }
        let mut used = [Creep { share: 0.0, time: 1.0 }; N];
        for (slot, one) in used.iter_mut().zip(creep) {
            slot.share = not_negative("creep_weights", one.share, "")?;
            slot.time = positive("creep_times", one.time, "s")?;
        }
        let lags = used.map(|one| Lag::new(one.time, dt));
        let mut gain = 1.0;
        for (one, lag) in used.iter().zip(&lags).take(creep.len()) {
            gain += one.share * lag.step(0.0, 1.0, 1.0);
        }
        let lags = lags.map(|one| [one.decay, one.ratio]);
        Ok(Self { shares: used.map(|one| one.share), lags, count: creep.len(), gain })
    }
}

impl<const N: usize> Cast for CreepInverse<N> {
    type In<T: Real> = CreepInverse<N, T>;

    fn cast<T: Real>(&self) -> Result<CreepInverse<N, T>> {
        let mut lags = [[T::ZERO; 2]; N];
        for (slot, lag) in lags.iter_mut().zip(&self.lags) {
            *slot = all_rounded("creep_times", lag, "")?;
        }
        let shares = all_rounded("creep_weights", &self.shares, "")?;
        let gain = rounded("creep_weights", self.gain, "")?;
        Ok(CreepInverse { shares, lags, count: self.count, gain })
    }
}

impl<const N: usize, T: Real> CreepInverse<N, T> {
    /// The input (m) at the end of the next step for which the displacement is `target` (m) there.
    #[inline]
    pub fn step(&self, state: &mut CreepState<N, T>, target: T) -> T {
        let used = self.shares.iter().zip(&self.lags).zip(&state.reached).take(self.count);
        let fixed = used.fold(T::ZERO, |sum, ((share, lag), &reached)| {
            sum + *share * lagged(reached, T::ZERO, -state.input, *lag)
        });
        let input = (target - fixed) / self.gain;
        let rise = input - state.input;
        for (reached, lag) in state.reached.iter_mut().zip(&self.lags).take(self.count) {
            *reached = lagged(*reached, input, rise, *lag);
        }
        state.input = input;
        input
    }

    /// The input (m) for which the displacement jumps to `target` (m), without time to creep.
    #[inline]
    pub fn jump(&self, state: &mut CreepState<N, T>, target: T) -> T {
        let crept = self.shares.iter().zip(&state.reached).take(self.count);
        let crept = crept.fold(T::ZERO, |sum, (share, reached)| sum + *share * *reached);
        let input = target - crept;
        state.input = input;
        input
    }
}

/// A first-order lag over steps of one length, in which its input is the cubic through its values
/// and slopes at both ends.
///
/// ```text
/// q1 = x1 + p (q0 - x1) + a (x0 - x1) + b h x0' + c h x1',   p = exp(-h/tau)
/// ```
///
/// Exact for that cubic. The weights are the same for all inputs, so they serve one lag or lanes
/// of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CubicLag {
    /// p.
    decay: f64,
    /// a.
    start: f64,
    /// b and c.
    slopes: [f64; 2],
    /// h/tau.
    rate: f64,
}

impl CubicLag {
    /// p, a, b and c, and h/tau.
    pub(crate) fn weights(&self) -> ([f64; 4], f64) {
        ([self.decay, self.start, self.slopes[0], self.slopes[1]], self.rate)
    }

    /// The lag with time constant `time` (s) for steps of `step` seconds.
    #[must_use]
    pub fn new(time: f64, step: f64) -> Self {
        let rate = step / time;
        let [m0, m1, m2, m3] = moments(rate);
        let start = m0 - 3.0 * m2 + 2.0 * m3;
        let slopes = [m1 - 2.0 * m2 + m3, m3 - m2];
        Self { decay: libm::exp(-rate), start, slopes, rate }
    }

    /// The output after one step from `output`; the input is given at the start and at the end
    /// with its slope times the step.
    #[must_use]
    #[inline(always)]
    pub fn step<N: Number>(&self, output: N, start: [N; 2], end: [N; 2]) -> N {
        let number = |value: f64| output.like(value);
        let [b, c] = self.slopes;
        cubic_lagged(
            output,
            start,
            end,
            [number(self.decay), number(self.start), number(b), number(c)],
        )
    }

    /// The output's slope times the step, at an input and an output.
    #[must_use]
    #[inline(always)]
    pub fn slope<N: Number>(&self, input: N, output: N) -> N {
        (input - output) * input.like(self.rate)
    }
}

/// The output after one step of a lag of which p, a, b and c are given.
#[inline(always)]
pub(crate) fn cubic_lagged<N: Number>(
    output: N,
    [x0, w0]: [N; 2],
    [x1, w1]: [N; 2],
    [p, a, b, c]: [N; 4],
) -> N {
    let from = (output - x1).mul_add(p, x1);
    let from = (x0 - x1).mul_add(a, from);
    let from = w0.mul_add(b, from);
    w1.mul_add(c, from)
}

/// Moments `rate int_0^1 exp(-rate (1 - s)) s^k ds` for k from 0 to 3.
fn moments(rate: f64) -> [f64; 4] {
    if rate > 1.0 {
        let m0 = -libm::expm1(-rate);
        let m1 = 1.0 - m0 / rate;
        let m2 = 1.0 - 2.0 * m1 / rate;
        return [m0, m1, m2, 1.0 - 3.0 * m2 / rate];
    }
    // The recursion would cancel: the series rate sum_n (-rate)^n k!/(n + k + 1)!.
    [1.0, 2.0, 3.0, 4.0].map(|order: f64| {
        let (mut term, mut sum) = (rate / order, 0.0);
        for n in 1..24 {
            sum += term;
            term *= -rate / (order + f64::from(n));
        }
        sum
    })
}
