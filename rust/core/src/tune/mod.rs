//! Gains that nobody picks by hand: closed loops of many controllers in lanes, what a loop has to
//! keep for every model of a set, and the search.

mod loops;

pub use loops::{Figures, Judged, Task};
