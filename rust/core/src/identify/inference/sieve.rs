//! A sieve: an autoregression of a noise, whose innovations are drawn with replacement (Buehlmann
//! 1997, doi 10.2307/3318584).

use super::autoregression::Autoregression;
use crate::math::Draws;
use crate::signal::index;

/// Samples of a noise before the record, most.
const LEADING: usize = 1000;

/// A noise that can be drawn again.
pub(in crate::identify) struct Sieve {
    pub noise: Autoregression,
    /// Centred.
    innovations: Vec<f64>,
}

impl Sieve {
    pub fn of(noise: &[f64]) -> Self {
        let fitted = Autoregression::of(noise);
        let mut innovations = fitted.innovations(noise);
        let mean = innovations.iter().sum::<f64>() / index(innovations.len().max(1));
        for value in &mut innovations {
            *value -= mean;
        }
        Self { noise: fitted, innovations }
    }

    /// A noise of so many samples, its variance times `scale`.
    pub fn drawn(&self, count: usize, scale: f64, stream: &mut Draws) -> Vec<f64> {
        let (leading, known) = (count.min(LEADING), &self.innovations);
        if known.is_empty() {
            return vec![0.0; count];
        }
        let size = scale.sqrt();
        let drawn: Vec<f64> =
            (0..count + leading).map(|_| size * known[stream.below(known.len())]).collect();
        self.noise.noise(&drawn, leading)
    }
}
