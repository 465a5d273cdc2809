//! Update of a particle's velocity and position.

use super::particle::{Best, Particle};
use super::settings::{Boundary, SwarmSettings, Update};
use crate::math::Draws;

impl Particle {
    /// Moves on, drawn by its own best place and its leader's.
    pub(super) fn fly(
        &mut self,
        settings: &SwarmSettings,
        inertia: f64,
        leader: &Best,
        draws: &mut Draws,
    ) {
        match settings.update {
            Update::Classic => self.classic(settings, inertia, leader, draws),
            Update::Hypersphere => {
                let around = draws.in_unit_ball(self.place.len());
                self.hypersphere(settings, inertia, leader, &around);
            }
            Update::HypersphereRadial => {
                let around = draws.in_unit_ball_radially(self.place.len());
                self.hypersphere(settings, inertia, leader, &around);
            }
        }
    }

    /// Equations (17) and (18) of Xu and Li 2010.
    fn classic(
        &mut self,
        settings: &SwarmSettings,
        inertia: f64,
        leader: &Best,
        draws: &mut Draws,
    ) {
        let limit = settings.velocity_limit;
        let Self { place, velocity, best } = self;
        let bests = best.place.iter().zip(&leader.place);
        for ((x, v), (own, lead)) in place.iter_mut().zip(velocity).zip(bests) {
            let own = settings.cognitive * draws.uniform() * (own - *x);
            let shared = settings.social * draws.uniform() * (lead - *x);
            let pulled = (inertia * *v + own + shared).clamp(-limit, limit);
            (*x, *v) = bounded(settings.boundary, *x + pulled, pulled);
        }
    }

    /// Clerc 2012, hal-00764996:
    ///
    /// ```text
    /// G  = (X + (X + c1 (P - X)) + (X + c2 (L - X))) / 3
    /// G  = (X + (X + c1 (P - X))) / 2                      where X is its own best informant
    /// X' = G + |G - X| B                                   B a point of the unit ball
    /// V <- w V + X' - X
    /// X <- X + V
    /// ```
    fn hypersphere(
        &mut self,
        settings: &SwarmSettings,
        inertia: f64,
        leader: &Best,
        around: &[f64],
    ) {
        let limit = settings.velocity_limit;
        let Self { place, velocity, best } = self;
        let leads_itself = best.cost <= leader.cost;
        let (social, share) = if leads_itself { (0.0, 0.5) } else { (settings.social, 1.0 / 3.0) };
        let bests = best.place.iter().zip(&leader.place);
        // G - X
        let centre: Vec<f64> = place
            .iter()
            .zip(bests)
            .map(|(x, (own, lead))| share * (settings.cognitive * (own - x) + social * (lead - x)))
            .collect();
        let radius = libm::sqrt(centre.iter().map(|d| d * d).sum());
        let steps = centre.iter().zip(around);
        for ((x, v), (centre, around)) in place.iter_mut().zip(velocity).zip(steps) {
            let pulled = (inertia * *v + centre + radius * around).clamp(-limit, limit);
            (*x, *v) = bounded(settings.boundary, *x + pulled, pulled);
        }
    }
}

/// One coordinate after its move.
fn bounded(boundary: Boundary, x: f64, velocity: f64) -> (f64, f64) {
    if (0.0..=1.0).contains(&x) {
        return (x, velocity);
    }
    let wall = if x < 0.0 { 0.0 } else { 1.0 };
    match boundary {
        Boundary::Absorb => (wall, 0.0),
        Boundary::Rebound => (wall, -0.5 * velocity),
        Boundary::Reflect => ((2.0 * wall - x).clamp(0.0, 1.0), -velocity),
        Boundary::Invisible => (x, velocity),
    }
}
