//! The search for the settings of a controller.
//!
//! A swarm (Standard Particle Swarm Optimisation 2011) looks for the settings with the least figure
//! over all tasks among those that keep what is required; where none does, for those nearest to it.
//! Then it looks again, about the best place, in a smaller box. Loops are only simulated for
//! controllers that keep the margins.

use piezotrack_control::Controller;
use rayon::prelude::*;

use super::loops::{Figures, ReadyTask, Task};
use super::requirements::{PlantSet, Requirements, Robustness};
use super::settings::{Setting, Sought, Template};
use crate::error::{Error, Result};
use crate::identify::{Swarm, SwarmSettings};
use crate::signal::{Stop, index};
use crate::simulate::Law;

/// What is made small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// The error, m rms over all tasks.
    Rms,
    /// The largest error in any task, m.
    Largest,
    /// Nothing is simulated: the integral gain is made large, so that the integral of the error
    /// after a step disturbance is small. Panagopoulos, Astrom and Hagglund 2002,
    /// doi 10.1049/ip-cta:20020013.
    Disturbance,
}

/// A search for settings.
#[derive(Clone, Debug)]
pub struct Tuning<'a> {
    /// What is sought in which range.
    pub sought: Vec<Sought>,
    /// What they are settings of.
    pub template: Template,
    /// Motions that the controllers are judged by.
    pub tasks: Vec<Task<'a>>,
    /// Plants for which every controller keeps what is required.
    pub plants: PlantSet,
    /// What that is.
    pub required: Requirements,
    /// What is made small.
    pub aim: Aim,
    /// Error that a volt (rms) of change from sample to sample is worth, m/V.
    pub effort: f64,
    /// Particles of the swarm.
    pub particles: usize,
    /// Iterations of either look.
    pub iterations: usize,
    /// Seed of the swarm.
    pub seed: u64,
}

/// Settings that were found.
#[derive(Clone, Debug)]
pub struct Found {
    /// Each setting with its value.
    pub settings: Vec<(Setting, f64)>,
    /// The controller with them.
    pub controller: Controller<Law>,
    /// What it keeps over the plants.
    pub robustness: Robustness,
    /// Its figures in each task; empty where it does not keep the margins.
    pub figures: Vec<Figures>,
    /// How far it is from what is required: 1 or less where it keeps it.
    pub excess: f64,
    /// Its figure, m; of [`Aim::Disturbance`] 1 over the integral gain, m/V.
    pub cost: f64,
    /// Controllers looked at, and loops simulated.
    pub candidates: usize,
    /// Loops simulated.
    pub loops: usize,
    /// Best figure after each iteration; infinite as long as none keeps what is required.
    pub history: Vec<f64>,
}

/// A candidate and what was found of it.
#[derive(Clone, Debug)]
struct Tried {
    settings: Vec<(Setting, f64)>,
    controller: Option<Controller<Law>>,
    robustness: Option<Robustness>,
    figures: Vec<Figures>,
    excess: f64,
    cost: f64,
}

impl Tried {
    /// What the swarm makes small: any that keeps what is required before any that does not, and
    /// one that keeps the margins before one that does not.
    fn rank(&self) -> f64 {
        match (self.excess <= 1.0, self.figures.is_empty()) {
            (true, _) => self.cost,
            (false, false) => 1e6 * self.excess,
            (false, true) => 1e12 * self.excess,
        }
    }
}

/// Half the width of the box of the second look, as a share of the first.
const NEARER: f64 = 0.08;

/// Iterations without a gain after which a look ends.
const STALLED: usize = 40;

impl Tuning<'_> {
    /// Searches; the result has the same bits whatever the threads. Where `stop` said so, the best
    /// so far.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming what cannot be used; where memory does not suffice.
    pub fn search(&self, stop: Stop<'_>) -> Result<Found> {
        self.validate()?;
        let tasks: Result<Vec<ReadyTask<'_>>> = self.tasks.iter().map(Task::ready).collect();
        let tasks = tasks?;
        let mut best: Option<(Vec<f64>, Tried)> = None;
        let mut counts = (0, 0);
        let mut history = Vec::new();
        for look in 0..2_u64 {
            let around = (look > 0).then(|| best.as_ref().map(|(place, _)| place.clone()));
            let settings = SwarmSettings {
                particles: self.particles,
                iterations: self.iterations,
                stall_iterations: STALLED,
                min_improvement: 0.0,
                ..SwarmSettings::spso_2011()
            };
            let mut swarm = Swarm::new(settings, self.sought.len(), self.seed, look)?;
            while !(swarm.exhausted() || swarm.stalled() || stop()) {
                let asked: Vec<Option<Vec<f64>>> = swarm
                    .ask()
                    .map(|place| place.map(|place| within(place, around.as_ref())))
                    .collect();
                let places: Vec<&Vec<f64>> = asked.iter().flatten().collect();
                let tried = self.tried(&places, &tasks, stop)?;
                counts.0 += tried.len();
                counts.1 += tried.iter().map(|one| one.figures.len()).sum::<usize>();
                let mut ranks = tried.iter().map(Tried::rank);
                let costs: Vec<f64> = asked
                    .iter()
                    .map(|place| place.as_ref().and_then(|_| ranks.next()).unwrap_or(f64::INFINITY))
                    .collect();
                for (place, one) in places.iter().zip(&tried) {
                    let beaten = best.as_ref().is_none_or(|(_, best)| one.rank() < best.rank());
                    if beaten {
                        best = Some(((*place).clone(), one.clone()));
                    }
                }
                swarm.tell(&costs);
                let kept = best.as_ref().filter(|(_, best)| best.excess <= 1.0);
                history.push(kept.map_or(f64::INFINITY, |(_, best)| best.cost));
            }
        }
        let none = || Error::Numerical("no controller could be built from the settings".into());
        let (_, Tried { settings, controller, robustness, figures, excess, cost }) =
            best.ok_or_else(none)?;
        Ok(Found {
            settings,
            controller: controller.ok_or_else(none)?,
            robustness: robustness.ok_or_else(none)?,
            figures,
            excess,
            cost,
            candidates: counts.0,
            loops: counts.1,
            history,
        })
    }

    fn validate(&self) -> Result<()> {
        self.required.validate()?;
        self.sought.iter().try_for_each(Sought::validate)?;
        if self.sought.is_empty() {
            return Err(Error::parameter("sought", "nothing", "one setting or more"));
        }
        if self.tasks.is_empty() && self.aim != Aim::Disturbance {
            return Err(Error::parameter("tasks", "none", "a reference or more"));
        }
        Ok(())
    }

    /// Looks at the controllers of some places.
    fn tried(
        &self,
        places: &[&Vec<f64>],
        tasks: &[ReadyTask<'_>],
        stop: Stop<'_>,
    ) -> Result<Vec<Tried>> {
        let mut tried: Vec<Tried> = places.par_iter().map(|place| self.judged(place)).collect();
        if self.aim == Aim::Disturbance {
            return Ok(tried);
        }
        let robust: Vec<usize> = (0..tried.len())
            .filter(|i| tried.get(*i).is_some_and(|one| one.excess <= 1.0))
            .collect();
        let controllers: Vec<Controller<Law>> =
            robust.iter().filter_map(|i| tried[*i].controller).collect();
        for task in tasks {
            let figures = task.figures(&controllers, stop)?;
            for (i, figures) in robust.iter().zip(figures) {
                tried[*i].figures.push(figures);
            }
        }
        for i in robust {
            let one = &mut tried[i];
            (one.cost, one.excess) = self.figure(&one.figures, one.excess);
        }
        Ok(tried)
    }

    /// The controller of a place, and what it keeps over the plants.
    fn judged(&self, place: &[f64]) -> Tried {
        let settings: Vec<(Setting, f64)> = self
            .sought
            .iter()
            .zip(place)
            .map(|(one, place)| (one.setting, one.at(*place)))
            .collect();
        let controller = self.template.controller(&settings);
        let robustness = controller.as_ref().map(|one| self.plants.robustness(one));
        let excess = robustness.map_or(f64::INFINITY, |one| one.excess(&self.required));
        let integral = settings.iter().find(|(setting, _)| *setting == Setting::Integral);
        let cost = integral.map_or(f64::INFINITY, |(_, gain)| 1.0 / gain);
        Tried { settings, controller, robustness, figures: Vec::new(), excess, cost }
    }

    /// Figure over all tasks, and how far from what is required.
    fn figure(&self, all: &[Figures], excess: f64) -> (f64, f64) {
        let count = index(all.len()).max(1.0);
        let mean = |of: fn(&Figures) -> f64| {
            libm::sqrt(all.iter().map(|one| of(one) * of(one)).sum::<f64>() / count)
        };
        let most = |of: fn(&Figures) -> f64| all.iter().map(of).fold(0.0, f64::max);
        let error = match self.aim {
            Aim::Rms | Aim::Disturbance => mean(|one| one.rms),
            Aim::Largest => most(|one| one.largest),
        };
        let changes = if self.effort > 0.0 { self.effort * mean(|one| one.effort) } else { 0.0 };
        let mut excess = excess.max(most(|one| one.slew) / self.required.slew);
        let clipped = most(|one| one.clipped);
        if clipped > self.required.clipped {
            excess = excess.max(1.0 + clipped - self.required.clipped);
        }
        let cost = error + changes;
        if cost.is_finite() { (cost, excess) } else { (f64::INFINITY, f64::INFINITY) }
    }
}

/// A place of the unit box, or of a smaller one about another place.
fn within(place: &[f64], around: Option<&Option<Vec<f64>>>) -> Vec<f64> {
    let Some(Some(middle)) = around else { return place.to_vec() };
    let nearer = |(place, middle): (&f64, &f64)| {
        let low = (middle - NEARER).clamp(0.0, 1.0 - 2.0 * NEARER);
        low + 2.0 * NEARER * place
    };
    place.iter().zip(middle).map(nearer).collect()
}
