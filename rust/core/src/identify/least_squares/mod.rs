//! Identification by least squares: weights of plays, dead zones, creep and linear dynamics.
//!
//! Weights, dead zones, weights of the creep and the offset are found by the Gauss-Newton method,
//! each step of which is a non-negative least-squares problem; without dead zones and creep one
//! step is sufficient (Kuhnen 2003, doi 10.3166/ejc.9.407-418, has the linear problem;
//! he identifies the dead zones of the inverse, which here would amplify the sensor's noise).
//! The numbers of the dynamics are further unknowns of these steps, from where the record's
//! spectrum has a mode; the numbers of an envelope are searched along one line at a time.

mod common;
mod identify_weights;
mod result;
mod settings;
mod solving;
mod structure;
mod weights_record;

pub use identify_weights::identify_weights;
pub use result::{LeastSquaresFit, RecordFit};
pub use settings::{CreepKind, DynamicsKind, NodesKind, Settings, Structure};
pub use weights_record::{WeightsDelay, WeightsRecord};
