//! The asymmetric Bouc-Wen stage: hysteresis at the input whose rising and falling branches differ.
//!
//! ```text
//! m x'' + b x' + k x = k (d u - h)
//! h' = alpha d u' - |h| psi u'
//! psi = beta sgn(u' h) + gamma + delta sgn(h) + epsilon sgn(u')
//! ```
//!
//! The stage of Xu and Li 2010, equations (19) and (20), doi 10.1115/1.4001712, with the generalised
//! shape function of Song and Der Kiureghian 2006, doi
//! 10.1061/(ASCE)0733-9399(2006)132:6(610), for a drive of one sign. One more number than the
//! symmetric stage has, delta, makes the rates of the rising branch differ from those of the falling
//! one; with epsilon each of the four combinations of direction and sgn(h) has a rate of its own.

use piezotrack_control::Number;
use piezotrack_control::hysteresis::{AsymmetricBoucWen, BoucWenState};
use piezotrack_control::inverse::AsymmetricBoucWenInverse;

use super::bouc_wen::{self as symmetric, BoucWenStage};
use super::input_kernel::{InputHysteresis, InputKernel, plants_with_input};
use crate::design::LoopPlant;
use crate::error::{Result, finite, positive};
use crate::integrator::{InputMemory, LumpedStage, Order, Parameters};
use crate::models::parameters::search_ranges::{Measures, Ranges};
use crate::models::parameters::values::{Held, ParameterInfo, Values};
use crate::models::plant::KernelModel;
use crate::models::traits::{KernelVisitor, LumpedModel, ModelInfo, Searchable, leading};

const PARAMETERS: &[ParameterInfo] = &[
    symmetric::PARAMETERS[0],
    symmetric::PARAMETERS[1],
    symmetric::PARAMETERS[2],
    symmetric::PARAMETERS[3],
    symmetric::PARAMETERS[4],
    symmetric::PARAMETERS[5],
    symmetric::PARAMETERS[6],
    ParameterInfo::new("asymmetry", "delta", "1/V"),
    ParameterInfo::new("sign_asymmetry", "epsilon", "1/V").or(0.0),
];

/// A stage with asymmetric Bouc-Wen hysteresis at its input.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `symmetric` | | | exponent 1 |
/// | `asymmetry` | delta | 1/V | any |
/// | `sign_asymmetry` | epsilon | 1/V | any |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsymmetricBoucWenStage {
    /// The stage without asymmetries.
    pub symmetric: BoucWenStage,
    /// delta: by how much the rates are higher while the drive rises, and lower while it falls.
    pub asymmetry: f64,
    /// epsilon: by how much the rates are higher above h = 0, and lower below it.
    pub sign_asymmetry: f64,
}

impl AsymmetricBoucWenStage {
    /// The stage with its nine parameters: those of [`BoucWenStage`] up to gamma, delta and epsilon.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] naming the parameter that is out of its range.
    pub fn new(values: &[f64; 9]) -> Result<Self> {
        let [m, b, k, d, alpha, beta, gamma, delta, epsilon] = *values;
        Ok(Self {
            symmetric: BoucWenStage::new(&[m, b, k, d, alpha, beta, gamma, 1.0])?,
            asymmetry: finite("asymmetry", delta, "1/V")?,
            sign_asymmetry: finite("sign_asymmetry", epsilon, "1/V")?,
        })
    }

    /// The parameters in their order.
    #[must_use]
    pub fn values(&self) -> [f64; 9] {
        let [m, b, k, d, alpha, beta, gamma, _] = self.symmetric.values();
        [m, b, k, d, alpha, beta, gamma, self.asymmetry, self.sign_asymmetry]
    }

    /// The hysteresis operator, V to m.
    #[must_use]
    pub fn operator(&self) -> AsymmetricBoucWen<f64> {
        AsymmetricBoucWenHysteresis.operator(&leading(&self.values()))
    }
}

impl KernelModel for AsymmetricBoucWenStage {
    type Kernel = InputKernel<AsymmetricBoucWenHysteresis>;

    fn lumped(&self) -> LumpedStage<Self::Kernel> {
        let kernel = InputKernel(AsymmetricBoucWenHysteresis);
        LumpedStage { kernel, parameters: leading(&self.values()) }
    }

    fn memory(&self, state: &[f64]) -> InputMemory<f64, BoucWenState<f64>> {
        self.symmetric.memory(state)
    }

    fn state(&self, memory: &InputMemory<f64, BoucWenState<f64>>) -> Vec<f64> {
        self.symmetric.state(memory)
    }
}

impl LumpedModel for AsymmetricBoucWenStage {
    const INFO: ModelInfo = ModelInfo {
        name: "asymmetric-bouc-wen",
        title: "asymmetric Bouc-Wen",
        drive_unit: "V",
        parameters: PARAMETERS,
        state: symmetric::STATE,
        published: &[],
    };

    type Inverse = AsymmetricBoucWenInverse;

    fn build(values: &Values) -> Result<Self> {
        Self::new(&values.numbers())
    }

    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]> {
        let BoucWenStage { mechanics, piezo_coefficient, .. } = &self.symmetric;
        plants_with_input(&self.operator(), mechanics, *piezo_coefficient, low, high)
    }

    fn inverse(&self, dt: f64) -> Result<AsymmetricBoucWenInverse> {
        positive("dt", dt, "s")?;
        let [m, b, k, d, alpha, rates @ ..] = self.values();
        Ok(AsymmetricBoucWenInverse::asymmetric([m, b, k, d], alpha, rates)?)
    }
}

impl Searchable for AsymmetricBoucWenStage {
    fn ranges(of: &Measures, held: &Held) -> Result<Ranges> {
        let mut ranges = BoucWenStage::ranges(of, held)?;
        // Of either sign, as gamma.
        let most = MOST_ASYMMETRY * of.gain / of.stroke;
        ranges.push(("asymmetry", (-most, most)));
        ranges.push(("sign_asymmetry", (-most, most)));
        Ok(ranges)
    }

    fn kernel<V: KernelVisitor>(_held: &Held, _order: Order, visitor: V) -> V::Output {
        visitor.visit(InputKernel(AsymmetricBoucWenHysteresis))
    }
}

/// Largest asymmetry that is searched, over the range of the drive.
const MOST_ASYMMETRY: f64 = 3.0;

/// The hysteresis of asymmetric Bouc-Wen stages.
#[derive(Clone, Copy, Debug)]
pub struct AsymmetricBoucWenHysteresis;

impl InputHysteresis for AsymmetricBoucWenHysteresis {
    type Operator<N: Number> = AsymmetricBoucWen<N>;

    #[inline(always)]
    fn operator<N: Number>(&self, parameters: &Parameters<N>) -> AsymmetricBoucWen<N> {
        let [_, _, _, gain, alpha, beta, gamma, asymmetry, sign_asymmetry, ..] = *parameters;
        let rise = alpha * gain;
        AsymmetricBoucWen { rise, beta, gamma, asymmetry, sign_asymmetry }
    }
}
