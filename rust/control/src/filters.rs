//! Filters for the measurement: first-order low-pass and notch.
//!
//! Both have a static gain of 1 and start in the steady state of their first sample. In the loop
//! their lag reduces the phase margin: a low-pass delays by 1/(2 pi cutoff).

use core::f64::consts::{PI, TAU};

use crate::cast::{Cast, all_rounded};
use crate::error::{Result, check, not_negative, positive};
use crate::number::{Number, Real};

/// A filter of first or second order, for one sampling interval.
///
/// ```text
/// y[k] = b0 x[k] + b1 x[k-1] + b2 x[k-2] - a1 y[k-1] - a2 y[k-2]
/// ```
///
/// ```
/// use piezotrack_control::Filter;
///
/// let filter = Filter::low_pass(5.0, 0.02)?;
/// let mut state = None;
/// assert_eq!(filter.step(&mut state, 3e-6), 3e-6);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter<T = f64> {
    b: [T; 3],
    a: [T; 2],
}

/// State of a [`Filter`]; `None` before the first sample.
pub type FilterState<T = f64> = Option<[T; 2]>;

impl Filter {
    /// `1/(1 + s/wc)`, wc = 2 pi `cutoff` (Hz), sampled every `dt` seconds.
    ///
    /// Exact for an input that is linear between samples (first-order hold), and therefore
    /// without the delay of half a sample that a zero-order hold adds.
    ///
    /// # Errors
    /// Names `dt` or `cutoff` where it is not above 0.
    pub fn low_pass(cutoff: f64, dt: f64) -> Result<Self> {
        positive("dt", dt, "s")?;
        positive("cutoff", cutoff, "Hz")?;
        let angle = TAU * cutoff * dt;
        let pole = libm::exp(-angle);
        // (1 - p)/angle, without cancelling where the angle is small
        let mean = if angle > 0.0 { -libm::expm1(-angle) / angle } else { 1.0 };
        let right = angle.is_finite();
        check("cutoff", cutoff, "Hz", right, "a frequency that a sampled filter can have")?;
        let gain = 1.0 - pole;
        let b0 = 1.0 - mean;
        Ok(Self { b: [b0, gain - b0, 0.0], a: [-pole, 0.0] })
    }

    /// `(s^2 + 2 depth width w0 s + w0^2)/(s^2 + 2 width w0 s + w0^2)`, w0 = 2 pi `frequency`.
    ///
    /// `depth` is the gain at `frequency` (Hz), 0 for a complete notch. `width` is the damping
    /// ratio of the poles; the notch is 2 `width` `frequency` wide. Bilinear transform, prewarped
    /// to keep the frequency of the notch.
    ///
    /// # Errors
    /// Names `dt`, `frequency` (above 0, below half the sampling rate), `width` (above 0) or
    /// `depth` (0 to 1).
    pub fn notch(frequency: f64, width: f64, depth: f64, dt: f64) -> Result<Self> {
        positive("dt", dt, "s")?;
        positive("frequency", frequency, "Hz")?;
        let right = frequency * dt < 0.5;
        check("frequency", frequency, "Hz", right, "less than half the sampling rate")?;
        positive("width", width, "")?;
        not_negative("depth", depth, "")?;
        check("depth", depth, "", depth <= 1.0, "a gain from 0 to 1")?;
        let t = libm::tan(PI * frequency * dt);
        let square = t * t;
        let poles = 2.0 * width * t;
        let zeros = depth * poles;
        let scale = 1.0 / (1.0 + poles + square);
        let right = scale > 0.0 && square > 0.0;
        check("width", width, "", right, "a damping ratio that a sampled filter can have")?;
        let middle = 2.0 * (square - 1.0) * scale;
        Ok(Self {
            b: [(1.0 + zeros + square) * scale, middle, (1.0 - zeros + square) * scale],
            a: [middle, (1.0 - poles + square) * scale],
        })
    }

    /// A filter of these coefficients, whose state begins at `Some([0.0; 2])` where its static gain
    /// is not 1.
    pub(crate) fn of(b: [f64; 3], a: [f64; 2]) -> Self {
        Self { b, a }
    }
}

impl Cast for Filter {
    type In<T: Real> = Filter<T>;

    fn cast<T: Real>(&self) -> Result<Filter<T>> {
        let (name, unit) = ("filter", "");
        Ok(Filter { b: all_rounded(name, &self.b, unit)?, a: all_rounded(name, &self.a, unit)? })
    }
}

impl<T: Real> Filter<T> {
    /// `[b0, b1, b2]` and `[a1, a2]` of the recursion.
    #[must_use]
    pub fn coefficients(&self) -> ([T; 3], [T; 2]) {
        (self.b, self.a)
    }

    /// The filtered value of `input`, in its unit.
    #[inline]
    pub fn step(&self, state: &mut FilterState<T>, input: T) -> T {
        let Self { b: [b0, _, b2], a: [_, a2] } = *self;
        let Some(sums) = state else {
            *state = Some([input - b0 * input, (b2 - a2) * input]);
            return input;
        };
        let output = self.output(sums, input);
        self.remember(sums, input, output);
        output
    }
}

impl<N: Number> Filter<N> {
    /// The filtered value after the first one, of one filter or of lanes of them.
    #[inline(always)]
    pub(crate) fn output(&self, sums: &[N; 2], input: N) -> N {
        self.b[0] * input + sums[0]
    }

    /// Goes on to the next sample.
    #[inline(always)]
    pub(crate) fn remember(&self, sums: &mut [N; 2], input: N, output: N) {
        let Self { b: [_, b1, b2], a: [a1, a2] } = *self;
        *sums = [b1 * input - a1 * output + sums[1], b2 * input - a2 * output];
    }

    /// The filters that a function gives for each lane of numbers like `like`.
    pub(crate) fn in_lanes(like: N, of: impl Fn(usize) -> Filter<N::Lane>) -> Self {
        let b = |i: usize| like.by_lane(|lane| of(lane).b[i]);
        let a = |i: usize| like.by_lane(|lane| of(lane).a[i]);
        Self { b: [b(0), b(1), b(2)], a: [a(0), a(1)] }
    }
}
