//! Models made of plays at the input: Prandtl-Ishlinskii, its extensions, Maxwell slip.

pub(super) mod asymmetric_prandtl_ishlinskii;
pub(super) mod cubic_curve;
pub(super) mod generalised_prandtl_ishlinskii;
pub(super) mod maxwell_slip;
pub(super) mod polynomial_prandtl_ishlinskii;
pub(super) mod prandtl_ishlinskii;
pub(super) mod rate_dependent_prandtl_ishlinskii;
pub(super) mod tanh_envelope;
