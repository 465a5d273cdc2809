//! The Bouc-Wen oscillator: Bouc-Wen hysteresis in feedback on linear mechanics.
//!
//! ```text
//! m y'' + c y' + k y + z = u
//! z' = alpha y' - beta (gamma |y'| |z|^(nu-1) z + delta y' |z|^nu)
//! ```
//!
//! Noel and Schoukens 2016, "Hysteretic benchmark with a dynamic nonlinearity", equations (1)
//! and (3), doi 10.4121/12967592. The drive u is a force.

use piezotrack_control::Number;
use piezotrack_control::hysteresis::{BoucWen, BoucWenState, Operator};

use crate::error::{Result, finite, not_zero, within};
use crate::integrator::nonsmooth_coupling::simulate;
use crate::integrator::{
    Kernel, Kinked, KinkedMotion, Mechanics, ParameterInfo, Parameters, linear,
};
use crate::signal::{Drive, Stop};

/// The oscillator's parameters, in the order of [`BoucWenOscillator::from_theta`]. The unit of
/// gamma and delta is that for nu = 1 and a beta without one; in general it is 1/(m N^(nu-1)).
pub const BOUC_WEN_OSCILLATOR_PARAMETERS: [ParameterInfo; 8] = [
    ParameterInfo { name: "mass", symbol: "m", unit: "kg" },
    ParameterInfo { name: "damping", symbol: "c", unit: "N s/m" },
    ParameterInfo { name: "stiffness", symbol: "k", unit: "N/m" },
    ParameterInfo { name: "alpha", symbol: "alpha", unit: "N/m" },
    ParameterInfo { name: "beta", symbol: "beta", unit: "" },
    ParameterInfo { name: "gamma", symbol: "gamma", unit: "1/m" },
    ParameterInfo { name: "delta", symbol: "delta", unit: "1/m" },
    ParameterInfo { name: "exponent", symbol: "nu", unit: "" },
];

/// Largest exponent, as for [`super::BoucWenStage`].
const MOST_EXPONENT: f64 = 20.0;

/// A mass on a spring with Bouc-Wen hysteresis, under a force.
///
/// Its beta and gamma are not those of [`super::BoucWenStage`], whose hysteresis is driven by
/// the voltage: here the products beta gamma and beta delta are what beta and gamma are there.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `mechanics` | m, c, k | kg, N s/m, N/m | > 0, >= 0, > 0 |
/// | `alpha` | alpha | N/m | any |
/// | `beta` | beta | 1 | not 0 |
/// | `gamma`, `delta` | gamma, delta | 1/(m N^(nu-1)) | any |
/// | `exponent` | nu | 1 | 1 to 20 |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoucWenOscillator {
    /// Mass, damping and stiffness.
    pub mechanics: Mechanics,
    /// alpha, N/m.
    pub alpha: f64,
    /// beta.
    pub beta: f64,
    /// gamma.
    pub gamma: f64,
    /// delta.
    pub delta: f64,
    /// nu.
    pub exponent: f64,
}

impl BoucWenOscillator {
    /// The oscillator with parameters in the order of [`BOUC_WEN_OSCILLATOR_PARAMETERS`].
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] naming the parameter that is out of its range.
    pub fn from_theta(theta: &[f64; 8]) -> Result<Self> {
        let [mass, damping, stiffness, alpha, beta, gamma, delta, exponent] = *theta;
        let mechanics = Mechanics::new(mass, damping, stiffness)?;
        not_zero("beta", beta, "")?;
        within("exponent", exponent, 1.0, MOST_EXPONENT)?;
        Ok(Self {
            mechanics,
            alpha: finite("alpha", alpha, "N/m")?,
            beta,
            gamma: finite("gamma", gamma, "1/m")?,
            delta: finite("delta", delta, "1/m")?,
            exponent,
        })
    }

    /// Table 1 of Noel and Schoukens 2016.
    #[must_use]
    pub fn benchmark() -> Self {
        Self {
            mechanics: Mechanics { mass: 2.0, damping: 10.0, stiffness: 5e4 },
            alpha: 5e4,
            beta: 1e3,
            gamma: 0.8,
            delta: -1.1,
            exponent: 1.0,
        }
    }

    /// The parameters in their order, as a kernel takes them.
    #[must_use]
    pub fn parameters(&self) -> Parameters<f64> {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let Self { alpha, beta, gamma, delta, exponent, .. } = *self;
        [mass, damping, stiffness, alpha, beta, gamma, delta, exponent, 0.0]
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
        let kernel = BoucWenOscillatorKernel { exponent: self.exponent };
        simulate(&kernel, &self.parameters(), drive, initial, accuracy, stop)
    }

    /// The hysteresis operator.
    #[must_use]
    pub fn operator(&self) -> BoucWen<f64> {
        BoucWen {
            rise: self.alpha,
            beta: self.beta * self.gamma,
            gamma: self.beta * self.delta,
            exponent: self.exponent,
        }
    }
}

/// Bouc-Wen oscillators of one exponent.
#[derive(Clone, Copy, Debug)]
pub struct BoucWenOscillatorKernel {
    /// nu, the same in all lanes.
    pub exponent: f64,
}

impl BoucWenOscillatorKernel {
    #[inline(always)]
    fn operator<N: Number>(self, parameters: &Parameters<N>) -> BoucWen<N> {
        let [_, _, _, rise, beta, gamma, delta, ..] = *parameters;
        BoucWen { rise, beta: beta * gamma, gamma: beta * delta, exponent: self.exponent }
    }
}

impl<N: Number> Kernel<N> for BoucWenOscillatorKernel {
    type Coupling = Kinked<N, BoucWen<N>>;

    /// The drive is a force.
    #[inline(always)]
    fn gain(&self, parameters: &Parameters<N>) -> N {
        parameters[0].like(1.0)
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
