//! Thresholds of the plays where the record has them.
//!
//! Between two thresholds of a grid, a play of the stage shows as weights on both. Neighbours are
//! gathered into one at their centre of weight, which is then moved to where the deviation is
//! least, as long as that explains the record better with fewer plays.

use super::fit::Fit;
use crate::models::WeightedPlays;
use crate::signal::index;

/// Share of the largest weight below which a play does nothing.
const IDLE: f64 = 1e-3;

/// Share of the deviation that moved thresholds have to take away.
const GAIN: f64 = 0.03;

/// Most plays whose thresholds are moved.
const MOST: usize = 12;

/// Steps of a threshold, in distances of the grid, from the first to the last.
const FIRST_STEP: f64 = 0.4;
const LAST_STEP: f64 = 0.005;

/// Gain of a step below which weights are settled.
const ROUGH: f64 = 1e-3;

/// Gathers plays and moves their thresholds where that explains the record better; `None` where
/// stopped.
pub(super) fn gather<M: WeightedPlays>(fit: &mut Fit<'_, M>) -> Option<()> {
    let weights = &fit.x[fit.layout().weights()][1..];
    let gathered = centres(&fit.thresholds, weights);
    if gathered.is_empty() || gathered.len() > MOST || fit.thresholds.len() < 2 {
        return Some(());
    }
    let grid = fit.thresholds[fit.thresholds.len() - 1] / index(fit.thresholds.len());
    let mut trial = fit.clone();
    trial.restructure(|trial| trial.thresholds = gathered);
    trial.settle(ROUGH)?;
    let mut step = FIRST_STEP;
    while step > LAST_STEP {
        let before = trial.rms;
        for j in 0..trial.thresholds.len() {
            for change in [step * grid, -step * grid] {
                if let Some(moved) = moved(&trial, j, change)? {
                    trial = moved;
                    break;
                }
            }
        }
        if trial.rms > (1.0 - GAIN) * before {
            step *= 0.4;
        }
    }
    if trial.rms < (1.0 - GAIN) * fit.rms {
        *fit = trial;
    }
    Some(())
}

/// The fit with one threshold moved, if that is better.
#[expect(clippy::option_option, reason = "stopped, or not better")]
fn moved<'a, M: WeightedPlays>(
    fit: &Fit<'a, M>,
    j: usize,
    change: f64,
) -> Option<Option<Fit<'a, M>>> {
    let mut thresholds = fit.thresholds.clone();
    let to = thresholds[j] + change;
    let above = j == 0 || to > thresholds[j - 1];
    let below = j + 1 == thresholds.len() || to < thresholds[j + 1];
    if !(to > 0.0 && above && below) {
        return Some(None);
    }
    thresholds[j] = to;
    let weights = fit.x[fit.layout().weights()].to_vec();
    let mut trial = fit.clone();
    trial.restructure(|trial| trial.thresholds = thresholds);
    let part = trial.layout().weights();
    trial.x[part].copy_from_slice(&weights);
    trial.settle(ROUGH)?;
    Some((trial.rms < fit.rms).then_some(trial))
}

/// Centres of the weights of neighbours that work.
fn centres(thresholds: &[f64], weights: &[f64]) -> Vec<f64> {
    let least = IDLE * weights.iter().fold(0.0, |most: f64, weight| most.max(*weight));
    let mut all: Vec<f64> = Vec::new();
    let mut i = 0;
    while i < weights.len() {
        if weights[i] <= least {
            i += 1;
            continue;
        }
        let pair = i + 1 < weights.len() && weights[i + 1] > least;
        let end = if pair { i + 2 } else { i + 1 };
        let sum: f64 = weights[i..end].iter().sum();
        let moment: f64 = weights[i..end].iter().zip(&thresholds[i..end]).map(|(w, r)| w * r).sum();
        all.push(moment / sum);
        i = end;
    }
    all
}
