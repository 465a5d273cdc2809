//! What the stages of a mass on a spring have in common as parameters and as states.

use super::values::ParameterInfo;

/// M of a Dahl stage.
pub(super) const MASS: ParameterInfo = ParameterInfo::new("mass", "M", "kg").force();

/// D of a Dahl stage.
pub(super) const DAMPING: ParameterInfo = ParameterInfo::new("damping", "D", "N s/m").force();

/// K of a Dahl stage.
pub(super) const STIFFNESS: ParameterInfo = ParameterInfo::new("stiffness", "K", "N/m").force();

/// T of a Dahl stage.
pub(super) const PIEZO_COEFFICIENT: ParameterInfo =
    ParameterInfo::new("piezo_coefficient", "T", "N/V").force();

/// Displacement.
pub(super) const X: ParameterInfo = ParameterInfo::new("x", "x", "m");

/// Velocity.
pub(super) const V: ParameterInfo = ParameterInfo::new("v", "x'", "m/s");
