//! Design aids for the sampled loop: margins, exact stability, and by how much a gain may rise.
//!
//! ```text
//! u = (C + R)(r - F y),   y = G u,   L = G F (C + R)
//! ```
//!
//! G is the stage from volts to metres behind a hold ([`LoopPlant`]), C the feedback, R the
//! repetitive part and F the filters of the measurement, taken with the coefficients that
//! really run in `piezotrack-control`. Stability is decided by the number of roots of the closed
//! loop outside a circle, which the principle of the argument counts exactly, for any length of
//! the repetitive delay line: no matrix of that size is needed.
//!
//! The displacement at a sampling instant counts as read before the new voltage acts, so that
//! even a static plant answers one sample later.

mod argument_principle;
mod linear_feedback;
mod margins;
mod plant;
mod sampled_loop;
mod small_signal_gain;
mod stability;
mod verdict;

pub use linear_feedback::LinearFeedback;
pub use margins::{Margins, Response, margins};
pub use plant::LoopPlant;
pub use sampled_loop::SampledLoop;
pub use stability::{GainRange, Root};
pub use verdict::{Verdict, check_loop};

pub(crate) use sampled_loop::in_series;
pub(crate) use small_signal_gain::Gains;
