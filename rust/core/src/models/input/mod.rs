//! Hysteresis at the input, before linear mechanics: its coupling, weighted signals, Bouc-Wen.

pub(super) mod asymmetric_bouc_wen;
pub(super) mod bouc_wen;
pub(super) mod input_kernel;
pub(super) mod input_model;
pub(super) mod input_stage;
pub(super) mod superposition;
