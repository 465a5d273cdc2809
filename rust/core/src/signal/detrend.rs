//! Removal of slow drift, such as creep, from a record.

use super::drive::index;

/// Highest power of time that counts as drift: creep is curved.
const DRIFT: usize = 3;

/// A record less the polynomial that fits it best, and how far that goes, highest less lowest.
///
/// Powers of time are made orthogonal to the lower ones sample by sample, so each is fitted separately.
pub(crate) fn without_drift(record: &[f64]) -> (Vec<f64>, f64) {
    let n = record.len();
    let mean = record.iter().sum::<f64>() / index(n);
    let mut left: Vec<f64> = record.iter().map(|value| value - mean).collect();
    let mut drift = vec![0.0; n];
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut shapes: Vec<Vec<f64>> = vec![vec![index(n).sqrt().recip(); n]];
    for power in 1..=DRIFT {
        let before = &shapes[power - 1];
        let time = |k: usize| 2.0 * index(k) / index(n - 1) - 1.0;
        let mut shape: Vec<f64> = (0..n).map(|k| time(k) * before[k]).collect();
        for lower in &shapes {
            let share = dot(&shape, lower);
            shape.iter_mut().zip(lower).for_each(|(s, l)| *s -= share * l);
        }
        let size = dot(&shape, &shape).sqrt();
        for s in &mut shape {
            *s /= size;
        }
        let share = dot(&left, &shape);
        left.iter_mut().zip(&shape).for_each(|(l, s)| *l -= share * s);
        drift.iter_mut().zip(&shape).for_each(|(d, s)| *d += share * s);
        shapes.push(shape);
    }
    let highest = drift.iter().fold(f64::NEG_INFINITY, |most, &d| most.max(d));
    let lowest = drift.iter().fold(f64::INFINITY, |least, &d| least.min(d));
    (left, highest - lowest)
}
