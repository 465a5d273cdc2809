//! Modes of rank one in parallel, as a fit moves them.

use crate::error::Result;
use crate::math::C;
use crate::simulate::check_modes;

/// Sampled modes of rank one in parallel, of n drives and m sensors.
///
/// ```text
/// G(z) = D + sum_i c_i b_i^T/(z - p_i) + conj(c_i b_i^T)/(z - conj(p_i))
/// ```
///
/// ```
/// use piezotrack_core::identify::ModalTerms;
///
/// let terms = ModalTerms::new([1, 1], &[[0.5, -0.5]], &[[0.0, 4.0]], &[[1.0, 0.0]], &[0.0])?;
/// let even = terms.balanced();
/// assert_eq!(even.poles(), [[0.5, 0.5]]);
/// assert_eq!(even.inputs(), [[2.0, 0.0]]);
/// assert_eq!(even.outputs(), [[0.0, -2.0]]);
/// # Ok::<(), piezotrack_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ModalTerms {
    pub(super) drives: usize,
    pub(super) sensors: usize,
    pub(super) poles: Vec<C>,
    /// b, mode by mode.
    pub(super) inputs: Vec<C>,
    /// c, mode by mode.
    pub(super) outputs: Vec<C>,
    /// D, sensor by sensor.
    pub(super) direct: Vec<f64>,
}

fn complex(parts: &[[f64; 2]]) -> Vec<C> {
    parts.iter().map(|&[real, imaginary]| C::new(real, imaginary)).collect()
}

fn parts(numbers: &[C]) -> Vec<[f64; 2]> {
    numbers.iter().map(|number| [number.re, number.im]).collect()
}

/// Magnitude of a complex number.
pub(super) fn size(number: C) -> f64 {
    libm::hypot(number.re, number.im)
}

/// Angle of a complex number.
pub(super) fn angle(number: C) -> f64 {
    libm::atan2(number.im, number.re)
}

/// `exp(-decay + i angle)`.
pub(super) fn pole(decay: f64, angle: f64) -> C {
    let (sine, cosine) = libm::sincos(angle);
    let size = libm::exp(-decay);
    C::new(size * cosine, size * sine)
}

/// `1/(z - p)` as real and imaginary part.
#[inline(always)]
pub(super) fn inverse(z: [f64; 2], pole: C) -> [f64; 2] {
    let (x, y) = (z[0] - pole.re, z[1] - pole.im);
    let size = x * x + y * y;
    [x / size, -y / size]
}

/// Euclidean length of a vector.
pub(super) fn length(vector: &[C]) -> f64 {
    libm::sqrt(vector.iter().map(C::norm_sqr).sum())
}

impl ModalTerms {
    /// Terms of `[drives, sensors]` with these poles, b of each mode, c of each mode, and D sensor
    /// by sensor; complex numbers as real and imaginary part.
    ///
    /// # Errors
    /// [`Error::Shape`](crate::Error::Shape) where the lists do not fit each other;
    /// [`Error::Parameter`](crate::Error::Parameter) where a pole is not inside the unit circle or
    /// a number is not finite.
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
            poles: complex(poles),
            inputs: complex(inputs),
            outputs: complex(outputs),
            direct: direct.to_vec(),
        })
    }

    /// Poles.
    #[must_use]
    pub fn poles(&self) -> Vec<[f64; 2]> {
        parts(&self.poles)
    }

    /// The vectors b, mode by mode.
    #[must_use]
    pub fn inputs(&self) -> Vec<[f64; 2]> {
        parts(&self.inputs)
    }

    /// The vectors c, mode by mode.
    #[must_use]
    pub fn outputs(&self) -> Vec<[f64; 2]> {
        parts(&self.outputs)
    }

    /// D, sensor by sensor.
    #[must_use]
    pub fn direct(&self) -> &[f64] {
        &self.direct
    }

    /// b of a mode.
    pub(super) fn input(&self, mode: usize) -> &[C] {
        &self.inputs[mode * self.drives..][..self.drives]
    }

    /// c of a mode.
    pub(super) fn output(&self, mode: usize) -> &[C] {
        &self.outputs[mode * self.sensors..][..self.sensors]
    }

    /// Logarithmic decays of the poles per sample.
    pub(super) fn decays(&self) -> Vec<f64> {
        self.poles.iter().map(|pole| -libm::log(size(*pole))).collect()
    }

    /// The matrix c b^T of a mode, sensor by sensor.
    pub(super) fn residue(&self, mode: usize) -> impl Iterator<Item = C> + '_ {
        let input = self.input(mode);
        self.output(mode).iter().flat_map(move |c| input.iter().map(move |b| c * b))
    }

    /// Terms with another mode at the end.
    pub(super) fn with(mut self, pole: C, input: &[C], output: &[C]) -> Self {
        self.poles.push(pole);
        self.inputs.extend_from_slice(input);
        self.outputs.extend_from_slice(output);
        self
    }

    /// The same modes in another order.
    pub(super) fn sorted(&self, order: &[usize]) -> Self {
        Self {
            poles: order.iter().map(|&mode| self.poles[mode]).collect(),
            inputs: order.iter().flat_map(|&mode| self.input(mode)).copied().collect(),
            outputs: order.iter().flat_map(|&mode| self.output(mode)).copied().collect(),
            ..self.clone()
        }
    }

    /// The same system with b and c of equal size, the largest b real, and poles above the axis.
    #[must_use]
    pub fn balanced(&self) -> Self {
        let mut found = self.clone();
        for mode in 0..self.poles.len() {
            if self.poles[mode].im < 0.0 {
                found.poles[mode] = self.poles[mode].conj();
            }
            let turned =
                |number: &C| if self.poles[mode].im < 0.0 { number.conj() } else { *number };
            let input: Vec<C> = self.input(mode).iter().map(turned).collect();
            let output: Vec<C> = self.output(mode).iter().map(turned).collect();
            let mut largest = C::new(0.0, 0.0);
            for number in &input {
                if size(*number) > size(largest) {
                    largest = *number;
                }
            }
            let ratio = libm::sqrt(length(&output) / length(&input));
            // A mode that nothing drives or shows stays as it is.
            let factor = if ratio > 0.0 && ratio < f64::INFINITY {
                largest.conj() * (ratio / size(largest))
            } else {
                C::new(1.0, 0.0)
            };
            found.write(
                mode,
                input.into_iter().map(|b| b * factor),
                output.into_iter().map(|c| c / factor),
            );
        }
        found
    }

    /// The same system with b of each mode turned and sized so that it is as near to that of
    /// another as it can be, and c for it.
    ///
    /// # Errors
    /// [`Error::Shape`](crate::Error::Shape) where `other` has other numbers of modes or drives.
    pub fn aligned(&self, other: &Self) -> Result<Self> {
        let found = |terms: &Self| [terms.poles.len(), terms.drives];
        if found(self) != found(other) {
            let [modes, drives] = found(other);
            let [expected, wide] = found(self);
            return Err(crate::Error::Shape {
                name: "other".into(),
                found: format!("{modes} modes of {drives} drives"),
                expected: format!("{expected} of {wide}"),
            });
        }
        Ok(self.turned(other))
    }

    /// [`Self::aligned`] to terms with as many modes and drives.
    pub(super) fn turned(&self, other: &Self) -> Self {
        let mut found = self.clone();
        for mode in 0..self.poles.len() {
            let (mine, theirs) = (self.input(mode), other.input(mode));
            let overlap: C = mine.iter().zip(theirs).map(|(b, other)| b.conj() * other).sum();
            let ratio = length(theirs) / length(mine);
            let way = size(overlap);
            let turn = if way > 0.0 { overlap * (ratio / way) } else { C::new(ratio, 0.0) };
            found.write(
                mode,
                mine.iter().map(|b| b * turn),
                self.output(mode).iter().map(|c| c / turn),
            );
        }
        found
    }

    /// Writes b and c of a mode.
    fn write(&mut self, mode: usize, b: impl Iterator<Item = C>, c: impl Iterator<Item = C>) {
        for (slot, value) in self.inputs[mode * self.drives..].iter_mut().zip(b) {
            *slot = value;
        }
        for (slot, value) in self.outputs[mode * self.sensors..].iter_mut().zip(c) {
            *slot = value;
        }
    }
}
