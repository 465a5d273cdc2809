//! Random numbers addressed by (seed, run, iteration, particle), or by (seed, sample).
//!
//! A draw depends on its address and on nothing drawn before, so results do not depend on
//! threads, and a resumed search or experiment draws what an uninterrupted one would have drawn.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// 32-bit words reserved for one particle in one iteration: room for 32 coordinates.
const WORDS: u128 = 128;

/// Stream of a sensor's noise: no search counts this many runs.
const SENSOR: u64 = u64::MAX;

/// The numbers of one particle in one iteration, uniform in [0, 1).
pub(crate) struct Draws(ChaCha8Rng);

impl Draws {
    /// Iteration 0 is where a particle starts.
    pub(crate) fn at(seed: u64, run: u64, iteration: u64, particle: u64, particles: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(run);
        let place = u128::from(iteration) * u128::from(particles) + u128::from(particle);
        generator.set_word_pos(place * WORDS);
        Self(generator)
    }

    /// The next number: the upper 53 bits of a word over 2^53.
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
    pub(crate) fn uniform(&mut self) -> f64 {
        const SCALE: f64 = 1.0 / (1_u64 << 53) as f64;
        (self.0.next_u64() >> 11) as f64 * SCALE
    }
    /// A number of the standard normal distribution for one sample of a sensor, by Box and
    /// Muller's transform.
    pub(crate) fn normal(seed: u64, sample: u64) -> f64 {
        let mut draws = Self::at(seed, SENSOR, sample, 0, 1);
        // 1 - u is in (0, 1]: the logarithm stays finite.
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - draws.uniform()));
        radius * libm::cos(core::f64::consts::TAU * draws.uniform())
    }
}
