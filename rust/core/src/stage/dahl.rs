//! The Dahl stage: second-order Dahl hysteresis in feedback on linear mechanics.
//!
//! ```text
//! M x'' + D x' + K x = T u - Fh,   Fh = b1 q1 + sgn(x') b0 q2
//! q1' = q2 x',   q2' = (up - a2 q1 - sgn(x') a1 q2) x'
//! ```
//!
//! Xu and Li 2010, equations (2), (7), (8) and Table 1, doi 10.1115/1.4001712.

use piezotrack_control::operator::{Dahl, DahlState};

use super::ParameterInfo;
use crate::error::{Error, Result, finite, not_negative};
use crate::mechanics::Mechanics;

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

/// A stage with second-order Dahl hysteresis, b0 = 0.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `mechanics` | M, D, K | kg, N s/m, N/m | > 0, >= 0, > 0 |
/// | `piezo_coefficient` | T | N/V | not 0 |
/// | `a1`, `a2` | a1, a2 | 1/m, 1/m^2 | >= 0 |
/// | `b1` | b1 | N/m^2 | any |
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
    /// Hysteresis force b1 q1, N.
    pub hysteresis: f64,
    /// Its slope along the path, b1 q2, N/m.
    pub hysteresis_slope: f64,
}

impl DahlStage {
    /// The stage with parameters in the order of [`DAHL_PARAMETERS`].
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the parameter that is out of its range.
    pub fn from_theta(theta: &[f64; 9]) -> Result<Self> {
        let [mass, damping, stiffness, piezo_coefficient, a1, a2, b1, b0, up] = *theta;
        let mechanics = Mechanics::new(mass, damping, stiffness)?;
        finite("piezo_coefficient", piezo_coefficient, "N/V")?;
        if piezo_coefficient == 0.0 {
            return Err(Error::parameter("piezo_coefficient", "0 N/V", "a value other than 0"));
        }
        if b0 != 0.0 {
            return Err(Error::parameter(
                "b0",
                format!("{b0} N/m"),
                "0: a stage with b0 other than 0 sticks at reversals (dry friction), which is \
                 not simulated yet",
            ));
        }
        Ok(Self {
            mechanics,
            piezo_coefficient,
            a1: not_negative("a1", a1, "1/m")?,
            a2: not_negative("a2", a2, "1/m^2")?,
            b1: finite("b1", b1, "N/m^2")?,
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
            up: 30.0,
        }
    }

    /// The hysteresis operator, scaled to force.
    #[must_use]
    pub fn operator<const TERMS: usize>(&self) -> Dahl<f64, TERMS> {
        Dahl { a1: self.a1, a2: self.a2, gain: self.b1 * self.up }
    }
}

impl From<StageState> for DahlState<f64> {
    fn from(state: StageState) -> Self {
        Self { force: state.hysteresis, slope: state.hysteresis_slope }
    }
}
