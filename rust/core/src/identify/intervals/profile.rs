//! Profiles of the cost: its least value with one coordinate held, all others fitted again.
//!
//! From the minimum on to both bounds, each descent begins where those before it lead to: Venzon and
//! Moolgavkar 1988, doi 10.2307/2347496; Raue et al. 2009, doi 10.1093/bioinformatics/btp358.

use nalgebra::{DMatrix, DVector};

use super::chain::{Chain, ProfilePoint};
use crate::identify::descent::levenberg_marquardt::LocalRefinement;
use crate::identify::descent::normal::Normal;
use crate::identify::search::descents::Start;
use crate::signal::index;

/// Times that a lower minimum is followed.
const FOLLOWED: usize = 4;

/// Share of the threshold by which a minimum has to be lower.
const LOWER: f64 = 0.01;

/// Share of the curvature of a coordinate below which the others stand for it.
const HIDDEN: f64 = 1e-9;

/// Profile along one coordinate.
#[derive(Clone, Debug)]
pub struct Profile {
    /// In ascending order of the coordinate, the minimum among them.
    pub points: Vec<ProfilePoint>,
    /// Coordinates of the outermost ends, where the squared cost has risen to its threshold; `None`
    /// where it stays below it up to the bound.
    pub ends: (Option<f64>, Option<f64>),
}

/// Profiles along several coordinates, from one minimum.
#[derive(Clone, Debug)]
pub struct Profiles {
    /// The lowest minimum that was met.
    pub minimum: ProfilePoint,
    /// In the order of the arguments.
    pub profiles: Vec<Profile>,
}

impl LocalRefinement<'_> {
    /// Profiles from the minimum next to a place, along coordinates with the relative rises of the
    /// squared cost at the ends of their intervals; `None` where stopped, where the place cannot be
    /// simulated, or where nothing is left of the records.
    ///
    /// A lower minimum that a profile meets is taken for all of them.
    #[must_use]
    pub fn profiles(&self, place: &[f64], wanted: &[(usize, f64)]) -> Option<Profiles> {
        let least = wanted.iter().fold(1.0, |least: f64, (_, threshold)| least.min(*threshold));
        let settled = |place: &[f64]| {
            let found = self.descended_from(&[Start::free(place, 1e-3 * least)]).pop()?;
            let found = self.polish(&found.place, found.costs);
            let usable = found.costs.rms > 0.0 && found.costs.rms.is_finite();
            usable.then_some(ProfilePoint { place: found.place, costs: found.costs })
        };
        let mut minimum = settled(place)?;
        for round in 0..=FOLLOWED {
            let mut chains = self.chains(&minimum, wanted)?;
            let lower = self.follow(&mut chains, &minimum, LOWER * least, round < FOLLOWED);
            if (self.stop)() {
                return None;
            }
            if let Some(lower) = lower {
                minimum = settled(&lower.place)?;
                continue;
            }
            let mut chains = chains.into_iter();
            let mut profiles = Vec::with_capacity(wanted.len());
            while let (Some(below), Some(above)) = (chains.next(), chains.next()) {
                let ends = (below.end(), above.end());
                let points = below.points().rev().chain(above.points().skip(1)).collect();
                profiles.push(Profile { points, ends });
            }
            return Some(Profiles { minimum, profiles });
        }
        None
    }

    /// Beginnings of the profiles, two for each.
    fn chains(&self, minimum: &ProfilePoint, wanted: &[(usize, f64)]) -> Option<Vec<Chain>> {
        let normal = self.records.normal(&minimum.place, minimum.costs.creep_weights, self.stop)?;
        let factor = self.records.problem().relations.factor(&self.records.theta(&minimum.place));
        let rms = minimum.costs.rms / factor;
        let squares = rms * rms * index(self.records.samples());
        let both = |&(coordinate, threshold): &(usize, f64)| {
            let (curvature, along) = Self::curvature(&normal, coordinate);
            let foretold = (threshold * squares / curvature).sqrt();
            [-1.0, 1.0].map(|way| {
                let begin = (foretold, along.clone());
                Chain::new((coordinate, way), threshold, minimum.clone(), begin)
            })
        };
        Some(wanted.iter().flat_map(both).collect())
    }

    /// Curvature of the sum of squares along a coordinate with all others fitted, and the change of
    /// all with it.
    fn curvature(normal: &Normal, coordinate: usize) -> (f64, DVector<f64>) {
        let count = normal.slope.len();
        let seen = |i: &usize| *i != coordinate && normal.square[(*i, *i)] > 0.0;
        let others: Vec<usize> = (0..count).filter(seen).collect();
        let mut along = DVector::zeros(count);
        along[coordinate] = 1.0;
        let whole = normal.square[(coordinate, coordinate)];
        let square = DMatrix::from_fn(others.len(), others.len(), |i, j| {
            let value = normal.square[(others[i], others[j])];
            if i == j { value * (1.0 + HIDDEN) } else { value }
        });
        let right = DVector::from_fn(others.len(), |i, _| normal.square[(others[i], coordinate)]);
        let Some(decomposed) = square.cholesky() else { return (whole, along) };
        let change = decomposed.solve(&right);
        let left = whole - change.dot(&right);
        if left <= HIDDEN * whole {
            return (HIDDEN * whole, along);
        }
        for (&i, change) in others.iter().zip(change.iter()) {
            along[i] = -change;
        }
        (left, along)
    }

    /// Follows profiles side by side to their ends, or until one of them meets a cost below that of the
    /// minimum, which is returned.
    fn follow(
        &self,
        chains: &mut [Chain],
        minimum: &ProfilePoint,
        margin: f64,
        ends_below: bool,
    ) -> Option<ProfilePoint> {
        let enough = minimum.costs.rms * (1.0 - margin).max(0.0).sqrt();
        loop {
            let mut active: Vec<(&mut Chain, Start)> = chains
                .iter_mut()
                .filter_map(|chain| chain.next().map(|start| (chain, start)))
                .collect();
            if active.is_empty() || (self.stop)() {
                return None;
            }
            let starts: Vec<Start> = active.iter().map(|(_, start)| start.clone()).collect();
            let mut lowest: Option<ProfilePoint> = None;
            for ((chain, _), found) in active.iter_mut().zip(self.descended_from(&starts)) {
                let point = ProfilePoint { place: found.place, costs: found.costs };
                let below = lowest.as_ref().map_or(enough, |one| one.costs.rms);
                if point.costs.rms < below {
                    lowest = Some(point.clone());
                }
                chain.take(point);
            }
            if ends_below && lowest.is_some() {
                return lowest;
            }
        }
    }
}
