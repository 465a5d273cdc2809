//! Slow drift of a sensor's reading along a record: a part that fades and has nothing to do with
//! the drive.
//!
//! ```text
//! y = x + offset + c g,   g = (exp(-t/tau) - exp(-T/tau)) / (1 - exp(-T/tau))
//! ```
//!
//! over a window of T seconds: g falls from 1 to 0, and is a straight line where tau is long. The
//! reading is linear in c, whose best value follows for each candidate as that of the offset does:
//! variable projection, Golub and Pereyra 1973, doi 10.1137/0710036.

use piezotrack_control::Number;

use super::coordinate::{Coordinate, Scale};
use crate::error::{Error, Result, positive};
use crate::identify::records::creep_weights::MOST_CREEP_WEIGHTS;
use crate::identify::records::record::Record;
use crate::signal::{index, range, turns};

/// Slow drift of what a sensor shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DriftKind {
    /// None.
    None,
    /// With this time constant, s.
    Time(f64),
    /// Fitted in a search; by least squares chosen from the record.
    Auto,
}

/// Fewest reversals of the drive.
const REVERSALS: usize = 6;

/// Smallest reversal that counts, as a share of the drive's range.
const LARGE_TURN: f64 = 0.1;

/// Range of the time constant of a drift, as shares of the window.
pub(in crate::identify) const DRIFT_TIMES: (f64, f64) = (0.1, 10.0);

/// Windows that a time constant lasts at most: beyond, the drift is a straight line.
const STRAIGHT: f64 = 1e6;

impl DriftKind {
    /// The time constant in a search; 0 for no drift.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a time constant that is not above 0 and finite, and for a drift without
    /// an offset.
    pub(in crate::identify) fn coordinate(
        self,
        record: &Record<'_>,
        offset: bool,
    ) -> Result<Coordinate> {
        let none = Coordinate::Fixed(0.0);
        if self != Self::None && !offset {
            let expected = "none without an offset";
            return Err(Error::parameter("drift", "given", expected));
        }
        match self {
            Self::None => Ok(none),
            Self::Time(time) => Ok(Coordinate::Fixed(positive("drift", time, "s")?)),
            Self::Auto => {
                let length = record.drive.dt * index(record.window.len() - 1);
                let [low, high] = [DRIFT_TIMES.0, DRIFT_TIMES.1].map(|share| share * length);
                Ok(Coordinate::Free { low, high, scale: Scale::Log })
            }
        }
    }
}

/// Whether a drive comes back so often that a loop which is not closed does not look like a drift.
#[must_use]
pub fn turns_often(u: &[f64]) -> bool {
    let (low, high) = range(u);
    turns(u, LARGE_TURN * (high - low)).len() >= REVERSALS
}

/// A drift of 1 along a window, from sample to sample: `g -> keep g - less`.
#[derive(Clone, Copy, Debug)]
pub(in crate::identify) struct Fading {
    pub keep: f64,
    pub less: f64,
}

impl Fading {
    /// With this time constant, s, along a window of so many samples.
    pub fn new(time: f64, dt: f64, samples: usize) -> Self {
        let length = dt * index(samples - 1);
        let time = time.min(STRAIGHT * length);
        let lost = -libm::expm1(-dt / time);
        Self { keep: 1.0 - lost, less: lost / libm::expm1(length / time) }
    }

    /// At every `stride`-th sample of the window.
    pub fn shape(self, samples: usize, stride: usize) -> Vec<f64> {
        let next = |g: &f64| Some(self.keep * g - self.less);
        core::iter::successors(Some(1.0), next).take(samples).step_by(stride).collect()
    }
}

/// A drift at a place of a search.
#[derive(Clone, Copy, Debug)]
pub(in crate::identify) struct Drift {
    /// Time constant, s.
    pub time: f64,
    /// Part of the reading that fades along the window, m.
    pub fallen: f64,
}

/// Sums over samples of a drift g of 1, beside those of the deviation r and of the creep's outputs.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::identify) struct DriftSums<N> {
    /// Of g, and of its square.
    pub shape: [N; 2],
    /// Of g r.
    pub deviation: N,
    /// Of g and each output of the creep.
    pub outputs: [N; MOST_CREEP_WEIGHTS],
}

/// The same while they are accumulated in lanes.
pub(in crate::identify) struct Drifting<N> {
    keep: N,
    less: N,
    /// g at the present sample.
    now: N,
    pub sums: DriftSums<N>,
}

impl<N: Number> Drifting<N> {
    /// From the first sample of a window on.
    pub fn new(keep: N, less: N) -> Self {
        let zero = keep.like(0.0);
        let sums =
            DriftSums { shape: [zero; 2], deviation: zero, outputs: [zero; MOST_CREEP_WEIGHTS] };
        Self { keep, less, now: keep.like(1.0), sums }
    }

    /// Adds a sample, and goes to the next.
    #[inline(always)]
    pub fn add(&mut self, deviation: N, outputs: impl Iterator<Item = N>) {
        let (g, sums) = (self.now, &mut self.sums);
        sums.shape = [sums.shape[0] + g, g.mul_add(g, sums.shape[1])];
        sums.deviation = g.mul_add(deviation, sums.deviation);
        for (sum, output) in sums.outputs.iter_mut().zip(outputs) {
            *sum = g.mul_add(output, *sum);
        }
        self.pass();
    }

    /// Goes to the next sample, without adding this one.
    #[inline(always)]
    pub fn pass(&mut self) {
        self.now = self.now * self.keep - self.less;
    }
}
