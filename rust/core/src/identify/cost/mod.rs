//! Cost of a candidate: its simulation beside one record or several.

pub(super) mod creep_sums;
pub(super) mod evaluator;
pub(super) mod journal;
pub(super) mod motion;
pub(super) mod residual_sums;
pub(super) mod several_records;
pub(super) mod step_size;
