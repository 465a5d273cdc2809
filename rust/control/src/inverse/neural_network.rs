//! A small neural network as the inverse of a stage: the drive from a reference and its memory.
//!
//! ```text
//! i = (x, v, a) scaled, and plays of the scaled x with the thresholds r_j
//! u = b + d i + w tanh(A i + c)
//! ```
//!
//! The plays are the memory of the hysteresis; the network maps them and the motion to the drive
//! without memory of its own. It is the inverse of a
//! Prandtl-Ishlinskii model where the hidden layer gives nothing.

use super::Inverse;
use crate::cast::{Cast, all_rounded, rounded};
use crate::error::{Result, check, finite, positive, usable};
use crate::number::Real;

/// Units of the hidden layer, at most.
pub const MOST_UNITS: usize = 16;
/// Plays along the reference, at most.
pub const MOST_NETWORK_PLAYS: usize = 8;
/// Displacement, velocity and acceleration, and the plays.
const INPUTS: usize = 3 + MOST_NETWORK_PLAYS;
/// Scaled inputs beyond this are taken to be this: nothing was learnt there.
const FARTHEST: f64 = 100.0;

/// The numbers of a [`NeuralNetworkInverse`], as a training gives them.
///
/// | field | numbers | unit |
/// | --- | --- | --- |
/// | `centre`, `scales` | 1, 3 | m; m, m/s, m/s^2 |
/// | `thresholds` | n, up to 8 | scaled displacement |
/// | `hidden` | rows of 3 + n, up to 16 of them | 1 |
/// | `biases`, `outputs` | one for each row | 1, V |
/// | `direct`, `offset` | 3 + n, 1 | V |
#[derive(Clone, Copy, Debug)]
pub struct NetworkNumbers<'a> {
    /// Displacement that is scaled to 0, m.
    pub centre: f64,
    /// Displacement, velocity and acceleration that are scaled to 1.
    pub scales: [f64; 3],
    /// Thresholds of the plays, 0 or above.
    pub thresholds: &'a [f64],
    /// A, row by row.
    pub hidden: &'a [f64],
    /// c.
    pub biases: &'a [f64],
    /// w, V.
    pub outputs: &'a [f64],
    /// d, V.
    pub direct: &'a [f64],
    /// b, V.
    pub offset: f64,
}

/// A network with one hidden layer as an inverse.
///
/// ```
/// use piezotrack_control::inverse::{NetworkNumbers, NeuralNetworkInverse};
/// use piezotrack_control::Inverse;
///
/// // 2 V/um, and 3 V tanh(x / 1 um) more; no memory.
/// let network = NeuralNetworkInverse::new(&NetworkNumbers {
///     centre: 0.0,
///     scales: [1e-6, 1.0, 1.0],
///     thresholds: &[],
///     hidden: &[1.0, 0.0, 0.0],
///     biases: &[0.0],
///     outputs: &[3.0],
///     direct: &[2.0, 0.0, 0.0],
///     offset: 0.0,
/// })?;
/// let mut state = network.rest();
/// let volts = network.step(&mut state, 5e-6, 0.0, 0.0);
/// assert!((volts - 13.0).abs() < 1e-3);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeuralNetworkInverse<T = f64> {
    centre: T,
    scales: [T; 3],
    plays: usize,
    units: usize,
    thresholds: [T; MOST_NETWORK_PLAYS],
    hidden: [[T; INPUTS]; MOST_UNITS],
    biases: [T; MOST_UNITS],
    outputs: [T; MOST_UNITS],
    direct: [T; INPUTS],
    offset: T,
}

/// State of a [`NeuralNetworkInverse`]: the outputs of its plays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeuralNetworkState<T = f64> {
    plays: [T; MOST_NETWORK_PLAYS],
}

crate::snapshot!([T: Real] NeuralNetworkState<T> { plays });

impl NeuralNetworkInverse {
    /// A network with these numbers.
    ///
    /// # Errors
    /// Names the numbers that are not finite, of which there are too many or not as many as belong
    /// together, a scale that is not above 0, and a threshold below 0.
    pub fn new(numbers: &NetworkNumbers<'_>) -> Result<Self> {
        let (plays, units) = (numbers.thresholds.len(), numbers.biases.len());
        let inputs = 3 + plays;
        counted("thresholds", plays, plays <= MOST_NETWORK_PLAYS, "8 at most")?;
        counted("biases", units, units <= MOST_UNITS, "16 at most")?;
        counted("outputs", numbers.outputs.len(), numbers.outputs.len() == units, "as biases")?;
        let (rows, text) = (numbers.hidden.len(), "3 and the thresholds, for each of the biases");
        counted("hidden", rows, rows == units * inputs, text)?;
        let direct = numbers.direct.len();
        counted("direct", direct, direct == inputs, "3 and as many as thresholds")?;
        for scale in numbers.scales {
            positive("scales", scale, "")?;
        }
        for (name, some) in [
            ("thresholds", numbers.thresholds),
            ("hidden", numbers.hidden),
            ("biases", numbers.biases),
            ("outputs", numbers.outputs),
            ("direct", numbers.direct),
        ] {
            for &one in some {
                // Sums of some hundred of them are finite then.
                let text = "finite numbers below 1e100, thresholds of 0 or above";
                let right = usable(one) && (name != "thresholds" || one >= 0.0);
                check(name, one, "", right, text)?;
            }
        }
        let mut made = Self {
            centre: finite("centre", numbers.centre, "m")?,
            scales: numbers.scales,
            plays,
            units,
            thresholds: [0.0; MOST_NETWORK_PLAYS],
            hidden: [[0.0; INPUTS]; MOST_UNITS],
            biases: [0.0; MOST_UNITS],
            outputs: [0.0; MOST_UNITS],
            direct: [0.0; INPUTS],
            offset: finite("offset", numbers.offset, "V")?,
        };
        made.thresholds[..plays].copy_from_slice(numbers.thresholds);
        made.biases[..units].copy_from_slice(numbers.biases);
        made.outputs[..units].copy_from_slice(numbers.outputs);
        made.direct[..inputs].copy_from_slice(numbers.direct);
        for (row, given) in made.hidden.iter_mut().zip(numbers.hidden.chunks_exact(inputs)) {
            row[..inputs].copy_from_slice(given);
        }
        Ok(made)
    }
}

impl Cast for NeuralNetworkInverse {
    type In<T: Real> = NeuralNetworkInverse<T>;

    fn cast<T: Real>(&self) -> Result<NeuralNetworkInverse<T>> {
        let mut hidden = [[T::ZERO; INPUTS]; MOST_UNITS];
        for (row, own) in hidden.iter_mut().zip(&self.hidden) {
            *row = all_rounded("hidden", own, "")?;
        }
        Ok(NeuralNetworkInverse {
            centre: rounded("centre", self.centre, "m")?,
            scales: all_rounded("scales", &self.scales, "")?,
            plays: self.plays,
            units: self.units,
            thresholds: all_rounded("thresholds", &self.thresholds, "")?,
            hidden,
            biases: all_rounded("biases", &self.biases, "")?,
            outputs: all_rounded("outputs", &self.outputs, "V")?,
            direct: all_rounded("direct", &self.direct, "V")?,
            offset: rounded("offset", self.offset, "V")?,
        })
    }
}

/// A scaled input, within what counts as learnt.
#[inline(always)]
fn within<T: Real>(value: T) -> T {
    value.larger(T::of(-FARTHEST)).smaller(T::of(FARTHEST))
}

impl<T: Real> Inverse<T> for NeuralNetworkInverse<T> {
    type State = NeuralNetworkState<T>;

    /// Of a stage at 0 that never moved: all plays are there.
    fn rest(&self) -> NeuralNetworkState<T> {
        NeuralNetworkState { plays: [within(-self.centre / self.scales[0]); MOST_NETWORK_PLAYS] }
    }

    /// Finite for finite inputs: what is far beyond what was learnt counts as its edge.
    #[inline]
    fn step(&self, state: &mut NeuralNetworkState<T>, x: T, v: T, a: T) -> T {
        let motion = [x - self.centre, v, a];
        if !motion.iter().all(|one| one.is_finite()) {
            return T::NAN;
        }
        let mut inputs = [T::ZERO; INPUTS];
        for i in 0..3 {
            inputs[i] = within(motion[i] / self.scales[i]);
        }
        for i in 0..self.plays {
            let (here, r) = (inputs[0], self.thresholds[i]);
            state.plays[i] = state.plays[i].smaller(here + r).larger(here - r);
            inputs[3 + i] = state.plays[i];
        }
        let count = 3 + self.plays;
        let sum = |weights: &[T; INPUTS]| {
            let pairs = weights[..count].iter().zip(&inputs);
            pairs.fold(-T::ZERO, |sum, (weight, input)| sum + *weight * *input)
        };
        let mut drive = self.offset + sum(&self.direct);
        for unit in 0..self.units {
            let activation = sum(&self.hidden[unit]) + self.biases[unit];
            drive = drive + self.outputs[unit] * activation.tanh();
        }
        drive
    }
}

/// Refuses a number of entries.
#[expect(clippy::cast_precision_loss, reason = "for a message")]
fn counted(name: &'static str, count: usize, right: bool, expected: &'static str) -> Result<f64> {
    check(name, count as f64, "numbers", right, expected)
}
