//! Parameters and states that the stages of a mass on a spring have in common.

use super::values::ParameterInfo;

/// M of a Dahl stage.
pub(in crate::models) const MASS: ParameterInfo = ParameterInfo::new("mass", "M", "kg").force();

/// D of a Dahl stage.
pub(in crate::models) const DAMPING: ParameterInfo =
    ParameterInfo::new("damping", "D", "N s/m").force();

/// K of a Dahl stage.
pub(in crate::models) const STIFFNESS: ParameterInfo =
    ParameterInfo::new("stiffness", "K", "N/m").force();

/// T of a Dahl stage.
pub(in crate::models) const PIEZO_COEFFICIENT: ParameterInfo =
    ParameterInfo::new("piezo_coefficient", "T", "N/V").force();

/// Displacement.
pub(in crate::models) const X: ParameterInfo = ParameterInfo::new("x", "x", "m");

/// Velocity.
pub(in crate::models) const V: ParameterInfo = ParameterInfo::new("v", "x'", "m/s");
