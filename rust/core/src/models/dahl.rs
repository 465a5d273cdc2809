//! The Dahl stage: second-order Dahl hysteresis in feedback on linear mechanics.
//!
//! ```text
//! M x'' + D x' + K x = T u - Fh,   Fh = b1 q1 + sgn(x') b0 q2
//! q1' = q2 x',   q2' = (up - a2 q1 - sgn(x') a1 q2) x'
//! ```
//!
//! Xu and Li 2010, equations (2), (7), (8) and Table 1, doi 10.1115/1.4001712.

use piezotrack_control::hysteresis::{Dahl, DahlState};

use crate::error::{Result, finite, not_negative, not_zero};
use crate::integrator::{FrictionParameters, Mechanics, ParameterInfo};

/// The stage's parameters, in the order of [`DahlStage::from_theta`].
pub const DAHL_PARAMETERS: [ParameterInfo; 9] = [
    ParameterInfo { name: "mass", symbol: "M", unit: "kg" },
    ParameterInfo { name: "damping", symbol: "D", unit: "N s/m" },
    ParameterInfo { name: "stiffness", symbol: "K", unit: "N/m" },
    ParameterInfo { name: "piezo_coefficient", symbol: "T", unit: "N/V" },
    ParameterInfo { name: "a1", symbol: "a1", unit: "1/m" },
    ParameterInfo { name: "a2", symbol: "a2", unit: "1/m^2" },
    ParameterInfo { name: "b1", symbol: "b1", unit: "N/m^2" },
    ParameterInfo { name: "b0", symbol: "b0", unit: "N/m" },
    ParameterInfo { name: "up", symbol: "up", unit: "" },
];

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

/// Displacement, velocity and memory of a stage at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageState {
    /// Displacement, m.
    pub x: f64,
    /// Velocity, m/s.
    pub v: f64,
    /// First state of the operator, q1; 0 where b1 and b0 are 0.
    pub q1: f64,
    /// Second state of the operator, q2 = dq1/dx, 1/m.
    pub q2: f64,
}

/// Motion of a stage at the samples of its drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Displacement, m.
    pub x: Vec<f64>,
    /// Velocity, m/s.
    pub v: Vec<f64>,
    /// Hysteresis force Fh, N.
    pub hysteresis: Vec<f64>,
    /// State at the last sample.
    pub last: StageState,
    /// Steps of the integrator in each sampling interval.
    pub substeps: usize,
    /// Largest difference in displacement from a coarser simulation, m; 0 where there was none.
    pub difference: f64,
    /// Whether each rest was unique: false once a stage with b0 other than 0 could have gone
    /// either way.
    pub well_posed: bool,
}

impl DahlStage {
    /// The stage with parameters in the order of [`DAHL_PARAMETERS`].
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] naming the parameter that is out of its range.
    pub fn from_theta(theta: &[f64; 9]) -> Result<Self> {
        let [mass, damping, stiffness, piezo_coefficient, a1, a2, b1, b0, up] = *theta;
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

    /// Whether the stage sticks: b0 other than 0.
    #[must_use]
    pub fn has_friction(&self) -> bool {
        self.b0 != 0.0
    }

    /// The hysteresis operator, scaled to force.
    #[must_use]
    pub fn operator<const TERMS: usize>(&self) -> Dahl<f64, TERMS> {
        Dahl { a1: self.a1, a2: self.a2, gain: self.b1 * self.up }
    }

    /// Memory of that operator.
    #[must_use]
    pub fn memory(&self, state: &StageState) -> DahlState<f64> {
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
}
