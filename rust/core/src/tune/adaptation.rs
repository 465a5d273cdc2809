//! A search about a place that adapts to the shape of the valley: CMA-ES.
//!
//! Hansen, The CMA Evolution Strategy: A Tutorial, 2016, arXiv 1604.00772, equations (38) to (53).
//! Places beyond an end of the unit box are reflected.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::math::Draws;
use crate::signal::index;

/// Candidates of a generation.
const CANDIDATES: usize = 12;
/// Which of a run's streams it draws from.
const STREAM: u64 = 1 << 40;
/// Share by which the best of some generations is to improve for the search to go on.
const LEAST_GAIN: f64 = 5e-4;
/// Widest step at which it ends, as a share of the box.
const NARROW: f64 = 1e-4;

/// Mean, step and covariance.
#[derive(Clone, Debug)]
pub(super) struct Adaptation {
    seed: u64,
    run: u64,
    budget: usize,
    evaluated: usize,
    generation: u64,
    mean: DVector<f64>,
    step: f64,
    covariance: DMatrix<f64>,
    basis: DMatrix<f64>,
    widths: DVector<f64>,
    path: DVector<f64>,
    step_path: DVector<f64>,
    pending: Vec<Vec<f64>>,
    /// Best rank after each generation.
    history: Vec<f64>,
}

impl Adaptation {
    /// About a place of the unit box.
    pub(super) fn new((seed, run): (u64, u64), place: &[f64], step: f64, budget: usize) -> Self {
        let n = place.len();
        let mut out = Self {
            seed,
            run,
            budget,
            evaluated: 0,
            generation: 0,
            mean: DVector::from_column_slice(place),
            step,
            covariance: DMatrix::identity(n, n),
            basis: DMatrix::identity(n, n),
            widths: DVector::from_element(n, 1.0),
            path: DVector::zeros(n),
            step_path: DVector::zeros(n),
            pending: Vec::new(),
            history: Vec::new(),
        };
        out.pending = out.drawn();
        out
    }

    /// The places whose ranks it needs now.
    pub(super) fn pending(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.pending.iter()
    }

    /// Candidates so far.
    pub(super) fn evaluated(&self) -> usize {
        self.evaluated
    }

    /// Whether the budget is used up, or nothing is to be gained any more.
    pub(super) fn ended(&self) -> bool {
        let n = index(self.mean.len());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small")]
        let patience = (10.0 + 30.0 * n / index(CANDIDATES)) as usize;
        let stalled = self.history.len() > patience && {
            let now = self.history[self.history.len() - 1];
            let before = self.history[self.history.len() - 1 - patience];
            now >= before * (1.0 - LEAST_GAIN)
        };
        self.evaluated >= self.budget || stalled || self.step * self.widths.max() < NARROW
    }

    fn drawn(&self) -> Vec<Vec<f64>> {
        let n = self.mean.len();
        (0..CANDIDATES as u64)
            .map(|k| {
                let run = self.run | STREAM;
                let mut draws = Draws::at(self.seed, run, self.generation, k, CANDIDATES as u64);
                let normals = DVector::from_vec(draws.normals(n));
                let way = &self.basis * self.widths.component_mul(&normals);
                self.mean
                    .iter()
                    .zip(&way)
                    .map(|(mean, way)| inside(mean + self.step * way))
                    .collect()
            })
            .collect()
    }

    /// Takes the ranks of the places that were pending, in their order.
    pub(super) fn tell(&mut self, ranks: &[f64]) {
        let n = index(self.mean.len());
        let mut order: Vec<usize> = (0..self.pending.len()).collect();
        order.sort_by(|a, b| ranks[*a].total_cmp(&ranks[*b]));
        self.evaluated += self.pending.len();
        let best = ranks[order[0]];
        self.history.push(self.history.last().map_or(best, |last| last.min(best)));
        let parents = self.pending.len() / 2;
        let half = libm::log(0.5 * (index(self.pending.len()) + 1.0));
        let raw: Vec<f64> = (1..=self.pending.len()).map(|i| half - libm::log(index(i))).collect();
        let (good, bad) = raw.split_at(parents);
        let total: f64 = good.iter().sum();
        let effective = total * total / good.iter().map(|one| one * one).sum::<f64>();
        let for_path = (4.0 + effective / n) / (n + 4.0 + 2.0 * effective / n);
        let for_step = (effective + 2.0) / (n + effective + 5.0);
        let one_rank = 2.0 / ((n + 1.3) * (n + 1.3) + effective);
        let many = 2.0 * (effective - 2.0 + 1.0 / effective) / ((n + 2.0) * (n + 2.0) + effective);
        let many = many.min(1.0 - one_rank);
        let more = libm::sqrt((effective - 1.0) / (n + 1.0)) - 1.0;
        let damping = 1.0 + 2.0 * more.max(0.0) + for_step;
        let expected = libm::sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));
        // What is worse makes its direction narrower, and the covariance stays positive.
        let lost: f64 = bad.iter().sum();
        let effective_bad = lost * lost / bad.iter().map(|one| one * one).sum::<f64>();
        let most = (1.0 + one_rank / many)
            .min(1.0 + 2.0 * effective_bad / (effective + 2.0))
            .min((1.0 - one_rank - many) / (n * many));
        let weights: Vec<f64> = good
            .iter()
            .map(|one| one / total)
            .chain(bad.iter().map(|one| -most * one / lost))
            .collect();
        let ways: Vec<DVector<f64>> = order
            .iter()
            .map(|i| (DVector::from_column_slice(&self.pending[*i]) - &self.mean) / self.step)
            .collect();
        let mut way = DVector::zeros(self.mean.len());
        for (weight, one) in weights[..parents].iter().zip(&ways) {
            way += *weight * one;
        }
        self.mean += self.step * &way;
        let whitened = |way: &DVector<f64>| -> DVector<f64> {
            (self.basis.transpose() * way).component_div(&self.widths)
        };
        let white = &self.basis * whitened(&way);
        let shares: Vec<f64> = weights
            .iter()
            .zip(&ways)
            .map(|(weight, one)| {
                let length = whitened(one).norm_squared();
                if *weight < 0.0 { *weight * n / length.max(1e-12) } else { *weight }
            })
            .collect();
        self.step_path = (1.0 - for_step) * &self.step_path
            + libm::sqrt(for_step * (2.0 - for_step) * effective) * white;
        self.generation += 1;
        #[expect(clippy::cast_precision_loss, reason = "a few hundred")]
        let faded = 1.0 - libm::pow(1.0 - for_step, 2.0 * self.generation as f64);
        let length = self.step_path.norm();
        let slow = length / libm::sqrt(faded) < (1.4 + 2.0 / (n + 1.0)) * expected;
        let pushed = if slow { libm::sqrt(for_path * (2.0 - for_path) * effective) } else { 0.0 };
        self.path = (1.0 - for_path) * &self.path + pushed * &way;
        let missed = if slow { 0.0 } else { one_rank * for_path * (2.0 - for_path) };
        let sum: f64 = weights.iter().sum();
        self.covariance *= 1.0 + missed - one_rank - many * sum;
        self.covariance += one_rank * &self.path * self.path.transpose();
        for (share, one) in shares.iter().zip(&ways) {
            self.covariance += many * *share * one * one.transpose();
        }
        self.step *= libm::exp((for_step / damping * (length / expected - 1.0)).min(1.0));
        let parts = SymmetricEigen::new(self.covariance.clone());
        self.widths = parts.eigenvalues.map(|one| libm::sqrt(one.max(1e-20)));
        self.basis = parts.eigenvectors;
        self.pending = self.drawn();
    }
}

/// The place in the unit box that a coordinate is reflected to.
fn inside(value: f64) -> f64 {
    let folded = libm::fabs(libm::fmod(value, 2.0));
    if folded > 1.0 { 2.0 - folded } else { folded }
}
