//! The classic Dahl stage: first-order Dahl friction in feedback on linear mechanics.
//!
//! ```text
//! M x'' + D x' + K x = T u - F
//! dF/dx = sigma |1 - F sgn(x')/Fc|^i sgn(1 - F sgn(x')/Fc)
//! ```
//!
//! Dahl 1968, Aerospace Corporation TOR-0158(3107-18)-1; Dahl 1976, doi 10.2514/3.61511. Unlike
//! the second-order form of [`crate::models::dahl::DahlStage`] the operator is bounded and dissipative, and
//! its loops close.

use piezotrack_control::hysteresis::{BoucWenState, FirstOrderDahl, Operator};
use piezotrack_control::inverse::FirstOrderDahlInverse;
use piezotrack_control::{Number, Real};

use crate::design::{Gains, LoopPlant};
use crate::error::{Result, not_negative, not_zero, positive, within};
use crate::integrator::{
    Kernel, LumpedStage, Mechanics, NonsmoothCoupling, Order, Parameters, equilibrium, linear,
};
use crate::models::parameters::mechanics_parameters::{
    DAMPING, MASS, PIEZO_COEFFICIENT, STIFFNESS, V, X,
};
use crate::models::parameters::search_ranges::{Measures, Ranges};
use crate::models::parameters::values::{Held, ParameterInfo, Values};
use crate::models::plant::KernelModel;
use crate::models::traits::{KernelVisitor, LumpedModel, ModelInfo, Searchable, leading};

const PARAMETERS: &[ParameterInfo] = &[
    MASS,
    DAMPING,
    STIFFNESS,
    PIEZO_COEFFICIENT,
    ParameterInfo::new("rest_stiffness", "sigma", "N/m").force(),
    ParameterInfo::new("coulomb_force", "Fc", "N").force(),
    ParameterInfo::new("exponent", "i", "")
        .or(1.0)
        .never_searched("exponent held, in parameters=: all candidates of a search share it"),
];

const STATE: &[ParameterInfo] = &[X, V, ParameterInfo::new("force", "F", "N")];

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
    /// The stage with its seven parameters in the order of the fields.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] naming the parameter that is out of its range.
    pub fn new(values: &[f64; 7]) -> Result<Self> {
        let [mass, damping, stiffness, piezo_coefficient, rest_stiffness, coulomb, exponent] =
            *values;
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

impl KernelModel for FirstOrderDahlStage {
    type Kernel = FirstOrderDahlKernel;

    fn lumped(&self) -> LumpedStage<FirstOrderDahlKernel> {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let Self { piezo_coefficient, rest_stiffness, coulomb_force, exponent, .. } = *self;
        let values =
            [mass, damping, stiffness, piezo_coefficient, rest_stiffness, coulomb_force, exponent];
        let kernel = FirstOrderDahlKernel { exponent };
        LumpedStage { kernel, parameters: leading(&values) }
    }

    fn memory(&self, state: &[f64]) -> BoucWenState<f64> {
        let [_, _, value] = leading(state);
        BoucWenState { value, ..self.operator().rest() }
    }

    fn state(&self, memory: &BoucWenState<f64>) -> Vec<f64> {
        vec![memory.value]
    }
}

impl LumpedModel for FirstOrderDahlStage {
    const INFO: ModelInfo = ModelInfo {
        name: "first-order-dahl",
        title: "Dahl, first order",
        drive_unit: "V",
        parameters: PARAMETERS,
        state: STATE,
        published: &[],
    };

    type Inverse = FirstOrderDahlInverse;

    fn build(values: &Values) -> Result<Self> {
        Self::new(&values.numbers())
    }

    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]> {
        plants_with_friction(&self.operator(), &self.mechanics, self.piezo_coefficient, low, high)
    }

    fn inverse(&self, dt: f64) -> Result<FirstOrderDahlInverse> {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let hysteresis = (self.rest_stiffness, self.coulomb_force, self.exponent);
        let piezo = self.piezo_coefficient;
        Ok(FirstOrderDahlInverse::new(mass, damping, stiffness, piezo, hysteresis, dt)?)
    }
}

/// A stage with friction on its settled loop between the displacements that the two voltages lead
/// to without friction: `T/(K + dF/dx)`.
pub(in crate::models) fn plants_with_friction<O: Operator<f64>>(
    operator: &O,
    mechanics: &Mechanics,
    piezo: f64,
    low: f64,
    high: f64,
) -> Result<[LoopPlant; 3]> {
    let Mechanics { mass, damping, stiffness } = *mechanics;
    let ends = [low, high].map(|volts| piezo * volts / stiffness);
    let ends = if piezo < 0.0 { [ends[1], ends[0]] } else { ends };
    let gain = |slope: f64| piezo / (stiffness + slope);
    let gains = Gains::of(operator, ends[0], ends[1], gain)?;
    gains.plants(|gain| {
        let mechanics = Mechanics { mass, damping, stiffness: piezo / gain };
        LoopPlant::mechanical(&mechanics, piezo)
    })
}

impl Searchable for FirstOrderDahlStage {
    const NONSMOOTH: bool = true;

    fn ranges(of: &Measures, held: &Held) -> Result<Ranges> {
        let limit = held.value("coulomb_force").map(|limit| 10.0 * limit / of.stroke);
        let hints = [held.value("rest_stiffness"), limit];
        let (soft, hard) = of.stiffness(held, held.value("piezo_coefficient"), &hints);
        let [mass, damping, stiffness] = of.mechanical((soft, hard));
        Ok(vec![
            ("mass", mass),
            ("damping", damping),
            ("stiffness", stiffness),
            ("piezo_coefficient", of.piezo(soft * of.gain, hard * of.gain)),
            // The path to the Coulomb force is between a hundredth of the stroke and all of it.
            ("rest_stiffness", (1e-2 * soft, 10.0 * hard)),
            ("coulomb_force", (1e-3 * soft * of.stroke, hard * of.stroke)),
        ])
    }

    fn kernel<V: KernelVisitor>(held: &Held, _order: Order, visitor: V) -> V::Output {
        visitor.visit(FirstOrderDahlKernel { exponent: held.value("exponent").unwrap_or(1.0) })
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
        FirstOrderDahl { rest_stiffness, coulomb_force, exponent: N::Lane::of(self.exponent) }
    }
}

impl Kernel for FirstOrderDahlKernel {
    type Coupling<N: Number> = NonsmoothCoupling<N, FirstOrderDahl<N>>;

    #[inline(always)]
    fn coupling<N: Number>(
        &self,
        parameters: &Parameters<N>,
        step: f64,
        halvings: u32,
    ) -> (Self::Coupling<N>, N) {
        let linear = linear(parameters, step, halvings);
        (NonsmoothCoupling { linear, operator: self.operator(parameters) }, parameters[3])
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
        let [_, _, stiffness, piezo, ..] = *parameters;
        equilibrium::feedback(&self.operator(parameters), stiffness, from, piezo * volts)
    }

    #[inline(always)]
    fn force(&self, _parameters: &Parameters<f64>, memory: &BoucWenState<f64>) -> f64 {
        memory.value
    }
}
