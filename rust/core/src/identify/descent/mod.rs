//! Levenberg-Marquardt with geodesic acceleration: Jacobian, normal equations, damped steps.

pub(super) mod acceleration;
pub(super) mod damped_step;
pub(super) mod jacobian;
pub(super) mod lag;
pub(super) mod levenberg_marquardt;
pub(super) mod neighbourhood;
pub(super) mod normal;
pub(super) mod priors;
