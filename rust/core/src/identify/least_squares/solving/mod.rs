//! The unknowns of a fit with a given structure, and the steps that find them.

mod columns;
pub(super) mod fit;
mod follower;
pub(super) mod form;
mod gauss_newton;
pub(super) mod judged;
mod late;
mod layout;
mod record_path;
mod strides;
