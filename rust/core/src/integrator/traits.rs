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
pub trait Coupling<N>: Copy {
    /// Whether a step is so short that a loop around it shows.
    const SHORT: bool = false;

    /// State of the hysteresis.
    type Memory: Copy;

    /// The state one step on, under a drive force that goes from `drive` to `drive + rise`, N.
    fn step(
        &self,
        state: &FeedbackState<N, Self::Memory>,
        drive: N,
        rise: N,
    ) -> FeedbackState<N, Self::Memory>;
}

/// Scalar parameters of a model, SI, mass, damping and stiffness first; places beyond those that
/// the model has hold 0.
pub type Parameters<N> = [N; MOST_PARAMETERS];

/// Most scalar parameters that a model has.
pub const MOST_PARAMETERS: usize = 12;

/// State of the hysteresis of a kernel.
pub type Memory<K, N> = <<K as Kernel>::Coupling<N> as Coupling<N>>::Memory;

/// Builds the step of a model from its parameters, for one stage or for lanes of them.
///
/// What is common to all lanes, as an exponent, is in `&self`.
pub trait Kernel: Copy + Send + Sync {
    /// Vectors that a bundle of lanes holds: more than one hides the latency of a short step.
    const VECTORS: usize = 1;

    /// One step in time.
    type Coupling<N: Number>: Coupling<N>;

    /// The step for steps of `step` seconds, and the force (or input) for 1 V.
    fn coupling<N: Number>(
        &self,
        parameters: &Parameters<N>,
        step: f64,
        halvings: u32,
    ) -> (Self::Coupling<N>, N);

    /// The memory before any motion.
    fn rest<N: Number>(&self, parameters: &Parameters<N>) -> Memory<Self, N>;

    /// Displacement and memory in equilibrium at `volts`, which the drive approaches slowly from the
    /// equilibrium `from`.
    fn approach<N: Number>(
        &self,
        parameters: &Parameters<N>,
        from: (N, Memory<Self, N>),
        volts: N,
    ) -> (N, Memory<Self, N>);

    /// Hysteresis force, N.
    fn force(&self, parameters: &Parameters<f64>, memory: &Memory<Self, f64>) -> f64;

    /// Whether the solution was unique up to this state.
    fn unique(&self, _memory: &Memory<Self, f64>) -> bool {
        true
    }
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
