//! The Dahl stage as a model: its motion, its identification, its inverse.

use piezotrack_control::hysteresis::DahlState;
use piezotrack_control::inverse::{DahlInverse, InverseState, SampledDahlInverse};

use super::kernels::{FrictionKernel, SmoothKernel};
use super::runge_kutta;
use super::stage::{DahlStage, DahlStageState, PARAMETERS, STATE};
use super::virgin_branch::extremes;
use crate::design::LoopPlant;
use crate::error::{Error, Result, positive};
use crate::integrator::{FEW_TERMS, Instant, Kernel, Memory, Motion, Order, TERMS, agrees};
use crate::models::parameters::search_ranges::{Measures, Ranges};
use crate::models::parameters::values::{Held, Values};
use crate::models::plant::Settling;
use crate::models::traits::{
    Experiment, Invertible, KernelVisitor, Method, ModelInfo, Response, Searchable, StageModel,
    finite_state, from_rest_only,
};

impl DahlStage {
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
