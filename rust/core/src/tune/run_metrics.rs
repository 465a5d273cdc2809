//! Metrics that are read of a closed loop while it runs.

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

/// The running sums of a loop.
#[derive(Clone, Copy)]
pub(super) struct Score {
    interval: f64,
    count: f64,
    squares: f64,
    largest: f64,
    changes: f64,
    fastest: f64,
    clipped: f64,
    before: Option<f64>,
}

impl Score {
    pub(super) fn new(interval: f64) -> Self {
        Self {
            interval,
            count: 0.0,
            squares: 0.0,
            largest: 0.0,
            changes: 0.0,
            fastest: 0.0,
            clipped: 0.0,
            before: None,
        }
    }

    #[inline(always)]
    pub(super) fn take(&mut self, counts: bool, error: f64, volts: f64, clipped: bool) {
        let change = self.before.map_or(0.0, |before| volts - before);
        self.before = Some(volts);
        if counts {
            self.count += 1.0;
            self.squares += error * error;
            // Not so where the error is not a number
            self.largest = if error.abs() <= self.largest { self.largest } else { error.abs() };
            self.changes += change * change;
            self.fastest = self.fastest.max(change.abs());
            self.clipped += f64::from(u8::from(clipped));
        }
    }

    pub(super) fn figures(&self) -> RunMetrics {
        if !(self.largest <= DIVERGED && self.squares.is_finite() && self.count > 0.0) {
            return RunMetrics::FAILED;
        }
        RunMetrics {
            rms: libm::sqrt(self.squares / self.count),
            largest: self.largest,
            effort: libm::sqrt(self.changes / self.count),
            slew: self.fastest / self.interval,
            clipped: self.clipped / self.count,
        }
    }
}
