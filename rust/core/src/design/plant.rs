//! The linearised stage in the loop, from volts to metres.

use core::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result, finite, not_negative, positive, shown};
use crate::integrator::{Mechanics, halvings};
use crate::math::Ratio;

/// States of a plant, at most: four modes and two lags.
const STATES: usize = 10;
/// Delay in samples, at most.
const DELAY: f64 = 1e3;
/// Terms of the power series of the matrix exponential, for a norm of 0.5 at most.
const TERMS: u32 = 18;

/// A linear plant in continuous time, from the controller's voltage (V) to displacement (m).
///
/// ```text
/// x'(t) = A x(t) + B u(t - delay),   y = C x + D u(t - delay)
/// ```
///
/// ```
/// use piezotrack_core::design::LoopPlant;
///
/// let stage = LoopPlant::mode(1.57e-6, 160.0, 0.065)?.with_amplifier(400.0)?.with_delay(1e-3)?;
/// assert!((stage.static_gain() - 1.57e-6).abs() < 1e-15);
/// # Ok::<(), piezotrack_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct LoopPlant {
    a: DMatrix<f64>,
    b: DVector<f64>,
    c: DVector<f64>,
    d: f64,
    delay: f64,
}

impl LoopPlant {
    /// A plant that follows at once: `y = gain u`, gain in m/V.
    ///
    /// # Errors
    /// Names `gain` where it is not finite.
    pub fn fixed_gain(gain: f64) -> Result<Self> {
        finite("gain", gain, "m/V")?;
        let (a, empty) = (DMatrix::zeros(0, 0), DVector::zeros(0));
        Ok(Self { a, b: empty.clone(), c: empty, d: gain, delay: 0.0 })
    }

    /// One mode: `gain w0^2/(s^2 + 2 damping w0 s + w0^2)`, w0 = 2 pi `frequency`.
    ///
    /// `gain` is static, m/V; `frequency` natural, Hz; `damping` a ratio. Xu and Li 2010,
    /// equations (3) to (5), doi 10.1115/1.4001712: 160 Hz and 0.065.
    ///
    /// # Errors
    /// Names the argument that is out of its range.
    pub fn mode(gain: f64, frequency: f64, damping: f64) -> Result<Self> {
        finite("gain", gain, "m/V")?;
        let natural = TAU * positive("frequency", frequency, "Hz")?;
        not_negative("damping", damping, "")?;
        // [x, x'/w0], so that all entries are of one size
        let rows = [0.0, natural, -natural, -2.0 * damping * natural];
        Self::state_space(&rows, &[0.0, natural], &[gain, 0.0], 0.0)
    }

    /// Modes in parallel (4 at most), each given by its static gain (m/V), its natural frequency
    /// (Hz) and its damping ratio, as [`Self::mode`] takes them.
    ///
    /// # Errors
    /// Names the argument that is out of its range.
    pub fn modes(modes: &[(f64, f64, f64)]) -> Result<Self> {
        let states = 2 * modes.len();
        let (mut rows, mut b) = (vec![0.0; states * states], vec![0.0; states]);
        let mut c = vec![0.0; states];
        for (k, &(gain, frequency, damping)) in modes.iter().enumerate() {
            let one = Self::mode(gain, frequency, damping)?;
            for i in 0..2 {
                for j in 0..2 {
                    rows[(2 * k + i) * states + 2 * k + j] = one.a[(i, j)];
                }
                (b[2 * k + i], c[2 * k + i]) = (one.b[i], one.c[i]);
            }
        }
        Self::state_space(&rows, &b, &c, 0.0)
    }

    /// `M x'' + D x' + K x = T u`, T in N/V.
    ///
    /// # Errors
    /// Names the argument that is out of its range.
    pub fn mechanical(mechanics: &Mechanics, piezo_coefficient: f64) -> Result<Self> {
        let Mechanics { mass, damping, stiffness } = *mechanics;
        Mechanics::new(mass, damping, stiffness)?;
        finite("piezo_coefficient", piezo_coefficient, "N/V")?;
        let rows = [0.0, 1.0, -stiffness / mass, -damping / mass];
        Self::state_space(&rows, &[0.0, piezo_coefficient / mass], &[1.0, 0.0], 0.0)
    }

    /// Matrices of `b.len()` states (10 at most), `a` row by row, in SI: 1/s, 1/(V s), m, m/V
    /// where the states have no unit.
    ///
    /// # Errors
    /// Names the matrix that has the wrong number of entries or one that is not finite.
    pub fn state_space(a: &[f64], b: &[f64], c: &[f64], d: f64) -> Result<Self> {
        let n = b.len();
        entries("b", b, n <= STATES, "10 entries at most")?;
        entries("a", a, a.len() == n * n, "a square of as many rows as b has entries")?;
        entries("c", c, c.len() == n, "as many entries as b")?;
        finite("d", d, "m/V")?;
        Ok(Self {
            a: DMatrix::from_row_slice(n, n, a),
            b: DVector::from_column_slice(b),
            c: DVector::from_column_slice(c),
            d,
            delay: 0.0,
        })
    }

    /// With `delay` seconds more between command and actuator, not only whole samples.
    ///
    /// # Errors
    /// Names `delay` where it is below 0.
    pub fn with_delay(mut self, delay: f64) -> Result<Self> {
        self.delay += not_negative("delay", delay, "s")?;
        Ok(self)
    }

    /// Behind an amplifier `1/(1 + s/wa)`, wa = 2 pi `bandwidth` (Hz).
    ///
    /// A lag of t seconds is a bandwidth of 1/(2 pi t).
    ///
    /// # Errors
    /// Names `bandwidth` where it is not above 0; where the plant has 10 states already.
    pub fn with_amplifier(self, bandwidth: f64) -> Result<Self> {
        let rate = TAU * positive("bandwidth", bandwidth, "Hz")?;
        let n = self.b.len();
        if n >= STATES {
            return Err(Error::parameter("plant", format!("{n} states"), "9 states at most"));
        }
        let mut a = self.a.resize(n + 1, n + 1, 0.0);
        a.view_mut((0, n), (n, 1)).copy_from(&self.b);
        a[(n, n)] = -rate;
        let mut b = DVector::zeros(n + 1);
        b[n] = rate;
        let c = self.c.push(self.d);
        Ok(Self { a, b, c, d: 0.0, delay: self.delay })
    }

    /// A row by row, B, C and D as [`Self::state_space`] takes them, and the delay, s.
    #[must_use]
    pub fn matrices(&self) -> (Vec<f64>, &[f64], &[f64], f64, f64) {
        let rows = self.a.transpose().as_slice().to_vec();
        (rows, self.b.as_slice(), self.c.as_slice(), self.d, self.delay)
    }

    /// Gain at frequency 0, m/V; infinite for a plant that integrates.
    #[must_use]
    pub fn static_gain(&self) -> f64 {
        if self.b.is_empty() {
            return self.d;
        }
        let state = (-&self.a).lu().solve(&self.b);
        state.map_or(f64::INFINITY, |state| self.d + self.c.dot(&state))
    }

    /// The sampled plant without its whole samples of delay, and how many those are.
    ///
    /// A held input delayed by part of a sample is the last one for that part of the interval
    /// and the present one for the rest; each part is integrated exactly (Franklin, Powell and
    /// Workman, Digital Control of Dynamic Systems, 3rd edition, section 4.3).
    pub(crate) fn sampled(&self, dt: f64) -> Result<(Ratio, usize)> {
        positive("dt", dt, "s")?;
        let samples = self.delay / dt;
        if samples > DELAY {
            return Err(Error::parameter(
                "delay",
                format!("{} s", shown(self.delay)),
                "1000 samples or less",
            ));
        }
        // A delay given in decimals is a whole number of samples up to rounding.
        let nearest = libm::round(samples);
        let near = (samples - nearest).abs() < 1e-9 * samples.max(1.0);
        let whole = if near { nearest } else { libm::floor(samples) };
        let part = if near { 0.0 } else { samples - whole };
        let (change, _) = self.held(dt)?;
        let (rest, now) = self.held(dt * (1.0 - part))?;
        let ratio = Ratio::of_matrices(&change, &now, &self.c, 0.0);
        let whole = count(whole);
        if part == 0.0 && self.d == 0.0 {
            return Ok((ratio.checked("plant")?, whole));
        }
        // e^(A (1 - part) dt) times what the last input does in the part before
        let (_, before) = self.held(dt * part)?;
        let last = &before + rest * &before;
        let later = Ratio::of_matrices(&change, &last, &self.c, self.d);
        Ok((ratio.and_later(&later.above).checked("plant")?, whole))
    }

    /// `e^(A h) - 1` and the integral of `e^(A s) B` over s from 0 to h.
    ///
    /// Both in one power series, of `[A B; 0 0]` balanced and halved until its norm is below
    /// 0.5, then doubled without the 1 so that slow modes keep their digits.
    fn held(&self, h: f64) -> Result<(DMatrix<f64>, DVector<f64>)> {
        let n = self.b.len();
        let mut m = self.a.clone().resize(n + 1, n + 1, 0.0) * h;
        m.view_mut((0, n), (n, 1)).copy_from(&(&self.b * h));
        let mut a = self.a.clone() * h;
        let scales = balance(&mut a);
        let input = (&self.b * h).component_div(&scales);
        // Any scale of the input will do: it only has to be small beside A.
        let size = input.amax().max(f64::MIN_POSITIVE);
        m.view_mut((0, 0), (n, n)).copy_from(&a);
        m.view_mut((0, n), (n, 1)).copy_from(&(input / size));
        let norm = m.row_iter().map(|row| row.iter().map(|v| v.abs()).sum()).fold(0.0, f64::max);
        let halved = halvings(norm, 1.0);
        let mut sum = DMatrix::zeros(n + 1, n + 1);
        let mut term = DMatrix::identity(n + 1, n + 1);
        let part = &m * libm::ldexp(1.0, -i32::try_from(halved).unwrap_or(0));
        for k in 1..=TERMS {
            term = &part * term / f64::from(k);
            sum += &term;
        }
        for _ in 0..halved {
            sum = &sum * &sum + &sum * 2.0;
        }
        if !sum.iter().all(|v| v.is_finite()) {
            let text = "the plant cannot be sampled: it is too fast or grows too fast for dt";
            return Err(Error::Numerical(text.into()));
        }
        let change = DMatrix::from_fn(n, n, |i, j| sum[(i, j)] * scales[i] / scales[j]);
        let input = DVector::from_fn(n, |i, _| sum[(i, n)] * scales[i] * size);
        Ok((change, input))
    }
}

/// Scales states by powers of two until rows and columns are of one size (Parlett and Reinsch
/// 1969, doi 10.1007/BF02165404): `a` becomes `S^-1 a S`; the diagonal of S is returned.
fn balance(a: &mut DMatrix<f64>) -> DVector<f64> {
    let n = a.nrows();
    let mut scales = DVector::from_element(n, 1.0);
    for _sweep in 0..100 {
        let mut done = true;
        for i in 0..n {
            let others = || (0..n).filter(|j| *j != i);
            let column: f64 = others().map(|j| a[(j, i)].abs()).sum();
            let row: f64 = others().map(|j| a[(i, j)].abs()).sum();
            let exponent = libm::round(0.5 * libm::log2(row / column));
            if exponent == 0.0 || !exponent.is_finite() {
                continue;
            }
            let factor = libm::exp2(exponent.clamp(-500.0, 500.0));
            a.column_mut(i).scale_mut(factor);
            a.row_mut(i).scale_mut(1.0 / factor);
            scales[i] *= factor;
            done = false;
        }
        if done {
            break;
        }
    }
    scales
}

/// Refuses a wrong number of entries, and entries that are not finite.
fn entries(name: &str, values: &[f64], right: bool, expected: &str) -> Result<()> {
    if !right {
        return Err(Error::Shape {
            name: name.into(),
            found: format!("{} entries", values.len()),
            expected: expected.into(),
        });
    }
    values.iter().try_for_each(|value| finite(name, *value, "").map(drop))
}

/// A whole number of samples, already checked to be small.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
fn count(value: f64) -> usize {
    value as usize
}
