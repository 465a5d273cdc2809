//! Linearisation of the Dahl stage: its stiffness along the virgin branch.

use core::ops::RangeInclusive;

use super::stage::DahlStage;
use crate::design::LoopPlant;
use crate::error::{Error, Result, finite};
use crate::integrator::Mechanics;

/// The stage for small motions about the displacement `at` (m) on its virgin branch.
///
/// The hysteresis adds a spring of stiffness `dFh/dx = b1 q2`, with
/// `q2 = up exp(-a1 x/2) sin(b x)/b`, `b^2 = a2 - a1^2/4`, from (7) and (8) of Xu and Li
/// 2010; odd in x. With Table 1 it takes the gain from 1.80 to 1.44 um/V over the stroke.
///
/// # Errors
/// Names `at` where it is not finite or the stage has no positive stiffness there.
pub fn linearised(stage: &DahlStage, at: f64) -> Result<LoopPlant> {
    finite("at", at, "m")?;
    let stiffness = stage.mechanics.stiffness + virgin_slope(stage, at);
    if stiffness > 0.0 {
        let mechanics = Mechanics { stiffness, ..stage.mechanics };
        return LoopPlant::mechanical(&mechanics, stage.piezo_coefficient);
    }
    let expected = "a displacement at which K + dFh/dx is above 0";
    Err(Error::parameter("at", format!("{at} m"), expected))
}

/// The softest and the stiffest of [`linearised`] over a range of displacement, m.
///
/// The loop must be stable with both: the softest has the highest static gain.
///
/// # Errors
/// Names `range` where it is empty or not finite; as [`linearised`].
pub fn extremes(stage: &DahlStage, range: RangeInclusive<f64>) -> Result<[LoopPlant; 2]> {
    let (low, high) = (*range.start(), *range.end());
    if !(low.is_finite() && high.is_finite() && low <= high) {
        let shown = format!("{low} to {high} m");
        return Err(Error::parameter("range", shown, "two displacements in rising order"));
    }
    let mut softest = (f64::INFINITY, low);
    let mut stiffest = (f64::NEG_INFINITY, low);
    let turns = turning_points(stage);
    let inside = turns.iter().flat_map(|x| [*x, -x]).filter(|x| range.contains(x));
    for x in [low, high].into_iter().chain(inside) {
        let slope = virgin_slope(stage, x);
        softest = if slope < softest.0 { (slope, x) } else { softest };
        stiffest = if slope > stiffest.0 { (slope, x) } else { stiffest };
    }
    Ok([linearised(stage, softest.1)?, linearised(stage, stiffest.1)?])
}

/// dFh/dx on the virgin branch at `x`, N/m.
fn virgin_slope(stage: &DahlStage, x: f64) -> f64 {
    let (distance, half) = (x.abs(), 0.5 * stage.a1);
    let square = stage.a2 - half * half;
    let root = libm::sqrt(square.abs());
    let wave = if root * distance < 1e-8 {
        distance * libm::exp(-half * distance)
    } else if square > 0.0 {
        libm::exp(-half * distance) * libm::sin(root * distance) / root
    } else {
        // e^(-a1 x/2) sinh(b x)/b, without the overflow of sinh
        let (slow, fast) = (root - half, -root - half);
        0.5 * (libm::exp(slow * distance) - libm::exp(fast * distance)) / root
    };
    let slope = stage.b1 * stage.up * wave;
    if x < 0.0 { -slope } else { slope }
}

/// Distances at which the slope of the virgin branch turns: the first two, the highest there is.
fn turning_points(stage: &DahlStage) -> Vec<f64> {
    let half = 0.5 * stage.a1;
    let square = stage.a2 - half * half;
    let root = libm::sqrt(square.abs());
    if square > 0.0 {
        let first = libm::atan2(root, half) / root;
        return vec![first, first + core::f64::consts::PI / root];
    }
    if root > 0.0 && half > root {
        return vec![libm::atanh(root / half) / root];
    }
    if half > 0.0 && root == 0.0 { vec![1.0 / half] } else { Vec::new() }
}
