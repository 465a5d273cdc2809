//! The search for the settings of a controller.
//!
//! Several searches, each from another side, look for the settings with the least figure over all
//! tasks among those that keep what is required; where none does, for those nearest to it. Where
//! none agrees with the best, there are more of them. The last search begins with the best of all.
//! Loops are only simulated for controllers that keep the margins.

use piezotrack_control::Controller;
use rayon::prelude::*;

use super::judge::{Judge, Ready};
use super::requirements::{PlantSet, Requirements, Robustness};
use super::run_metrics::RunMetrics;
use super::settings::{Setting, Settings, Sought, Template};
use super::sides::{ROUNDS, Run, Side, Tried, agreeing, spread};
use crate::error::{Error, Result, not_negative, positive};
use crate::parts::Law;
use crate::signal::{Stop, index};

/// Quantity that is made small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// The error, m rms over the motions.
    Rms,
    /// The largest error in any motion, m.
    Largest,
    /// The change of the command from sample to sample, V rms over the motions.
    Effort,
    /// Nothing is simulated: the integral gain is made large, so that the integral of the error
    /// after a step disturbance is small. Panagopoulos, Astrom and Hagglund 2002,
    /// doi 10.1049/ip-cta:20020013. Of a law that damps what a disturbance at any frequency causes is
    /// to be as small, see [`PlantSet::disturbed`].
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
    /// Motions that the controllers are judged by: all of the first stage, then of the second, and so
    /// on.
    pub tasks: Vec<Judge<'a>>,
    /// Stages that follow the motions; the worst of them counts.
    pub stages: usize,
    /// Requirements on every loop.
    pub required: Requirements,
    /// Quantity that is made small.
    pub aim: Aim,
    /// Errors that are tolerable along each motion, m, in shares of which [`Aim::Rms`] counts them;
    /// where empty all count alike.
    pub tolerances: Vec<f64>,
    /// Error that a volt (rms) of change from sample to sample is worth, m/V.
    pub effort: f64,
    /// Candidates that each search begins with.
    pub particles: usize,
    /// Each search evolves for as many candidates as this times those it begins with, and is refined
    /// for as many again at most.
    pub iterations: usize,
    /// Seed of the searches.
    pub seed: u64,
    /// Places of the unit box that one search begins with besides random ones.
    pub starts: Vec<Vec<f64>>,
}

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
    /// Independent searches, from different sides; a last one begins with the best of them all.
    pub searches: usize,
    /// How many of them end within 2 % of the best.
    pub agreeing: usize,
    /// By how much each of them ends above the best, as a share of it, the least first; infinite where
    /// one keeps not what is required.
    pub spread: Vec<f64>,
}

/// Fewest candidates that a search begins with: a trial is made of four.
const LEAST_PARTICLES: usize = 4;

/// Most candidates of a search.
const MOST_CANDIDATES: usize = 1_000_000_000;

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
        let mut runs: Vec<Run> = Vec::new();
        let mut counts = (0, 0);
        let mut history = Vec::new();
        for (sides, times) in ROUNDS {
            if stop() {
                break;
            }
            if sides != [Side::Joint] && agreeing(&runs).1 > 1 {
                continue;
            }
            let begun = self.begin(sides, times, &runs);
            runs.extend(begun);
            loop {
                let pending: Vec<Vec<Vec<f64>>> = runs.iter().map(Run::pending).collect();
                let places: Vec<&Vec<f64>> = pending.iter().flatten().collect();
                if places.is_empty() || stop() {
                    break;
                }
                let tried = self.tried(&places, &tasks, stop)?;
                counts.0 += tried.len();
                counts.1 += tried.iter().map(|one| one.figures.len()).sum::<usize>();
                let mut rest = tried.as_slice();
                for (run, places) in runs.iter_mut().zip(&pending).filter(|(_, it)| !it.is_empty())
                {
                    let (own, others) = rest.split_at_checked(places.len()).unwrap_or_default();
                    rest = others;
                    run.tell(places, own);
                }
                let leads = runs.iter().map(Run::rank).fold(f64::INFINITY, f64::min);
                for run in &mut runs {
                    run.give_up(leads);
                }
                let kept = runs.iter().filter_map(|run| run.best.as_ref());
                let kept = kept.filter(|(_, best)| best.excess <= 1.0);
                history.push(kept.map(|(_, best)| best.cost).fold(f64::INFINITY, f64::min));
            }
        }
        let ((searches, agreeing), spread) = (agreeing(&runs), spread(&runs));
        let best = runs.into_iter().filter_map(|run| run.best);
        let best = best.min_by(|(_, a), (_, b)| a.rank().total_cmp(&b.rank()));
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
            searches,
            agreeing,
            spread,
        })
    }

    /// Excess and cost of the controllers of some places of the unit box, as the search ranks them:
    /// of those beyond what is required the cost is infinite.
    ///
    /// # Errors
    /// Those of [`Tuning::search`]; names `place` where one has another number of coordinates.
    pub fn costs(&self, places: &[Vec<f64>], stop: Stop<'_>) -> Result<Vec<(f64, f64)>> {
        self.validate()?;
        self.validate_places(places)?;
        let tasks: Result<Vec<Ready<'_>>> = self.tasks.iter().map(Judge::ready).collect();
        let places: Vec<&Vec<f64>> = places.iter().collect();
        let tried = self.tried(&places, &tasks?, stop)?;
        let cost = |one: &Tried| if one.excess <= 1.0 { one.cost } else { f64::INFINITY };
        Ok(tried.iter().map(|one| (one.excess, cost(one))).collect())
    }

    /// Searches of a round, after those of the rounds before.
    fn begin(&self, sides: &[Side], times: usize, before: &[Run]) -> Vec<Run> {
        let sought = self.axes.iter().flat_map(|axis| &axis.sought);
        let settings: Vec<Setting> = sought.map(|one| one.setting).collect();
        let sizes = (self.particles, times * self.particles * self.iterations);
        let found = || before.iter().filter_map(|run| Some(run.best.as_ref()?.0.clone()));
        let begin = |(side, run): (&Side, u64)| {
            let starts = match side {
                Side::Inside => self.starts.clone(),
                Side::Joint => found().collect(),
                Side::Slow | Side::Fast | Side::Ahead => Vec::new(),
            };
            Run::new(*side, (self.seed, run), &settings, &starts, sizes)
        };
        sides.iter().zip(before.len() as u64..).map(begin).collect()
    }

    fn validate(&self) -> Result<()> {
        self.required.validate()?;
        not_negative("effort", self.effort, "m/V")?;
        self.axes.iter().flat_map(|axis| &axis.sought).try_for_each(Sought::validate)?;
        self.validate_places(&self.starts)?;
        for (name, count, least) in
            [("particles", self.particles, LEAST_PARTICLES), ("iterations", self.iterations, 1)]
        {
            if count < least {
                return Err(Error::parameter(name, count, format!("{least} or more")));
            }
        }
        if self.particles.saturating_mul(self.iterations) > MOST_CANDIDATES {
            let expected =
                format!("such that times the iterations {MOST_CANDIDATES} at most result");
            return Err(Error::parameter("particles", self.particles, expected));
        }
        if self.dimensions() == 0 {
            return Err(Error::parameter("sought", "nothing", "one setting or more"));
        }
        if self.tasks.is_empty() && self.aim != Aim::Disturbance {
            return Err(Error::parameter("tasks", "none", "a reference or more"));
        }
        if self.stages == 0 || !self.tasks.len().is_multiple_of(self.stages) {
            let expected = format!("a part of the {} tasks", self.tasks.len());
            return Err(Error::parameter("stages", self.stages, expected));
        }
        let motions = self.tasks.len() / self.stages;
        if !self.tolerances.is_empty() && motions > 0 && self.tolerances.len() != motions {
            let expected = format!("{motions}, one for each reference");
            return Err(Error::parameter("tolerances", self.tolerances.len(), expected));
        }
        for tolerance in &self.tolerances {
            positive("tolerances", *tolerance, "m")?;
        }
        if self.tasks.iter().any(|task| task.axes() != self.axes.len()) {
            return Err(Error::parameter("axes", self.axes.len(), "as many as the tasks have"));
        }
        Ok(())
    }

    fn validate_places(&self, places: &[Vec<f64>]) -> Result<()> {
        let expected = self.dimensions();
        let Some(place) = places.iter().find(|place| place.len() != expected) else {
            return Ok(());
        };
        Err(Error::Shape {
            name: "place".into(),
            found: format!("{} coordinates", place.len()),
            expected: format!("{expected}, as many as are sought"),
        })
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
        let mut cost = settings.iter().map(integral).fold(0.0, f64::max);
        if let (Aim::Disturbance, Some(all), true) = (self.aim, &controllers, excess <= 1.0) {
            // That integral is not all where a mode may ring, as one inside of the loop may.
            let damps = |(_, one): &(_, &Controller<Law>)| matches!(one.feedback, Law::Damped(_));
            let damped = self.axes.iter().zip(all).filter(damps);
            cost = damped.map(|(axis, one)| axis.plants.disturbed(one)).fold(cost, f64::max);
        }
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

    /// Figure of the worst stage, and how far from what is required.
    fn figure(&self, all: &[RunMetrics], excess: f64) -> (f64, f64) {
        let motions = (all.len() / self.stages.max(1)).max(1);
        all.chunks(motions).fold((0.0, excess), |(cost, excess), own| {
            let (figure, beyond) = self.figure_of(own, excess);
            // Also where it is not a number.
            (
                if figure <= cost { cost } else { figure },
                if beyond <= excess { excess } else { beyond },
            )
        })
    }

    /// Rms error over the motions, each in shares of what is tolerable, m.
    fn weighted(&self, all: &[RunMetrics]) -> f64 {
        let pairs = || all.iter().zip(&self.tolerances);
        let squares: f64 = pairs().map(|(one, most)| (one.rms / most) * (one.rms / most)).sum();
        let weights: f64 = pairs().map(|(_, most)| 1.0 / (most * most)).sum();
        libm::sqrt(squares / weights)
    }

    /// Figure of a stage over its motions, and how far from what is required.
    fn figure_of(&self, all: &[RunMetrics], excess: f64) -> (f64, f64) {
        let count = index(all.len()).max(1.0);
        let mean = |of: fn(&RunMetrics) -> f64| {
            libm::sqrt(all.iter().map(|one| of(one) * of(one)).sum::<f64>() / count)
        };
        let most = |of: fn(&RunMetrics) -> f64| all.iter().map(of).fold(0.0, f64::max);
        let error = match self.aim {
            Aim::Rms | Aim::Disturbance if !self.tolerances.is_empty() => self.weighted(all),
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
