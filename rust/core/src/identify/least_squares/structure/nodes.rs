//! The nodes of a fit: thresholds of plays, or levels; how many, and where.

use core::ops::Range;

use crate::identify::least_squares::common::Common;
use crate::identify::least_squares::settings::{
    HISTORY_GAIN, NodesKind, ROUGH, SAME, STEPS, Settings,
};
use crate::identify::least_squares::solving::fit::Fit;
use crate::math::on_all_threads;
use crate::models::{MOST_PLAYS, Nodes};
use crate::signal::index;

/// Share of the deviation on what they were not fitted to that other plays have to take away.
const PLAYS_GAIN: f64 = 0.03;

/// Plays of a record of many samples, and of another one.
const MANY_SAMPLES: usize = 800;
const PLAYS: usize = 20;
const FEW_PLAYS: usize = 10;

/// Intervals between levels to begin with, and those that are tried.
const LEVELS: usize = 6;
const TRIED_LEVELS: [(usize, f64); 1] = [(12, 1.0)];

/// Numbers of plays that are tried, and the power by which their thresholds are spread.
const TRIED: [(usize, f64); 3] = [(PLAYS, 1.0), (PLAYS, 1.5), (MANY_PLAYS, 1.0)];

/// As many as there can be, and one.
const MANY_PLAYS: usize = MOST_PLAYS - 1;

/// Least travel of a play that moves once, as a share of its threshold.
const LEAST_TRAVEL: f64 = 0.01;

/// Rounds in which plays are gathered: each halves the distance between neighbours.
const ROUNDS: usize = 5;

/// Weight of a play that counts, as a share of all.
const LEAST_WEIGHT: f64 = 1e-3;

/// Nodes to begin with: few plays take a rounded loop for a lag, many need samples.
pub(super) fn few_or_many(common: &Common<'_>) -> usize {
    let few = common.samples() < MANY_SAMPLES;
    match common.of.nodes() {
        Nodes::None => 0,
        Nodes::Thresholds if few => FEW_PLAYS,
        Nodes::Thresholds => PLAYS,
        Nodes::Levels => LEVELS,
    }
}

/// Thresholds up to half of the drive's range; a `power` above 1 has more of them near 0.
///
/// Where the stage goes beyond where it was before, plays of half of the range and more move once
/// and never back: with `once` one further threshold stands for all of them.
/// Levels divide all of the range that the drives reach, with `once` one stands beyond it.
pub(super) fn spread(common: &Common<'_>, (count, power): (usize, f64), once: bool) -> Vec<f64> {
    match common.of.nodes() {
        Nodes::None => Vec::new(),
        Nodes::Thresholds => {
            let part = |i: usize| libm::pow(index(i) / index(count + 1), power);
            (1..=count + usize::from(once)).map(|i| reach(common) * part(i)).collect()
        }
        Nodes::Levels => {
            let (low, high) = common.reached();
            let mut levels: Vec<f64> =
                (0..=count).map(|i| low + (high - low) * index(i) / index(count)).collect();
            levels.extend(beyond(common).filter(|_| once));
            levels.sort_by(f64::total_cmp);
            levels
        }
    }
}

/// The level as far from 0 V as the drives reach to the other side, where they do not reach it:
/// relays that switch once and never back lie between the two.
fn beyond(common: &Common<'_>) -> Option<f64> {
    let (low, high) = common.reached();
    let least = (high - low) / index(TRIED_LEVELS[0].0);
    if high + low > least {
        Some(-high)
    } else if high + low < -least {
        Some(-low)
    } else {
        None
    }
}

/// Whether the play or the relays of a node move once and never back.
fn moves_once(common: &Common<'_>, node: f64) -> bool {
    match common.of.nodes() {
        Nodes::None => false,
        Nodes::Thresholds => node >= reach(common),
        Nodes::Levels => {
            let (low, high) = common.reached();
            !(low..=high).contains(&node)
        }
    }
}

/// Whether some of the plays or relays move once and never back.
fn has_once(fit: &Fit<'_>) -> bool {
    fit.nodes.iter().any(|node| moves_once(fit.common, *node))
}

/// Adds the plays or relays that move once where they explain more than a share `gain` of the
/// deviation: less would give them a weight by chance.
pub(super) fn add_once(fit: &mut Fit<'_>, gain: f64) -> Option<()> {
    let (common, mut trial) = (fit.common, fit.clone());
    match common.of.nodes() {
        Nodes::Thresholds => {
            let kept = fit.x[fit.layout().weights()].to_vec();
            trial.restructure(|trial| trial.nodes.push(reach(common)));
            trial.x[..kept.len()].copy_from_slice(&kept);
        }
        Nodes::Levels if beyond(common).is_some() => {
            trial.restructure(|trial| trial.nodes = spread(common, (LEVELS, 1.0), true));
        }
        Nodes::Levels | Nodes::None => return Some(()),
    }
    trial.settle(ROUGH)?;
    if trial.rms < (1.0 - gain) * fit.rms && !hardly_moves(&trial) {
        *fit = trial;
    }
    Some(())
}

/// Whether the play that moves once hardly moves, by the weight that it has: a drive that begins in
/// the middle of its range moves it by rounding errors.
fn hardly_moves(fit: &Fit<'_>) -> bool {
    let common = fit.common;
    let most = common.stroke / (LEAST_TRAVEL * reach(common));
    let weights = &fit.x[fit.layout().weights()];
    common.of.nodes() == Nodes::Thresholds
        && has_once(fit)
        && weights.last().is_some_and(|weight| *weight > most)
}

/// Leaves out the plays or relays that move once where they explain too little beside what was
/// chosen after them: what they stood for may be explained by now.
pub(super) fn drop_once(fit: &mut Fit<'_>, settings: &Settings) -> Option<()> {
    if settings.nodes != NodesKind::Auto || !has_once(fit) {
        return Some(());
    }
    let mut bare = fit.clone();
    bare.restructure(|bare| bare.nodes.retain(|node| !moves_once(fit.common, *node)));
    bare.settle(ROUGH)?;
    if (1.0 - HISTORY_GAIN) * bare.rms <= fit.rms || hardly_moves(fit) {
        *fit = bare;
    }
    Some(())
}

/// Numbers of nodes that are tried.
fn tried(nodes: Nodes) -> &'static [(usize, f64)] {
    match nodes {
        Nodes::None => &[],
        Nodes::Thresholds => &TRIED,
        Nodes::Levels => &TRIED_LEVELS,
    }
}

/// Half of the drive's range, V.
fn reach(common: &Common<'_>) -> f64 {
    let (low, high) = common.reached();
    0.5 * (high - low)
}

/// Where the last third of a window begins, which is foretold from what is before it.
pub(super) fn split(window: &Range<usize>) -> usize {
    window.start + 2 * window.len() / 3
}

/// Other plays, where they foretell a part of the window that they were not fitted to.
pub(super) fn choose_nodes(fit: &mut Fit<'_>, settings: &Settings) -> Option<()> {
    if settings.nodes != NodesKind::Auto {
        return Some(());
    }
    let mut here = fit.clone();
    here.windows = fit.windows.iter().map(|one| one.start..split(one)).collect();
    here.settle_rigid(STEPS)?;
    let later: Vec<Range<usize>> = fit.windows.iter().map(|one| split(one)..one.end).collect();
    let foretold = |fit: &Fit<'_>| {
        let mut trial = fit.clone();
        trial.windows.clone_from(&later);
        trial.deviation()
    };
    let once = has_once(fit);
    let trials = |&(count, power): &(usize, f64)| {
        let mut trial = here.clone();
        set_nodes(&mut trial, spread(here.common, (count, power), once));
        trial.settle_rigid(STEPS)?;
        let few = if count == MANY_PLAYS { gathered(&trial)? } else { None };
        let both = [Some(trial), few].into_iter().flatten();
        Some(both.map(|trial| (foretold(&trial), trial)).collect::<Vec<_>>())
    };
    let found: Option<Vec<_>> =
        on_all_threads(tried(fit.common.of.nodes()), &trials).into_iter().collect();
    let least = (1.0 - PLAYS_GAIN) * foretold(&here);
    let mut better: Vec<(f64, Fit<'_>)> =
        found?.into_iter().flatten().filter(|(rms, _)| *rms < least).collect();
    better.sort_by(|one, other| one.0.total_cmp(&other.0));
    for (_, mut trial) in better {
        trial.windows.clone_from(&fit.windows);
        trial.settle(ROUGH)?;
        // What foretells the last third has to explain all of the window too.
        if trial.rms < SAME * fit.rms {
            *fit = trial;
            break;
        }
    }
    Some(())
}

/// Gives a fit other nodes. The weight of each play goes to its neighbours among them, or all that
/// depends on the weights would begin about a stage without plays.
fn set_nodes(fit: &mut Fit<'_>, nodes: Vec<f64>) {
    let before = (fit.nodes.clone(), fit.x[fit.layout().weights()].to_vec());
    fit.restructure(|fit| fit.nodes = nodes);
    let single = |weights: usize, nodes: &[f64]| weights == nodes.len() + 1;
    let weights = &before.1;
    if fit.common.of.nodes() != Nodes::Thresholds
        || !single(weights.len(), &before.0)
        || !single(fit.layout().weights, &fit.nodes)
    {
        return;
    }
    // What passes without a play is one of threshold 0.
    fit.x[0] = weights[0];
    for (at, weight) in before.0.iter().zip(&weights[1..]) {
        let above = fit.nodes.partition_point(|node| node <= at);
        let low = if above == 0 { 0.0 } else { fit.nodes[above - 1] };
        let share = fit.nodes.get(above).map_or(0.0, |high| (at - low) / (high - low));
        fit.x[above] += (1.0 - share) * weight;
        if share > 0.0 {
            fit.x[above + 1] += share * weight;
        }
    }
}

/// Few plays in place of many that are spread evenly, where their weights gather about few
/// thresholds: two neighbours stand for one play between them. `None` where they do not gather.
#[expect(clippy::option_option, reason = "stopped, or none")]
fn gathered<'a>(fit: &Fit<'a>) -> Option<Option<Fit<'a>>> {
    // Weights that are not those of single plays gather nowhere.
    if fit.layout().weights <= fit.nodes.len() {
        return Some(None);
    }
    let mut trial = fit.clone();
    let mut gap = reach(fit.common) / index(fit.nodes.len() + 1);
    for _ in 0..ROUNDS {
        let middle = middles(&trial, 1.1 * gap);
        if middle.is_empty() || 2 * middle.len() > MOST_PLAYS {
            return Some(None);
        }
        gap *= 0.5;
        let mut pairs: Vec<f64> =
            middle.iter().flat_map(|at| [f64::max(at - 0.5 * gap, 0.0), at + 0.5 * gap]).collect();
        pairs.sort_by(f64::total_cmp);
        set_nodes(&mut trial, pairs);
        trial.settle_rigid(STEPS)?;
    }
    let middle = middles(&trial, 1.1 * gap);
    set_nodes(&mut trial, middle);
    trial.settle_rigid(STEPS)?;
    Some(Some(trial))
}

/// Thresholds of plays whose weights count, those of two neighbours `width` or less apart as one.
fn middles(fit: &Fit<'_>, width: f64) -> Vec<f64> {
    let weights = &fit.x[1..fit.layout().weights];
    let least = LEAST_WEIGHT * weights.iter().sum::<f64>();
    let counts = fit.nodes.iter().zip(weights).filter(|(_, weight)| **weight > least);
    let mut found: Vec<f64> = Vec::new();
    let mut alone: Option<(f64, f64)> = None;
    for (&at, &weight) in counts {
        alone = match alone {
            Some((before, other)) if at - before <= width => {
                found.push((before * other + at * weight) / (other + weight));
                None
            }
            Some((before, _)) => {
                found.push(before);
                Some((at, weight))
            }
            None => Some((at, weight)),
        };
    }
    found.extend(alone.map(|(at, _)| at));
    found
}
