//! Identification: parameters searched, cost of a candidate, particle swarm, local refinement.

pub mod bounds;
mod candidate;
mod constraint;
mod coordinate;
mod cost;
mod creep_shares;
mod cross_talk;
mod delay;
mod descents;
mod history;
mod identification;
mod inertia;
mod information;
mod journal;
mod lag;
mod least_squares;
mod levenberg_marquardt;
mod motion;
mod normal;
mod plan;
mod prior;
mod problem;
mod progress;
mod record;
mod records;
mod relations;
mod residual_sums;
mod resonances;
mod search;
mod sensor_noise;
mod step_response;
mod step_ringing;
mod step_size;
mod swarm;
mod tie;

pub use candidate::{BEFORE, Candidate, DELAY, PLACES, Point, Theta};
pub use constraint::Constraint;
pub use coordinate::{Coordinate, Scale};
pub use cost::Evaluator;
pub use creep_shares::{MOST_CREEP, MOST_SHARES, Shares, creep_times};
pub use cross_talk::{CrossTalk, cross_talk};
pub use delay::Delay;
pub use descents::DescentSettings;
pub use history::{History, visited};
pub use identification::{Identification, OwnResult, identify, identify_together};
pub use journal::Journal;
pub use lag::LagRange;
pub use least_squares::{
    CreepKind, DriftKind, DynamicsKind, LeastSquaresFit, PlacesKind, RecordFit,
    Settings as WeightsSettings, WeightsDelay, WeightsRecord, identify_weights,
};
pub use levenberg_marquardt::{LocalRefinement, Polished, Sensitivity};
pub use plan::{Method, Plan};
pub use prior::Prior;
pub use problem::{Problem, Spec};
pub use progress::{Monitor, Outcome, Progress, StopReason};
pub use record::Record;
pub use records::Records;
pub use relations::Relations;
pub use residual_sums::Costs;
pub use resonances::{Resonance, resonances};
pub use search::search;
pub use sensor_noise::{Noise, noise_at_rest};
pub use step_response::{Conventional, StepReadings, StepResponse, read_step, separate};
pub use swarm::{Boundary, Swarm, SwarmSettings, Topology, Update};
pub use tie::Tie;
