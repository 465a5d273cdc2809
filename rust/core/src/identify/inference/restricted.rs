//! Autoregressions of the noises of a fit, by restricted maximum likelihood.
//!
//! A fit takes a part of the noise along, most of it where a value acts as slowly as the noise does:
//! an autoregression of the residual has too little slow noise. Restricted likelihood counts all
//! changes of the values as possible: Cheang and Reinsel 2000, doi 10.1080/01621459.2000.10474318. It
//! is found by expectation and maximisation: Dempster, Laird and Rubin 1977, doi
//! 10.1111/j.2517-6161.1977.tb01600.x.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::autoregression::Autoregression;
use super::inverse::Inverse;
use super::linearised::Linearised;
use crate::math::on_all_threads;
use crate::signal::index;

/// Rounds at most, and change of the coefficients below which there are no more.
const ROUNDS: usize = 100;
const SETTLED: f64 = 1e-5;

/// Variance of a noise over that of what the fit has left of it, at most: where a record does not show
/// how slow the noise is, its likelihood grows towards a drift without end.
const MOST_TAKEN: f64 = 4.0;

/// Halvings of a range of factors of the poles.
const HALVINGS: usize = 30;

/// Steps of a round at most, the least part of one, and the least gain of the logarithm of the
/// likelihood, twice.
const STEPS: usize = 20;
const LEAST_PART: f64 = 1e-3;
const LEAST_GAIN: f64 = 1e-6;

/// Change of a coefficient for a derivative by differences.
const NUDGE: f64 = 1e-6;

/// Autoregressions of the noises of records, from those of their residuals.
///
/// `precision` is the inverse of the covariance of the values that was known besides the records.
pub(super) fn restricted(
    records: &[Linearised],
    precision: &DMatrix<f64>,
    begun: Vec<Autoregression>,
) -> Vec<Autoregression> {
    let places: Vec<usize> = (0..records.len()).collect();
    let products = on_all_threads(&places, &|&r| Products::of(&records[r], begun[r].order()));
    let mut noises = begun;
    for _ in 0..ROUNDS {
        let Some(next) = improved(&products, precision, &noises) else { break };
        let pairs = || next.iter().zip(&noises);
        let changes = pairs().flat_map(|(a, b)| a.coefficients.iter().zip(&b.coefficients));
        let shares = pairs().map(|(a, b)| a.variance / b.variance - 1.0);
        let change = changes.map(|(a, b)| a - b).chain(shares).map(f64::abs).fold(0.0, f64::max);
        noises = next;
        if change < SETTLED {
            break;
        }
    }
    noises
}

/// One round; `None` where none is better.
fn improved(
    products: &[Products],
    precision: &DMatrix<f64>,
    noises: &[Autoregression],
) -> Option<Vec<Autoregression>> {
    let count = precision.nrows();
    let whitened = products.iter().zip(noises).map(|(one, noise)| one.whitened(noise));
    let squares = whitened.collect::<Option<Vec<DMatrix<f64>>>>()?;
    // What each record tells of the values, and what all of them do.
    let told: Vec<DMatrix<f64>> = squares.iter().map(|square| alone(square, count)).collect();
    let mut all = DMatrix::zeros(count + 1, count + 1);
    all.view_mut((0, 0), (count, count)).copy_from(precision);
    all = told.iter().fold(all, |sum, one| sum + one);
    let each = products.iter().zip(&squares).zip(&told).zip(noises);
    each.map(|(((products, square), told), noise)| {
        let others = &all - told;
        let last = square.nrows() - 1;
        let mut normal = square.view((0, 0), (last, last)).into_owned();
        let mut right = square.view((0, last), (last, 1)).into_owned();
        for i in 0..count {
            right[i] += others[(i, count)];
            for j in 0..count {
                normal[(i, j)] += others[(i, j)];
            }
        }
        let spread = Inverse::of(&normal).matrix;
        let moved = &spread * right;
        // Expected products of the noise: of its mean, and of what the values leave open.
        let mut expected = DMatrix::zeros(last + 1, last + 1);
        expected.view_mut((0, 0), (last, last)).copy_from(&spread);
        let mean = DVector::from_fn(last + 1, |i, _| if i == last { 1.0 } else { -moved[i] });
        expected += &mean * mean.transpose();
        products.likelier(&expected, noise)
    })
    .collect()
}

/// The block of the first values, and of the noise, without what belongs to the record alone.
fn alone(square: &DMatrix<f64>, count: usize) -> DMatrix<f64> {
    let last = square.nrows() - 1;
    let kept: Vec<usize> = (0..count).chain([last]).collect();
    let own: Vec<usize> = (count..last).collect();
    let block =
        |rows: &[usize], columns: &[usize]| square.select_rows(rows).select_columns(columns);
    let cross = block(&kept, &own);
    block(&kept, &kept) - &cross * Inverse::of(&block(&own, &own)).matrix * cross.transpose()
}

/// Products of the columns of a record, and of its noise as the last, at two lags.
struct Products {
    /// At lags i and j from i on, one i after the other, either column first; of the samples that have
    /// the whole order before them.
    lagged: Vec<DMatrix<f64>>,
    /// The samples before these.
    first: DMatrix<f64>,
    samples: usize,
    /// Mean square of the noise that the fit has left.
    left: f64,
}

impl Products {
    fn of(record: &Linearised, order: usize) -> Self {
        let columns: Vec<&Vec<f64>> =
            record.columns.iter().chain(&record.nuisance).chain([&record.noise]).collect();
        let samples = record.noise.len();
        let z = DMatrix::from_fn(samples, columns.len(), |t, i| columns[i][t]);
        let lags: Vec<usize> = (0..=order).collect();
        let mut forward = vec![on_all_threads(&lags, &|&lag| {
            z.rows(order, samples - order).tr_mul(&z.rows(order - lag, samples - order))
        })];
        // A step further into the past, a product at the beginning comes in and one at the end goes.
        for i in 0..order {
            let step = |j: usize| {
                let outer = |a: usize, b: usize| z.row(a).tr_mul(&z.row(b));
                let comes = outer(order - 1 - i, order - 1 - (i + j));
                &forward[i][j] + comes - outer(samples - 1 - i, samples - 1 - (i + j))
            };
            let next = (0..order - i).map(step).collect();
            forward.push(next);
        }
        let lagged = forward.iter().flatten().map(|one| (one + one.transpose()) * 0.5).collect();
        let left = record.noise.iter().map(|x| x * x).sum::<f64>() / index(samples);
        Self { lagged, first: z.rows(0, order).into_owned(), samples, left }
    }

    /// Products of the innovations that an autoregression makes of the columns, over their variance.
    fn whitened(&self, noise: &Autoregression) -> Option<DMatrix<f64>> {
        let filter = noise.filter();
        let size = self.first.ncols();
        let mut sum = DMatrix::zeros(size, size);
        for ((i, j), products) in pairs(noise.order()).zip(&self.lagged) {
            let both = if i == j { 1.0 } else { 2.0 };
            sum += products * (both * filter[i] * filter[j]);
        }
        for (t, (predictor, variance)) in noise.first()?.iter().enumerate() {
            let filter = predictor.filter();
            let error = |i: usize| (0..=t).map(|k| filter[k] * self.first[(t - k, i)]).sum::<f64>();
            let row = DVector::from_fn(size, |i, _| error(i));
            sum += &row * row.transpose() / *variance;
        }
        sum /= noise.variance;
        sum.iter().all(|entry| entry.is_finite()).then_some(sum)
    }

    /// The autoregression that expected products make likelier than another one; `None` where there
    /// is none.
    fn likelier(&self, expected: &DMatrix<f64>, than: &Autoregression) -> Option<Autoregression> {
        let order = than.order();
        let mut moments = DMatrix::zeros(order + 1, order + 1);
        for ((i, j), products) in pairs(order).zip(&self.lagged) {
            moments[(i, j)] = products.dot(expected);
            moments[(j, i)] = moments[(i, j)];
        }
        let likelihood = Likelihood {
            steps: moments.view((1, 1), (order, order)).into_owned().cholesky()?,
            moments,
            first: &self.first * expected * self.first.transpose(),
            samples: index(self.samples),
        };
        let best = likelihood.best(than)?;
        Some(limited(best, MOST_TAKEN * self.left))
    }
}

/// An autoregression, its poles moved in until its noise has a variance of `most`, if it has more.
fn limited(noise: Autoregression, most: f64) -> Autoregression {
    let moved = |factor: f64| {
        let mut power = 1.0;
        let mut other = noise.clone();
        for a in &mut other.coefficients {
            power *= factor;
            *a *= power;
        }
        other
    };
    let is_within = |one: &Autoregression| one.power().is_some_and(|power| power <= most);
    if is_within(&noise) {
        return noise;
    }
    let (mut within, mut beyond) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (within + beyond);
        if is_within(&moved(middle)) { within = middle } else { beyond = middle }
    }
    moved(within)
}

/// Expected likelihood of an autoregression.
struct Likelihood {
    /// Expected products of the noise at two lags, and of its first samples.
    moments: DMatrix<f64>,
    first: DMatrix<f64>,
    samples: f64,
    /// Of the part of the moments that the coefficients are multiplied with.
    steps: Cholesky<f64, Dyn>,
}

impl Likelihood {
    /// The autoregression with coefficients, and its cost: twice the negative logarithm of the
    /// likelihood, but for what all have.
    fn of(&self, coefficients: &DVector<f64>) -> Option<(Autoregression, f64)> {
        let of = Autoregression { coefficients: coefficients.as_slice().to_vec(), variance: 1.0 };
        let filter = DVector::from_vec(of.filter());
        let mut squares = filter.dot(&(&self.moments * &filter));
        let mut cost = 0.0;
        for (t, (predictor, variance)) in of.first()?.iter().enumerate() {
            let filter = predictor.filter();
            let of =
                |k: usize| (0..=t).map(|j| filter[j] * self.first[(t - k, t - j)]).sum::<f64>();
            squares += (0..=t).map(|k| filter[k] * of(k)).sum::<f64>() / variance;
            cost += libm::log(*variance);
        }
        let variance = squares / self.samples;
        let sound = variance > 0.0 && variance.is_finite();
        cost += self.samples * libm::log(variance);
        sound.then_some((Autoregression { variance, ..of }, cost))
    }

    /// The best one from another on, by steps that the moments scale.
    fn best(&self, from: &Autoregression) -> Option<Autoregression> {
        let mut at = DVector::from_column_slice(&from.coefficients);
        let (mut best, mut cost) = self.of(&at)?;
        for _ in 0..STEPS {
            let slope = |i: usize| {
                let moved = |by: f64| {
                    let mut other = at.clone();
                    other[i] += by;
                    self.of(&other).map(|(_, cost)| cost)
                };
                Some((moved(NUDGE)? - moved(-NUDGE)?) / (2.0 * NUDGE))
            };
            let slopes: Option<Vec<f64>> = (0..at.len()).map(slope).collect();
            let Some(slopes) = slopes else { break };
            let step = self.steps.solve(&DVector::from_vec(slopes)) * (-0.5 * best.variance);
            let (before, mut part) = (cost, 1.0);
            while part > LEAST_PART {
                let other = &at + &step * part;
                match self.of(&other) {
                    Some((found, less)) if less < cost => {
                        (at, best, cost) = (other, found, less);
                        break;
                    }
                    _ => part *= 0.5,
                }
            }
            if before - cost < LEAST_GAIN {
                break;
            }
        }
        Some(best)
    }
}

/// Lags up to an order, each with itself and those after it.
fn pairs(order: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..=order).flat_map(move |i| (i..=order).map(move |j| (i, j)))
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use nalgebra::{DMatrix, DVector};

    use super::{Autoregression, Linearised, limited, restricted};
    use crate::math::Draws;
    use crate::signal::index;

    const SAMPLES: usize = 400;

    /// A record whose columns are as slow as its noise, and were fitted to it.
    fn fitted(draw: u64, truth: &Autoregression) -> Option<Linearised> {
        let drawn: Vec<f64> = (0..1000 + SAMPLES as u64).map(|k| Draws::normal(draw, k)).collect();
        let noise = DVector::from_vec(truth.noise(&drawn, 1000));
        let column = |i: usize| {
            (0..SAMPLES).map(|k| libm::cos(PI * index(i * k) / index(SAMPLES))).collect::<Vec<_>>()
        };
        let columns: Vec<Vec<f64>> = (0..4).map(column).collect();
        let z = DMatrix::from_fn(SAMPLES, columns.len(), |t, i| columns[i][t]);
        let taken = z.tr_mul(&z).cholesky()?.solve(&z.tr_mul(&noise));
        let residual: Vec<f64> = (noise - z * taken).iter().copied().collect();
        let noise = residual.clone();
        Some(Linearised { columns, nuisance: vec![], residual, noise, weight: 1.0 })
    }

    #[test]
    fn a_noise_without_end_is_held_where_its_variance_is_the_largest() {
        let endless = Autoregression { coefficients: vec![1.2, -0.2], variance: 1.0 };
        assert_eq!(endless.power(), None);
        let held = limited(endless, 40.0);
        assert!(held.power().is_some_and(|power| (39.9..=40.0).contains(&power)));
    }

    #[test]
    fn slow_noise_that_a_fit_has_taken_along_is_found() {
        let truth = Autoregression { coefficients: vec![0.97], variance: 1.0 };
        let (mut left, mut found) = (Vec::new(), Vec::new());
        for record in (0..200).filter_map(|draw| fitted(draw, &truth)) {
            let begun = Autoregression::of(&record.noise);
            if begun.order() == 1 {
                left.push(begun.coefficients[0]);
                let better = restricted(&[record], &DMatrix::zeros(4, 4), vec![begun]);
                found.push(better[0].coefficients[0]);
            }
        }
        let mean = |of: &[f64]| of.iter().sum::<f64>() / index(of.len());
        assert!(found.len() > 100);
        assert!(mean(&left) < 0.945, "{}", mean(&left));
        assert!((mean(&found) - 0.97).abs() < 0.008, "{}", mean(&found));
    }
}
