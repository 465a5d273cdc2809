//! Integration tests of the crates, as one binary.

mod control;
mod identification;
mod layers;
mod same_bits;
mod stages;
mod stopping;
