//! Models identified by least squares: weighted sums of signals that follow from the drive.

use core::fmt::Debug;
use core::marker::PhantomData;

use crate::models::creep::Relaxation;
use crate::models::parameters::values::Values;
use crate::models::traits::{ModelInfo, StageModel};

/// Result of the least squares.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedWeights {
    /// Weight of the first signal, that of the drive without hysteresis.
    pub linear: f64,
    /// Nodes of the signals: thresholds of plays, levels of a grid, V.
    pub nodes: Vec<f64>,
    /// Weights of the other signals.
    pub weights: Vec<f64>,
    /// Thresholds of the dead zones behind them, m.
    pub dead_zone_thresholds: Vec<f64>,
    /// Weights of the dead zones.
    pub dead_zone_weights: Vec<f64>,
    /// Numbers of the shape that were searched.
    pub shape: Vec<f64>,
    /// Range of the drive that the signals were made for, V.
    pub drive: (f64, f64),
    /// Creep and dynamics.
    pub relaxation: Relaxation,
}

/// Where the signals of a model have their nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Nodes {
    /// Nowhere: a model has always the same signals.
    None,
    /// At thresholds of plays, V, up to half of the drive's range.
    Thresholds,
    /// At levels that divide the drive's range, V.
    Levels,
}

/// A number above 0 that shapes signals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Least and largest, between which it is searched on a logarithmic scale.
    pub range: (f64, f64),
    /// Value where a record does not determine it.
    pub neutral: f64,
}

impl Shape {
    /// A number that is neutral in the middle of its range.
    #[must_use]
    pub fn about(low: f64, high: f64) -> Self {
        Self { range: (low, high), neutral: libm::sqrt(low * high) }
    }
}

/// Signals of the drive, whose weighted sum comes out of a hysteresis.
pub trait Signals: Debug + Send + Sync {
    /// How many; the first is the drive itself, or an envelope of it, without memory.
    fn count(&self) -> usize;

    /// Memory before any voltage, as the state of the model has it.
    fn rest(&self) -> Vec<f64>;

    /// Pairs of signals whose weights are as alike as the records allow: those of neighbours, of
    /// which a record may not tell one from the other.
    fn alike(&self) -> Vec<(usize, usize)> {
        Vec::new()
    }

    /// Takes the memory to `volts` within `dt` seconds, infinite for a slow visit, and writes the
    /// signals there.
    fn follow(&self, memory: &mut Vec<f64>, volts: f64, dt: f64, signals: &mut [f64]);
}

/// Inputs from which the signals of a model are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalsOf<'a> {
    /// Numbers of the shape, see [`Superposition::shapes`].
    pub shape: &'a [f64],
    /// Nodes, V, ascending.
    pub nodes: &'a [f64],
    /// Range of the drive in what is fitted, V.
    pub drive: (f64, f64),
}

/// A stage at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest<'a> {
    /// Displacement, m.
    pub x: f64,
    /// Drive, V.
    pub volts: f64,
    /// Weighted sum of the signals, m.
    pub sum: f64,
    /// Memory of the signals.
    pub memory: &'a [f64],
    /// Relaxations of the creep, m.
    pub creep: &'a [f64],
    /// Number of modes beside the main one.
    pub modes: usize,
}

/// A model whose hysteresis is a sum of signals with weights of one sign.
///
/// Weights are found as 0 or above for a displacement that rises with the drive. One that falls
/// is fitted as one that rises: under the negative drive where the model has dead zones, else
/// negative itself.
pub trait Superposition: StageModel {
    /// Whether dead zones may follow the sum.
    const DEAD_ZONES: bool = false;

    /// Where its signals have their nodes.
    const NODES: Nodes;

    /// Share of the deviation that creep has to take away in the end, beside lag and drift, where
    /// the signals are so many that they follow what creep does within a cycle; `None` where it
    /// stays as it was chosen before the lag.
    const CREEP_GAIN: Option<f64> = None;

    /// Numbers that shape the signals and are searched around the least squares. One that gains
    /// little stays at its neutral value.
    #[must_use]
    fn shapes() -> Vec<Shape> {
        Vec::new()
    }

    /// The signals.
    fn signals(of: &SignalsOf<'_>) -> Box<dyn Signals>;

    /// The parameters of the stage, as [`StageModel::build`] takes them.
    fn values(fitted: &FittedWeights) -> Values;

    /// The state at rest.
    fn state_at_rest(rest: &Rest<'_>) -> Values;
}

/// A [`Superposition`] whose type is not known; one search serves them all.
pub trait AnySuperposition: Sync {
    /// Name and parts of the model.
    fn info(&self) -> ModelInfo;
    /// See [`Superposition::DEAD_ZONES`].
    fn has_dead_zones(&self) -> bool;
    /// See [`Superposition::NODES`].
    fn nodes(&self) -> Nodes;
    /// See [`Superposition::CREEP_GAIN`].
    fn creep_gain(&self) -> Option<f64>;
    /// See [`Superposition::shapes`].
    fn shapes(&self) -> Vec<Shape>;
    /// See [`Superposition::signals`].
    fn signals(&self, of: &SignalsOf<'_>) -> Box<dyn Signals>;
    /// See [`Superposition::values`].
    fn values(&self, fitted: &FittedWeights) -> Values;
    /// See [`Superposition::state_at_rest`].
    fn state_at_rest(&self, rest: &Rest<'_>) -> Values;
}

/// The superposition of a model, its type forgotten.
pub(in crate::models) struct Of<M>(pub PhantomData<fn() -> M>);

impl<M: Superposition> AnySuperposition for Of<M> {
    fn info(&self) -> ModelInfo {
        M::INFO
    }

    fn has_dead_zones(&self) -> bool {
        M::DEAD_ZONES
    }

    fn nodes(&self) -> Nodes {
        M::NODES
    }

    fn creep_gain(&self) -> Option<f64> {
        M::CREEP_GAIN
    }

    fn shapes(&self) -> Vec<Shape> {
        M::shapes()
    }

    fn signals(&self, of: &SignalsOf<'_>) -> Box<dyn Signals> {
        M::signals(of)
    }

    fn values(&self, fitted: &FittedWeights) -> Values {
        M::values(fitted)
    }

    fn state_at_rest(&self, rest: &Rest<'_>) -> Values {
        M::state_at_rest(rest)
    }
}

/// Plays between the edges of an envelope, whose first is that of the drive with threshold 0.
#[derive(Clone, Debug)]
pub(in crate::models) struct PlaySignals<E> {
    /// Edges up and down at a voltage; at 0 V both are 0, where the plays rest.
    pub edges: E,
    /// Thresholds of the others, V.
    pub thresholds: Vec<f64>,
}

/// Edges of plays at a voltage: a play of threshold r is pushed up to `up - r` and down to
/// `down + r`.
pub(in crate::models) trait Edges: Debug + Send + Sync {
    /// Edges up and down.
    fn at(&self, volts: f64) -> (f64, f64);
}

/// The voltage itself.
#[derive(Clone, Copy, Debug)]
pub(in crate::models) struct Plain;

impl Edges for Plain {
    #[inline(always)]
    fn at(&self, volts: f64) -> (f64, f64) {
        (volts, volts)
    }
}

impl<E: Edges> Signals for PlaySignals<E> {
    fn count(&self) -> usize {
        1 + self.thresholds.len()
    }

    fn rest(&self) -> Vec<f64> {
        vec![0.0; self.count()]
    }

    fn follow(&self, memory: &mut Vec<f64>, volts: f64, _dt: f64, signals: &mut [f64]) {
        let (up, down) = self.edges.at(volts);
        if let Some((first, plays)) = memory.split_first_mut() {
            *first = up.max(down.min(*first));
            for (play, threshold) in plays.iter_mut().zip(&self.thresholds) {
                *play = (up - threshold).max((down + threshold).min(*play));
            }
        }
        signals.copy_from_slice(memory);
    }
}
