//! The delay of a displacement, as a caller says it and as a coordinate of a search.

use super::bounds;
use super::coordinate::Coordinate;
use crate::error::{Error, Result, shown};
use crate::identify::records::record::Record;
use crate::signal::index;

/// Delay between drive and displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Delay {
    /// Known, s; 0 for none.
    Fixed(f64),
    /// Fitted, up to twenty samples or a tenth of the drive's period, whichever is less.
    Fitted,
    /// Fitted between two bounds, s.
    Between(f64, f64),
}

impl Default for Delay {
    fn default() -> Self {
        Self::Fixed(0.0)
    }
}

impl Delay {
    /// The coordinate of the search.
    pub(in crate::identify) fn coordinate(self, record: &Record<'_>) -> Result<Coordinate> {
        let length = record.drive.dt * index(record.drive.u.len());
        let (low, high) = self.ends(length, || bounds::measures(record).longest_delay())?;
        match self {
            Self::Fixed(value) => Ok(Coordinate::Fixed(value)),
            _ => Coordinate::between("delay", low, high),
        }
    }

    /// Between which delays a record of `length` seconds is searched, s; `longest` is the longest
    /// one where the caller gives no bounds.
    pub(in crate::identify) fn ends(
        self,
        length: f64,
        longest: impl FnOnce() -> f64,
    ) -> Result<(f64, f64)> {
        let (low, high) = match self {
            Self::Fixed(value) => (value, value),
            Self::Fitted => return Ok((0.0, longest())),
            Self::Between(low, high) => (low, high),
        };
        if low >= 0.0 && high < length {
            return Ok((low, high));
        }
        let found = if low < high || high < low {
            format!("({}, {}) s", shown(low), shown(high))
        } else {
            format!("{} s", shown(low))
        };
        let expected = format!("0 s or above, below the record's {length:.6} s");
        Err(Error::parameter("delay", found, expected))
    }
}
