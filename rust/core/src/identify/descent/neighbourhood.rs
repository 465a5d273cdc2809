//! Normal equations of all records at a place, with the curvature along the steps from it.

use super::acceleration::Neighbourhood;
use super::normal::{Block, Extended, Normal, STEPS, Spot};
use super::priors::add_priors;
use crate::identify::cost::journal::remembered;
use crate::identify::cost::several_records::{Member, Records};
use crate::identify::records::creep_weights::CreepWeights;
use crate::signal::{Stop, index};

/// Most rows of Jacobians in memory at a time.
const MOST_TOGETHER: usize = 400_000;

/// Places whose Jacobians are computed together however long a record is: their simulations fill the
/// threads.
const FEWEST_TOGETHER: usize = 4;

impl Records<'_> {
    /// Normal equations at a place with its weights of the creep, by central differences, with the
    /// priors, for which the mean square of the deviations is the variance of one; `None` where a
    /// neighbour cannot be simulated.
    pub(in crate::identify) fn normal(
        &self,
        place: &[f64],
        creep_weights: CreepWeights,
        stop: Stop<'_>,
    ) -> Option<Normal> {
        let block = |one: &Member<'_>| one.evaluator.central(&one.own(place), creep_weights, stop);
        let computed = || {
            let blocks: Option<Vec<Block>> = self.members().iter().map(block).collect();
            let joined = blocks.map(|all| Extended::of(self.members(), &all, place.len()));
            vec![joined.map(|joined| self.with_priors(place, &joined))]
        };
        remembered(self.journal(), (1, place.len()), stop, computed).pop().flatten()
    }

    /// Normal equations at each of some places by one-sided differences, with the curvature along the
    /// steps from it, all simulated side by side; `None` for one where a neighbour cannot be simulated.
    pub(in crate::identify) fn normals(
        &self,
        spots: &[Spot],
        stop: Stop<'_>,
    ) -> Vec<Option<Normal>> {
        let questions = (spots.len(), self.coordinates().len());
        let rows = self.members().iter().map(|one| one.evaluator.rows()).sum::<usize>();
        let together = (MOST_TOGETHER / rows.max(1)).max(FEWEST_TOGETHER);
        let parts = || spots.chunks(together).flat_map(|part| self.differentiated(part, stop));
        remembered(self.journal(), questions, stop, || parts().collect())
    }

    fn differentiated(&self, spots: &[Spot], stop: Stop<'_>) -> Vec<Option<Normal>> {
        let mut all: Vec<Option<Vec<Block>>> = spots.iter().map(|_| Some(Vec::new())).collect();
        for one in self.members() {
            let own: Vec<(Vec<f64>, CreepWeights)> =
                spots.iter().map(|spot| (one.own(&spot.place), spot.creep_weights)).collect();
            for (blocks, block) in all.iter_mut().zip(one.evaluator.one_sided(&own, stop)) {
                match (blocks.as_mut(), block) {
                    (Some(blocks), Some(block)) => blocks.push(block),
                    _ => *blocks = None,
                }
            }
        }
        let local = |(spot, blocks): (&Spot, Option<Vec<Block>>)| {
            let blocks = blocks?;
            let extended = Extended::of(self.members(), &blocks, spot.place.len());
            let mut normal = self.with_priors(&spot.place, &extended);
            spot.held.into_iter().for_each(|coordinate| normal.hold(coordinate));
            Some(Neighbourhood { blocks, extended, normal })
        };
        let local: Vec<Option<Neighbourhood>> = spots.iter().zip(all).map(local).collect();
        self.with_bends(spots, local, stop)
    }

    /// The equations about the best weights of the creep, with the priors.
    fn with_priors(&self, place: &[f64], of: &Extended) -> Normal {
        let (mut square, mut slope) = of.eliminated(&of.slope);
        // Some rows stand for all samples, and weigh less against the priors by their share.
        let variance = of.squares / index(self.samples());
        add_priors(self, place, variance, &mut square, &mut slope);
        Normal { square, slope, bends: [const { None }; STEPS] }
    }
}
