//! Autoregression of a noise: its coefficients, innovations and spectrum.

use core::f64::consts::TAU;
use libm::sincos;

use crate::signal::index;

/// Highest order of an autoregression.
const HIGHEST: usize = 20;

/// Samples to a coefficient, at least.
const EACH: usize = 10;

/// An autoregression, `n_t = sum_k a_k n_(t-k) + v_t`.
#[derive(Clone, Debug)]
pub struct Autoregression {
    /// Its coefficients `a_k`; none for white noise.
    pub coefficients: Vec<f64>,
    /// Variance of the innovations v, in the square of the noise's unit.
    pub variance: f64,
}

impl Autoregression {
    /// Fits one to a noise, of the order that the criterion of Akaike chooses (1974, doi
    /// 10.1109/TAC.1974.1100705).
    #[must_use]
    pub fn of(noise: &[f64]) -> Self {
        Self::likeliest(Self::of_all_orders(noise), noise.len())
    }

    /// The same, and of an order half as high again: that of Akaike is for predictions, and short of
    /// what is slow and small beside other noise.
    pub(super) fn pair_of(noise: &[f64]) -> [Self; 2] {
        let all = Self::of_all_orders(noise);
        let chosen = Self::likeliest(all.clone(), noise.len());
        let higher = (chosen.order() + chosen.order().div_ceil(2)).min(all.len() - 1);
        let longer = all.into_iter().nth(higher).unwrap_or_else(|| chosen.clone());
        [chosen, longer]
    }

    /// The one of least criterion, the lowest order first.
    fn likeliest(all: Vec<Self>, samples: usize) -> Self {
        let criterion = |one: &Self| {
            let power = one.variance.max(f64::MIN_POSITIVE);
            index(samples) * libm::log(power) + 2.0 * index(one.order())
        };
        let better =
            |best: Self, one: Self| if criterion(&one) < criterion(&best) { one } else { best };
        all.into_iter().reduce(better).unwrap_or(Self { coefficients: vec![], variance: 0.0 })
    }

    /// Those of orders 0 and above, by Burg's method (Burg 1968; Kay 1988, Modern Spectral Estimation,
    /// section 7.6).
    fn of_all_orders(noise: &[f64]) -> Vec<Self> {
        let count = noise.len();
        let mut power = noise.iter().map(|x| x * x).sum::<f64>() / index(count.max(1));
        let (mut forward, mut backward) = (noise.to_vec(), noise.to_vec());
        let mut a: Vec<f64> = Vec::new();
        let mut all = vec![Self { coefficients: Vec::new(), variance: power }];
        for order in 1..=HIGHEST.min(count / EACH) {
            let (mut product, mut squares) = (0.0, 0.0);
            for t in order..count {
                product += forward[t] * backward[t - 1];
                squares += forward[t] * forward[t] + backward[t - 1] * backward[t - 1];
            }
            if squares <= 0.0 || squares.is_nan() {
                break;
            }
            let reflection = 2.0 * product / squares;
            let mut next = a.clone();
            for (k, value) in next.iter_mut().enumerate() {
                *value -= reflection * a[order - 2 - k];
            }
            next.push(reflection);
            a = next;
            for t in (order..count).rev() {
                let (f, b) = (forward[t], backward[t - 1]);
                forward[t] = f - reflection * b;
                backward[t] = b - reflection * f;
            }
            power *= 1.0 - reflection * reflection;
            all.push(Self { coefficients: a.clone(), variance: power });
        }
        all
    }

    /// The same, its variance times a factor.
    pub(super) fn scaled(mut self, scale: f64) -> Self {
        self.variance *= scale;
        self
    }

    /// Number of its coefficients.
    #[must_use]
    pub fn order(&self) -> usize {
        self.coefficients.len()
    }

    /// Coefficients of the filter that leaves the innovations, from the present sample on.
    pub(super) fn filter(&self) -> Vec<f64> {
        core::iter::once(1.0).chain(self.coefficients.iter().map(|a| -a)).collect()
    }

    /// Predictors of the first samples from those before them, and the variance of their errors over
    /// that of the innovations; `None` where the noise grows. By the recursion of Levinson and Durbin.
    pub(super) fn first(&self) -> Option<Vec<(Self, f64)>> {
        let (mut a, mut variance) = (self.coefficients.clone(), 1.0);
        let mut predictors = Vec::with_capacity(a.len());
        while let Some(reflection) = a.pop() {
            let left = 1.0 - reflection * reflection;
            if left.is_nan() || left <= 0.0 {
                return None;
            }
            a = a.iter().zip(a.iter().rev()).map(|(a, b)| (a + reflection * b) / left).collect();
            variance /= left;
            predictors.push((Self { coefficients: a.clone(), variance: 1.0 }, variance));
        }
        predictors.reverse();
        Some(predictors)
    }

    /// Variance of its noise; `None` where it grows.
    pub(super) fn power(&self) -> Option<f64> {
        let first = self.first()?;
        Some(self.variance * first.first().map_or(1.0, |(_, variance)| *variance))
    }

    /// Spectral density at a frequency, in shares of the sampling rate: the variance of the noise is
    /// its mean.
    pub(super) fn density(&self, frequency: f64) -> f64 {
        let (mut re, mut im) = (1.0, 0.0);
        let (sine, cosine) = sincos(TAU * frequency);
        let (mut c, mut s) = (cosine, sine);
        for a in &self.coefficients {
            re -= a * c;
            im += a * s;
            (c, s) = (c * cosine - s * sine, s * cosine + c * sine);
        }
        self.variance / (re * re + im * im)
    }

    /// Innovations of a noise, from the sample on that has the whole order before it.
    pub(super) fn innovations(&self, noise: &[f64]) -> Vec<f64> {
        let order = self.coefficients.len();
        let of = |window: &[f64]| {
            let before = window[..order].iter().rev();
            window[order] - self.coefficients.iter().zip(before).map(|(a, n)| a * n).sum::<f64>()
        };
        noise.windows(order + 1).map(of).collect()
    }

    /// The adjoint of [`Self::innovations`]: as many values as the noise has samples.
    pub(super) fn reversed_innovations(&self, values: &[f64]) -> Vec<f64> {
        let order = self.coefficients.len();
        let mut sums = vec![0.0; values.len() + order];
        for (t, value) in values.iter().enumerate() {
            sums[t + order] += value;
            for (k, a) in self.coefficients.iter().enumerate() {
                sums[t + order - 1 - k] -= a * value;
            }
        }
        sums
    }

    /// The noise that innovations make, less the first `leading` samples.
    pub(super) fn noise(&self, innovations: &[f64], leading: usize) -> Vec<f64> {
        let mut noise: Vec<f64> = Vec::with_capacity(innovations.len());
        for (t, v) in innovations.iter().enumerate() {
            let before = noise[t.saturating_sub(self.coefficients.len())..].iter().rev();
            let value = v + self.coefficients.iter().zip(before).map(|(a, n)| a * n).sum::<f64>();
            noise.push(value);
        }
        noise.split_off(leading.min(innovations.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::Autoregression;
    use crate::math::Draws;

    #[test]
    fn an_autoregression_is_found_again() {
        let known = Autoregression { coefficients: vec![1.2, -0.5], variance: 4.0 };
        let drawn: Vec<f64> = (0..20_000).map(|k| 2.0 * Draws::normal(1, k)).collect();
        let noise = known.noise(&drawn, 100);
        let found = Autoregression::of(&noise);
        assert!((found.variance / 4.0 - 1.0).abs() < 0.05);
        assert!((found.coefficients[0] - 1.2).abs() < 0.05);
        for f in [0.0, 0.05, 0.1, 0.3, 0.5] {
            assert!((found.density(f) / known.density(f) - 1.0).abs() < 0.3);
        }
        let back = known.innovations(&noise);
        assert!(back.iter().zip(&drawn[102..]).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
