//! The Dahl stage: its parameters, its state at one instant.

use piezotrack_control::hysteresis::DahlState;

use crate::error::{Result, finite, not_negative, not_zero};
use crate::integrator::{FrictionParameters, Kernel, LumpedStage, Mechanics};
use crate::models::parameters::mechanics_parameters::{
    DAMPING, MASS, PIEZO_COEFFICIENT, STIFFNESS, V, X,
};
use crate::models::parameters::values::ParameterInfo;

pub(super) const PARAMETERS: &[ParameterInfo] = &[
    MASS,
    DAMPING,
    STIFFNESS,
    PIEZO_COEFFICIENT,
    ParameterInfo::new("a1", "a1", "1/m"),
    ParameterInfo::new("a2", "a2", "1/m^2"),
    ParameterInfo::new("b1", "b1", "N/m^2").force(),
    ParameterInfo::new("b0", "b0", "N/m").force().or(0.0),
    ParameterInfo::new("up", "up", "")
        .or(30.0)
        .never_searched("up held: only the products b1 up and b0 up show in the data"),
];

pub(super) const STATE: &[ParameterInfo] =
    &[X, V, ParameterInfo::new("q1", "q1", ""), ParameterInfo::new("q2", "q2", "1/m")];

/// A stage with second-order Dahl hysteresis.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `mechanics` | M, D, K | kg, N s/m, N/m | > 0, >= 0, > 0 |
/// | `piezo_coefficient` | T | N/V | not 0 |
/// | `a1`, `a2` | a1, a2 | 1/m, 1/m^2 | >= 0 |
/// | `b1` | b1 | N/m^2 | any |
/// | `b0` | b0 | N/m | any |
/// | `up` | up | 1 | any |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DahlStage {
    /// Mass, damping and stiffness.
    pub mechanics: Mechanics,
    /// T, N/V.
    pub piezo_coefficient: f64,
    /// a1, 1/m.
    pub a1: f64,
    /// a2, 1/m^2.
    pub a2: f64,
    /// b1, N/m^2.
    pub b1: f64,
    /// b0, N/m: other than 0 it adds dry friction at reversals.
    pub b0: f64,
    /// up, a constant of the operator.
    pub up: f64,
}

/// Displacement, velocity and memory of a Dahl stage at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DahlStageState {
    /// Displacement, m.
    pub x: f64,
    /// Velocity, m/s.
    pub v: f64,
    /// First state of the operator, q1; 0 where b1 and b0 are 0.
    pub q1: f64,
    /// Second state of the operator, q2 = dq1/dx, 1/m.
    pub q2: f64,
}

impl DahlStage {
    /// The stage with its nine parameters in the order of the fields, as in Table 1.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] naming the parameter that is out of its range.
    pub fn new(values: &[f64; 9]) -> Result<Self> {
        let [mass, damping, stiffness, piezo_coefficient, a1, a2, b1, b0, up] = *values;
        let mechanics = Mechanics::new(mass, damping, stiffness)?;
        not_zero("piezo_coefficient", piezo_coefficient, "N/V")?;
        Ok(Self {
            mechanics,
            piezo_coefficient,
            a1: not_negative("a1", a1, "1/m")?,
            a2: not_negative("a2", a2, "1/m^2")?,
            b1: finite("b1", b1, "N/m^2")?,
            b0: finite("b0", b0, "N/m")?,
            up: finite("up", up, "")?,
        })
    }

    /// Table 1 of Xu and Li 2010.
    #[must_use]
    pub fn xu_li_2010() -> Self {
        Self {
            mechanics: Mechanics { mass: 0.1828, damping: 2597.3, stiffness: 26065.0 },
            piezo_coefficient: 0.0468,
            a1: 121.9874,
            a2: 1.1773e6,
            b1: 1.8485e6,
            b0: 0.0,
            up: 30.0,
        }
    }

    /// The parameters in their order.
    #[must_use]
    pub fn values(&self) -> [f64; 9] {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let Self { piezo_coefficient, a1, a2, b1, b0, up, .. } = *self;
        [mass, damping, stiffness, piezo_coefficient, a1, a2, b1, b0, up]
    }

    /// Whether the stage sticks: b0 other than 0.
    #[must_use]
    pub fn has_friction(&self) -> bool {
        self.b0 != 0.0
    }

    /// Memory of the operator, scaled to force.
    #[must_use]
    pub fn memory(&self, state: &DahlStageState) -> DahlState<f64> {
        DahlState { force: self.b1 * state.q1, slope: self.b1 * state.q2 }
    }

    /// q1 and q2 from that memory.
    #[must_use]
    pub fn states(&self, memory: &DahlState<f64>) -> (f64, f64) {
        if self.b1 == 0.0 { (0.0, 0.0) } else { (memory.force / self.b1, memory.slope / self.b1) }
    }

    /// The parameters for steps with friction.
    #[must_use]
    pub fn friction(&self) -> FrictionParameters<f64> {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        FrictionParameters {
            mechanics: [mass, damping, stiffness],
            operator: [self.a1, self.a2, self.up],
            b1: self.b1,
            b0: self.b0,
        }
    }

    /// The stage as a kernel steps it.
    #[must_use]
    pub fn lumped<K: Kernel>(&self, kernel: K) -> LumpedStage<K> {
        LumpedStage { kernel, parameters: crate::models::traits::leading(&self.values()) }
    }
}
