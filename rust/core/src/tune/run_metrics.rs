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

/// The running sums of a loop, or of loops in lanes.
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

impl<N: Number<Lane = f64>> Score<N> {
    pub(super) fn new(interval: f64, zero: N) -> Self {
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

    /// A sample: its error, m, its command, V, and 1 where that was clipped, otherwise 0.
    #[inline(always)]
    pub(super) fn take(&mut self, counts: bool, error: N, volts: N, clipped: N) {
        let change = volts - self.before.unwrap_or(volts);
        self.before = Some(volts);
        if counts {
            self.count += 1.0;
            // Stays NaN where an error is, which the largest one may not.
            self.squares = self.squares + error * error;
            self.largest = self.largest.larger(error).larger(-error);
            self.changes = self.changes + change * change;
            self.fastest = self.fastest.larger(change).larger(-change);
            self.clipped = self.clipped + clipped;
        }
    }

    pub(super) fn figures(&self, lane: usize) -> RunMetrics {
        let of = |sum: &N| sum.lane(lane);
        let (squares, largest) = (of(&self.squares), of(&self.largest));
        if !(largest <= DIVERGED && squares.is_finite() && self.count > 0.0) {
            return RunMetrics::FAILED;
        }
        RunMetrics {
            rms: libm::sqrt(squares / self.count),
            largest,
            effort: libm::sqrt(of(&self.changes) / self.count),
            slew: of(&self.fastest) / self.interval,
            clipped: of(&self.clipped) / self.count,
        }
    }
}
