//! Iterative learning between periods, against a direct transcription and on a stage that is late.
#![allow(missing_docs, clippy::unwrap_used, clippy::float_cmp, clippy::cast_possible_truncation)]

use core::f64::consts::TAU;

use piezotrack_control::{Cast, IterativeLearning, Limits};
use proptest::prelude::*;

const WIDE: (f64, f64) = (-1e6, 1e6);

fn limits((low, high): (f64, f64)) -> Limits {
    Limits::new(low, high).unwrap()
}

/// The sum over a period that goes on at its ends; the middle tap is of the sample itself.
fn filtered(taps: &[f64], signal: &[f64]) -> Vec<f64> {
    let (count, half) = (signal.len(), taps.len() / 2);
    // Whole periods more, so that no index is below 0.
    let at = |k: usize, i: usize| signal[(k + half + taps.len() * count - i) % count];
    (0..count).map(|k| taps.iter().enumerate().map(|(i, tap)| tap * at(k, i)).sum()).collect()
}

proptest! {
    #[test]
    fn it_is_the_two_filters_over_the_whole_period(
        table in prop::collection::vec(-50.0..50.0_f64, 9..60),
        side in prop::collection::vec(-0.1..0.1_f64, 0..5),
        learning in prop::collection::vec(-1e6..1e6_f64, 0..20),
        seed in 0.0..1.0_f64,
    ) {
        let mut learning = learning;
        if learning.len() % 2 == 0 {
            learning.push(0.3e6);
        }
        let smoothing: Vec<f64> =
            side.iter().rev().copied().chain([0.1]).chain(side.iter().copied()).collect();
        let times = || (0_u32..).map(f64::from).take(table.len());
        let forward: Vec<f64> = times().map(|k| (seed + k).sin()).collect();
        let error: Vec<f64> = times().map(|k| 1e-6 * (seed * k).cos()).collect();
        let rule = IterativeLearning::new(&learning, &smoothing, limits(WIDE)).unwrap();
        let mut found = table.clone();
        prop_assert_eq!(rule.update(&mut found, &forward, &error).unwrap(), 0);
        let learnt: Vec<f64> = table.iter().zip(&forward).map(|(u, f)| u - f).collect();
        let (kept, added) = (filtered(&smoothing, &learnt), filtered(&learning, &error));
        for k in 0..table.len() {
            prop_assert!((found[k] - (forward[k] + kept[k] + added[k])).abs() < 1e-9);
        }
    }

    #[test]
    fn no_nan_passes_and_the_limits_hold(
        kind in prop::collection::vec(0..6_u8, 30),
        place in 0..30_usize,
    ) {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308, -1e308, 1.0];
        let mut error: Vec<f64> = kind.iter().map(|&i| odd[usize::from(i)]).collect();
        error[place] = f64::NAN;
        let mut table: Vec<f64> = kind.iter().rev().map(|&i| odd[usize::from(i)]).collect();
        let forward = table.clone();
        let rule =
            IterativeLearning::new(&[1e6, 2e6, 1e6], &[0.25, 0.5, 0.25], limits((0.0, 75.0)))
                .unwrap();
        let skipped = rule.update(&mut table, &forward, &error).unwrap();
        prop_assert_eq!(skipped, error.iter().filter(|e| e.is_nan() || e.abs() >= 1e100).count());
        prop_assert!(table.iter().all(|u| (0.0..=75.0).contains(u)));
    }
}

/// A stage of 1.2 um/V that is 3 samples late follows after some periods.
#[test]
fn it_learns_a_stage_that_is_late() {
    let count = 200;
    let desired: Vec<f64> =
        (0..count).map(|k| 20e-6 * (1.0 - (TAU * f64::from(k) / 200.0).cos())).collect();
    // The model says 1 um/V and 3 samples; the gain is 0.7.
    let mut learning = [0.0; 7];
    learning[0] = 0.7e6;
    let smoothing = [0.0, 1.0, 0.0];
    let rule = IterativeLearning::new(&learning, &smoothing, limits((0.0, 75.0))).unwrap();
    let forward = vec![0.0; desired.len()];
    let mut table = forward.clone();
    let mut largest = Vec::new();
    for _ in 0..20 {
        let error: Vec<f64> = (0..desired.len())
            .map(|k| desired[k] - 1.2e-6 * table[(k + desired.len() - 3) % desired.len()])
            .collect();
        largest.push(error.iter().fold(0.0_f64, |most, e| most.max(e.abs())));
        rule.update(&mut table, &forward, &error).unwrap();
    }
    // 1 - 0.7 * 1.2 of it is left by each period.
    for pair in largest.windows(2).take(8) {
        assert!((pair[1] / pair[0] - 0.16).abs() < 1e-6, "{pair:?}");
    }
}

/// A reference beyond the limits for a thousand periods, then one within them.
#[test]
fn it_does_not_wind_up() {
    let rule = IterativeLearning::new(&[0.5e6], &[1.0], limits((0.0, 10.0))).unwrap();
    let mut table = [0.0; 8];
    for _ in 0..1000 {
        let error: Vec<f64> = table.iter().map(|u| 50e-6 - 1e-6 * u).collect();
        rule.update(&mut table, &[0.0; 8], &error).unwrap();
    }
    assert!(table.iter().all(|&u| u == 10.0));
    let error: Vec<f64> = table.iter().map(|u| 4e-6 - 1e-6 * u).collect();
    rule.update(&mut table, &[0.0; 8], &error).unwrap();
    assert!(table.iter().all(|&u| (u - 7.0).abs() < 1e-9));
}

#[test]
fn what_cannot_be_used_is_refused_by_name() {
    let new = |learning: &'static [f64], smoothing: &'static [f64]| {
        IterativeLearning::new(learning, smoothing, limits(WIDE)).unwrap_err().name
    };
    assert_eq!(new(&[1.0, 1.0], &[1.0]), "learning");
    assert_eq!(new(&[], &[1.0]), "learning");
    assert_eq!(new(&[f64::NAN], &[1.0]), "learning");
    assert_eq!(new(&[1.0], &[0.2, 0.5, 0.3]), "smoothing");
    assert_eq!(new(&[1.0], &[0.5, 0.5, 0.5]), "smoothing");
    assert_eq!(new(&[1.0], &[0.0; 131]), "smoothing");
    let rule = IterativeLearning::new(&[1.0], &[0.25, 0.5, 0.25], limits(WIDE)).unwrap();
    let mut table = [1.0; 4];
    assert_eq!(rule.update(&mut table, &[0.0; 3], &[0.0; 4]).unwrap_err().name, "feedforward");
    assert_eq!(rule.update(&mut table, &[0.0; 4], &[0.0; 5]).unwrap_err().name, "error");
    assert_eq!(rule.update(&mut [1.0; 2], &[0.0; 2], &[0.0; 2]).unwrap_err().name, "table");
    assert_eq!(rule.update(&mut [], &[], &[]).unwrap_err().name, "table");
    assert_eq!(table, [1.0; 4]);
}

/// A period adds the roundings of its sums: two of the table and its differences, eight of what is
/// learnt and seven of the correction; Q keeps no more than all of those before.
#[test]
fn a_table_in_single_precision_differs_by_the_roundings_of_its_periods() {
    const PERIODS: u32 = 4;
    let rounding = 0.5 * f64::from(f32::EPSILON);
    let (learning, smoothing) = ([0.5e6, 0.2e6, -0.1e6], [0.25, 0.5, 0.25]);
    let wide = limits((0.0, 75.0));
    let rule = IterativeLearning::new(&learning, &smoothing, wide).unwrap();
    let taps = (learning.map(|tap| tap as f32), smoothing.map(|tap| tap as f32));
    let single = IterativeLearning::new(&taps.0, &taps.1, wide.cast::<f32>().unwrap()).unwrap();
    let times: Vec<f64> = (0_u32..40).map(f64::from).collect();
    let forward: Vec<f64> = times.iter().map(|k| 30.0 + 20.0 * (0.157 * k).sin()).collect();
    let mut error: Vec<f64> = times.iter().map(|k| 4e-6 * (0.3 * k).cos()).collect();
    error[7] = f64::NAN;
    let rounded = |values: &[f64]| values.iter().map(|&one| one as f32).collect::<Vec<f32>>();
    let (given, off) = (rounded(&forward), rounded(&error));
    let (mut table, mut other) = (forward.clone(), given.clone());
    for _ in 0..PERIODS {
        assert_eq!(rule.update(&mut table, &forward, &error).unwrap(), 1);
        assert_eq!(single.update(&mut other, &given, &off).unwrap(), 1);
    }
    let most = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
    let learnt = most(&mut table.iter().zip(&forward).map(|(one, of)| one - of));
    assert!(learnt > 5.0, "{learnt}");
    let found = most(&mut table.iter().zip(&other).map(|(one, other)| one - f64::from(*other)));
    let sample = rounding * (2.0 * 75.0 + 8.0 * learnt + 7.0 * 0.8e6 * 4e-6);
    let bound = f64::from(PERIODS) * sample;
    assert!(found > 0.0 && found < bound, "{found} V of {bound} V");
}
