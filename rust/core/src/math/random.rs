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

/// Stream of the sampling jitter of a controller.
const LATENESS: u64 = u64::MAX - 1;

/// Stream of the ticks that an axis misses.
const TICKS: u64 = u64::MAX - 2;

/// Which of a run's streams draws the links between particles.
const LINKS: u64 = 1 << 63;

/// The numbers of one particle in one iteration.
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

    /// As [`Draws::at`], of another stream: whom the particle informs from this iteration on.
    pub(crate) fn of_links(
        seed: u64,
        run: u64,
        iteration: u64,
        particle: u64,
        particles: u64,
    ) -> Self {
        Self::at(seed, run ^ LINKS, iteration, particle, particles)
    }

    /// The next number, uniform in [0, 1): the upper 53 bits of a word over 2^53.
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
    pub(crate) fn uniform(&mut self) -> f64 {
        const SCALE: f64 = 1.0 / (1_u64 << 53) as f64;
        (self.0.next_u64() >> 11) as f64 * SCALE
    }

    /// A normal deviate for one sample of a sensor.
    pub(crate) fn normal(seed: u64, sample: u64) -> f64 {
        Self::at(seed, SENSOR, sample, 0, 1).two_normals()[0]
    }

    /// The next normal deviate.
    pub(crate) fn normal_deviate(&mut self) -> f64 {
        self.two_normals()[0]
    }

    /// Jitter of one control sample, in units of the mean.
    pub(crate) fn jitter(seed: u64, sample: u64) -> f64 {
        Self::at(seed, LATENESS, sample, 0, 1).exponential()
    }

    /// Decides about the tick of one control sample: uniform in [0, 1).
    pub(crate) fn tick(seed: u64, sample: u64) -> f64 {
        Self::at(seed, TICKS, sample, 0, 1).uniform()
    }

    /// A whole number below `count`.
    #[expect(clippy::cast_possible_truncation, reason = "below count, which is a usize")]
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.0.next_u64()) * count as u128) >> 64) as usize
    }

    /// A point drawn evenly from the unit ball; of 32 coordinates it takes 33 numbers.
    ///
    /// Normal deviates g and an exponential one e give g / sqrt(|g|^2 + 2 e): Barthe, Guedon,
    /// Mendelson and Naor 2005, doi 10.1214/009117904000000874. Its radius is d/(d+1) on average.
    pub(crate) fn in_unit_ball(&mut self, coordinates: usize) -> Vec<f64> {
        let normals = self.normals(coordinates);
        let rest = 2.0 * self.exponential();
        scaled(normals, 1.0, rest)
    }

    /// A point of the unit ball in an even direction at an even radius, so that points are denser
    /// the nearer to the centre; of 32 coordinates it takes 33 numbers.
    pub(crate) fn in_unit_ball_radially(&mut self, coordinates: usize) -> Vec<f64> {
        let normals = self.normals(coordinates);
        let radius = self.uniform();
        scaled(normals, radius, 0.0)
    }

    /// Normal deviates.
    pub(crate) fn normals(&mut self, count: usize) -> Vec<f64> {
        let mut normals = Vec::with_capacity(count + 1);
        while normals.len() < count {
            normals.extend(self.two_normals());
        }
        normals.truncate(count);
        normals
    }

    /// Two normal deviates: Box and Muller 1958, doi 10.1214/aoms/1177706645.
    fn two_normals(&mut self) -> [f64; 2] {
        let radius = libm::sqrt(2.0 * self.exponential());
        let (sine, cosine) = libm::sincos(core::f64::consts::TAU * self.uniform());
        [radius * cosine, radius * sine]
    }

    /// An exponential deviate of mean 1: 1 - u is in (0, 1], so the logarithm stays finite.
    fn exponential(&mut self) -> f64 {
        -libm::log(1.0 - self.uniform())
    }
}

/// `radius g / sqrt(|g|^2 + rest)`; 0 where the radius or everything else is 0.
fn scaled(mut g: Vec<f64>, radius: f64, rest: f64) -> Vec<f64> {
    let squares: f64 = g.iter().map(|g| g * g).sum();
    let scale = libm::sqrt(squares + rest + f64::MIN_POSITIVE) / radius;
    for g in &mut g {
        *g /= scale;
    }
    g
}
