//! Numerical methods: SIMD lanes, threads, random numbers, least squares, line search, roots, transfer functions,
//! memory.

mod bounded_least_squares;
mod dispatch;
mod golden_section;
mod lanes;
mod memory;
mod random;
mod threads;
mod transfer_function;

pub use bounded_least_squares::{FREE, NOT_NEGATIVE, Rows, bounded};
pub use lanes::Lanes;
pub use memory::{available, room, zeros};

pub(crate) use piezotrack_control::root::rising_root;

pub(crate) use dispatch::{dispatch_fused, dispatch_vectors, width};
pub(crate) use golden_section::least;
pub(crate) use random::Draws;
pub(crate) use threads::on_all_threads;
pub(crate) use transfer_function::{C, Jet, Ratio};
