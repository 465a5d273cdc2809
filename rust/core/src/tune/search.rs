//! The search for the settings of a controller.
//!
//! A swarm (Standard Particle Swarm Optimisation 2011) looks for the settings with the least figure
//! over all tasks among those that keep what is required; where none does, for those nearest to it.
//! Then it looks again, about the best place, in a smaller box. Loops are only simulated for
//! controllers that keep the margins.

use piezotrack_control::Controller;
use rayon::prelude::*;

use super::judge::{Judge, Ready};
use super::requirements::{PlantSet, Requirements, Robustness};
use super::run_metrics::RunMetrics;
use super::settings::{Setting, Sought, Template};
use crate::error::{Error, Result, not_negative};
use crate::identify::{Swarm, SwarmSettings};
use crate::parts::Law;
use crate::signal::{Stop, index};

/// Quantity that is made small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// The error, m rms over all tasks.
    Rms,
    /// The largest error in any task, m.
    Largest,
    /// The change of the command from sample to sample, V rms over all tasks.
    Effort,
    /// Nothing is simulated: the integral gain is made large, so that the integral of the error
    /// after a step disturbance is small. Panagopoulos, Astrom and Hagglund 2002,
    /// doi 10.1049/ip-cta:20020013.
    Disturbance,
}

/// The controller of an axis, of which settings are sought.
#[derive(Clone, Debug)]
pub struct SoughtController {
    /// Settings that are sought, and their ranges.
    pub sought: Vec<Sought>,
    /// Controller of which they are settings.
    pub template: Template,
    /// Plants for which it keeps what is required.
    pub plants: PlantSet,
}

/// A search for settings.
#[derive(Clone, Debug)]
pub struct Tuning<'a> {
    /// One controller, or those of both axes of an XY stage.
    pub axes: Vec<SoughtController>,
    /// Motions that the controllers are judged by.
    pub tasks: Vec<Judge<'a>>,
    /// Requirements on every loop.
    pub required: Requirements,
    /// Quantity that is made small.
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

/// Settings with their values.
pub type Settings = Vec<(Setting, f64)>;

/// Settings that were found.
#[derive(Clone, Debug)]
pub struct Found {
    /// Each setting with its value, for each axis.
    pub settings: Vec<Settings>,
    /// The controllers with them.
    pub controllers: Vec<Controller<Law>>,
    /// Margins that they keep over the plants, which are numbered through all axes.
    pub robustness: Robustness,
    /// Their figures in each task; empty where they do not keep the margins.
    pub figures: Vec<RunMetrics>,
    /// How far they are from what is required: 1 or less where they keep it.
    pub excess: f64,
    /// Their figure, m, or V of [`Aim::Effort`]; of [`Aim::Disturbance`] 1 over the integral gain,
    /// m/V.
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
    settings: Vec<Settings>,
    controllers: Option<Vec<Controller<Law>>>,
    robustness: Option<Robustness>,
    figures: Vec<RunMetrics>,
    excess: f64,
    cost: f64,
}

impl Tried {
    /// Rank that the swarm makes small: any that keeps what is required comes before any that does
    /// not, and one that keeps the margins before one that does not.
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
        let tasks: Result<Vec<Ready<'_>>> = self.tasks.iter().map(Judge::ready).collect();
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
            let mut swarm = Swarm::new(settings, self.dimensions(), self.seed, look)?;
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
        let (_, Tried { settings, controllers, robustness, figures, excess, cost }) =
            best.ok_or_else(none)?;
        Ok(Found {
            settings,
            controllers: controllers.ok_or_else(none)?,
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
        not_negative("effort", self.effort, "m/V")?;
        self.axes.iter().flat_map(|axis| &axis.sought).try_for_each(Sought::validate)?;
        if self.dimensions() == 0 {
            return Err(Error::parameter("sought", "nothing", "one setting or more"));
        }
        if self.tasks.is_empty() && self.aim != Aim::Disturbance {
            return Err(Error::parameter("tasks", "none", "a reference or more"));
        }
        if self.tasks.iter().any(|task| task.axes() != self.axes.len()) {
            return Err(Error::parameter("axes", self.axes.len(), "as many as the tasks have"));
        }
        Ok(())
    }

    /// Settings of all axes.
    fn dimensions(&self) -> usize {
        self.axes.iter().map(|axis| axis.sought.len()).sum()
    }

    /// Looks at the controllers of some places.
    fn tried(
        &self,
        places: &[&Vec<f64>],
        tasks: &[Ready<'_>],
        stop: Stop<'_>,
    ) -> Result<Vec<Tried>> {
        let mut tried: Vec<Tried> = places.par_iter().map(|place| self.judged(place)).collect();
        if self.aim == Aim::Disturbance {
            return Ok(tried);
        }
        let robust: Vec<usize> = (0..tried.len())
            .filter(|i| tried.get(*i).is_some_and(|one| one.excess <= 1.0))
            .collect();
        let of_axis = |axis: usize| -> Vec<Controller<Law>> {
            robust.iter().filter_map(|i| Some(tried[*i].controllers.as_ref()?[axis])).collect()
        };
        let controllers: Vec<_> = (0..self.axes.len()).map(of_axis).collect();
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
        let mut rest = place;
        let mut settings: Vec<Settings> = Vec::with_capacity(self.axes.len());
        for axis in &self.axes {
            let (own, others) = rest.split_at_checked(axis.sought.len()).unwrap_or_default();
            let at = |(one, place): (&Sought, &f64)| (one.setting, one.at(*place));
            settings.push(axis.sought.iter().zip(own).map(at).collect());
            rest = others;
        }
        let pairs = || self.axes.iter().zip(&settings);
        let controllers: Option<Vec<Controller<Law>>> =
            pairs().map(|(axis, settings)| axis.template.controller(settings)).collect();
        let robustness = controllers.as_ref().and_then(|all| self.robustness(all));
        let excess = robustness.map_or(f64::INFINITY, |one| one.excess(&self.required));
        let integral = |one: &Settings| {
            let found = one.iter().find(|(setting, _)| *setting == Setting::Integral);
            found.map_or(f64::INFINITY, |(_, gain)| 1.0 / gain)
        };
        let cost = settings.iter().map(integral).fold(0.0, f64::max);
        Tried { settings, controllers, robustness, figures: Vec::new(), excess, cost }
    }

    /// Worst margins over the plants of all axes.
    fn robustness(&self, controllers: &[Controller<Law>]) -> Option<Robustness> {
        let mut before = 0;
        let mut all = None;
        for (axis, controller) in self.axes.iter().zip(controllers) {
            let one = axis.plants.robustness(controller).numbered_from(before);
            before += axis.plants.len();
            all = Some(all.map_or(one, |found: Robustness| found.worse(one)));
        }
        all
    }

    /// Figure over all tasks, and how far from what is required.
    fn figure(&self, all: &[RunMetrics], excess: f64) -> (f64, f64) {
        let count = index(all.len()).max(1.0);
        let mean = |of: fn(&RunMetrics) -> f64| {
            libm::sqrt(all.iter().map(|one| of(one) * of(one)).sum::<f64>() / count)
        };
        let most = |of: fn(&RunMetrics) -> f64| all.iter().map(of).fold(0.0, f64::max);
        let error = match self.aim {
            Aim::Rms | Aim::Disturbance => mean(|one| one.rms),
            Aim::Largest => most(|one| one.largest),
            Aim::Effort => mean(|one| one.effort),
        };
        let weighs = self.effort > 0.0 && self.aim != Aim::Effort;
        let changes = if weighs { self.effort * mean(|one| one.effort) } else { 0.0 };
        let mut excess = excess.max(most(|one| one.slew) / self.required.slew);
        excess = excess.max(mean(|one| one.rms) / self.required.largest_error);
        let clipped = most(|one| one.clipped);
        if clipped > self.required.largest_saturation {
            excess = excess.max(1.0 + clipped - self.required.largest_saturation);
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
