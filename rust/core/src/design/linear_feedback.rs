//! Feedback laws as transfer functions: those of `piezotrack-control`, as they are sampled.

use nalgebra::{DMatrix, DVector};
use piezotrack_control::{
    Damped, Filter, HysteresisObserved, Observed, ObservedOperator, SampledPid, SampledSlidingMode,
    ScheduledPid, StateSpace,
};

use crate::math::Ratio;

/// A feedback law that is linear while nothing saturates.
pub trait LinearFeedback {
    /// Numerator and denominator in powers of `z - 1`, constant term first, from the error (m)
    /// to volts; the denominator monic and not of lower degree.
    fn transfer_function(&self) -> [Vec<f64>; 2];

    /// Numerator from the reference alone to the same denominator, of a law to which a reading is
    /// more than what is taken off the reference; [`Self::transfer_function`] is from less the
    /// displacement then, around which the loop closes.
    fn reference_numerator(&self) -> Option<Vec<f64>> {
        None
    }

    /// The proportional gain Kp in V/m, if the law has one.
    fn named_gain(&self) -> Option<f64> {
        None
    }
}

impl LinearFeedback for () {
    fn transfer_function(&self) -> [Vec<f64>; 2] {
        [vec![0.0], vec![1.0]]
    }
}

/// `Kp + Ki z/(z-1) + Kd (z-1)/z` with Ki = Kp Ts/Ti, Kd = Kp Td/Ts: equation (22) of Xu and Li
/// 2010, doi 10.1115/1.4001712.
impl LinearFeedback for SampledPid {
    fn transfer_function(&self) -> [Vec<f64>; 2] {
        let [kp, ki, kd] = self.weights();
        [vec![ki, kp + 2.0 * ki, kp + ki + kd], vec![0.0, 1.0, 1.0]]
    }

    fn named_gain(&self) -> Option<f64> {
        Some(self.weights()[0])
    }
}

/// At its first gains.
impl LinearFeedback for ScheduledPid {
    fn transfer_function(&self) -> [Vec<f64>; 2] {
        self.first().transfer_function()
    }

    fn named_gain(&self) -> Option<f64> {
        self.first().named_gain()
    }
}

/// `C (z I - A)^-1 B + D`.
impl<const N: usize> LinearFeedback for StateSpace<N> {
    fn transfer_function(&self) -> [Vec<f64>; 2] {
        let (a, b, c, d) = self.matrices();
        // Room that no state has filled
        let idle = |i: &usize| {
            b[*i] == 0.0 && c[*i] == 0.0 && (0..N).all(|j| a[*i][j] == 0.0 && a[j][*i] == 0.0)
        };
        let n = N - (0..N).rev().take_while(idle).count();
        let change = DMatrix::from_fn(n, n, |i, j| a[i][j] - f64::from(u8::from(i == j)));
        let of = |v: &[f64; N]| DVector::from_column_slice(&v[..n]);
        let ratio = Ratio::of_matrices(&change, &of(b), &of(c), d);
        [ratio.above, ratio.below]
    }
}

/// Inside the boundary layer: `eta/phi (1 + Ts/Ti z/(z-1) + Td/Ts c (z-1)/(z-1+c))`, c the share of
/// a new difference in the filtered one. Slotine and Li 1991, section 7.2.
impl LinearFeedback for SampledSlidingMode {
    fn transfer_function(&self) -> [Vec<f64>; 2] {
        let [gain, ki, td, c] = self.inside();
        let kd = td * c;
        if ki > 0.0 {
            let above = vec![gain * ki * c, gain * (c + ki * (1.0 + c)), gain * (1.0 + ki + kd)];
            return [above, vec![0.0, c, 1.0]];
        }
        [vec![gain * c, gain * (1.0 + kd)], vec![c, 1.0]]
    }
}

/// `((z - q) C + (1 - q)(z - p)/(g (1 - p)))/(z - 1)` around the law C: the estimate has seen the
/// law's own output, so that the observer integrates.
impl<F: LinearFeedback> LinearFeedback for Observed<F> {
    fn transfer_function(&self) -> [Vec<f64>; 2] {
        let [fresh, pole, inverse] = self.coefficients();
        let [above, below] = self.inner().transfer_function();
        let mut sum = product(&above, &[fresh, 1.0]);
        let observed = product(&below, &[fresh * inverse * (1.0 - pole), fresh * inverse]);
        add(&mut sum, 1.0, &observed);
        [sum, product(&below, &[0.0, 1.0])]
    }
}

/// `C - K` around the law C, which tracks, for the filter K, which damps.
impl<F: LinearFeedback> LinearFeedback for Damped<F> {
    fn transfer_function(&self) -> [Vec<f64>; 2] {
        let [above, below] = self.inner().transfer_function();
        let [damping, own] = of_filter(self.filter());
        let mut sum = product(&above, &own);
        add(&mut sum, -1.0, &product(&below, &damping));
        [sum, product(&below, &own)]
    }

    fn reference_numerator(&self) -> Option<Vec<f64>> {
        let [above, _] = self.inner().transfer_function();
        Some(product(&above, &of_filter(self.filter())[1]))
    }

    fn named_gain(&self) -> Option<f64> {
        self.inner().named_gain()
    }
}

/// w^ = Hy y + Hu u of the observer, at the larger slope s of the operator, about a point. The states
/// are x^, w^ and the last two voltages.
fn observed<O: ObservedOperator, F>(law: &HysteresisObserved<O, F>) -> [Ratio; 2] {
    let ([p, g, l], [_, slope]) = (law.coefficients(), law.slopes());
    // Of x-, x^, w- and w^ the weights of x^, w^, v[k-1], v[k-2] before and of y.
    let sum = |pairs: &[(f64, [f64; 5])]| -> [f64; 5] {
        std::array::from_fn(|i| pairs.iter().map(|(factor, row)| factor * row[i]).sum())
    };
    let unit = |at: usize| -> [f64; 5] { std::array::from_fn(|i| f64::from(u8::from(i == at))) };
    let [x, w, last, before, y] = [0, 1, 2, 3, 4].map(unit);
    let along_drive = sum(&[(1.0, w), (slope, last), (-slope, before)]);
    let at = if law.is_of_drive() { along_drive } else { w };
    let ahead = sum(&[(p, x), (g, last), (-g, at)]);
    let place = sum(&[(1.0 - l, ahead), (l, y)]);
    let along_path = sum(&[(1.0, w), (slope, place), (-slope, x)]);
    let moved = if law.is_of_drive() { along_drive } else { along_path };
    let estimate = sum(&[(1.0 - l, moved), (l, last), (l * p / g, x), (-l / g, y)]);

    let rows = [place, estimate, [0.0; 5], last];
    let change = DMatrix::from_fn(4, 4, |i, j| rows[i][j] - f64::from(u8::from(i == j)));
    let column = |numbers: [f64; 4]| DVector::from_column_slice(&numbers);
    let out = column([estimate[0], estimate[1], estimate[2], estimate[3]]);
    let of_y = Ratio::of_matrices(&change, &column(rows.map(|row| row[4])), &out, estimate[4]);
    let of_u = Ratio::of_matrices(&change, &column([0.0, 0.0, 1.0, 0.0]), &out, 0.0);
    [of_y, of_u]
}

/// u/e = (C - Hy)/(1 - Hu) around the law C; from the reference alone it is C/(1 - Hu).
impl<O: ObservedOperator, F: LinearFeedback> LinearFeedback for HysteresisObserved<O, F> {
    fn transfer_function(&self) -> [Vec<f64>; 2] {
        let [of_y, of_u] = observed(self);
        let [above, below] = self.inner().transfer_function();
        let mut top = product(&above, &of_y.below);
        add(&mut top, -1.0, &product(&below, &of_y.above));
        let mut bottom = of_u.below;
        add(&mut bottom, -1.0, &of_u.above);
        [top, product(&below, &bottom)]
    }

    fn reference_numerator(&self) -> Option<Vec<f64>> {
        let [of_y, _] = observed(self);
        let [above, _] = self.inner().transfer_function();
        Some(product(&above, &of_y.below))
    }
}

/// Adds a multiple of a polynomial.
fn add(sum: &mut Vec<f64>, factor: f64, more: &[f64]) {
    sum.resize(sum.len().max(more.len()), 0.0);
    for (sum, more) in sum.iter_mut().zip(more) {
        *sum += factor * more;
    }
}

/// A filter, `b0 z^2 + b1 z + b2` over `z^2 + a1 z + a2`.
pub(super) fn of_filter(filter: &Filter) -> [Vec<f64>; 2] {
    let ([b0, b1, b2], [a1, a2]) = filter.coefficients();
    [vec![b0 + b1 + b2, 2.0 * b0 + b1, b0], vec![1.0 + a1 + a2, 2.0 + a1, 1.0]]
}

/// Product of two polynomials.
pub(super) fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; a.len() + b.len() - 1];
    for (i, a) in a.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            out[i + j] += a * b;
        }
    }
    out
}
