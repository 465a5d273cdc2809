//! The parts of a control interval, as few as the stage and its amplifier need.

use crate::simulate::{Delay, SAME, Timing, VirtualStage};

/// Ends of the parts in which an amplifier settles after a change of its command, in lags.
const SETTLING: [f64; 3] = [0.5, 1.5, 4.0];

/// Most steps of equal length in a control interval.
const MOST_STEPS: f64 = 4.0;

/// A part of a control interval in which the command does not change.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    /// Its length, s.
    pub(super) step: f64,
    /// Whether the newest command that acts in this interval acts here, or the one before.
    pub(super) newest: bool,
    /// Whether the motion is shown at its end.
    pub(super) shown: bool,
}

/// Whole intervals of delay, and the parts of each interval: none longer than `longest` seconds, and
/// one that ends where the motion is shown.
pub(super) fn parts(
    stage: &VirtualStage,
    timing: &Timing,
    shown_at: f64,
    longest: f64,
) -> (usize, Vec<Part>) {
    let dt = timing.interval;
    let Delay { whole, fraction } = Delay::new(timing.delay + stage.sensor.delay, dt);
    let lag = stage.amplifier.lag();
    let mut edges = vec![fraction, 1.0, shown_at];
    let edge = |after: f64| [fraction + after, fraction + after - 1.0];
    for settled in SETTLING {
        edges.extend(edge(settled * lag / dt));
    }
    // While it slews, and a command that its lag rounds off.
    let slewing = (stage.amplifier.high - stage.amplifier.low) / stage.amplifier.slew / dt;
    let slews = if slewing > 1.0 / MOST_STEPS { MOST_STEPS } else { 1.0 };
    edges.extend(edge(slewing.min(1.0)));
    let count = libm::ceil(dt / longest).clamp(slews, MOST_STEPS);
    if count > 1.0 {
        let mut edge = 1.0;
        while edge < count {
            edges.push(edge / count);
            edge += 1.0;
        }
    }
    edges.retain(|edge| *edge > SAME && *edge < 1.0 + SAME);
    edges.sort_by(f64::total_cmp);
    edges.dedup_by(|a, b| (*a - *b).abs() < SAME);
    let mut from = 0.0;
    let mut parts = Vec::with_capacity(edges.len());
    for edge in edges {
        let shown = (edge - shown_at).abs() < SAME;
        parts.push(Part { step: (edge - from) * dt, newest: from > fraction - SAME, shown });
        from = edge;
    }
    (whole, parts)
}

/// Step of a loop by itself, s: as accurate as the parts.
pub(super) fn coarse_step(stage: &VirtualStage, interval: f64) -> f64 {
    let amplifier = &stage.amplifier;
    let slewing = (amplifier.high - amplifier.low) / amplifier.slew;
    let settling = [amplifier.lag(), slewing].into_iter().filter(|time| *time > 0.0);
    let longest = settling.fold(interval, f64::min) / MOST_STEPS;
    stage.step.max(longest)
}
