//! The structure of a fit: nodes, modes, lag, creep and drifts, each chosen from trials.

mod histories;
mod lag;
mod modes;
mod nodes;
mod refinement;
pub(super) mod selection;
mod slow_parts;
mod trials;
