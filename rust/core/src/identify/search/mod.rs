//! Global searches: descents from random points, swarms, their plan and their progress.

pub(super) mod descent_settings;
pub(super) mod descents;
pub(super) mod inertia;
pub(super) mod plan;
pub(super) mod progress;
pub(super) mod resolved;
pub(super) mod swarms;
