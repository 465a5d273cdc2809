//! Refits of a model to its own reading with resampled noise: a bootstrap with full refits.
//!
//! The noise is that of a sieve: an autoregression whose innovations are drawn with replacement
//! (Buehlmann 1997, doi 10.2307/3318584).

use crate::error::{Error, Result};
use crate::identify::cost::evaluator::Evaluator;
use crate::identify::cost::residual_sums::Costs;
use crate::identify::cost::several_records::{Member, Records};
use crate::identify::descent::levenberg_marquardt::{LocalRefinement, Polished};
use crate::identify::inference::Sieve;
use crate::identify::problem::Problem;
use crate::identify::records::record::Record;
use crate::identify::search::descents::Start;
use crate::math::{Draws, on_all_threads};
use crate::signal::index;

/// Share of the cost that is little for an iteration of a refit to gain.
const LITTLE: f64 = 1e-6;

impl LocalRefinement<'_> {
    /// Fits what a place foretells with resampled noise, `draws` times, each from that place on.
    ///
    /// `noises` has the noise of each record at its samples that count, m.
    ///
    /// # Errors
    /// [`Error::Data`] where a noise has another length than its record, or the place cannot be
    /// simulated.
    pub fn refits(
        &self,
        place: &[f64],
        costs: Costs,
        noises: &[Vec<f64>],
        (draws, seed): (u32, u64),
    ) -> Result<Vec<Polished>> {
        let members = self.records.members();
        let counts: Vec<usize> =
            members.iter().map(|one| one.evaluator.record().samples()).collect();
        if noises.iter().map(Vec::len).ne(counts.iter().copied()) {
            return Err(Error::Data("a noise has another length than its record".into()));
        }
        let foretold = |one: &Member<'_>| {
            let record = one.evaluator.record();
            let residual =
                one.evaluator.residual(&one.own(place), &costs.creep_weights, self.stop)?;
            let mut y = record.y.to_vec();
            for (y, left) in y[record.window.clone()].iter_mut().zip(&residual) {
                *y -= left;
            }
            Some(y)
        };
        let foretold: Option<Vec<Vec<f64>>> = members.iter().map(foretold).collect();
        let foretold =
            foretold.ok_or_else(|| Error::Data("the fitted model cannot be simulated".into()))?;
        let sieves: Vec<Sieve> = noises.iter().map(|noise| Sieve::of(noise)).collect();
        let scale = index(self.records.samples()) / self.freedom(place.len());
        let draws: Vec<u32> = (0..draws).collect();
        let found = on_all_threads(&draws, &|&draw| {
            let mut stream = Draws::at(seed, u64::from(draw), 0, 0, 1);
            let mut all = foretold.clone();
            for ((y, one), (sieve, &count)) in
                all.iter_mut().zip(members).zip(sieves.iter().zip(&counts))
            {
                let record = one.evaluator.record();
                let mut noise = sieve.drawn(count, scale, &mut stream).into_iter();
                for k in record.window.clone().filter(|&k| record.counts(k)) {
                    y[k] += noise.next().unwrap_or(0.0);
                }
            }
            let records: Vec<Record<'_>> = members
                .iter()
                .zip(&all)
                .map(|(one, y)| Record { y, ..one.evaluator.record().clone() })
                .collect();
            // A prior is an observation of its own.
            let mut problems: Vec<Problem> = self.records.problems().cloned().collect();
            let known = self.records.theta(place);
            for i in 0..self.records.problem().relations.priors.len() {
                let deviation = stream.normal_deviate();
                for prior in problems.iter_mut().map(|one| &mut one.relations.priors[i]) {
                    prior.mean = prior.width.mul_add(deviation, known.0[prior.parameter]);
                }
            }
            let evaluators = members.iter().zip(&records).zip(&problems);
            let evaluators = evaluators.map(|((one, record), problem)| {
                Evaluator::stepped(record, problem, one.evaluator.stepping)
            });
            let records = Records::new(evaluators.collect());
            let local = LocalRefinement { records: &records, stop: self.stop };
            local.descended_from(&[Start::free(place, LITTLE)]).pop()
        });
        Ok(found.into_iter().flatten().collect())
    }

    /// Samples less what was fitted to them, with an offset of each record, and the size of its drift.
    fn freedom(&self, count: usize) -> f64 {
        let own =
            |problem: &Problem| usize::from(problem.offset) + usize::from(problem.has_drift());
        let fitted = count + self.records.problems().map(own).sum::<usize>();
        index(self.records.samples().saturating_sub(fitted).max(1))
    }
}
