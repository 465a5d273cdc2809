//! The LuGre stage: friction that depends on the speed, in feedback on linear mechanics.
//!
//! ```text
//! M x'' + D x' + K x = T u - F,   F = sigma0 z + sigma1 z' + sigma2 x'
//! z' = x' - sigma0 |x'| z/g(x'),   g(v) = Fc + (Fs - Fc) exp(-(v/vs)^2)
//! ```
//!
//! Canudas de Wit, Olsson, Astrom and Lischinsky 1995, IEEE Trans. Autom. Control 40(3), 419-425,
//! doi 10.1109/9.376053. With Fs = Fc and without sigma1 and sigma2 it is the stage of
//! [`super::first_order_dahl::FirstOrderDahlStage`] with exponent 1. Displacement and drive determine the sum of D and
//! sigma2 only.

use piezotrack_control::hysteresis::{BoucWenState, FirstOrderDahl, LuGre, Operator};
use piezotrack_control::inverse::LuGreInverse;
use piezotrack_control::{Number, Real};

use super::first_order_dahl::plants_with_friction;
use crate::design::LoopPlant;
use crate::error::{Error, Result, not_negative, not_zero, positive};
use crate::integrator::{
    Kernel, LuGreCoupling, LuGreMemory, LumpedStage, Mechanics, Order, Parameters, equilibrium,
    linear,
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
    ParameterInfo::new("rest_stiffness", "sigma0", "N/m").force(),
    ParameterInfo::new("micro_damping", "sigma1", "N s/m").force().or(0.0),
    ParameterInfo::new("coulomb_force", "Fc", "N").force(),
    ParameterInfo::new("static_ratio", "Fs/Fc", "").or(1.0),
    ParameterInfo::new("stribeck_velocity", "vs", "m/s").or(STRIBECK_VELOCITY),
    ParameterInfo::new("viscous_friction", "sigma2", "N s/m").force().or(0.0).never_searched(
        "viscous_friction held, in parameters=: a record determines its sum with the damping only",
    ),
];

/// Speed that is held where it is not searched, m/s.
const STRIBECK_VELOCITY: f64 = 1e-3;

const STATE: &[ParameterInfo] = &[X, V, ParameterInfo::new("deflection", "z", "m")];

/// Halvings of the matrix exponential beside those for the damping alone, which the damping of the
/// friction is not part of: see [`MOST_DAMPING`].
const MORE_HALVINGS: u32 = 20;

/// Most damping of the friction, over that of the mechanics or its natural frequency times the mass,
/// whichever is larger.
const MOST_DAMPING: f64 = 5e5;

/// A stage with LuGre friction.
///
/// | field | symbol | unit | range |
/// | --- | --- | --- | --- |
/// | `mechanics` | M, D, K | kg, N s/m, N/m | > 0, >= 0, > 0 |
/// | `piezo_coefficient` | T | N/V | not 0 |
/// | `friction` | sigma0, sigma1, Fc, Fs, vs | N/m, N s/m, N, N, m/s | > 0, >= 0, > 0, > 0, > 0 |
/// | `viscous_friction` | sigma2 | N s/m | >= 0 |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LuGreStage {
    /// Mass, damping and stiffness.
    pub mechanics: Mechanics,
    /// T, N/V.
    pub piezo_coefficient: f64,
    /// The friction without its viscous part.
    pub friction: LuGre<f64>,
    /// sigma2, N s/m.
    pub viscous_friction: f64,
}

impl LuGreStage {
    /// The stage with its ten parameters: M, D, K, T, sigma0, sigma1, Fc, Fs/Fc, vs and sigma2.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the parameter that is out of its range.
    pub fn new(values: &[f64; 10]) -> Result<Self> {
        let [mass, damping, stiffness, piezo_coefficient, .., viscous] = *values;
        let [_, _, _, _, rest, micro, coulomb, ratio, velocity, _] = *values;
        let mechanics = Mechanics::new(mass, damping, stiffness)?;
        not_zero("piezo_coefficient", piezo_coefficient, "N/V")?;
        let friction = LuGre {
            rest_stiffness: positive("rest_stiffness", rest, "N/m")?,
            micro_damping: not_negative("micro_damping", micro, "N s/m")?,
            coulomb_force: positive("coulomb_force", coulomb, "N")?,
            static_force: coulomb * positive("static_ratio", ratio, "")?,
            stribeck_velocity: positive("stribeck_velocity", velocity, "m/s")?,
        };
        not_negative("viscous_friction", viscous, "N s/m")?;
        let most = MOST_DAMPING * mechanics.rate() * mass;
        if micro + viscous > most {
            let expected = format!("{most:.6} N s/m or less together with viscous_friction");
            return Err(Error::parameter("micro_damping", format!("{micro} N s/m"), expected));
        }
        Ok(Self { mechanics, piezo_coefficient, friction, viscous_friction: viscous })
    }

    /// The parameters in their order.
    #[must_use]
    pub fn values(&self) -> [f64; 10] {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let LuGre { rest_stiffness, micro_damping, coulomb_force, static_force, stribeck_velocity } =
            self.friction;
        [
            mass,
            damping,
            stiffness,
            self.piezo_coefficient,
            rest_stiffness,
            micro_damping,
            coulomb_force,
            static_force / coulomb_force,
            stribeck_velocity,
            self.viscous_friction,
        ]
    }
}

/// The friction in a motion so slow that only its path matters.
#[inline(always)]
fn slow<N: Number>(friction: &LuGre<N>) -> FirstOrderDahl<N> {
    let LuGre { rest_stiffness, static_force, .. } = *friction;
    FirstOrderDahl { rest_stiffness, coulomb_force: static_force, exponent: N::Lane::of(1.0) }
}

impl KernelModel for LuGreStage {
    type Kernel = LuGreKernel;

    fn lumped(&self) -> LumpedStage<LuGreKernel> {
        LumpedStage { kernel: LuGreKernel, parameters: leading(&self.values()) }
    }

    fn memory(&self, state: &[f64]) -> LuGreMemory<f64> {
        let [_, velocity, deflection] = leading(state);
        LuGreMemory { deflection, velocity }
    }

    fn state(&self, memory: &LuGreMemory<f64>) -> Vec<f64> {
        vec![memory.deflection]
    }
}

impl LumpedModel for LuGreStage {
    const INFO: ModelInfo = ModelInfo {
        name: "lugre",
        title: "LuGre",
        drive_unit: "V",
        parameters: PARAMETERS,
        state: STATE,
        published: &[],
    };

    type Inverse = LuGreInverse;

    fn build(values: &Values) -> Result<Self> {
        Self::new(&values.numbers())
    }

    /// On a slow settled loop, without the damping of the bristles, which is gone where they slide.
    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]> {
        let Mechanics { damping, .. } = self.mechanics;
        let mechanics = Mechanics { damping: damping + self.viscous_friction, ..self.mechanics };
        plants_with_friction(&slow(&self.friction), &mechanics, self.piezo_coefficient, low, high)
    }

    fn inverse(&self, dt: f64) -> Result<LuGreInverse> {
        let Mechanics { mass, damping, stiffness } = self.mechanics;
        let mechanics = [mass, damping + self.viscous_friction, stiffness];
        Ok(LuGreInverse::new(mechanics, self.piezo_coefficient, &self.friction, dt)?)
    }
}

impl Searchable for LuGreStage {
    const NONSMOOTH: bool = true;

    fn ranges(of: &Measures, held: &Held) -> Result<Ranges> {
        let limit = held.value("coulomb_force").map(|limit| 10.0 * limit / of.stroke);
        let hints = [held.value("rest_stiffness"), limit];
        let (soft, hard) = of.stiffness(held, held.value("piezo_coefficient"), &hints);
        let [mass, damping, stiffness] = of.mechanical((soft, hard));
        // The fastest motion that a sine of the same size and rate has.
        let fastest = of.stroke * of.displacement_rate;
        Ok(vec![
            ("mass", mass),
            ("damping", damping),
            ("stiffness", stiffness),
            ("piezo_coefficient", of.piezo(soft * of.gain, hard * of.gain)),
            ("rest_stiffness", (1e-2 * soft, 10.0 * hard)),
            ("micro_damping", (1e-2 * damping.0, damping.1)),
            ("coulomb_force", (1e-3 * soft * of.stroke, hard * of.stroke)),
            ("static_ratio", (0.3, 3.0)),
            ("stribeck_velocity", (0.01 * fastest, 3.0 * fastest)),
        ])
    }

    fn kernel<V: KernelVisitor>(_held: &Held, _order: Order, visitor: V) -> V::Output {
        visitor.visit(LuGreKernel)
    }
}

/// Stages with LuGre friction.
#[derive(Clone, Copy, Debug)]
pub struct LuGreKernel;

impl LuGreKernel {
    #[inline(always)]
    fn friction<N: Number>(parameters: &Parameters<N>) -> LuGre<N> {
        let [_, _, _, _, rest_stiffness, micro_damping, coulomb_force, ratio, velocity, ..] =
            *parameters;
        LuGre {
            rest_stiffness,
            micro_damping,
            coulomb_force,
            static_force: coulomb_force * ratio,
            stribeck_velocity: velocity,
        }
    }
}

/// Place of sigma2 among the parameters.
const VISCOUS: usize = 9;

impl Kernel for LuGreKernel {
    type Coupling<N: Number> = LuGreCoupling<N>;

    #[inline(always)]
    fn coupling<N: Number>(
        &self,
        parameters: &Parameters<N>,
        step: f64,
        halvings: u32,
    ) -> (Self::Coupling<N>, N) {
        let friction = Self::friction(parameters);
        let mut damped = *parameters;
        damped[1] = parameters[1] + friction.micro_damping + parameters[VISCOUS];
        let linear = linear(&damped, step, halvings + MORE_HALVINGS);
        (LuGreCoupling { linear, friction, rate: parameters[0].like(1.0 / step) }, parameters[3])
    }

    #[inline(always)]
    fn rest<N: Number>(&self, parameters: &Parameters<N>) -> LuGreMemory<N> {
        let zero = parameters[0].like(0.0);
        LuGreMemory { deflection: zero, velocity: zero }
    }

    /// So slowly that the speed does not matter.
    #[inline(always)]
    fn approach<N: Number>(
        &self,
        parameters: &Parameters<N>,
        from: (N, LuGreMemory<N>),
        volts: N,
    ) -> (N, LuGreMemory<N>) {
        let [_, _, stiffness, piezo, ..] = *parameters;
        let friction = Self::friction(parameters);
        let operator = slow(&friction);
        let value = friction.rest_stiffness * from.1.deflection;
        let before = BoucWenState { value, ..operator.rest() };
        let (x, after) =
            equilibrium::feedback(&operator, stiffness, (from.0, before), piezo * volts);
        let deflection = after.value / friction.rest_stiffness;
        (x, LuGreMemory { deflection, velocity: x.like(0.0) })
    }

    #[inline(always)]
    fn force(&self, parameters: &Parameters<f64>, memory: &LuGreMemory<f64>) -> f64 {
        let friction = Self::friction(parameters);
        let LuGreMemory { deflection, velocity } = *memory;
        let damping = friction.micro_damping + parameters[VISCOUS];
        friction.force(deflection, velocity) + damping * velocity
    }
}
