//! Gains that nobody picks by hand: closed loops of many controllers in lanes, what a loop has to
//! keep for every model of a set, and the search.

mod adaptation;
mod contour;
mod evolution;
mod judge;
mod loops;
mod parts;
mod requirements;
mod run_metrics;
mod search;
mod settings;
mod sides;

pub use contour::{Outline, PathTask, ReadyPath};
pub use judge::Judge;
pub use loops::{ErrorSignal, ReadyTask, Task};
pub use requirements::{PlantSet, Requirements, Robustness, Worst, check_margins};
pub use run_metrics::RunMetrics;
pub use search::{Aim, Found, SoughtController, Tuning};
pub use settings::{Nominal, Setting, Settings, Sought, Structure, Template, pid};
