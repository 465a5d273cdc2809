//! The search by swarms: their candidates, costs and ends.

use super::progress::{Monitor, Outcome, Progress, StopReason};
use crate::error::{Error, Result};
use crate::identify::cost::residual_sums::Costs;
use crate::identify::cost::several_records::Records;
use crate::identify::parameters::candidate::Point;
use crate::identify::swarm::{Swarm, SwarmSettings};
use crate::signal::Stop;

/// One swarm of a search.
struct Run {
    swarm: Swarm,
    /// Of its best candidate.
    costs: Costs,
    evaluations: usize,
    failures: usize,
    history: Vec<f64>,
    reason: Option<StopReason>,
}

impl Run {
    fn new(settings: &SwarmSettings, coordinates: usize, seed: u64, run: u64) -> Result<Self> {
        Ok(Self {
            swarm: Swarm::new(settings.clone(), coordinates, seed, run)?,
            costs: Costs::FAILED,
            evaluations: 0,
            failures: 0,
            history: Vec::new(),
            reason: None,
        })
    }

    /// Points whose costs the swarm needs now; none once it has ended.
    fn candidates(&self) -> Vec<Point> {
        if self.reason.is_some() {
            return Vec::new();
        }
        let asked = self.swarm.ask().zip(self.swarm.limits());
        asked.filter_map(|(place, limit)| Some(Point { place: place?.to_vec(), limit })).collect()
    }

    /// Takes the costs of its candidates, in their order.
    fn tell(&mut self, costs: &[Costs]) {
        self.evaluations += costs.len();
        self.failures += costs.iter().filter(|costs| costs.rms.is_infinite()).count();
        let best = costs.iter().min_by(|a, b| a.rms.total_cmp(&b.rms));
        if let Some(best) = best.filter(|best| best.rms < self.swarm.best().1) {
            self.costs = *best;
        }
        let mut computed = costs.iter();
        let costs: Vec<f64> = self
            .swarm
            .ask()
            .map(|place| place.and_then(|_| computed.next()).map_or(f64::INFINITY, |c| c.rms))
            .collect();
        self.swarm.tell(&costs);
        self.history.push(self.swarm.best().1);
        if self.swarm.stalled() {
            self.reason = Some(StopReason::Stalled);
        } else if self.swarm.exhausted() {
            self.reason = Some(StopReason::Iterations);
        }
    }

    fn outcome(self, records: &Records<'_>) -> Outcome {
        let (place, rms) = self.swarm.best();
        Outcome {
            theta: records.theta(place),
            place: place.to_vec(),
            costs: Costs { rms, ..self.costs },
            iterations: self.swarm.iteration(),
            evaluations: self.evaluations,
            polish_evaluations: 0,
            failures: self.failures,
            history: self.history,
            reason: self.reason.unwrap_or(StopReason::Interrupted),
        }
    }
}

/// Searches the box of a problem with one or more swarms, whose particles share the lanes.
///
/// A run gives the same bits whatever the other runs, the threads and the instruction set.
///
/// # Errors
/// [`Error::Parameter`] for settings that cannot be used, [`Error::Numerical`] where no candidate
/// could be simulated.
pub fn search(
    records: &Records<'_>,
    settings: &SwarmSettings,
    seed: u64,
    runs: usize,
    monitor: &mut dyn Monitor,
    stop: Stop<'_>,
) -> Result<Vec<Outcome>> {
    let coordinates = records.coordinates().len();
    let runs: Result<Vec<Run>> =
        (0..runs as u64).map(|run| Run::new(settings, coordinates, seed, run)).collect();
    let mut runs = runs?;
    while runs.iter().any(|run| run.reason.is_none()) {
        let asked: Vec<Vec<Point>> = runs.iter().map(Run::candidates).collect();
        let costs = records.costs(&asked.concat(), stop);
        if stop() {
            break;
        }
        let mut rest = costs.as_slice();
        for (run, asked) in runs.iter_mut().zip(&asked) {
            let (own, others) = rest.split_at(asked.len());
            rest = others;
            if run.reason.is_none() {
                run.tell(own);
            }
        }
        if monitor.report(&progress(&runs, records, settings.iterations)).is_break() {
            for run in &mut runs {
                run.reason = Some(StopReason::Interrupted);
            }
        }
    }
    let simulations: usize = runs.iter().map(|run| run.evaluations).sum();
    let found = runs.iter().any(|run| run.swarm.best().1.is_finite());
    let interrupted =
        runs.iter().any(|run| matches!(run.reason, None | Some(StopReason::Interrupted)));
    if !found && !interrupted {
        return Err(Error::Numerical(format!(
            "not one of {simulations} simulations stayed finite: check bounds and units"
        )));
    }
    Ok(runs.into_iter().map(|run| run.outcome(records)).collect())
}

/// Where the runs stand together.
fn progress(runs: &[Run], records: &Records<'_>, iterations: usize) -> Progress {
    let best = runs.iter().map(|run| run.swarm.best()).min_by(|a, b| a.1.total_cmp(&b.1));
    let (place, cost) = best.unwrap_or((&[], f64::INFINITY));
    Progress {
        iteration: runs.iter().map(|run| run.swarm.iteration()).max().unwrap_or(0),
        iterations,
        evaluations: runs.iter().map(|run| run.evaluations).sum(),
        cost,
        theta: records.theta(place),
    }
}
