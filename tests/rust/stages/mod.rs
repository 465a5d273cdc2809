//! Stages, their hysteresis and their inverses.

mod asymmetric_bouc_wen;
mod asymmetric_prandtl_ishlinskii;
mod bouc_wen;
mod duhem;
mod generalised_prandtl_ishlinskii;
mod inverse;
mod lugre;
mod maxwell_slip;
mod neural_network;
mod play;
mod polynomial_prandtl_ishlinskii;
mod prandtl_ishlinskii;
mod preisach;
mod propagator;
mod virtual_stage;
