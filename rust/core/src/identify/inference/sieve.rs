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
        Self::with(Autoregression::of(noise), noise)
    }

    /// With an autoregression that is known, whose variance the innovations have.
    pub fn with(fitted: Autoregression, noise: &[f64]) -> Self {
        let mut innovations = fitted.innovations(noise);
        let count = index(innovations.len().max(1));
        let mean = innovations.iter().sum::<f64>() / count;
        let power = innovations.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        let size = if power > 0.0 { (fitted.variance / power).sqrt() } else { 1.0 };
        for value in &mut innovations {
            *value = size * (*value - mean);
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

/// Noises like one, their variance times `scale`.
#[must_use]
pub fn resampled_noises(noise: &[f64], scale: f64, (draws, seed): (u32, u64)) -> Vec<Vec<f64>> {
    let sieve = Sieve::of(noise);
    let drawn = |draw| {
        let mut stream = Draws::at(seed, u64::from(draw), 0, 0, 1);
        sieve.drawn(noise.len(), scale, &mut stream)
    };
    (0..draws).map(drawn).collect()
}
