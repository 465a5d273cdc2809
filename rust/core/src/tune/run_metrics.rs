//! Metrics that are read of a closed loop while it runs.

use piezotrack_control::Number;

/// Metrics of the run of a closed loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunMetrics {
    /// Tracking error, m rms.
    pub rms: f64,
    /// Largest tracking error, m.
    pub largest: f64,
    /// Change of the command from sample to sample, V rms.
    pub effort: f64,
    /// Fastest change of the command, V/s.
    pub slew: f64,
    /// Share of the samples at which the command was clipped.
    pub clipped: f64,
}

impl RunMetrics {
    /// Of a loop that did not stay finite.
    pub const FAILED: Self = Self {
        rms: f64::INFINITY,
        largest: f64::INFINITY,
        effort: f64::INFINITY,
        slew: f64::INFINITY,
        clipped: 1.0,
    };
}

/// Beyond this a loop counts as diverged, m.
const DIVERGED: f64 = 1.0;

/// The running sums of a loop, or of one in each lane.
#[derive(Clone, Copy)]
pub(super) struct Score<N> {
    interval: f64,
    count: f64,
    squares: N,
    largest: N,
    changes: N,
    fastest: N,
    clipped: N,
    before: Option<N>,
}

impl<N: Number> Score<N> {
    /// The sums before the first sample; `zero` makes numbers of that type.
    #[inline(always)]
    pub(super) fn new(zero: N, interval: f64) -> Self {
        Self {
            interval,
            count: 0.0,
            squares: zero,
            largest: zero,
            changes: zero,
            fastest: zero,
            clipped: zero,
            before: None,
        }
    }

    /// Takes a sample; `clipped` is 1 where the command was, else 0.
    #[inline(always)]
    pub(super) fn take(&mut self, counts: bool, error: N, volts: N, clipped: N) {
        let change = self.before.map_or(volts.like(0.0), |before| volts - before);
        self.before = Some(volts);
        if counts {
            self.count += 1.0;
            self.squares = self.squares + error * error;
            self.largest = self.largest.larger(error).larger(-error);
            self.changes = self.changes + change * change;
            self.fastest = self.fastest.larger(change).larger(-change);
            self.clipped = self.clipped + clipped;
        }
    }

    /// The metrics of a lane, which `of` reads.
    pub(super) fn figures(&self, of: impl Fn(&N) -> f64) -> RunMetrics {
        let [squares, largest, changes, fastest, clipped] =
            [&self.squares, &self.largest, &self.changes, &self.fastest, &self.clipped].map(of);
        // Squares are not finite where an error is not a number.
        if !(largest <= DIVERGED && squares.is_finite() && self.count > 0.0) {
            return RunMetrics::FAILED;
        }
        RunMetrics {
            rms: libm::sqrt(squares / self.count),
            largest,
            effort: libm::sqrt(changes / self.count),
            slew: fastest / self.interval,
            clipped: clipped / self.count,
        }
    }
}
