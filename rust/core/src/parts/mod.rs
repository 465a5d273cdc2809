//! The parts of a controller by their names: one description of each, and how it is made from its
//! numbers.

mod controller;
mod filters;
mod info;
mod laws;
mod repetitive;

pub use controller::{ControllerParts, Named, OTHERS, check_part};
pub use info::{Form, NumberInfo, PartInfo, Role};
pub use laws::law::{Law, LawState};
pub use laws::state_space::MOST_STATES;
