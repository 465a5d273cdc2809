//! The Dahl stage: second-order Dahl hysteresis in feedback on linear mechanics.
//!
//! ```text
//! M x'' + D x' + K x = T u - Fh,   Fh = b1 q1 + sgn(x') b0 q2
//! q1' = q2 x',   q2' = (up - a2 q1 - sgn(x') a1 q2) x'
//! ```
//!
//! Xu and Li 2010, equations (2), (7), (8) and Table 1, doi 10.1115/1.4001712.

mod kernels;
mod runge_kutta;
mod virgin_branch;

use piezotrack_control::hysteresis::DahlState;
use piezotrack_control::inverse::{DahlInverse, InverseState, SampledDahlInverse};

use super::parameters::mechanics_parameters::{DAMPING, MASS, PIEZO_COEFFICIENT, STIFFNESS, V, X};
use super::parameters::search_ranges::{Measures, Ranges};
use super::parameters::values::{Held, ParameterInfo, Values};
use super::plant::Settling;
use super::traits::{
    Experiment, Invertible, KernelVisitor, Method, ModelInfo, Response, Searchable, StageModel,
    finite_state, from_rest_only,
};
use crate::design::LoopPlant;
use crate::error::{Error, Result, finite, not_negative, not_zero, positive};
use crate::integrator::{
    FEW_TERMS, FrictionParameters, Instant, Kernel, LumpedStage, Mechanics, Memory, Motion, Order,
    TERMS, agrees,
};

pub use kernels::{DahlFlow, FrictionKernel, SmoothKernel};
pub use virgin_branch::{extremes, linearised};

const PARAMETERS: &[ParameterInfo] = &[
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

const STATE: &[ParameterInfo] =
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
        LumpedStage { kernel, parameters: super::traits::leading(&self.values()) }
    }

    /// Motion to fourth order, or to second where that is accurate enough: for slow drives it is,
    /// in half the time. The error is a third of the estimate to second order, a fifteenth to
    /// fourth.
    fn smooth(
        &self,
        experiment: &Experiment<'_>,
        from: &DahlStageState,
    ) -> Result<Option<Response>> {
        let Experiment { drive, accuracy, stop, .. } = *experiment;
        let memory = self.memory(from);
        let start = Instant { x: from.x, v: from.v, memory };
        let response = |motion: Motion<DahlState<f64>>| {
            let (q1, q2) = self.states(&motion.last.memory);
            response(motion, q1, q2, true)
        };
        let quick = self.lumped(SmoothKernel::<TERMS, false>).simulate_once(drive, start, stop);
        if let Ok(Some(quick)) = quick
            && agrees(f64::INFINITY, quick.error_estimate, accuracy)
        {
            return Ok(Some(response(quick)));
        }
        let motion =
            self.lumped(SmoothKernel::<TERMS, true>).simulate(drive, start, accuracy, stop)?;
        Ok(motion.map(response))
    }

    /// Motion with sticking and breaking away.
    fn sliding(
        &self,
        experiment: &Experiment<'_>,
        from: &DahlStageState,
    ) -> Result<Option<Response>> {
        let Experiment { drive, accuracy, stop, .. } = *experiment;
        let operator = DahlState { force: from.q1, slope: from.q2 };
        let memory = self.friction().memory(from.v, operator);
        let start = Instant { x: from.x, v: from.v, memory };
        let motion = self.lumped(FrictionKernel).simulate(drive, start, accuracy, stop)?;
        Ok(motion.map(|motion| {
            let end: Memory<FrictionKernel, f64> = motion.last.memory;
            let unique = FrictionKernel.unique(&end);
            response(motion, end.operator.force, end.operator.slope, unique)
        }))
    }
}

/// The motion with the operator's state at its end.
fn response<M>(motion: Motion<M>, q1: f64, q2: f64, unique: bool) -> Response {
    let last = Values::scalars(STATE, &[motion.last.x, motion.last.v, q1, q2]);
    Response::of(motion, last, unique)
}

impl StageModel for DahlStage {
    const INFO: ModelInfo = ModelInfo {
        name: "dahl",
        title: "Dahl, second order",
        drive_unit: "V",
        parameters: PARAMETERS,
        state: STATE,
        published: &[("xu_li_2010", || Values::scalars(PARAMETERS, &Self::xu_li_2010().values()))],
    };

    fn build(values: &Values) -> Result<Self> {
        Self::new(&values.numbers())
    }

    fn equilibrium(&self, voltages: &[f64]) -> Result<Values> {
        let DahlStageState { x, v, q1, q2 } = self.settled(voltages);
        finite_state(Values::scalars(STATE, &[x, v, q1, q2]), voltages)
    }

    fn simulate(&self, experiment: &Experiment<'_>) -> Result<Option<Response>> {
        positive("accuracy", experiment.accuracy, "m")?;
        let [x, v, q1, q2] = experiment.initial.map_or([0.0; 4], Values::numbers);
        let from = DahlStageState { x, v, q1, q2 };
        match experiment.method {
            Method::Exponential if self.has_friction() => self.sliding(experiment, &from),
            Method::Exponential => self.smooth(experiment, &from),
            Method::Rk4 | Method::Rk45 => runge_kutta::simulate(self, experiment, from),
        }
    }

    /// At the stiffest, the middle and the softest displacement between those that the two
    /// voltages lead to without hysteresis, on the virgin branch.
    fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]> {
        let ends =
            [low, high].map(|volts| self.piezo_coefficient * volts / self.mechanics.stiffness);
        let [soft, stiff] = extremes(self, ends[0].min(ends[1])..=ends[0].max(ends[1]))?;
        let half = 0.5 * (ends[0] + ends[1]);
        Ok([stiff, extremes(self, half..=half)?[0].clone(), soft])
    }
}

impl Searchable for DahlStage {
    fn ranges(of: &Measures, held: &Held) -> Result<Ranges> {
        let up = held.value("up").unwrap_or(30.0);
        if up == 0.0 {
            let expected = "a value other than 0: without it no hysteresis";
            return Err(Error::parameter("up", 0, expected));
        }
        // Half the curvature times the stroke is a stiffness.
        let hints = [
            held.value("b1").map(|b1| 0.5 * b1 * up * of.stroke),
            held.value("b0").map(|b0| b0 * up),
        ];
        let (soft, hard) = of.stiffness(held, held.value("piezo_coefficient"), &hints);
        let [mass, damping, stiffness] = of.mechanical((soft, hard));
        // A force of half the elastic one at full stroke, of either sign.
        let curvature = hard / (up.abs().max(f64::MIN_POSITIVE) * of.stroke);
        Ok(vec![
            ("mass", mass),
            ("damping", damping),
            ("stiffness", stiffness),
            ("piezo_coefficient", of.piezo(soft * of.gain, hard * of.gain)),
            // From 100 strokes of memory to a tenth: with a1 = 0 the operator is a lossless spring.
            ("a1", (1e-2 / of.stroke, 10.0 / of.stroke)),
            ("a2", (1e-2 / (of.stroke * of.stroke), 40.0 / (of.stroke * of.stroke))),
            ("b1", (-2.0 * curvature, 2.0 * curvature)),
            // q2 is about up times the path: a friction of half the elastic force.
            ("b0", (0.0, 0.5 * hard / up.abs().max(f64::MIN_POSITIVE))),
        ])
    }

    fn kernel<V: KernelVisitor>(held: &Held, order: Order, visitor: V) -> V::Output {
        if !Self::has_second_order(held) {
            visitor.visit(FrictionKernel)
        } else if order == Order::Second {
            visitor.visit(SmoothKernel::<FEW_TERMS, false>)
        } else {
            visitor.visit(SmoothKernel::<TERMS, true>)
        }
    }

    /// Without dry friction.
    fn has_second_order(held: &Held) -> bool {
        held.value("b0") == Some(0.0)
    }
}

impl Invertible for DahlStage {
    type Inverse = SampledDahlInverse;

    fn inverse(
        &self,
        dt: f64,
        initial: Option<&Values>,
    ) -> Result<(SampledDahlInverse, InverseState)> {
        from_rest_only(initial)?;
        let [m, d, k, t, a1, a2, b1, b0, up] = self.values();
        let inverse = DahlInverse::new(m, d, k, t, a1, a2, b1, b0, up)?.at(dt)?;
        Ok((inverse, inverse.rest()))
    }
}
