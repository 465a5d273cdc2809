//! Measured records: drive and displacement, what came before them, and what they show of the stage.

pub(super) mod creep_weights;
pub(super) mod history;
pub(super) mod record;
pub(super) mod resonances;
mod sampled_dynamics;
pub(super) mod thinned;
