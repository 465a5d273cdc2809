//! The Bouc-Wen oscillator: Bouc-Wen hysteresis in feedback on linear mechanics.
//!
//! ```text
//! m y'' + c y' + k y + z = u
//! z' = alpha y' - beta (gamma |y'| |z|^(nu-1) z + delta y' |z|^nu)
//! ```
//!
//! Noel and Schoukens 2016, "Hysteretic benchmark with a dynamic nonlinearity", equations (1)
//! and (3), doi 10.4121/12967592. The drive u is a force.

use piezotrack_control::hysteresis::{BoucWen, BoucWenState, Operator};
use piezotrack_control::inverse::OscillatorInverse;
use piezotrack_control::{Number, Real};

use crate::design::{Gains, LoopPlant};
use crate::error::{Result, finite, not_zero, within};
use crate::integrator::{
    Kernel, LumpedStage, Mechanics, NonsmoothCoupling, Order, Parameters, equilibrium, linear,
};
use crate::models::parameters::mechanics_parameters::{V, X};
use crate::models::parameters::search_ranges::{Measures, Ranges};
use crate::models::parameters::values::{Held, ParameterInfo, Values};
use crate::models::plant::KernelModel;
use crate::models::traits::{KernelVisitor, LumpedModel, ModelInfo, Searchable, leading};

/// The unit of gamma and delta is that for nu = 1 and a beta without one; in general it is
/// 1/(m N^(nu-1)).
const PARAMETERS: &[ParameterInfo] = &[
    ParameterInfo::new("mass", "m", "kg"),
    ParameterInfo::new("damping", "c", "N s/m"),
    ParameterInfo::new("stiffness", "k", "N/m"),
    ParameterInfo::new("alpha", "alpha", "N/m"),
    ParameterInfo::new("beta", "beta", "")
        .or(1.0)
        .never_searched("beta held: only the products beta gamma and beta delta show in the data"),
    ParameterInfo::new("gamma", "gamma", "1/m"),
    ParameterInfo::new("delta", "delta", "1/m"),
    ParameterInfo::new("exponent", "nu", "")
        .or(1.0)
        .never_searched("exponent held, in parameters=: it decides the unit of gamma and delta"),
];

const STATE: &[ParameterInfo] = &[X, V, ParameterInfo::new("force", "z", "N")];

/// Largest exponent, as for [`crate::models::input::bouc_wen::BoucWenStage`].
const MOST_EXPONENT: f64 = 20.0;

/// A mass on a spring with Bouc-Wen hysteresis, under a force.
///
/// Its beta and gamma are not those of [`crate::models::input::bouc_wen::BoucWenStage`], whose hysteresis is driven by
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
    /// The oscillator with its eight parameters in the order of the fields.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] naming the parameter that is out of its range.
    pub fn new(values: &[f64; 8]) -> Result<Self> {
        let [mass, damping, stiffness, alpha, beta, gamma, delta, exponent] = *values;
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

    /// The parameters in their order.
    #[must_use]
    pub fn values(&self) -> [f64; 8] {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let Self { alpha, beta, gamma, delta, exponent, .. } = *self;
        [mass, damping, stiffness, alpha, beta, gamma, delta, exponent]
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

impl KernelModel for BoucWenOscillator {
    type Kernel = BoucWenOscillatorKernel;

    fn lumped(&self) -> LumpedStage<BoucWenOscillatorKernel> {
        let kernel = BoucWenOscillatorKernel { exponent: self.exponent };
        LumpedStage { kernel, parameters: leading(&self.values()) }
    }

    fn memory(&self, state: &[f64]) -> BoucWenState<f64> {
        let [_, _, value] = leading(state);
        BoucWenState { value, ..self.operator().rest() }
    }

    fn state(&self, memory: &BoucWenState<f64>) -> Vec<f64> {
        vec![memory.value]
    }
}

impl LumpedModel for BoucWenOscillator {
    const INFO: ModelInfo = ModelInfo {
        name: "bouc-wen-oscillator",
        title: "Bouc-Wen oscillator",
        drive_unit: "N",
        parameters: PARAMETERS,
        state: STATE,
        published: &[("benchmark", || Values::scalars(PARAMETERS, &Self::benchmark().values()))],
    };

    type Inverse = OscillatorInverse;

    fn build(values: &Values) -> Result<Self> {
        Self::new(&values.numbers())
    }

    /// On its settled loop between the displacements that the two forces lead to without
    /// hysteresis: `1/(k + dz/dy)`.
    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]> {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let ends = [low, high].map(|force| force / stiffness);
        let gains =
            Gains::of(&self.operator(), ends[0], ends[1], |slope| 1.0 / (stiffness + slope))?;
        gains.plants(|gain| {
            let mechanics = Mechanics { mass, damping, stiffness: 1.0 / gain };
            LoopPlant::mechanical(&mechanics, 1.0)
        })
    }

    fn inverse(&self, dt: f64) -> Result<OscillatorInverse> {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let Self { alpha, beta, gamma, delta, exponent, .. } = *self;
        let hysteresis = (alpha, beta * gamma, beta * delta, exponent);
        Ok(OscillatorInverse::new(mass, damping, stiffness, hysteresis, dt)?)
    }
}

impl Searchable for BoucWenOscillator {
    const NONSMOOTH: bool = true;

    /// The drive is a force, and may well shake the mass at its resonance.
    fn ranges(of: &Measures, held: &Held) -> Result<Ranges> {
        let stiff = of.drive_size / of.displacement_size;
        let rate = of.displacement_rate;
        let spring = (0.02 * stiff, 3.0 * stiff);
        // The restoring force reaches about stiff * stroke/2.
        let [beta, exponent] = ["beta", "exponent"].map(|name| held.value(name).unwrap_or(1.0));
        let fade = libm::pow(0.25 * stiff * of.stroke, 1.0 - exponent) / (beta * of.stroke);
        let gamma = if fade < 0.0 { (20.0 * fade, 0.0) } else { (0.0, 20.0 * fade) };
        Ok(vec![
            ("mass", (0.05 * stiff / (rate * rate), 10.0 * stiff / (rate * rate))),
            ("damping", (1e-4 * stiff / rate, 3.0 * stiff / rate)),
            ("stiffness", spring),
            ("alpha", spring),
            ("gamma", gamma),
            ("delta", (-20.0 * fade.abs(), 20.0 * fade.abs())),
        ])
    }

    fn kernel<V: KernelVisitor>(held: &Held, _order: Order, visitor: V) -> V::Output {
        visitor.visit(BoucWenOscillatorKernel { exponent: held.value("exponent").unwrap_or(1.0) })
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
        BoucWen {
            rise,
            beta: beta * gamma,
            gamma: beta * delta,
            exponent: N::Lane::of(self.exponent),
        }
    }
}

impl Kernel for BoucWenOscillatorKernel {
    type Coupling<N: Number> = NonsmoothCoupling<N, BoucWen<N>>;

    /// The drive is a force.
    #[inline(always)]
    fn coupling<N: Number>(
        &self,
        parameters: &Parameters<N>,
        step: f64,
        halvings: u32,
    ) -> (Self::Coupling<N>, N) {
        let linear = linear(parameters, step, halvings);
        let operator = self.operator(parameters);
        (NonsmoothCoupling { linear, operator }, parameters[0].like(1.0))
    }

    #[inline(always)]
    fn rest<N: Number>(&self, parameters: &Parameters<N>) -> BoucWenState<N> {
        self.operator(parameters).rest()
    }

    #[inline(always)]
    fn approach<N: Number>(
        &self,
        parameters: &Parameters<N>,
        from: (N, BoucWenState<N>),
        volts: N,
    ) -> (N, BoucWenState<N>) {
        equilibrium::feedback(&self.operator(parameters), parameters[2], from, volts)
    }

    #[inline(always)]
    fn force(&self, _parameters: &Parameters<f64>, memory: &BoucWenState<f64>) -> f64 {
        memory.value
    }
}
