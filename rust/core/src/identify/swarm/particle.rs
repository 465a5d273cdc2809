//! Particles: where they are, where they go, and the best place that they know.

/// A place in the unit box and what it cost.
#[derive(Clone, Debug)]
pub(super) struct Best {
    pub(super) place: Vec<f64>,
    pub(super) cost: f64,
}

/// One particle.
#[derive(Clone, Debug)]
pub(super) struct Particle {
    pub(super) place: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    pub(super) best: Best,
}
