//! Numerical methods: SIMD lanes, threads, random numbers, least squares, line search, roots, transfer functions,
//! memory.

mod bounded_least_squares;
mod dispatch;
mod lanes;
mod line_search;
mod memory;
mod random;
mod rows;
mod threads;
mod transfer_function;

pub use bounded_least_squares::{FREE, NOT_NEGATIVE, bounded, bounded_rows};
pub use dispatch::instruction_set;
pub use lanes::Lanes;
pub use memory::{available, room, zeros};
pub use rows::Rows;

pub(crate) use piezotrack_control::root::rising_root;

pub(crate) use dispatch::{dispatch_fused, dispatch_vectors, width};
pub(crate) use line_search::least;
pub(crate) use random::Draws;
pub(crate) use threads::on_all_threads;
pub(crate) use transfer_function::{C, Jet, Ratio};
