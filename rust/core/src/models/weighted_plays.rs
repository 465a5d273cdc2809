//! Models identified by least squares: weighted sums of plays with given thresholds.

use super::creep::Relaxation;
use super::input_stage::PLAYS_STATE;
use super::traits::StageModel;
use super::values::Values;

/// Result of the least squares.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedPlays {
    /// Weight of the drive without hysteresis, w0.
    pub linear: f64,
    /// Thresholds of the plays, V.
    pub thresholds: Vec<f64>,
    /// Weights of the plays.
    pub weights: Vec<f64>,
    /// Thresholds of the dead zones behind them, m.
    pub dead_zone_thresholds: Vec<f64>,
    /// Weights of the dead zones.
    pub dead_zone_weights: Vec<f64>,
    /// Numbers of the envelope that were searched.
    pub shape: Vec<f64>,
    /// Range of the drive that the envelope was made for, V.
    pub drive: (f64, f64),
    /// Creep and dynamics.
    pub relaxation: Relaxation,
}

/// A model of weighted plays.
///
/// A play of threshold r is pushed up to `up - r` and down to `down + r`, where up and down are the
/// edges at the present voltage: the voltage itself for plain plays, an envelope of it for
/// generalised ones.
pub trait WeightedPlays: StageModel {
    /// Whether dead zones may follow the plays.
    const DEAD_ZONES: bool;

    /// Whether a state lists the play of the drive itself, whose threshold is 0, before the others.
    const PLAY_OF_DRIVE: bool = false;

    /// What makes edges of a voltage.
    type Envelope: Clone;

    /// Ranges of the envelope's numbers, above 0, which are searched around the least squares on
    /// a logarithmic scale. A number that gains little stays at the middle of its range.
    #[must_use]
    fn shapes() -> Vec<(f64, f64)> {
        Vec::new()
    }

    /// The envelope of these numbers for a range of the drive, V.
    fn envelope(shape: &[f64], drive: (f64, f64)) -> Self::Envelope;

    /// Edges up and down at a voltage; at 0 V both are 0, where the plays rest.
    fn edges(envelope: &Self::Envelope, volts: f64) -> (f64, f64);

    /// The parameters of the stage, as [`StageModel::build`] takes them.
    fn values(fitted: &FittedPlays) -> Values;
}

/// A state at rest at `x`, m, and `volts` with the plays of the drive and the thresholds, and so
/// many further modes.
#[must_use]
pub fn state_at_rest<M: WeightedPlays>(
    x: f64,
    volts: f64,
    plays: &[f64],
    creep: &[f64],
    modes: usize,
) -> Values {
    let kept = plays.get(usize::from(!M::PLAY_OF_DRIVE)..).unwrap_or(&[]).to_vec();
    let (mode_x, mode_v) = (vec![x; modes], vec![0.0; modes]);
    let entries = [vec![x], vec![0.0], vec![volts], kept, creep.to_vec(), mode_x, mode_v];
    Values::of(PLAYS_STATE, entries)
}

/// An operation on any model of weighted plays.
pub trait WeightedVisitor {
    /// Its result.
    type Output;

    /// Performs it.
    fn visit<M: WeightedPlays>(self) -> Self::Output;
}
