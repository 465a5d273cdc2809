//! Controllers, their parts and their loops.

pub mod coefficients;
pub mod controller;
pub mod design;
pub mod parts;
pub mod tracking;
