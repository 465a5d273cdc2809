//! The slot for a feedback law.

/// A law that turns the tracking error into a voltage: configuration in `&self`, memory in
/// `State`.
///
/// `excess` is the voltage that the actuator got in the sample before, less the voltage that all
/// parts of the controller together asked for; 0 where nothing saturated. An antiwindup scheme
/// needs nothing else.
pub trait Feedback {
    /// What the law remembers from sample to sample.
    type State: Clone;

    /// The memory of a law whose output begins at 0 V.
    fn rest(&self) -> Self::State;

    /// The memory of a law whose output goes on from `volts`: a start without a bump.
    fn start(&self, volts: f64) -> Self::State;

    /// The voltage for the tracking error `error` (reference less displacement), m.
    fn step(&self, state: &mut Self::State, error: f64, excess: f64) -> f64;
}

/// No feedback: 0 V, for tracking by feedforward alone.
impl Feedback for () {
    type State = ();

    fn rest(&self) {}

    fn start(&self, _volts: f64) {}

    fn step(&self, _state: &mut (), _error: f64, _excess: f64) -> f64 {
        0.0
    }
}
