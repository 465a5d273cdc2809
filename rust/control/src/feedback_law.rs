//! The interface of a feedback law.

use crate::number::Real;

/// Input of a feedback law at a sample: finite numbers, all of them.
///
/// ```
/// use piezotrack_control::FeedbackSample;
///
/// let sample = FeedbackSample { excess: -0.5, ..FeedbackSample::new(1e-6) };
/// assert_eq!(sample.error, sample.reference - sample.measured);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FeedbackSample<T = f64> {
    /// Tracking error: reference less filtered measurement, m.
    pub error: T,
    /// Reference, m.
    pub reference: T,
    /// Filtered measurement, m.
    pub measured: T,
    /// For antiwindup: the voltage applied in the sample before, less the unclipped sum of all
    /// parts of the controller, V; 0 where nothing saturated.
    pub excess: T,
    /// For observers: the voltage at the actuator since the sample before, V.
    pub applied: T,
    /// The other parts of this sample's command, feedforward and repetitive part, V.
    pub feedforward: T,
    /// For damping: whether the feedforward makes the stage follow the reference already.
    pub follows: bool,
}

impl<T: Real> FeedbackSample<T> {
    /// A sample with this tracking error (m), measured at 0 m, with 0 V all around.
    #[must_use]
    pub fn new(error: T) -> Self {
        Self { error, reference: error, ..Self::default() }
    }
}

/// A law that computes a voltage from the tracking error in the real type `T`: configuration in
/// `&self`, state in `State`.
pub trait Feedback<T = f64> {
    /// The state of the law.
    type State: Clone;

    /// The initial state for an output of 0 V.
    fn rest(&self) -> Self::State;

    /// The initial state for an output that continues from `volts` (V): a bumpless start.
    fn start(&self, volts: T) -> Self::State;

    /// Whether the law can hold a voltage at which it is started.
    fn holds(&self) -> bool {
        true
    }

    /// Whether the law can go on without a bump from a state of the law `before`, whose gains were
    /// others. Where it cannot, the controller starts it anew from the voltage that is there.
    fn adopt(&self, _before: &Self, _state: &mut Self::State) -> bool {
        false
    }

    /// The voltage (V) for a sample. Where that overflows it is one that the law had before, or 0,
    /// and the state stays finite.
    fn step(&self, state: &mut Self::State, sample: &FeedbackSample<T>) -> T;
}

/// No feedback: 0 V, for tracking by feedforward only.
impl<T: Real> Feedback<T> for () {
    type State = ();

    fn rest(&self) {}

    fn start(&self, _volts: T) {}

    fn holds(&self) -> bool {
        false
    }

    fn step(&self, _state: &mut (), _sample: &FeedbackSample<T>) -> T {
        T::ZERO
    }
}
