//! The swarm as ask/tell, on functions whose minimum is known.
#![allow(missing_docs, clippy::unwrap_used, clippy::float_cmp)]

use piezotrack_core::identify::{Boundary, Swarm, SwarmSettings, Topology, Update};

const BOUNDARIES: [Boundary; 4] =
    [Boundary::Absorb, Boundary::Rebound, Boundary::Reflect, Boundary::Invisible];
const TOPOLOGIES: [Topology; 3] = [Topology::Global, Topology::Ring, Topology::Random];

fn quick() -> SwarmSettings {
    SwarmSettings {
        particles: 30,
        iterations: 400,
        inertia: (0.7298, 0.7298),
        cognitive: 1.49618,
        social: 1.49618,
        ..SwarmSettings::xu_li_2010()
    }
}

fn sphere(place: &[f64]) -> f64 {
    place.iter().map(|x| (x - 0.3) * (x - 0.3)).sum()
}

fn run(settings: SwarmSettings, cost: impl Fn(&[f64]) -> f64) -> Swarm {
    run_from(settings, 4, 1, cost)
}

fn run_from(
    settings: SwarmSettings,
    coordinates: usize,
    seed: u64,
    cost: impl Fn(&[f64]) -> f64,
) -> Swarm {
    let mut swarm = Swarm::new(settings, coordinates, seed, 0).unwrap();
    while !swarm.exhausted() && !swarm.stalled() {
        let costs: Vec<f64> = swarm.ask().map(|place| place.map_or(f64::INFINITY, &cost)).collect();
        swarm.tell(&costs);
    }
    swarm
}

/// Where all particles are; NaN where one is not shown.
fn places(swarm: &Swarm, coordinates: usize) -> Vec<Vec<f64>> {
    let hidden = vec![f64::NAN; coordinates];
    swarm.ask().map(|place| place.map_or_else(|| hidden.clone(), <[f64]>::to_vec)).collect()
}

#[test]
fn finds_the_minimum_with_every_update_boundary_and_topology() {
    let standard = SwarmSettings { particles: 30, iterations: 400, ..SwarmSettings::spso_2011() };
    let radial = SwarmSettings { update: Update::HypersphereRadial, ..standard.clone() };
    for settings in [quick(), standard, radial] {
        for boundary in BOUNDARIES {
            for topology in TOPOLOGIES {
                let settings =
                    SwarmSettings { boundary, topology, min_improvement: 0.0, ..settings.clone() };
                let swarm = run(settings.clone(), sphere);
                assert!(swarm.best().1 < 1e-12, "{settings:?} {}", swarm.best().1);
            }
        }
    }
}

#[test]
fn particles_stay_inside_or_are_not_shown() {
    // The minimum lies far outside, so every particle runs against the wall.
    let outside = |place: &[f64]| place.iter().map(|x| (x - 5.0) * (x - 5.0)).sum::<f64>();
    for settings in [quick(), SwarmSettings::spso_2011()] {
        for boundary in BOUNDARIES {
            let settings = SwarmSettings { boundary, ..settings.clone() };
            let mut swarm = Swarm::new(settings, 3, 1, 0).unwrap();
            for _ in 0..100 {
                let shown: Vec<_> = swarm.ask().flatten().map(<[f64]>::to_vec).collect();
                assert!(shown.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
                let costs: Vec<f64> =
                    swarm.ask().map(|place| place.map_or(f64::INFINITY, outside)).collect();
                swarm.tell(&costs);
            }
            if matches!(boundary, Boundary::Absorb | Boundary::Rebound) {
                assert_eq!(swarm.best().0, [1.0; 3], "{boundary:?}: walls hold the best corner");
            }
        }
    }
}

#[test]
fn stops_after_stalled_iterations_in_a_row() {
    let settings = SwarmSettings { stall_iterations: 7, ..quick() };
    let swarm = run(settings, |_| 1.0);
    assert_eq!(swarm.iteration(), 7);
    let settings = SwarmSettings { iterations: 5, ..quick() };
    assert_eq!(run(settings, sphere).iteration(), 5);
}

#[test]
fn nan_and_infinity_never_win() {
    let mut swarm = Swarm::new(quick(), 2, 1, 0).unwrap();
    let mut costs = vec![f64::NAN; 30];
    costs[0] = f64::INFINITY;
    costs[7] = 2.0;
    swarm.tell(&costs);
    assert_eq!(swarm.best().1, 2.0);
}

#[test]
fn the_first_step_is_equation_17() {
    // With c1 = c2 = 0 only inertia is left: each particle moves by w times its velocity, and
    // two iterations show the velocity of both.
    let settings = SwarmSettings {
        cognitive: 0.0,
        social: 0.0,
        inertia: (0.9, 0.4),
        inertia_iterations: 500,
        boundary: Boundary::Invisible,
        ..SwarmSettings::xu_li_2010()
    };
    let mut swarm = Swarm::new(settings, 1, 1, 0).unwrap();
    let mut places = Vec::new();
    for _ in 0..3 {
        places.push(swarm.ask().map(|p| p.map_or(f64::NAN, |p| p[0])).collect::<Vec<_>>());
        swarm.tell(&[1.0; 10]);
    }
    let second_inertia = 0.9 + (0.4 - 0.9) / 499.0;
    for ((start, next), last) in places[0].iter().zip(&places[1]).zip(&places[2]) {
        let (first, second) = (next - start, last - next);
        if first.is_finite() && second.is_finite() {
            assert!((second - second_inertia * first).abs() < 1e-15);
        }
    }
}

#[test]
fn half_the_velocity_turns_back_at_the_wall() {
    // Inertia alone, and of 1: two places inside show the velocity of a particle, the third may
    // be on a wall, the fourth is back from it.
    let settings = SwarmSettings {
        particles: 200,
        cognitive: 0.0,
        social: 0.0,
        inertia: (1.0, 1.0),
        velocity_limit: f64::INFINITY,
        boundary: Boundary::Rebound,
        ..quick()
    };
    let mut swarm = Swarm::new(settings, 1, 1, 0).unwrap();
    let mut seen = Vec::new();
    for _ in 0..8 {
        seen.push(places(&swarm, 1));
        swarm.tell(&[1.0; 200]);
    }
    let inside = |x: f64| 0.0 < x && x < 1.0;
    let mut met = 0;
    for (four, i) in seen.windows(4).flat_map(|four| (0..200).map(move |i| (four, i))) {
        let [a, b, wall, back] = [0, 1, 2, 3].map(|k| four[k][i][0]);
        if inside(a) && inside(b) && !inside(wall) {
            assert!((back - (wall - 0.5 * (b - a))).abs() < 1e-15, "{a} {b} {wall} {back}");
            met += 1;
        }
    }
    assert!(met > 50, "{met}");
}

// Standard Particle Swarm Optimisation 2011.

#[test]
fn the_settings_of_spso_2011() {
    let standard = SwarmSettings::spso_2011();
    assert_eq!(standard.particles, 40);
    assert!((standard.inertia.0 - 0.721_347_520_444_481_7).abs() < 1e-15);
    assert!((standard.cognitive - 1.193_147_180_559_945_3).abs() < 1e-15);
    assert_eq!(standard.cognitive, standard.social);
    let kinds = (standard.update, standard.topology, standard.boundary);
    assert_eq!(kinds, (Update::Hypersphere, Topology::Random, Boundary::Rebound));
}

/// First steps of a swarm without inertia, as points of the unit ball: from X, its own best place,
/// a particle goes into the sphere about G = X + c2 (L - X)/3. A small c2 keeps that in the box.
fn points_of_the_ball(update: Update, coordinates: usize, particles: usize) -> Vec<Vec<f64>> {
    let settings = SwarmSettings {
        particles,
        update,
        inertia: (0.0, 0.0),
        social: 3e-5,
        topology: Topology::Global,
        ..SwarmSettings::spso_2011()
    };
    let mut swarm = Swarm::new(settings, coordinates, 5, 0).unwrap();
    let before = places(&swarm, coordinates);
    let mut costs = vec![1.0; particles];
    costs[0] = 0.0;
    swarm.tell(&costs);
    let moved = |(x, after): (&Vec<f64>, Vec<f64>)| {
        let centre: Vec<f64> = x.iter().zip(&before[0]).map(|(x, l)| 1e-5 * (l - x)).collect();
        let radius = size(&centre);
        let offsets = after.iter().zip(x).zip(&centre);
        offsets.map(|((after, x), centre)| (after - x - centre) / radius).collect()
    };
    before.iter().zip(places(&swarm, coordinates)).skip(1).map(moved).collect()
}

fn size(vector: &[f64]) -> f64 {
    vector.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Kolmogorov and Smirnov: the largest distance from evenly spread numbers, over the square root
/// of their count; 1.95 is passed by one sample in a thousand.
fn unevenness(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    let n = numbers.iter().map(|_| 1.0).sum::<f64>();
    let apart = (0_u16..).zip(&numbers).map(|(i, x)| (x - (f64::from(i) + 0.5) / n).abs());
    apart.fold(0.0, f64::max) * n.sqrt()
}

#[test]
fn points_are_even_in_the_hypersphere() {
    const COUNT: u16 = 20_000;
    let n = f64::from(COUNT - 1);
    for coordinates in [1_u8, 2, 3, 6, 7, 32] {
        let d = f64::from(coordinates);
        let points = |update| points_of_the_ball(update, coordinates.into(), COUNT.into());
        let even = points(Update::Hypersphere);
        let radii: Vec<f64> = even.iter().map(|point| size(point)).collect();
        assert!(radii.iter().all(|r| *r <= 1.0 + 1e-9));
        // The share of points within r is r^d: mean d/(d+1), variance of a coordinate 1/(d+2).
        let mean = radii.iter().sum::<f64>() / n;
        let deviation = (d / (d + 2.0)).sqrt() / (d + 1.0);
        assert!((mean - d / (d + 1.0)).abs() < 4.0 * deviation / n.sqrt(), "{d} {mean}");
        assert!(unevenness(radii.iter().map(|r| r.powf(d)).collect()) < 1.95, "{d}");
        for k in [0, usize::from(coordinates) - 1] {
            let mean = even.iter().map(|point| point[k]).sum::<f64>() / n;
            assert!(mean.abs() < 4.0 / (n * (d + 2.0)).sqrt(), "{d} {mean}");
            let variance = even.iter().map(|point| point[k] * point[k]).sum::<f64>() / n;
            assert!((variance * (d + 2.0) - 1.0).abs() < 6.0 / n.sqrt(), "{d} {variance}");
        }
        let radial = points(Update::HypersphereRadial);
        assert!(unevenness(radial.iter().map(|point| size(point)).collect()) < 1.95, "{d}");
    }
}

#[test]
fn each_informs_three_until_the_best_stalls() {
    // Neither inertia nor a pull of its own: who moves has been told of a better place.
    let settings = SwarmSettings {
        inertia: (0.0, 0.0),
        cognitive: 0.0,
        particles: 60,
        ..SwarmSettings::spso_2011()
    };
    let mut swarm = Swarm::new(settings, 2, 4, 0).unwrap();
    let mut told = |best: f64| {
        let before = places(&swarm, 2);
        let mut costs = [1.0; 60];
        costs[7] = best;
        swarm.tell(&costs);
        let after = places(&swarm, 2);
        (0..60).filter(|&i| before[i] != after[i]).collect::<Vec<usize>>()
    };
    let first = told(0.0);
    assert!((1..=3).contains(&first.len()), "{first:?}");
    assert!(!first.contains(&7));
    assert_eq!(told(-1.0), first, "the best improved: the links stay");
    let others: Vec<Vec<usize>> = (0..5).map(|_| told(-1.0)).collect();
    assert!(others.iter().all(|told| (0..=3).contains(&told.len()) && *told != first));
}

/// An ellipsoid about (0.4, ...), its longest axis a hundred times its shortest, turned by two
/// reflections or not.
fn ellipsoid(place: &[f64], turned: bool) -> f64 {
    let mut y: Vec<f64> = place.iter().map(|x| x - 0.4).collect();
    if turned {
        for mirror in [[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [3.0, -1.0, 4.0, -1.0, 5.0, -9.0]] {
            let size: f64 = mirror.iter().map(|m| m * m).sum();
            let part: f64 = mirror.iter().zip(&y).map(|(m, y)| m * y).sum();
            y.iter_mut().zip(mirror).for_each(|(y, m)| *y -= 2.0 * part * m / size);
        }
    }
    (0_i32..).zip(&y).map(|(k, y)| 10_f64.powf(0.8 * f64::from(k)) * y * y).sum()
}

/// Mean of the logarithm of the best cost over 40 seeds, and its standard error.
fn reached(settings: &SwarmSettings, turned: bool) -> (f64, f64) {
    let found: Vec<f64> = (0..40)
        .map(|seed| {
            run_from(settings.clone(), 6, seed, |place| ellipsoid(place, turned)).best().1.log10()
        })
        .collect();
    let mean = found.iter().sum::<f64>() / 40.0;
    let square = found.iter().map(|f| (f - mean) * (f - mean)).sum::<f64>() / 39.0;
    (mean, (square / 40.0).sqrt())
}

#[test]
fn a_rotation_matters_to_the_classic_update_alone() {
    let changed = |settings: SwarmSettings| {
        let settings = SwarmSettings { iterations: 150, min_improvement: 0.0, ..settings };
        let (straight, error) = reached(&settings, false);
        let (turned, other) = reached(&settings, true);
        (turned - straight, error.hypot(other))
    };
    for update in [Update::Hypersphere, Update::HypersphereRadial] {
        let (found, error) = changed(SwarmSettings { update, ..SwarmSettings::spso_2011() });
        assert!(found.abs() < 2.5 * error, "{update:?} {found} +- {error}");
    }
    let (classic, error) = changed(SwarmSettings { particles: 40, ..quick() });
    assert!(classic > 8.0 * error && classic > 1.0, "{classic} +- {error}");
}

#[test]
fn a_search_that_pauses_goes_on_as_if_it_had_not() {
    let whole = run(SwarmSettings { iterations: 90, ..SwarmSettings::spso_2011() }, sphere);
    let mut paused = Swarm::new(SwarmSettings::spso_2011(), 4, 1, 0).unwrap();
    for _ in 0..91 {
        let mut resumed = paused.clone();
        let costs: Vec<f64> = resumed.ask().flatten().map(sphere).collect();
        resumed.tell(&costs);
        paused = resumed;
    }
    assert_eq!(paused.best(), whole.best());
    assert_eq!(places(&paused, 4), places(&whole, 4));
    let other = Swarm::new(SwarmSettings::spso_2011(), 4, 1, 1).unwrap();
    assert_ne!(
        places(&other, 4),
        places(&Swarm::new(SwarmSettings::spso_2011(), 4, 1, 0).unwrap(), 4)
    );
}

#[test]
fn the_draws_do_not_depend_on_the_other_particles() {
    // Particle 0 starts at the same place however many others there are.
    let start = |particles: usize| {
        let swarm = Swarm::new(SwarmSettings { particles, ..quick() }, 3, 9, 0).unwrap();
        let first = swarm.ask().next().flatten().map(<[f64]>::to_vec);
        first.unwrap()
    };
    assert_eq!(start(10), start(50));
}

#[test]
fn settings_are_refused_by_name() {
    let cases: [(&str, SwarmSettings); 4] = [
        ("particles", SwarmSettings { particles: 1, ..quick() }),
        ("velocity_limit", SwarmSettings { velocity_limit: 0.0, ..quick() }),
        ("social", SwarmSettings { social: f64::NAN, ..quick() }),
        ("stall_iterations", SwarmSettings { stall_iterations: 0, ..quick() }),
    ];
    for (name, settings) in cases {
        let error = Swarm::new(settings, 2, 1, 0).unwrap_err().to_string();
        assert!(error.starts_with(name), "{error}");
    }
}
