//! The classic Dahl stage: first-order Dahl friction in feedback on linear mechanics.
//!
//! ```text
//! M x'' + D x' + K x = T u - F
//! dF/dx = sigma |1 - F sgn(x')/Fc|^i sgn(1 - F sgn(x')/Fc)
//! ```
//!
//! Dahl 1968, Aerospace Corporation TOR-0158(3107-18)-1; Dahl 1976, doi 10.2514/3.61511. Unlike
//! the second-order form of [`super::DahlStage`] the operator is bounded and dissipative, and
//! its loops close.

use piezotrack_control::Number;
use piezotrack_control::hysteresis::{BoucWenState, FirstOrderDahl, Operator};

use crate::error::{Result, not_negative, not_zero, positive, within};
use crate::integrator::nonsmooth_coupling::simulate;
use crate::integrator::{
    Kernel, Kinked, KinkedMotion, Mechanics, ParameterInfo, Parameters, linear,
};
use crate::signal::{Drive, Stop};

/// The stage's parameters, in the order of [`FirstOrderDahlStage::from_theta`].
pub const FIRST_ORDER_DAHL_PARAMETERS: [ParameterInfo; 7] = [
    ParameterInfo { name: "mass", symbol: "M", unit: "kg" },
    ParameterInfo { name: "damping", symbol: "D", unit: "N s/m" },
    ParameterInfo { name: "stiffness", symbol: "K", unit: "N/m" },
    ParameterInfo { name: "piezo_coefficient", symbol: "T", unit: "N/V" },
    ParameterInfo { name: "rest_stiffness", symbol: "sigma", unit: "N/m" },
    ParameterInfo { name: "coulomb_force", symbol: "Fc", unit: "N" },
    ParameterInfo { name: "exponent", symbol: "i", unit: "" },
];

/// Largest exponent: far beyond it the force hardly leaves the rest stiffness, and then stands.
const MOST_EXPONENT: f64 = 20.0;

/// A stage with first-order Dahl friction.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `mechanics` | M, D, K | kg, N s/m, N/m | > 0, >= 0, > 0 |
/// | `piezo_coefficient` | T | N/V | not 0 |
/// | `rest_stiffness` | sigma | N/m | >= 0 |
/// | `coulomb_force` | Fc | N | > 0 |
/// | `exponent` | i | 1 | 0 to 20 |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrderDahlStage {
    /// Mass, damping and stiffness.
    pub mechanics: Mechanics,
    /// T, N/V.
    pub piezo_coefficient: f64,
    /// sigma, N/m.
    pub rest_stiffness: f64,
    /// Fc, N.
    pub coulomb_force: f64,
    /// i.
    pub exponent: f64,
}

impl FirstOrderDahlStage {
    /// The stage with parameters in the order of [`FIRST_ORDER_DAHL_PARAMETERS`].
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] naming the parameter that is out of its range.
    pub fn from_theta(theta: &[f64; 7]) -> Result<Self> {
        let [mass, damping, stiffness, piezo_coefficient, rest_stiffness, coulomb, exponent] =
            *theta;
        let mechanics = Mechanics::new(mass, damping, stiffness)?;
        not_zero("piezo_coefficient", piezo_coefficient, "N/V")?;
        within("exponent", exponent, 0.0, MOST_EXPONENT)?;
        Ok(Self {
            mechanics,
            piezo_coefficient,
            rest_stiffness: not_negative("rest_stiffness", rest_stiffness, "N/m")?,
            coulomb_force: positive("coulomb_force", coulomb, "N")?,
            exponent,
        })
    }

    /// The parameters in their order, as a kernel takes them.
    #[must_use]
    pub fn parameters(&self) -> Parameters<f64> {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let Self { piezo_coefficient, rest_stiffness, coulomb_force, exponent, .. } = *self;
        [
            mass,
            damping,
            stiffness,
            piezo_coefficient,
            rest_stiffness,
            coulomb_force,
            exponent,
            0.0,
            0.0,
        ]
    }

    /// Simulates from `initial`: displacement, velocity and the hysteresis force, N.
    ///
    /// `None` where `stop` said so meanwhile.
    ///
    /// # Errors
    /// Those of [`crate::integrator::Alone::simulate`].
    pub fn simulate(
        &self,
        drive: &Drive<'_>,
        initial: [f64; 3],
        accuracy: f64,
        stop: Stop<'_>,
    ) -> Result<Option<KinkedMotion>> {
        let kernel = FirstOrderDahlKernel { exponent: self.exponent };
        simulate(&kernel, &self.parameters(), drive, initial, accuracy, stop)
    }

    /// The hysteresis operator.
    #[must_use]
    pub fn operator(&self) -> FirstOrderDahl<f64> {
        FirstOrderDahl {
            rest_stiffness: self.rest_stiffness,
            coulomb_force: self.coulomb_force,
            exponent: self.exponent,
        }
    }
}

/// First-order Dahl stages of one exponent.
#[derive(Clone, Copy, Debug)]
pub struct FirstOrderDahlKernel {
    /// i, the same in all lanes.
    pub exponent: f64,
}

impl FirstOrderDahlKernel {
    #[inline(always)]
    fn operator<N: Number>(self, parameters: &Parameters<N>) -> FirstOrderDahl<N> {
        let [_, _, _, _, rest_stiffness, coulomb_force, ..] = *parameters;
        FirstOrderDahl { rest_stiffness, coulomb_force, exponent: self.exponent }
    }
}

impl<N: Number> Kernel<N> for FirstOrderDahlKernel {
    type Coupling = Kinked<N, FirstOrderDahl<N>>;

    #[inline(always)]
    fn gain(&self, parameters: &Parameters<N>) -> N {
        parameters[3]
    }

    #[inline(always)]
    fn coupling(&self, parameters: &Parameters<N>, step: f64, halvings: u32) -> Self::Coupling {
        Kinked { linear: linear(parameters, step, halvings), operator: self.operator(parameters) }
    }

    #[inline(always)]
    fn rest(&self, parameters: &Parameters<N>) -> BoucWenState<N> {
        self.operator(parameters).rest()
    }

    #[inline(always)]
    fn force(&self, _parameters: &Parameters<N>, memory: &BoucWenState<N>) -> N {
        memory.value
    }
}
