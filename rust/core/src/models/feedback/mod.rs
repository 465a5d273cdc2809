//! Models whose hysteresis acts on the displacement, in feedback: friction.

pub(super) mod bouc_wen_oscillator;
pub(super) mod first_order_dahl;
pub(super) mod lugre;
pub(super) mod parallel_dahl;
