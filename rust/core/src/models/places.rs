//! Which places the signals of a model may have.

use super::input::superposition::Places;
use super::plays::prandtl_ishlinskii::PlayHysteresis;
use super::relays::everett::Everett;
use crate::error::{Error, Result};

/// Refuses places with which no stage exists.
///
/// # Errors
/// Names the place.
pub(crate) fn check_places(kind: Places, places: &[f64]) -> Result<()> {
    match kind {
        Places::None if places.is_empty() => Ok(()),
        Places::None => {
            let found = format!("{} of them", places.len());
            Err(Error::parameter("thresholds", found, "none, as the model has no plays"))
        }
        Places::Thresholds => {
            PlayHysteresis::new(1.0, places, &vec![0.0; places.len()], &[], &[]).map(drop)
        }
        Places::Levels => Everett::of_levels(places).map(drop),
    }
}
