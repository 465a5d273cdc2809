//! Parameters of models: their values, names, units, and the ranges in which they are searched.

pub(super) mod dynamics_parameters;
pub(super) mod mechanics_parameters;
pub(super) mod search_ranges;
pub(super) mod values;
