//! Gains that nobody picks by hand: closed loops of many controllers in lanes, what a loop has to
//! keep for every model of a set, and the search.

mod contour;
mod figures;
mod judge;
mod loops;
mod parts;
mod requirements;
mod search;
mod settings;

pub use contour::{Outline, PathTask, ReadyPath};
pub use figures::Figures;
pub use judge::Judge;
pub use loops::{Judged, ReadyTask, Task};
pub use requirements::{PlantSet, Requirements, Robustness, Worst};
pub use search::{Aim, Found, Settings, SoughtController, Tuning};
pub use settings::{Nominal, Setting, Sought, Structure, Template, pid};
