//! Traits that a model implements for the integrator, and the state of a step.

use piezotrack_control::Number;

use super::propagator::Propagator;

/// Displacement, scaled velocity `h x'` and the operator's memory.
#[derive(Clone, Copy, Debug)]
pub struct FeedbackState<N, M> {
    /// Displacement, m.
    pub x: N,
    /// Velocity times the step, m.
    pub w: N,
    /// Memory of the operator.
    pub memory: M,
}

/// A hysteresis coupled with linear mechanics, as one step in time sees it.
pub trait Coupling<N> {
    /// What the hysteresis remembers.
    type Memory: Copy;

    /// The state one step on, under a drive force that goes from `drive` to `drive + rise`, N.
    fn step(
        &self,
        state: &FeedbackState<N, Self::Memory>,
        drive: N,
        rise: N,
    ) -> FeedbackState<N, Self::Memory>;
}

/// Parameters of a model, SI, mass, damping and stiffness first; those it does not have are 0.
pub type Parameters<N> = [N; MOST_PARAMETERS];

/// Most parameters that a model has.
pub const MOST_PARAMETERS: usize = 9;

/// A model built from plain parameters, for one stage or for lanes of them.
pub trait Kernel<N> {
    /// Its step.
    type Coupling: Coupling<N>;

    /// What 1 V enters the step as.
    fn gain(&self, parameters: &Parameters<N>) -> N;

    /// The step for steps of `step` seconds.
    fn coupling(&self, parameters: &Parameters<N>, step: f64, halvings: u32) -> Self::Coupling;

    /// The memory before any motion.
    fn rest(&self, parameters: &Parameters<N>) -> <Self::Coupling as Coupling<N>>::Memory;

    /// Hysteresis force, N.
    fn force(
        &self,
        parameters: &Parameters<N>,
        memory: &<Self::Coupling as Coupling<N>>::Memory,
    ) -> N;
}

/// The linear part of a stage over steps of `step` seconds.
#[inline(always)]
pub(crate) fn linear<N: Number>(
    parameters: &Parameters<N>,
    step: f64,
    halvings: u32,
) -> Propagator<N> {
    let [mass, damping, stiffness, ..] = *parameters;
    let inverse = mass.like(1.0) / mass;
    Propagator::new(inverse, damping / mass, stiffness / mass, step, halvings)
}

/// Name, symbol and unit of one parameter of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterInfo {
    /// The name that both languages use.
    pub name: &'static str,
    /// The symbol in the literature.
    pub symbol: &'static str,
    /// SI unit, empty where there is none.
    pub unit: &'static str,
}
