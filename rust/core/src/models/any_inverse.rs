//! The inverse in a feedforward, of whatever kind.

use piezotrack_control::inverse::{Inverse, NeuralNetworkInverse, NeuralNetworkState};
use piezotrack_control::snapshot::Snapshot;

use super::registry::{StageInverse, StageInverseState};

/// The inverse of a stage, or a network in its place.
#[expect(missing_debug_implementations, reason = "that of a stage has none")]
pub enum AnyInverse {
    /// Of the list of models.
    Stage(Box<StageInverse>),
    /// A network that was trained.
    Network(Box<NeuralNetworkInverse>),
}

/// State of an [`AnyInverse`], of the same kind.
#[derive(Clone, Copy)]
#[expect(clippy::large_enum_variant, reason = "a state is copied, as each of an inverse is")]
#[expect(missing_debug_implementations, reason = "that of a stage has none")]
pub enum AnyInverseState {
    /// Of the inverse of a stage.
    Stage(StageInverseState),
    /// Of a network.
    Network(NeuralNetworkState),
}

impl Inverse for AnyInverse {
    type State = AnyInverseState;

    fn rest(&self) -> AnyInverseState {
        match self {
            Self::Stage(inverse) => AnyInverseState::Stage(inverse.rest()),
            Self::Network(inverse) => AnyInverseState::Network(inverse.rest()),
        }
    }

    fn step(&self, state: &mut AnyInverseState, x: f64, v: f64, a: f64) -> f64 {
        match (self, state) {
            (Self::Stage(inverse), AnyInverseState::Stage(state)) => inverse.step(state, x, v, a),
            (Self::Network(inverse), AnyInverseState::Network(state)) => {
                inverse.step(state, x, v, a)
            }
            _ => f64::NAN,
        }
    }
}

impl Snapshot for AnyInverseState {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        match self {
            Self::Stage(state) => state.save(write),
            Self::Network(state) => state.save(write),
        }
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        match self {
            Self::Stage(state) => state.load(read),
            Self::Network(state) => state.load(read),
        }
    }
}
