//! The stage with first-order Dahl elements in parallel, in feedback on linear mechanics.
//!
//! ```text
//! M x'' + D x' + K x = T u - sum F_j,   j = 1, 2, 3
//! dF_j/dx = sigma_j (1 - F_j sgn(x')/Fc_j),   Fc_j = sigma_j l rho^(j-1)
//! ```
//!
//! One element has one curvature, that of the path l after which its force changes little; several
//! give loops of any size their tips. The paths are a geometric sequence, so that no two sets of
//! parameters differ by the order of the elements only.

use piezotrack_control::Number;
use piezotrack_control::hysteresis::{
    FRICTION_ELEMENTS, Operator, ParallelDahl, ParallelDahlState,
};
use piezotrack_control::inverse::ParallelDahlInverse;

use super::first_order_dahl::plants_with_friction;
use crate::design::LoopPlant;
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
    ParameterInfo::new(REST_STIFFNESS[0], "sigma1", "N/m").force(),
    ParameterInfo::new(REST_STIFFNESS[1], "sigma2", "N/m").force(),
    ParameterInfo::new(REST_STIFFNESS[2], "sigma3", "N/m").force(),
    ParameterInfo::new("yield_path", "l", "m"),
    ParameterInfo::new("path_ratio", "rho", ""),
];

const REST_STIFFNESS: [&str; FRICTION_ELEMENTS] =
    ["rest_stiffness_1", "rest_stiffness_2", "rest_stiffness_3"];

const STATE: &[ParameterInfo] = &[
    X,
    V,
    ParameterInfo::new("force_1", "F1", "N"),
    ParameterInfo::new("force_2", "F2", "N"),
    ParameterInfo::new("force_3", "F3", "N"),
];

/// Largest ratio of the paths of two elements.
const MOST_RATIO: f64 = 1000.0;

/// A stage with first-order Dahl elements in parallel.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `mechanics` | M, D, K | kg, N s/m, N/m | > 0, >= 0, > 0 |
/// | `piezo_coefficient` | T | N/V | not 0 |
/// | `rest_stiffnesses` | `sigma_j` | N/m | >= 0 |
/// | `yield_path` | l | m | > 0 |
/// | `path_ratio` | rho | 1 | 1 to 1000 |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParallelDahlStage {
    /// Mass, damping and stiffness.
    pub mechanics: Mechanics,
    /// T, N/V.
    pub piezo_coefficient: f64,
    /// Slope of each element's force where it is 0, N/m.
    pub rest_stiffnesses: [f64; FRICTION_ELEMENTS],
    /// Path of the first element, Fc/sigma, m.
    pub yield_path: f64,
    /// Path of an element over that of the one before.
    pub path_ratio: f64,
}

impl ParallelDahlStage {
    /// The stage with its nine parameters in the order of the fields.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] naming the parameter that is out of its range.
    pub fn new(values: &[f64; 9]) -> Result<Self> {
        let [mass, damping, stiffness, piezo_coefficient, first, second, third, path, ratio] =
            *values;
        let mechanics = Mechanics::new(mass, damping, stiffness)?;
        not_zero("piezo_coefficient", piezo_coefficient, "N/V")?;
        let rest_stiffnesses = [first, second, third];
        for (name, value) in REST_STIFFNESS.into_iter().zip(rest_stiffnesses) {
            not_negative(name, value, "N/m")?;
        }
        within("path_ratio", ratio, 1.0, MOST_RATIO)?;
        Ok(Self {
            mechanics,
            piezo_coefficient,
            rest_stiffnesses,
            yield_path: positive("yield_path", path, "m")?,
            path_ratio: ratio,
        })
    }

    /// The hysteresis operator.
    #[must_use]
    pub fn operator(&self) -> ParallelDahl<f64> {
        ParallelDahl::geometric(self.rest_stiffnesses, self.yield_path, self.path_ratio)
    }
}

impl KernelModel for ParallelDahlStage {
    type Kernel = ParallelDahlKernel;

    fn lumped(&self) -> LumpedStage<ParallelDahlKernel> {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let [first, second, third] = self.rest_stiffnesses;
        let Self { piezo_coefficient, yield_path, path_ratio, .. } = *self;
        let values = [
            mass,
            damping,
            stiffness,
            piezo_coefficient,
            first,
            second,
            third,
            yield_path,
            path_ratio,
        ];
        LumpedStage { kernel: ParallelDahlKernel, parameters: leading(&values) }
    }

    fn memory(&self, state: &[f64]) -> ParallelDahlState<f64> {
        let [_, _, first, second, third] = leading(state);
        ParallelDahlState { forces: [first, second, third], ..self.operator().rest() }
    }

    fn state(&self, memory: &ParallelDahlState<f64>) -> Vec<f64> {
        memory.forces.to_vec()
    }
}

impl LumpedModel for ParallelDahlStage {
    const INFO: ModelInfo = ModelInfo {
        name: "parallel-dahl",
        title: "Dahl elements in parallel",
        drive_unit: "V",
        parameters: PARAMETERS,
        state: STATE,
        published: &[],
    };

    type Inverse = ParallelDahlInverse;

    fn build(values: &Values) -> Result<Self> {
        Self::new(&values.numbers())
    }

    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]> {
        plants_with_friction(&self.operator(), &self.mechanics, self.piezo_coefficient, low, high)
    }

    fn inverse(&self, dt: f64) -> Result<ParallelDahlInverse> {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let hysteresis = (self.rest_stiffnesses, self.yield_path, self.path_ratio);
        let piezo = self.piezo_coefficient;
        Ok(ParallelDahlInverse::new(mass, damping, stiffness, piezo, hysteresis, dt)?)
    }
}

impl Searchable for ParallelDahlStage {
    const NONSMOOTH: bool = true;

    fn ranges(of: &Measures, held: &Held) -> Result<Ranges> {
        let hints = REST_STIFFNESS.map(|name| held.value(name));
        let (soft, hard) = of.stiffness(held, held.value("piezo_coefficient"), &hints);
        let [mass, damping, stiffness] = of.mechanical((soft, hard));
        let mut ranges = vec![
            ("mass", mass),
            ("damping", damping),
            ("stiffness", stiffness),
            ("piezo_coefficient", of.piezo(soft * of.gain, hard * of.gain)),
        ];
        // An element without effect, up to one that holds most of the force.
        ranges.extend(REST_STIFFNESS.map(|name| (name, (1e-3 * soft, 10.0 * hard))));
        // The first element yields within a small part of a loop, the last mostly within all of it. A
        // larger ratio fits single records better and ends more often in a local minimum.
        ranges.push(("yield_path", (3e-3 * of.stroke, 0.3 * of.stroke)));
        ranges.push(("path_ratio", (1.5, 8.0)));
        Ok(ranges)
    }

    fn kernel<V: KernelVisitor>(_held: &Held, _order: Order, visitor: V) -> V::Output {
        visitor.visit(ParallelDahlKernel)
    }
}

/// Stages with first-order Dahl elements in parallel.
#[derive(Clone, Copy, Debug)]
pub struct ParallelDahlKernel;

impl ParallelDahlKernel {
    #[inline(always)]
    fn operator<N: Number>(parameters: &Parameters<N>) -> ParallelDahl<N> {
        let [_, _, _, _, first, second, third, yield_path, path_ratio, ..] = *parameters;
        ParallelDahl::geometric([first, second, third], yield_path, path_ratio)
    }
}

impl Kernel for ParallelDahlKernel {
    type Coupling<N: Number> = NonsmoothCoupling<N, ParallelDahl<N>>;

    #[inline(always)]
    fn coupling<N: Number>(
        &self,
        parameters: &Parameters<N>,
        step: f64,
        halvings: u32,
    ) -> (Self::Coupling<N>, N) {
        let linear = linear(parameters, step, halvings);
        (NonsmoothCoupling { linear, operator: Self::operator(parameters) }, parameters[3])
    }

    #[inline(always)]
    fn rest<N: Number>(&self, parameters: &Parameters<N>) -> ParallelDahlState<N> {
        Self::operator(parameters).rest()
    }

    #[inline(always)]
    fn approach<N: Number>(
        &self,
        parameters: &Parameters<N>,
        from: (N, ParallelDahlState<N>),
        volts: N,
    ) -> (N, ParallelDahlState<N>) {
        let [_, _, stiffness, piezo, ..] = *parameters;
        equilibrium::feedback(&Self::operator(parameters), stiffness, from, piezo * volts)
    }

    #[inline(always)]
    fn force(&self, parameters: &Parameters<f64>, memory: &ParallelDahlState<f64>) -> f64 {
        Self::operator(parameters).output(memory).0
    }
}
