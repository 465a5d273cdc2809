//! Which nodes the signals of a model may have.

use super::input::superposition::Nodes;
use super::plays::prandtl_ishlinskii::PlayHysteresis;
use super::relays::everett::Everett;
use crate::error::{Error, Result};

/// Refuses nodes with which no stage exists.
///
/// # Errors
/// Names the place.
pub(crate) fn check_nodes(kind: Nodes, nodes: &[f64]) -> Result<()> {
    match kind {
        Nodes::None if nodes.is_empty() => Ok(()),
        Nodes::None => {
            let found = format!("{} of them", nodes.len());
            Err(Error::parameter("thresholds", found, "none, as the model has no plays"))
        }
        Nodes::Thresholds => {
            PlayHysteresis::new(1.0, nodes, &vec![0.0; nodes.len()], &[], &[]).map(drop)
        }
        Nodes::Levels => Everett::of_levels(nodes).map(drop),
    }
}
