//! The interface of a feedback law.

/// A law that computes a voltage from the tracking error: configuration in `&self`, state in
/// `State`.
///
/// `excess` (V) is for antiwindup: the voltage applied in the sample before, less the unclipped
/// sum of all parts of the controller; 0 where nothing saturated.
pub trait Feedback {
    /// The state of the law.
    type State: Clone;

    /// The initial state for an output of 0 V.
    fn rest(&self) -> Self::State;

    /// The initial state for an output that continues from `volts` (V): a bumpless start.
    fn start(&self, volts: f64) -> Self::State;

    /// Whether the law can hold a voltage at which it is started.
    fn holds(&self) -> bool {
        true
    }

    /// Whether the law can go on without a bump from a state of the law `before`, whose gains were
    /// others. Where it cannot, the controller starts it anew from the voltage that is there.
    fn adopt(&self, _before: &Self, _state: &mut Self::State) -> bool {
        false
    }

    /// The voltage (V) for the tracking error `error` (reference less displacement, m).
    fn step(&self, state: &mut Self::State, error: f64, excess: f64) -> f64;
}

/// No feedback: 0 V, for tracking by feedforward only.
impl Feedback for () {
    type State = ();

    fn rest(&self) {}

    fn start(&self, _volts: f64) {}

    fn holds(&self) -> bool {
        false
    }

    fn step(&self, _state: &mut (), _error: f64, _excess: f64) -> f64 {
        0.0
    }
}
