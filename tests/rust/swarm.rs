//! The swarm as ask/tell, on functions whose minimum is known.
#![allow(missing_docs, clippy::unwrap_used, clippy::float_cmp)]

use piezotrack_core::identify::{Boundary, Swarm, SwarmSettings, Topology};

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
    let mut swarm = Swarm::new(settings, 4, 1, 0).unwrap();
    while !swarm.exhausted() && !swarm.stalled() {
        let costs: Vec<f64> = swarm.ask().map(|place| place.map_or(f64::INFINITY, &cost)).collect();
        swarm.tell(&costs);
    }
    swarm
}

#[test]
fn finds_the_minimum_with_every_boundary_and_topology() {
    for boundary in [Boundary::Absorb, Boundary::Reflect, Boundary::Invisible] {
        for topology in [Topology::Global, Topology::Ring] {
            let settings = SwarmSettings { boundary, topology, min_improvement: 0.0, ..quick() };
            let swarm = run(settings, sphere);
            assert!(swarm.best().1 < 1e-12, "{boundary:?} {topology:?} {}", swarm.best().1);
        }
    }
}

#[test]
fn particles_stay_inside_or_are_not_shown() {
    // The minimum lies far outside, so every particle runs against the wall.
    let outside = |place: &[f64]| place.iter().map(|x| (x - 5.0) * (x - 5.0)).sum::<f64>();
    for boundary in [Boundary::Absorb, Boundary::Reflect, Boundary::Invisible] {
        let mut swarm = Swarm::new(SwarmSettings { boundary, ..quick() }, 3, 1, 0).unwrap();
        for _ in 0..100 {
            let shown: Vec<_> = swarm.ask().flatten().map(<[f64]>::to_vec).collect();
            assert!(shown.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
            let costs: Vec<f64> =
                swarm.ask().map(|place| place.map_or(f64::INFINITY, outside)).collect();
            swarm.tell(&costs);
        }
        if boundary == Boundary::Absorb {
            assert_eq!(swarm.best().0, [1.0; 3], "absorbing walls hold the best corner");
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
