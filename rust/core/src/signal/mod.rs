//! Sampled signals: drives, delays, turning points, drift, frequency response, error measures.

pub mod contour_error;
mod delay;
mod detrend;
mod drive;
mod frequency_response;
pub mod metrics;
mod noise;
mod turning_points;

pub use delay::delayed;
pub use drive::{Drive, Hold, INTERVALS, NEVER, Stop};
pub use noise::sample_noise;
pub use turning_points::turns;

pub(crate) use delay::FractionalDelay;
pub(crate) use detrend::without_drift;
pub(crate) use drive::{all_finite, index, largest_difference, range, sampling_interval};
pub(crate) use frequency_response::Spectrum;
