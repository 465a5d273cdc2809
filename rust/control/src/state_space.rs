//! Feedback law in discrete-time state space.
//!
//! ```text
//! x[k+1] = A x[k] + B e[k],   u[k] = C x[k] + D e[k]
//! ```

use crate::back_calculation::gain;
use crate::cast::{Cast, all_rounded, rounded};
use crate::error::{Error, Result, check, finite};
use crate::feedback_law::{Feedback, FeedbackSample};
use crate::number::Real;

/// A linear controller with up to `N` states: tracking error (m) in, voltage (V) out.
///
/// **Antiwindup** is back-calculation: the applied voltage less the unclipped command, `eu[k]` in
/// V, enters as `x[k+1] = A x[k] + B e[k] + l eu[k]`. Where no gain `l` is given, it is that of an
/// observer of the law, which makes `A - l C` stable (see [`StateSpace::antiwindup`]); zeros turn
/// antiwindup off. A law of which an unstable part does not show in the output has no such gain;
/// then, while the command is clipped, a step of the state that would move the command further
/// beyond the limit is omitted.
///
/// ```
/// use piezotrack_control::{Feedback, FeedbackSample, StateSpace};
///
/// // An integrator of 1e5 V/(m sample).
/// let law = StateSpace::<1>::new(&[1.0], &[1e5], &[1.0], 0.0, None)?;
/// let mut state = law.rest();
/// let sample = FeedbackSample::new(1e-6);
/// law.step(&mut state, &sample);
/// assert!((law.step(&mut state, &sample) - 0.1).abs() < 1e-15);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateSpace<const N: usize, T = f64> {
    a: [[T; N]; N],
    b: [T; N],
    c: [T; N],
    d: T,
    back: Option<[T; N]>,
    /// States that are used: the others stay 0.
    used: usize,
}

impl<const N: usize> StateSpace<N> {
    /// Matrices for `b.len()` states, `a` row by row; they are padded with zeros to `N` states.
    ///
    /// `d` and the product of `b` and `c` are in V/m; `back` is the vector `l`, by default one that
    /// fits the law.
    ///
    /// # Errors
    /// Names the matrix that has the wrong number of entries or one that is not finite.
    pub fn new(a: &[f64], b: &[f64], c: &[f64], d: f64, back: Option<&[f64]>) -> Result<Self> {
        let n = b.len();
        entries("b", b, n, n <= N, "at most as many entries as the controller has room for")?;
        entries("a", a, n, a.len() == n * n, "a square of as many rows as b has entries")?;
        entries("c", c, n, c.len() == n, "as many entries as b")?;
        finite("d", d, "V/m")?;
        let mut out = Self {
            a: [[0.0; N]; N],
            b: [0.0; N],
            c: [0.0; N],
            d,
            back: back.map(|_| [0.0; N]),
            used: n,
        };
        for (to, from) in out.a.iter_mut().zip(a.chunks(n.max(1))) {
            fill(to, from);
        }
        fill(&mut out.b, b);
        fill(&mut out.c, c);
        match (&mut out.back, back) {
            (Some(to), Some(from)) => {
                entries("back", from, n, from.len() == n, "as many entries as b")?;
                fill(to, from);
            }
            _ => out.back = gain(&out.a, &out.b, &out.c, d, n),
        }
        Ok(out)
    }
}

impl<const N: usize> Cast for StateSpace<N> {
    type In<T: Real> = StateSpace<N, T>;

    fn cast<T: Real>(&self) -> Result<StateSpace<N, T>> {
        let mut a = [[T::ZERO; N]; N];
        for (row, own) in a.iter_mut().zip(&self.a) {
            *row = all_rounded("a", own, "")?;
        }
        Ok(StateSpace {
            a,
            b: all_rounded("b", &self.b, "")?,
            c: all_rounded("c", &self.c, "")?,
            d: rounded("d", self.d, "V/m")?,
            back: self.back.as_ref().map(|back| all_rounded("back", back, "")).transpose()?,
            used: self.used,
        })
    }
}

impl<const N: usize, T: Real> StateSpace<N, T> {
    /// A (row by row), B, C and D, padded with zeros where there are fewer than `N` states.
    #[must_use]
    pub fn matrices(&self) -> (&[[T; N]; N], &[T; N], &[T; N], T) {
        (&self.a, &self.b, &self.c, self.d)
    }

    /// Number of states that are used; the others stay 0.
    #[must_use]
    pub fn states(&self) -> usize {
        self.used
    }

    /// The gain `l` of back-calculation; `None` where the state is held under saturation instead.
    #[must_use]
    pub fn antiwindup(&self) -> Option<&[T; N]> {
        self.back.as_ref()
    }
}

/// Refuses a wrong number of entries, and entries that are not finite.
fn entries(
    name: &'static str,
    values: &[f64],
    n: usize,
    right: bool,
    expected: &'static str,
) -> Result<()> {
    let count = u32::try_from(values.len()).map_or(f64::INFINITY, f64::from);
    check(name, count, "entries", right && n > 0, expected)?;
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(Error { name, value, unit: "", expected: "finite numbers" }),
        None => Ok(()),
    }
}

fn fill(to: &mut [f64], from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

/// State of a [`StateSpace`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateSpaceState<const N: usize, T = f64> {
    x: [T; N],
    /// The error of the last sample, not yet applied to `x`; `None` before the first sample.
    error: Option<T>,
    /// Voltage at the first sample for a bumpless start, V.
    first: Option<T>,
    /// Constant output for the bumpless start, V. It stays; an integrator compensates it.
    offset: T,
}

crate::snapshot!([const N: usize, T: Real] StateSpaceState<N, T> { x, error, first, offset });

impl<const N: usize, T: Real> Feedback<T> for StateSpace<N, T> {
    type State = StateSpaceState<N, T>;

    fn rest(&self) -> Self::State {
        StateSpaceState { x: [T::ZERO; N], error: None, first: None, offset: T::ZERO }
    }

    fn start(&self, volts: T) -> Self::State {
        StateSpaceState { first: Some(volts), ..self.rest() }
    }

    fn adopt(&self, before: &Self, _state: &mut Self::State) -> bool {
        self == before
    }

    #[inline]
    fn step(&self, state: &mut Self::State, sample: &FeedbackSample<T>) -> T {
        let FeedbackSample { error, excess, .. } = *sample;
        if let Some(last) = state.error {
            self.advance(&mut state.x, last, excess);
        } else if let Some(first) = state.first {
            state.offset = first - self.d * error;
        }
        state.error = Some(error);
        let volts = self.dot(&self.c, &state.x) + self.d * error + state.offset;
        if volts.is_finite() {
            return volts;
        }
        // Overflow: start again.
        *state = self.rest();
        T::ZERO
    }
}

impl<const N: usize, T: Real> StateSpace<N, T> {
    /// Advances the state by the last sample, whose error and excess are known now.
    #[inline]
    fn advance(&self, x: &mut [T; N], error: T, excess: T) {
        let mut next = [T::ZERO; N];
        for ((next, row), b) in next.iter_mut().zip(&self.a).zip(&self.b).take(self.used) {
            *next = self.dot(row, x) + *b * error;
        }
        if let Some(back) = &self.back {
            for (next, gain) in next.iter_mut().zip(back).take(self.used) {
                *next = *next + *gain * excess;
            }
        } else if excess * (self.dot(&self.c, &next) - self.dot(&self.c, x)) < T::ZERO {
            return;
        }
        *x = next;
    }

    #[inline]
    fn dot(&self, a: &[T; N], b: &[T; N]) -> T {
        a.iter().zip(b).take(self.used).fold(T::ZERO, |sum, (a, b)| sum + *a * *b)
    }
}
