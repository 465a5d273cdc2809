//! Identification: parameters searched, cost of a candidate, particle swarm, local refinement.

mod cost;
mod descent;
mod experiments;
mod identification;
mod inference;
mod intervals;
mod least_squares;
mod modes;
mod parameters;
mod problem;
mod records;
mod search;
mod swarm;

pub use cost::evaluator::Evaluator;
pub use cost::journal::Journal;
pub use cost::residual_sums::Costs;
pub use cost::several_records::Records;
pub use descent::lag::LagRange;
pub use descent::levenberg_marquardt::{LocalRefinement, Polished};
pub use experiments::cross_talk::{CrossTalk, cross_talk};
pub use experiments::sensor_noise::{Noise, noise_at_rest};
pub use experiments::step_response::{
    Conventional, StepReadings, StepResponse, read_step, separate,
};
pub use identification::{Identification, OwnResult, identify, identify_together};
pub use inference::{Autoregression, Covariance, Linearised, covariance, resampled_noises};
pub use intervals::chain::ProfilePoint;
pub use intervals::profile::{Profile, Profiles};
pub use least_squares::{
    CreepKind, DynamicsKind, LeastSquaresFit, NodesKind, RecordFit, Settings as WeightsSettings,
    Structure, WeightsDelay, WeightsRecord, identify_weights,
};
pub use modes::{
    Descent, Distortion, DistortionRecord, ModalFit, ModalForce, ModalTerms, choose_distortion,
};
pub use parameters::bounds;
pub use parameters::candidate::{
    BEFORE, Candidate, DELAY, DRIFT_TIME, ITS_OWN, PLACES, Point, Theta,
};
pub use parameters::constraint::Constraint;
pub use parameters::coordinate::{Coordinate, Scale};
pub use parameters::delay::Delay;
pub use parameters::drift::{DriftKind, turns_often};
pub use parameters::prior::Prior;
pub use parameters::relations::Relations;
pub use parameters::tie::Tie;
pub use problem::{Problem, Spec};
pub use records::creep_weights::{CreepWeights, MOST_CREEP, MOST_CREEP_WEIGHTS, creep_times};
pub use records::history::{History, voltages_before};
pub use records::record::Record;
pub use records::resonances::{Resonance, resonances};
pub use search::descent_settings::DescentSettings;
pub use search::plan::{Method, Plan};
pub use search::progress::{Monitor, Outcome, Progress, StopReason};
pub use search::swarms::search;
pub use swarm::{Boundary, Swarm, SwarmSettings, Topology, Update};
